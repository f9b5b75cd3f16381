"""Runs: how well a perfect model follows, what reaches whom, what is kept of a broken one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control import ComputedTorque, Controller, Gains, PDControl, Status, effective_inertia
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.loop.status import KEPT
from rps_pin.control.simulation import loop_run as loop_run_module
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.faults import Fault, Faults
from rps_pin.control.simulation.loop_run import LoopRun, run_loop, write_loop_csv
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps.kinematics.pose import platform_pose
from rps_pin.trajectories.path import PathSample, Trajectory
from rps_pin.trajectories.point_to_point import point_to_point

Array = NDArray[np.float64]

ROBOT = RPSRobot.from_preset("micro")
START, END = np.array([0.222, 0.03, -0.02]), np.array([0.225, -0.04, 0.05])
STILL = np.zeros(3)
GAINS = Gains.placed(10.0)
PATH = point_to_point(START, END, duration=0.2)
ENCODERS = Encoders(50e-9, 20e-9, seed=3)
ARRAYS = (
    *("time", "target", "target_rate", "pose", "rate", "configuration", "reading", "length"),
    *("estimate", "command", "applied", "status", "distance", "pace", "gap"),
)


class Swing:
    """Each entry there and back by sin^3, at one, two and three times the rate; smooth at ends."""

    duration = 0.4
    size, rate = np.array([1.5e-3, 0.02, -0.01]), np.array([1, 2, 3]) * np.pi / 0.4

    def sample(self, t: Any) -> PathSample:
        w, s, c = self.rate, np.sin(self.rate * t), np.cos(self.rate * t)
        bend = w**2 * (6 * s * c**2 - 3 * s**3)
        return PathSample(START + self.size * s**3, self.size * 3 * w * s**2 * c, self.size * bend)


class Spy(ComputedTorque):
    """Notes what it is given."""

    given: list[tuple[Any, Any, Any]]

    def tick(self, length: Any, target: Any = None, speed: Any = None, **more: Any) -> Status:
        vars(self).setdefault("given", []).append((length, target, speed))
        return super().tick(length, target, speed, **more)


def spied(path: Trajectory = PATH, plant: Plant | None = None, **options: Any) -> tuple[Any, Any]:
    controller = Spy(ROBOT, START, GAINS)
    run = run_loop(controller, plant or Plant(ROBOT, START, encoders=ENCODERS), path, **options)
    return run, controller.given


def assert_equal_runs(one: LoopRun, other: LoopRun, ticks: int | None = None) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name)[:ticks], name)


# How well it follows ------------------------------------------------------------------------------


def held_force_bound(path: Trajectory, period: float, proportional: float) -> Array:
    """What forces held for a tick leave of a perfect model's errors, for each entry of the pose.

    They lag by T / 2, which is an acceleration w = B f_d' T / 2 that nobody asked for; of an axis
    with critical damping, e'' + Kd e' + Kp e = w never has |e| > max |w| / Kp.
    """
    worst, h = STILL, 1e-5
    for t in np.linspace(h, path.duration - h, 60):
        pose, rate, _ = path.sample(t)
        q, v, _ = ROBOT.state(pose, rate, STILL)
        later, before = (ROBOT.actuator_forces(*path.sample(t + s * h)) for s in (1, -1))
        slope = (later - before) / (2 * h)
        dynamics = ROBOT.mechanism.forward_dynamics
        change = dynamics(q, v, slope) - dynamics(q, v, STILL)  # B f' of all joints
        to_joints = np.array([ROBOT.state(pose, unit, STILL)[1] for unit in np.eye(3)]).T
        of_pose = np.linalg.lstsq(to_joints, change, rcond=None)[0]
        worst = np.maximum(worst, np.abs(of_pose) * period / 2 / proportional)
    return worst


@pytest.mark.parametrize("path", [PATH, Swing()], ids=["line", "swing"])
def test_a_perfect_model_follows_as_held_forces_allow(path: Trajectory) -> None:
    start = path.sample(0.0).pose
    missed = []
    for period in (1e-3, 5e-4):
        controller = ComputedTorque(ROBOT, start, GAINS, space="task", period=period)
        run = run_loop(controller, Plant(ROBOT, start, period=period), path, speeds="measured")
        assert not run.status.any()
        found = np.abs(run.pose - run.target).max(axis=0)
        bound = held_force_bound(path, period, GAINS.rows[0][0])
        assert (found < 1.05 * bound + 1e-9).all()
        missed.append(found.max())
    assert missed[1] < 0.6 * missed[0]


@pytest.mark.parametrize("law", ["computed torque", "feed-forward"])
def test_it_comes_to_rest_at_the_end_after_resting_at_the_start(law: str) -> None:
    """Errors die out like (1 + w t) exp(-w t), w = 2 pi 10 / s, once the target rests."""
    settle, rest = 0.05, 0.4
    controller: Controller = ComputedTorque(ROBOT, START, GAINS)
    if law == "feed-forward":
        gains = GAINS.times(effective_inertia(ROBOT, START))
        controller = PDControl(ROBOT, START, gains, compensation="feed_forward")
    duration = settle + PATH.duration + rest
    run = run_loop(controller, Plant(ROBOT, START), PATH, settle=settle, duration=duration)
    before = run.time < settle - 1e-9
    after = run.time > settle + PATH.duration + 1e-9
    during = ~before & ~after
    assert (before.sum(), during.sum(), after.sum()) == (50, 201, 399)
    for rows, pose in ((before, START), (after, END)):
        np.testing.assert_array_equal(run.target[rows], np.tile(pose, (rows.sum(), 1)))
        np.testing.assert_array_equal(run.target_rate[rows], 0.0)
    sample = PATH.sample(np.clip(run.time[during] - settle, 0.0, PATH.duration))
    np.testing.assert_allclose(run.target[during], sample.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.target_rate[during], sample.rate, rtol=0, atol=1e-9)
    assert np.abs(run.pose[before] - START).max() < 1e-8
    assert np.abs(run.pose[-1] - END).max() < 1e-6
    assert np.abs(run.rate[-1]).max() < 1e-4


# What is recorded, and what reaches the controller ------------------------------------------------


def test_its_arrays_agree_with_each_other() -> None:
    limit, delay = 6.2, 2
    weak = RPSRobot(ROBOT.parameters.replace(actuator_force_limit=limit))
    plant = Plant(weak, START, delay=delay, encoders=ENCODERS)
    hold = weak.actuator_forces(START, STILL, STILL)
    fast = point_to_point(START, END, duration=0.12)
    run, _ = spied(fast, plant, duration=0.2)
    n = run.time.size
    assert n == 200
    assert run.parameters == ROBOT.parameters
    np.testing.assert_array_equal(run.time, np.arange(n) * 1e-3)
    generator = ENCODERS.generator()
    np.testing.assert_array_equal(
        run.reading, [ENCODERS.read(length, generator) for length in run.length]
    )
    np.testing.assert_array_equal(run.configuration[:, 1:6:2], run.length)
    np.testing.assert_array_equal(run.pose, platform_pose(run.configuration))
    legs = ROBOT.inverse_kinematics(run.pose, errors="mask").length
    np.testing.assert_allclose(run.length, legs, rtol=0, atol=1e-11)
    delayed = np.vstack([np.tile(hold, (delay, 1)), run.command[: n - delay]])
    np.testing.assert_allclose(run.applied, np.clip(delayed, -limit, limit), rtol=1e-9)
    assert (np.abs(delayed) > limit).any()
    # The acceleration is nearly constant between ticks, and jumps there.
    steps = 1e-3 * (run.rate[1:] + run.rate[:-1]) / 2
    np.testing.assert_allclose(np.diff(run.pose, axis=0), steps, rtol=0, atol=1e-8)
    assert np.abs(steps).max() > 1e-3
    assert run.gap.max() < 1e-11
    fresh = (run.status & KEPT) == 0  # too fast in the end, for a limit it does not know of
    assert fresh.sum() > 60
    estimate = ROBOT.forward_kinematics(run.reading[fresh], run.pose[fresh])
    np.testing.assert_allclose(run.estimate[fresh], estimate, rtol=0, atol=1e-9)
    assert ((run.type_ii > 0.1) & (run.type_ii <= 1.0)).all()
    for name in ARRAYS:
        assert len(getattr(run, name)) == n


@pytest.mark.parametrize("speeds", ["filtered", "measured"])
def test_faults_reach_the_controller_and_not_the_record_of_targets(speeds: Any) -> None:
    faults = [
        Fault("nan", 0.0105, 0.002, leg=2),
        Fault("lost", 0.0305, 0.001),
        Fault("jump", 0.0505, 0.001, leg=1, size=2e-5),
        Fault("stuck", 0.0705, 0.003, leg=3),
        Fault("target", 0.0905, 0.01, offset=(1e-4, 2e-3, 0.0)),
        Fault("target_nan", 0.1205, 0.01),
    ]
    run, given = spied(faults=iter(faults), speeds=speeds)
    spoilt, generator = Faults(faults), ENCODERS.generator()
    for k, (reading, target, speed) in enumerate(given):
        true = PATH.sample(k * 1e-3)
        np.testing.assert_allclose(run.target[k], true.pose, rtol=0, atol=1e-12)
        for found, wanted in zip(target, spoilt.target(k * 1e-3, true), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9, equal_nan=True)
        arrives = spoilt.reading(k * 1e-3, ENCODERS.read(run.length[k], generator))
        assert (reading is None) == (arrives is None)
        if arrives is not None:
            np.testing.assert_array_equal(reading, arrives)
        np.testing.assert_array_equal(run.reading[k], np.nan if arrives is None else arrives)
        assert (speed is None) == (speeds == "filtered" or reading is None)
        if speed is not None and 0 < k < 199:
            slope = (run.length[k + 1] - run.length[k - 1]) / 2e-3
            np.testing.assert_allclose(speed, slope, rtol=0, atol=5e-3)
    assert np.flatnonzero(run.status & Status.BAD_INPUT).tolist() == [11, 12, 31]
    assert np.flatnonzero(run.status & Status.TARGET_HELD).tolist() == list(
        range(121, 200)
    )  # and back
    assert np.flatnonzero(np.isnan(run.reading[:, 1])).tolist() == [11, 12, 31]
    assert np.flatnonzero(np.isnan(run.reading[:, 0])).tolist() == [31]


def test_events_are_the_changes_of_the_status(monkeypatch: pytest.MonkeyPatch) -> None:
    faults = [Fault("lost", (k - 0.5) * 1e-3, 2e-3) for k in (10, 20, 22, 40, 60, 80)]
    faults.append(Fault("target_nan", 0.0605, 0.05))
    run, _ = spied(faults=faults)
    before = np.concatenate([[0], run.status[:-1]])
    changes = np.flatnonzero(run.status != before)
    assert changes.size > 8
    assert [event.time for event in run.events] == run.time[changes].tolist()
    assert [event.status for event in run.events] == run.status[changes].tolist()
    for event in run.events:
        assert (event.text == "ok") == (event.status == 0)
    monkeypatch.setattr(loop_run_module, "_MOST_EVENTS", 5)
    assert spied(faults=faults)[0].events == run.events[:5]


def test_targets_go_on_at_the_controller_s_pace() -> None:
    weak = RPSRobot(ROBOT.parameters.replace(actuator_force_limit=6.2))
    path = point_to_point(START, END, duration=0.12)
    runs = {}
    for paced in (False, True):
        controller = ComputedTorque(weak, START, GAINS)
        runs[paced] = run_loop(
            controller, Plant(weak, START), path, paced=paced, settle=0.02, duration=0.4
        )
    assert (runs[True].pace < 0.99).any()
    assert (runs[True].status & Status.SATURATED).any()
    for paced, run in runs.items():
        goal = PacedTrajectory(path, 1e-3, settle=0.02)
        for k in range(400):
            target = goal.target()
            np.testing.assert_array_equal(run.target[k], target.pose)
            np.testing.assert_array_equal(run.target_rate[k], target.rate)
            goal.advance(run.pace[k] if paced else 1.0)
    apart = [
        np.abs(runs[paced].target[:140] - runs[paced].pose[:140]).max() for paced in (False, True)
    ]
    assert apart[1] < apart[0]


def test_equal_runs_are_equal_to_the_last_digit() -> None:
    assert_equal_runs(spied()[0], spied()[0])


@pytest.mark.parametrize("ticks", [1, 7, 199, 200, 201, 999])
def test_progress_is_told_to_the_end(ticks: int) -> None:
    told: list[float] = []
    run, _ = spied(duration=ticks * 1e-3, progress=told.append)
    assert run.time.size == ticks
    assert told[-1] == 1.0
    assert (np.diff(told) > 0).all()
    assert min(ticks, 150) <= len(told) <= 250
    assert np.diff([0.0, *told]).max() < max(1 / ticks, 0.01) + 1e-12


# Broken off ---------------------------------------------------------------------------------------


class Failing(Plant):
    """Fails at a tick, with the error given."""

    at: int
    error: BaseException

    def step(self, forces: Any) -> None:
        if self.time > (self.at - 0.5) * 1e-3:
            raise self.error
        super().step(forces)


@pytest.mark.parametrize("at", [0, 1, 30])
@pytest.mark.parametrize("kind", [KeyboardInterrupt, RPSPinError, ZeroDivisionError])
def test_what_was_done_is_kept_when_it_breaks_off(at: int, kind: type[BaseException]) -> None:
    plant = Failing(ROBOT, START, encoders=ENCODERS)
    plant.at, plant.error = at, kind("broken")
    with pytest.raises(kind, match=r"^broken$") as caught:
        spied(plant=plant)
    partial: LoopRun = vars(caught.value)["partial"]
    assert partial.time.size == at
    assert_equal_runs(partial, spied()[0], ticks=at)


def test_ctrl_c_in_the_progress_keeps_the_tick_that_was_told() -> None:
    def progress(done: float) -> None:
        if done > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        spied(progress=progress)
    partial: LoopRun = vars(caught.value)["partial"]
    assert 100 < partial.time.size < 105
    assert_equal_runs(partial, spied()[0], ticks=partial.time.size)
    assert partial.applied[-1].any()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"speeds": "guessed"}, "speeds = 'guessed': it must be 'filtered' or 'measured'"),
        ({"duration": 0.0}, "duration = 0.0: it must be a positive number of s"),
        ({"duration": np.inf}, "duration = inf"),
        ({"duration": np.nan}, "duration = nan"),
        ({"settle": -0.1}, "settle = -0.1"),
        ({"settle": np.nan, "duration": 1.0}, "settle = nan"),
    ],
)
def test_what_does_not_fit_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        spied(**options)


def test_periods_that_differ_are_refused() -> None:
    with pytest.raises(InputError, match=r"plant's period is 0.002 s, the controller's 0.001"):
        spied(plant=Plant(ROBOT, START, period=2e-3))


# Files --------------------------------------------------------------------------------------------


def test_its_csv_reads_back(tmp_path: Path) -> None:
    run, _ = spied(faults=[Fault("lost", 0.0305, 0.002), Fault("nan", 0.0505, 0.001, leg=3)])
    write_loop_csv(tmp_path / "run.csv", run)
    rows = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    assert rows.dtype.names is not None
    assert len(rows) == 200
    expected = {"time_s": run.time, "type_ii": run.type_ii, "status": run.status}
    for name in ("target", "pose", "estimate"):
        for k, entry in enumerate(("z_m", "tilt_x_rad", "tilt_y_rad")):
            expected[f"{name}_{entry}"] = getattr(run, name)[:, k]
    for name, unit in (("reading", "m"), ("length", "m"), ("command", "N"), ("applied", "N")):
        for leg in range(3):
            expected[f"{name}_{leg + 1}_{unit}"] = getattr(run, name)[:, leg]
    assert set(rows.dtype.names) == set(expected)
    for name, column in expected.items():
        np.testing.assert_allclose(
            rows[name], column, rtol=1e-11, atol=0, equal_nan=True, err_msg=name
        )
    assert np.isnan(rows["reading_3_m"]).sum() == 3


@pytest.mark.parametrize("kind", [OSError, KeyboardInterrupt])
def test_a_csv_that_fails_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[BaseException]
) -> None:
    path = tmp_path / "run.csv"
    path.write_text("old")

    def fails(scratch: Path, *_: Any, **__: Any) -> None:
        Path(scratch).write_text("half a li")
        raise kind

    run, _ = spied(duration=0.01)
    monkeypatch.setattr(np, "savetxt", fails)
    with pytest.raises(kind):
        write_loop_csv(path, run)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.csv"]
    assert path.read_text() == "old"


def test_a_csv_without_ticks_has_its_header(tmp_path: Path) -> None:
    plant = Failing(ROBOT, START)
    plant.at, plant.error = 0, RPSPinError("at once")
    with pytest.raises(RPSPinError) as caught:
        spied(plant=plant)
    write_loop_csv(tmp_path / "none.csv", vars(caught.value)["partial"])
    lines = (tmp_path / "none.csv").read_text().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("time_s,target_z_m,")


def test_parameters_of_the_run_are_those_believed() -> None:
    heavy = RPSRobot(RPSParameters.from_preset("micro").replace(platform_mass=2.0))
    run, _ = spied(plant=Plant(heavy, START), duration=0.01)
    assert run.parameters == ROBOT.parameters
