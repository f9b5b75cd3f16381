"""Figures of runs: brute force with SciPy's rotations, windows, statuses, how they are shown."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rich.console import Console
from scipy.spatial.transform import Rotation

from rps_pin import RPSRobot
from rps_pin.control import ComputedTorque, Gains, Status
from rps_pin.control.simulation.faults import Fault
from rps_pin.control.simulation.loop_run import LoopRun, run_loop
from rps_pin.control.simulation.loop_summary import LoopSummary, TrackingErrors, status_name
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError
from rps_pin.trajectories.point_to_point import point_to_point
from tests import strategies

Array = NDArray[np.float64]

LEG_WAYS = np.column_stack(
    [np.cos(strategies.LEG_ANGLES), np.sin(strategies.LEG_ANGLES), np.zeros(3)]
)
NAMES = {flag: str(flag.name).lower().replace("_", " ") for flag in Status if flag}


def centre(pose: Array, turn: Rotation, h: float) -> Array:
    """Eq. 4, from the rotation matrix."""
    R = turn.as_matrix()
    return np.array([h / 2 * (R[0, 0] - R[1, 1]), -h * R[1, 0], pose[0]])


def turned(pose: Array) -> Rotation:
    return Rotation.from_rotvec([pose[1], pose[2], 0.0])


def random_run(seed: int, n: int = 60, apart: float = 1e-3) -> LoopRun:
    """A run that never was: poses apart from their targets by so much, all else random."""
    rng = np.random.default_rng(seed)
    p = strategies.random_parameters(rng)
    target = strategies.random_motions(rng, p, n, largest_tilt=1.2)[0]
    pose = target + apart * rng.normal(size=(n, 3))
    configuration = rng.normal(size=(n, 13))
    lengths = np.empty((n, 3))
    g, h = p.base_radius, p.platform_radius
    for k in range(n):
        turn = turned(pose[k])
        configuration[k, 6:9] = middle = centre(pose[k], turn, h)
        configuration[k, 9:13] = turn.as_quat()
        tips = middle + turn.apply(h * LEG_WAYS)
        lengths[k] = np.linalg.norm(tips - g * LEG_WAYS, axis=1)
    return LoopRun(
        parameters=p,
        time=np.arange(n) * 1e-3,
        target=target,
        target_rate=rng.normal(size=(n, 3)),
        pose=pose,
        rate=rng.normal(size=(n, 3)),
        configuration=configuration,
        reading=np.full((n, 3), np.nan),
        length=lengths,
        estimate=rng.normal(size=(n, 3)),
        command=rng.normal(size=(n, 3)),
        applied=rng.normal(size=(n, 3)) * [1.0, 3.0, 2.0],
        status=rng.choice([0, 0, 0, 2, 32, 1 | 8, 32 | 64, 128], size=n),
        type_ii=rng.uniform(size=n),
        pace=np.ones(n),
        gap=rng.uniform(size=n) * 1e-12,
        events=(),
    )


def brute_force(run: LoopRun) -> tuple[Array, Array, Array]:
    """Vector from the target's centre, angle of R_target' R, errors of lengths; tick by tick."""
    g, h = run.parameters.base_radius, run.parameters.platform_radius
    apart, angles, lengths = [], [], []
    for k in range(run.time.size):
        goal, true = turned(run.target[k]), Rotation.from_quat(run.configuration[k, 9:13])
        middle = centre(run.target[k], goal, h)
        apart.append(run.configuration[k, 6:9] - middle)
        angles.append((goal.inv() * true).magnitude())
        tips = middle + goal.apply(h * LEG_WAYS)
        lengths.append(run.length[k] - np.linalg.norm(tips - g * LEG_WAYS, axis=1))
    return np.array(apart), np.array(angles), np.array(lengths)


# Errors -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("apart", [1e-9, 1e-6, 1e-2, 0.5])
def test_errors_are_those_of_brute_force(apart: float) -> None:
    for seed in range(8):
        run = random_run(seed, apart=apart)
        found = TrackingErrors.of(run)
        expected = brute_force(run)
        for one, other in zip((found.centre, found.turn, found.length), expected, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-14)


def test_half_a_turn_is_the_largest_angle() -> None:
    run = random_run(1, n=4)
    tilts = np.array([[0.0, 0.0], [math.pi, 0.0], [math.pi / 2, 0.0], [3.0, 0.0]])
    pose = np.column_stack([run.target[:, 0], tilts])
    target = np.column_stack([run.target[:, 0], np.zeros((4, 2))])
    found = TrackingErrors.of(dataclasses.replace(run, pose=pose, target=target))
    np.testing.assert_allclose(found.turn, [0.0, math.pi, math.pi / 2, 3.0], atol=1e-7)


def test_a_run_on_its_target_has_no_errors() -> None:
    errors = TrackingErrors.of(random_run(2, apart=0.0))
    for values in (errors.centre, errors.turn, errors.length):
        assert np.abs(values).max() < 2e-15


def test_errors_of_a_plant_s_own_run_are_those_of_brute_force() -> None:
    """Where the true pose comes from the free platform, and lengths from its joints."""
    robot = RPSRobot.from_preset("micro")
    start, end = [0.222, 0.03, -0.02], [0.225, -0.04, 0.05]
    run = run_loop(
        ComputedTorque(robot, start, Gains.placed(5.0)),
        Plant(robot, start, delay=1),
        point_to_point(start, end, duration=0.15),
        faults=[Fault("jump", 0.05, 0.02, leg=2, size=1e-4)],
    )
    found, expected = TrackingErrors.of(run), brute_force(run)
    assert np.linalg.norm(expected[0], axis=1).max() > 1e-6
    np.testing.assert_allclose(found.centre, expected[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.turn, expected[1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.length, expected[2], rtol=0, atol=1e-14)


# Figures ------------------------------------------------------------------------------------------


def rms(values: list[float]) -> float:
    return math.sqrt(math.fsum(value * value for value in values) / len(values))


@given(st.integers(0, 50), st.integers(0, 58), st.integers(1, 70), st.sampled_from([1e-6, 1e-2]))
def test_figures_are_of_the_ticks_in_the_window(
    seed: int, first: int, count: int, apart: float
) -> None:
    run = random_run(seed, apart=apart)
    ticks = range(first, min(first + count, 60))
    begin, end = first * 1e-3, (first + count - 0.5) * 1e-3
    summary = LoopSummary.of(run, begin=begin, end=end)
    centres, angles, lengths = brute_force(run)
    distance = [1e6 * math.dist(centres[k], (0, 0, 0)) for k in ticks]
    turn = [1e6 * float(angles[k]) for k in ticks]
    length = [1e6 * abs(float(entry)) for k in ticks for entry in lengths[k]]
    force = [[abs(float(run.applied[k, leg])) for k in ticks] for leg in range(3)]
    expected = {
        "centre_rms": rms(distance),
        "centre_max": max(distance),
        "centre_end": distance[-1],
        "turn_rms": rms(turn),
        "turn_max": max(turn),
        "turn_end": turn[-1],
        "length_rms": rms(length),
        "length_max": max(length),
        "force_peak": max(map(max, force)),
        "force_rms": max(map(rms, force)),
        "saturated": sum(bool(run.status[k] & 32) for k in ticks) / len(ticks),
        "minimum_type_ii": min(run.type_ii[k] for k in ticks),
        "gap": max(run.gap[k] for k in ticks),
        "ticks": len(ticks),
    }
    found = summary.as_dict()
    assert {*expected, "statuses", "first", "turn_unit"} == set(found)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-7, abs=1e-8), name


@given(st.integers(0, 50), st.integers(0, 59))
def test_statuses_are_counted_over_the_whole_run(seed: int, first: int) -> None:
    run = random_run(seed)
    summary = LoopSummary.of(run, begin=first * 1e-3)
    for flag, name in NAMES.items():
        ticks = [k for k in range(60) if int(run.status[k]) & int(flag)]
        assert summary.statuses.get(name, 0) == len(ticks)
        if ticks:
            assert summary.first[name] == pytest.approx(1e-3 * ticks[0], abs=1e-15)
    assert set(summary.statuses) == set(summary.first) <= set(NAMES.values())


def test_without_a_window_it_is_the_whole_run() -> None:
    run = random_run(3)
    assert LoopSummary.of(run) == LoopSummary.of(run, begin=-1.0, end=1.0)
    assert LoopSummary.of(run).ticks == 60


def test_a_window_ends_before_its_end_and_its_beginning_is_in_it() -> None:
    run = random_run(4, n=3000)
    for k in range(1, 3000, 31):
        begin = float(f"{k * 1e-3:.3f}")  # as written in a file
        assert LoopSummary.of(run, begin=begin).ticks == 3000 - k
        assert LoopSummary.of(run, end=begin).ticks == k


@pytest.mark.parametrize("period", [7e-4, 1 / 3000])
def test_windows_written_in_decimals_mean_whole_ticks(period: float) -> None:
    run = random_run(4, n=600)
    run = dataclasses.replace(run, time=np.arange(600) * period)
    for k in range(1, 600, 2):
        written = float(f"{k * period:.12g}")
        assert LoopSummary.of(run, begin=written).ticks == 600 - k
        assert LoopSummary.of(run, end=written).ticks == k


@pytest.mark.parametrize(
    "window",
    [{"begin": 1.0}, {"end": 0.0}, {"begin": 0.03, "end": 0.02}, {"begin": math.nan}],
)
def test_a_window_without_ticks_is_refused(window: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"no tick between .* the run has 60"):
        LoopSummary.of(random_run(5), **window)


# How they are shown -------------------------------------------------------------------------------


@given(st.integers(0, 100))
def test_plain_data_goes_through_json(seed: int) -> None:
    data = LoopSummary.of(random_run(seed)).as_dict()
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert data.pop("turn_unit") == "urad"
    for name, value in data.items():
        kind: Any = dict if name in ("statuses", "first") else int if name == "ticks" else float
        assert type(value) is kind, name


def test_the_table_shows_every_figure() -> None:
    summary = LoopSummary.of(random_run(6))
    console = Console(width=120, force_terminal=False)
    with console.capture() as captured:
        console.print(summary.table())
    text = captured.get()
    shown = [
        *(summary.centre_rms, summary.centre_max, summary.centre_end),
        *(summary.turn_rms, summary.turn_max, summary.turn_end),
        *(summary.length_rms, summary.length_max, summary.force_rms, summary.force_peak),
        summary.minimum_type_ii,
    ]
    for value in shown:
        assert f"{value:.4g}" in text
    assert f"{summary.saturated:.2%}" in text
    assert len(summary.statuses) >= 4
    lines = text.splitlines()
    for name, count in summary.statuses.items():
        (line,) = (line for line in lines if f" {name} " in line)
        assert f"{count} ticks" in line
        assert f"first at {summary.first[name]:.6g} s" in line


def test_names_of_all_statuses() -> None:
    for number in range(256):
        names = [name for flag, name in NAMES.items() if number & int(flag)]
        assert status_name(number) == (", ".join(names) or "ok")
