"""Targets at a pace: the trajectory's own, slower ones, and derivatives that are those of x."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import InputError, RPSRobot, helix
from rps_pin.control import ComputedTorque, Gains
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.simulation.loop_run import run_loop
from rps_pin.control.simulation.loop_summary import LoopSummary
from rps_pin.control.simulation.plant import Plant
from rps_pin.trajectories import circle

PERIOD = 1e-3


def test_at_full_pace_it_is_the_trajectory() -> None:
    path = circle(height=0.223, tilt=0.1, duration=0.5)
    paced = PacedTrajectory(path, PERIOD, settle=0.1)
    for k in range(700):
        t = k * PERIOD - 0.1
        target = paced.target()
        inside = path.sample(min(max(t, 0.0), path.duration))
        np.testing.assert_allclose(target.pose, inside.pose, rtol=0, atol=1e-12)
        if -0.5 * PERIOD < t < path.duration - 0.5 * PERIOD:
            np.testing.assert_allclose(target.rate, inside.rate, rtol=0, atol=1e-9)
            np.testing.assert_allclose(target.acceleration, inside.acceleration, rtol=0, atol=1e-7)
        elif t < -0.5 * PERIOD or t > path.duration + 0.5 * PERIOD:
            assert not target.rate.any()
            assert not target.acceleration.any()
        paced.advance()
    assert paced.done


def test_rates_are_those_of_the_poses_at_any_pace() -> None:
    """Central differences over ticks of a pace that changes smoothly."""
    period = 1e-4
    path = circle(height=0.223, tilt=0.1, duration=0.5)
    paced = PacedTrajectory(path, period)
    rows = []
    for k in range(3000):
        rows.append(np.stack(paced.target()))
        paced.advance(0.6 + 0.4 * np.cos(40.0 * (k + 1) * period))
    x = np.array(rows)
    speed = (x[2:, 0] - x[:-2, 0]) / (2 * period)
    pull = (x[2:, 1] - x[:-2, 1]) / (2 * period)
    scale = np.abs(x[10:, 1]).max(), np.abs(x[10:, 2]).max()
    np.testing.assert_allclose(x[11:-1, 1], speed[10:], rtol=0, atol=1e-3 * scale[0])
    # s'' is a difference over the last tick: half a tick late.
    np.testing.assert_allclose(x[11:-1, 2], pull[10:], rtol=0, atol=1e-2 * scale[1])


def test_a_weak_robot_stays_nearer_to_its_path_at_its_pace() -> None:
    robot = RPSRobot.from_preset("micro")
    path = helix(robot, radius=0.5e-3, pitch=0.33e-3, height=0.223, duration=0.3)
    start = path.sample(0.0).pose
    dense = path.sample(np.linspace(0, path.duration, 5001)).pose
    far = {}
    for paced in (False, True):
        controller = ComputedTorque(robot, start, Gains.placed(15.0), force_limit=5.2)
        run = run_loop(
            controller, Plant(robot, start), path, settle=0.05, duration=1.2, paced=paced
        )
        assert np.abs(run.command).max() <= 5.2
        assert LoopSummary.of(run).saturated > 0.05
        assert (run.pace < 1.0).any()
        scaled = run.pose * [1.0, 0.1, 0.1]  # tilts as the balls' motion, about
        apart = np.linalg.norm(scaled[:, None] - (dense * [1.0, 0.1, 0.1])[None, ::20], axis=2)
        far[paced] = apart.min(axis=1).max()
        end = LoopSummary.of(run, begin=1.15)
        if paced:
            assert end.centre_max < 1.0  # um: it arrives
    assert far[True] < far[False] / 2


def test_nonsense_is_refused() -> None:
    path = circle(height=0.223, tilt=0.1, duration=0.5)
    with pytest.raises(InputError, match="settle"):
        PacedTrajectory(path, PERIOD, settle=-1.0)
    with pytest.raises(InputError, match="period"):
        PacedTrajectory(path, 0.0)


def test_time_does_not_drift_over_hours() -> None:
    path = circle(height=0.223, tilt=0.1, duration=0.5)
    paced = PacedTrajectory(path, PERIOD, settle=0.3)
    for _ in range(1_000_000):
        paced.advance()
    assert paced.time == pytest.approx(1_000_000 * PERIOD - 0.3, rel=0, abs=1e-12)
