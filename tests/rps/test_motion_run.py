"""A whole motion: the paper's helix, its summary, and motions that cannot be."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from rps_pin import InputError, RPSRobot, SingularityError, UnreachableError, helix
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion, sample_times, summarise
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.trajectories import HelixPath
from tests.reference import newton_euler


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module")
def run(robot: RPSRobot) -> MotionRun:
    return run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 200.0)


def test_the_forces_and_reactions_are_those_of_the_independent_derivation(
    robot: RPSRobot, run: MotionRun
) -> None:
    reference = newton_euler.inverse_dynamics(
        robot.parameters, run.pose, run.rate, run.acceleration
    )
    assert_allclose(run.force, reference.forces, rtol=1e-10)
    assert_allclose(run.reaction, reference.reactions, atol=1e-10 * np.abs(run.reaction).max())


def test_the_actuators_power_is_the_rate_of_the_energy(robot: RPSRobot, run: MotionRun) -> None:
    expected = newton_euler.power(robot.parameters, run.pose, run.rate, run.acceleration)
    assert_allclose(run.power.sum(axis=1), expected, atol=1e-10 * np.abs(run.power).max())


def test_the_loops_are_closed_and_the_equations_hold(run: MotionRun) -> None:
    assert run.loop_gap.max() <= 1e-12
    assert run.residual.max() <= 1e-10


def test_the_columns_belong_together(run: MotionRun) -> None:
    smooth = np.all(np.abs(np.diff(run.acceleration, axis=0)) < 1e-2, axis=1)  # off the corners
    assert smooth.mean() > 0.99
    step = np.diff(run.time)[smooth, None]
    for values, rates in ((run.length, run.speed), (run.speed, run.leg_acceleration)):
        middle = (rates[1:] + rates[:-1]) / 2
        difference = np.diff(values, axis=0)[smooth] / step
        assert_allclose(difference, middle[smooth], atol=2e-6)


def test_the_summary_says_what_the_samples_say(robot: RPSRobot, run: MotionRun) -> None:
    summary = summarise(run, robot)
    assert summary.duration == run.time[-1]
    assert summary.samples == len(run.time)
    for one in summary.actuators:
        leg = one.actuator - 1
        assert one.force_min == min(run.force[:, leg])
        assert one.force_max == max(run.force[:, leg])
        assert one.force_min <= one.force_rms <= one.force_max  # all are positive here
        assert one.length_min == min(run.length[:, leg])
        assert one.length_max == max(run.length[:, leg])
        assert one.speed_peak == max(abs(run.speed[:, leg]))
        assert one.power_peak == max(abs(run.force[:, leg] * run.speed[:, leg]))
        assert 0 < one.power_mean < one.power_peak
    worst = int(np.argmin(run.passive_conditioning))
    condition = robot.mechanism.condition(run.configuration[worst])
    assert_allclose(summary.passive_conditioning_min, 1 / condition, rtol=1e-9)
    distance = singularity_measures(robot.parameters, run.pose).distance
    assert_allclose(summary.minimum_distance, distance.min(), rtol=1e-5)
    nearest = singularity_measures(robot.parameters, summary.minimum_pose)
    assert_allclose(summary.minimum_distance, nearest.distance, rtol=1e-12)
    assert summary.minimum_singularity == "type II"
    pose = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4).sample(summary.minimum_time).pose
    assert_allclose(summary.minimum_pose, pose, rtol=0, atol=1e-15)
    assert summary.exceeded == ()


def test_time_averages_are_weighted_with_time(robot: RPSRobot) -> None:
    """Twice the samples leave the averages as they are, to the trapezoids' error."""
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    coarse, fine = (summarise(run_motion(robot, path, rate), robot) for rate in (100.0, 400.0))
    for a, b in zip(coarse.actuators, fine.actuators, strict=True):
        assert_allclose(a.force_rms, b.force_rms, rtol=2e-3)
        assert_allclose(a.power_mean, b.power_mean, rtol=2e-3)


def test_limits_of_the_actuators_that_are_exceeded_are_told(robot: RPSRobot) -> None:
    weak = RPSRobot(robot.parameters.replace(actuator_force_limit=0.9, actuator_speed_limit=0.01))
    run = run_motion(weak, helix(weak, radius=0.75e-3, pitch=0.5e-3, height=0.4), 100.0)
    force, speed = summarise(run, weak).exceeded
    assert "actuator 1" in force
    assert "0.9 N" in force
    assert "0.01 m/s" in speed


@pytest.mark.parametrize(
    ("radius", "pitch", "height", "crossing"),
    [(75e-3, 50e-3, 0.4, 4.0752), (0.75e-3, 0.5e-3, 0.4e-3, 0.1293)],
)
def test_a_motion_across_a_singularity_is_refused_and_says_when(
    robot: RPSRobot, radius: float, pitch: float, height: float, crossing: float
) -> None:
    path = helix(robot, radius=radius, pitch=pitch, height=height)
    with pytest.raises(SingularityError, match="crosses a type II singularity") as caught:
        run_motion(robot, path, 100.0)
    told = re.match(r"at t = (\S+) s of 5.23884 s", str(caught.value))
    assert told is not None
    assert_allclose(float(told.group(1)), _sign_change(robot, path, crossing), rtol=0, atol=2e-9)


def test_the_other_branch_of_that_motion_crosses_none(robot: RPSRobot) -> None:
    run = run_motion(robot, helix(robot, radius=75e-3, pitch=50e-3, height=0.4, branch="-"), 100.0)
    assert run.passive_conditioning.min() > 1e-4


def test_a_motion_that_starts_in_a_singularity_says_so(robot: RPSRobot) -> None:
    with pytest.raises(SingularityError, match=r"at t = 0 s .* condition number"):
        run_motion(robot, helix(robot, radius=0.0, pitch=0.1, height=0.0), 100.0)


def test_a_motion_out_of_reach_says_when_and_why() -> None:
    micro = RPSRobot.from_preset("micro")
    path = helix(micro, radius=0.2e-3, pitch=0.1, height=0.225)
    with pytest.raises(UnreachableError, match=r"at t = .* of 5.23884 s .*leg .*length") as caught:
        run_motion(micro, path, 100.0)
    (first, *_) = caught.value.violations
    assert first.quantity == "length"
    assert first.value > 0.250


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf, 1e9])
def test_a_sample_rate_that_makes_no_sense_is_refused(rate: float) -> None:
    with pytest.raises(InputError, match="Hz"):
        sample_times(5.0, rate)


@pytest.mark.parametrize(("duration", "rate"), [(1.0, 10.0), (5.23884, 1000.0), (0.3, 1.0)])
def test_samples_are_even_and_end_with_the_motion(duration: float, rate: float) -> None:
    times = sample_times(duration, rate)
    assert times[0] == 0.0
    assert times[-1] == duration
    steps = np.diff(times)
    assert_allclose(steps[:-1], 1 / rate, rtol=1e-9)
    assert 0 < steps[-1] <= (1 + 1e-6) / rate


def test_progress_sees_every_sample(robot: RPSRobot) -> None:
    seen: list[int] = []

    def progress(samples: Iterable[int]) -> Iterator[int]:
        for sample in samples:
            seen.append(sample)
            yield sample

    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    run = run_motion(robot, path, 10.0, progress=progress)
    assert seen == list(range(len(run.time)))


def _sign_change(robot: RPSRobot, path: HelixPath, near: float) -> float:
    """When the determinant of the mechanism's passive Jacobian changes its sign, s."""

    def orientation(time: float) -> float:
        state = robot.state(*path.sample(time))
        J = robot.mechanism.jacobian(state[0])
        passive = np.setdiff1d(np.arange(12), robot.mechanism.actuated_indices)
        return float(np.linalg.det(J[:, passive]))

    return float(brentq(orientation, near - 1e-3, near + 1e-3, xtol=1e-13))
