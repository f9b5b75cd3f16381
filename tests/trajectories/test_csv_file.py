"""Trajectories from CSV: what is written is read back, and every mistake is told with its line."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from rps_pin import InputError, RPSPinError, RPSRobot, helix
from rps_pin.rps.dynamics.motion_csv import write_csv
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.helix import HelixPath
from rps_pin.trajectories.spline import spline
from tests.each import each
from tests.trajectories.csv_files import SI, good_lines, read, refuse, save, swings

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[HelixPath, MotionRun, Path]:
    """Return the paper's helix, its run at 100 Hz, and the table of that."""
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    run = run_motion(robot, path, 100.0)
    file = tmp_path_factory.mktemp("helix") / "helix.csv"
    write_csv(file, run)
    return path, run, file


def test_the_helix_is_read_back_as_it_was_written(
    written: tuple[HelixPath, MotionRun, Path],
) -> None:
    path, run, file = written
    found = read_csv(file)
    assert found.rates is not None
    assert found.accelerations is not None
    assert_array_equal(found.times, run.time)
    assert_array_equal(found.poses, run.pose)
    assert_array_equal(found.rates, run.rate)
    assert_array_equal(found.accelerations, run.acceleration)
    assert found.duration == run.time[-1]
    for a, b in zip(found.sample(run.time), path.sample(run.time), strict=True):
        assert_allclose(a, b, rtol=0, atol=1e-13)


def test_the_helix_is_met_between_samples(written: tuple[HelixPath, MotionRun, Path]) -> None:
    """Within a step of where the acceleration jumps, by h^2 times the jump; elsewhere, by h^6."""
    path, run, file = written
    found = read_csv(file)
    t = np.linspace(0, found.duration, 20_000)
    errors = [
        np.abs(a - b).max(axis=-1) for a, b in zip(found.sample(t), path.sample(t), strict=True)
    ]
    h = run.time[1]
    jumps = np.minimum(abs(t - path.ramp), abs(t - path.duration + path.ramp)) < h
    jump = np.abs(run.acceleration).max()
    assert (np.max(errors, axis=-1) > 0).all()
    for error, order in zip(errors, (2, 1, 0), strict=True):
        assert error[~jumps].max() < 1e-9
        assert error[jumps].max() < 2 * jump * h**order


@given(st.integers(0, 10**6), st.sampled_from([3, 6, 9]))
@settings(max_examples=30)
def test_smooth_motions_are_met_at_any_time(
    tmp_path_factory: pytest.TempPathFactory, seed: int, columns: int
) -> None:
    """Poses, with rates, and with accelerations; uneven steps; times that begin anywhere."""
    rng, at = np.random.default_rng(seed), swings(seed)
    steps = rng.uniform(0.5, 1.0, size=100)
    t = np.cumsum(steps / steps.sum() * 2) + rng.normal(scale=5)
    file = save(
        tmp_path_factory.mktemp("smooth") / "path.csv",
        ",".join(["time_s", *SI[:columns]]),
        np.column_stack([t, at(t)[:, :columns]]),
    )
    found = read_csv(file, ends=None if columns == 9 else "free")
    assert (found.rates is None) == (columns == 3)
    assert (found.accelerations is None) == (columns < 9)
    fine = np.linspace(0, found.duration, 1001)
    expected = at(fine + t[0])
    assert_allclose(found.sample(t - t[0]).pose, at(t)[:, :3], rtol=0, atol=1e-14)
    for k, part in enumerate(found.sample(fine)):
        scale = np.abs(expected[:, 3 * k : 3 * k + 3]).max()
        wanted = expected[:, 3 * k : 3 * k + 3]
        assert_allclose(part, wanted, rtol=0, atol=scale * 10.0 ** (2 * k - 8))


def test_with_rates_and_accelerations_two_samples_do(tmp_path: Path) -> None:
    """From rest to rest: the quintic law of time."""
    text = ",".join(["time_s", *SI]) + "\n0,0.2,0,0,0,0,0,0,0,0\n2,0.3,0,0,0,0,0,0,0,0\n"
    found = read(tmp_path, text).sample([0.5, 1.0])
    assert_allclose(found.pose[:, 0], [0.2 + 0.1 * 53 / 512, 0.25], rtol=1e-15)
    assert_allclose(found.rate[1, 0], 0.1 / 2 * 15 / 8, rtol=1e-15)


def test_a_file_of_poses_starts_and_ends_at_rest(tmp_path: Path) -> None:
    """As a spline in a YAML file does: the same motion."""
    text = "\n".join(good_lines())
    path = read(tmp_path, text)
    other = spline(path.poses, path.times)
    t = np.linspace(0, path.duration, 50)
    for a, b in zip(path.sample(t), other.sample(t), strict=True):
        assert_array_equal(a, b)
    assert_allclose(path.sample([0.0, path.duration]).rate, 0, atol=1e-12)
    assert (path.starts, path.ends) == ("at rest", "at rest")
    free = read(tmp_path, text, ends="free")
    assert np.abs(free.sample(0.0).rate).min() > 1e-2
    assert free.starts == "with the rate of the fitted spline"
    with pytest.raises(InputError, match=r"path.csv: ends = 'measured': no rates are given"):
        read(tmp_path, text, ends="measured")


def test_a_file_of_poses_and_rates_has_the_measured_rates_at_its_ends(tmp_path: Path) -> None:
    t = np.linspace(0, 2, 101)
    rows = np.column_stack([t, 0.3 * swings(5)(t)[:, :6]])
    path = read_csv(save(tmp_path / "path.csv", ",".join(["time_s", *SI[:6]]), rows))
    assert_allclose(path.sample([0.0, 2.0]).rate, rows[[0, -1], 4:7], rtol=0, atol=1e-12)
    assert (path.starts, path.ends) == ("with the measured rate", "with the measured rate")


def test_a_gap_is_told_with_its_times_and_can_be_allowed(tmp_path: Path) -> None:
    lines = good_lines(20)
    del lines[5:16]  # the samples at 0.4 to 1.4 s
    text = "\n".join(lines)
    words = r"a gap of 1.2 s, from time_s = 0.3 to 1.5: .*10 times the median step, 0.1 s; max_step"
    refuse(tmp_path, text, 6, words)
    assert len(read(tmp_path, text, max_step=1.21).times) == 9
    refuse(tmp_path, text, 6, "a gap of 1.2 s.*max_step is 1.19 s", max_step=1.19)
    assert len(read(tmp_path, text, max_step=np.int64(2)).times) == 9
    lines = good_lines(20)
    del lines[5:13]  # nine steps are no gap, unless one says so
    assert len(read(tmp_path, "\n".join(lines)).times) == 12
    refuse(tmp_path, "\n".join(lines), 6, "a gap of 0.9 s", max_step=0.5)


@pytest.mark.parametrize("bad", [0, -1.0, math.nan, "1", True, 10**400])
def test_a_longest_step_is_a_positive_number(tmp_path: Path, bad: Any) -> None:
    with pytest.raises(InputError, match="max_step"):
        read(tmp_path, "\n".join(good_lines()), max_step=bad)


# Derivatives that are not -------------------------------------------------------------------------


@each(
    ("columns", "factor", "words"),
    [
        (
            [5, 6],
            180 / math.pi,
            "tilt_x_rate_rad_per_s = .*tilt_x_rad changes.*degrees and radians",
        ),
        ([2, 3], 1e-3, "tilt_x_rate_rad_per_s.*thousandths"),
        ([4], 1e3, "z_rate_m_per_s = .*z_m changes at .*thousandths"),
        ([4, 5, 6], 1e-3, "z_rate_m_per_s.*thousandths"),
        ([5], -1.0, "tilt_x_rate_rad_per_s.*opposite sign"),
        (
            [8, 9],
            180 / math.pi,
            "tilt_x_acceleration_rad_per_s2.*tilt_x_rate_rad_per_s changes.*deg",
        ),
        ([9], 5.0, "tilt_y_acceleration_rad_per_s2.*leave out"),
        ([0], 1e3, "z_rate_m_per_s.*thousandths"),
        ([4, 5, 6], 0.0, "z_rate_m_per_s = 0, but"),
    ],
)
def test_wrong_units_show_in_the_derivatives(
    tmp_path: Path, columns: list[int], factor: float, words: str
) -> None:
    t = np.linspace(0, 2, 101)
    rows = np.column_stack([t, 0.3 * swings(5)(t)])
    rows[:, columns] *= factor
    file = save(tmp_path / "path.csv", ",".join(["time_s", *SI]), rows)
    with pytest.raises(InputError, match=rf"path.csv, line \d+: {words}"):
        read_csv(file)


@each("column", range(1, 10))
def test_one_wrong_entry_is_told_with_its_line_and_values(tmp_path: Path, column: int) -> None:
    t = np.linspace(0, 2, 101)
    rows = np.column_stack([t, 0.1 * swings(6)(t)])
    rows[40, column] += 3.0 + 3 * np.abs(rows[:, column]).max()
    file = save(tmp_path / "path.csv", ",".join(["time_s", *SI]), rows)
    named = SI[column - 1] if column > 3 else SI[column + 2]
    with pytest.raises(InputError, match=f"line 42: {named} = ") as caught:
        read_csv(file)
    if column > 3:
        assert f"{rows[40, column]:.6g}" in str(caught.value)
        slope = (rows[40, column - 3] - rows[39, column - 3]) / (t[40] - t[39])
        assert f"changes at {slope:.6g} and " in str(caught.value)


def test_what_is_wrong_is_told_in_the_units_of_the_file(tmp_path: Path) -> None:
    lines = good_lines()
    lines[0] = "time_ms,z_mm,tilt_x_deg,tilt_y_deg"
    text = "\n".join([lines[0], *(f"{i},200,{i},400" for i in range(12))])
    refuse(tmp_path, text, 2, r"tilt_y_deg = 400: it cannot be beyond 6\.283 rad$")
    t = np.arange(30) / 10
    pose, rate = 200 + 10 * np.sin(t), 10 * np.cos(t)
    rate[20] = 77.0
    still = np.zeros((30, 2))
    names = "time_s,z_mm,tilt_x_rad,tilt_y_rad,"
    names += "z_rate_mm_per_s,tilt_x_rate_rad_per_s,tilt_y_rate_rad_per_s"
    file = save(tmp_path / "path.csv", names, np.column_stack([t, pose, still, rate, still]))
    slopes = [f"{10 * (pose[i + 1] - pose[i]):.6g}" for i in (19, 20)]
    words = f"line 22: z_rate_mm_per_s = 77, but next to it z_mm changes at {' and '.join(slopes)} "
    with pytest.raises(InputError, match=words):
        read_csv(file)


@pytest.mark.parametrize("rate", [3.0, 10.0, 100.0, 1000.0])
def test_a_coarse_helix_is_not_refused(tmp_path: Path, rate: float) -> None:
    """Its acceleration jumps at the ends of its ramps."""
    robot = SimpleNamespace(parameters=SimpleNamespace(platform_radius=0.1))
    path = helix(robot, radius=0.01, pitch=0.02, height=0.3)
    t = np.append(np.arange(0, path.duration, 1 / rate), path.duration)
    rows = np.column_stack([t, *path.sample(t)])
    found = read_csv(save(tmp_path / "path.csv", ",".join(["time_s", *SI]), rows))
    assert_array_equal(found.poses, rows[:, 1:4])


NOISE = [
    *'0123456789.-+eE,;\t\n\r"#_ ',
    "nan",
    "inf",
    "1e308",
    "1e-320",
    "\ufeff",
    "\x00",
    "é",
    "9" * 400,
]


def damaged(text: str, rng: np.random.Generator) -> bytes:
    """Delete, repeat or replace pieces of a text, one to five times."""
    raw = text.encode()
    for _ in range(rng.integers(1, 6)):
        start = int(rng.integers(0, len(raw) + 1))
        end = start + int(rng.choice([0, 1, 1, 1, 2, 5, 40]))
        middle = [b"", raw[start:end] * 2, str(rng.choice(NOISE)).encode(), rng.bytes(1)]
        raw = raw[:start] + middle[rng.choice(4, p=[0.25, 0.25, 0.45, 0.05])] + raw[end:]
    return raw


@pytest.mark.parametrize("columns", [3, 6, 9])
def test_a_damaged_file_is_finite_or_refused(tmp_path: Path, columns: int) -> None:
    t = np.arange(15) / 10
    rows = np.column_stack([t, 0.2 * swings(7)(t)])[:, : columns + 1]
    text = save(tmp_path / "good.csv", ",".join(["time_s", *SI][: columns + 1]), rows).read_text()
    outcomes = {True: 0, False: 0}
    for seed in range(300):
        (tmp_path / "path.csv").write_bytes(damaged(text, np.random.default_rng(seed)))
        try:
            found = read_csv(tmp_path / "path.csv")
        except RPSPinError as error:
            assert str(tmp_path / "path.csv") in str(error)
            outcomes[False] += 1
            continue
        outcomes[True] += 1
        for part in found.sample(np.linspace(0, found.duration, 100)):
            assert np.isfinite(part).all()
    assert min(outcomes.values()) > 20


SLOW = "time_s,z_m,tilt_x_rad,tilt_y_rad"


def slow_rows(step: float, count: int) -> np.ndarray:
    """Return a circle sampled in such steps of time."""
    share = np.linspace(0.0, 1.0, count)
    around = 2 * np.pi * share
    return np.column_stack(
        [step * np.arange(count), 0.223 + 0 * share, 0.1 * np.sin(around), 0.1 * np.cos(around)]
    )


@pytest.mark.parametrize("step", [1.0, 10.0])
def test_times_in_milliseconds_are_doubted(tmp_path: Path, step: float) -> None:
    rows = slow_rows(step, 101)
    file = save(tmp_path / "path.csv", SLOW, rows)
    with pytest.raises(InputError, match=rf"line 1: time_s has steps of {step:g} s.*time_ms"):
        read_csv(file)
    meant = read_csv(file, max_step=2 * step)
    assert meant.duration == pytest.approx(100 * step, rel=1e-12)
    named = save(tmp_path / "named.csv", SLOW.replace("time_s", "time_ms"), rows)
    assert read_csv(named).duration == pytest.approx(0.1 * step, rel=1e-12)


@pytest.mark.parametrize(("step", "count"), [(0.5, 101), (5.0, 5)])
def test_slow_motions_of_few_or_short_steps_are_taken(
    tmp_path: Path, step: float, count: int
) -> None:
    file = save(tmp_path / "path.csv", SLOW, slow_rows(step, count))
    assert read_csv(file).duration == pytest.approx(step * (count - 1), rel=1e-12)
