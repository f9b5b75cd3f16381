"""Which limits a motion reaches, as it reports."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.errors import InputError
from rps_pin.rps import ActuatorLimits, RPSRobot
from rps_pin.rps.motion.limited_motion import SIDES, LimitedMotion
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.trajectories.point_to_point import LineCurve


@pytest.fixture(scope="module")
def lift() -> LimitedMotion:
    """Straight up: pushed at 30 N, at 0.2 m/s, and braked at -30 N, all legs alike."""
    robot = RPSRobot.from_preset("micro")
    line = LineCurve([0.21, 0, 0], [0.24, 0, 0])
    return time_optimal(robot, line, limits=ActuatorLimits(30.0, 0.2))


def test_the_limits_are_reached_in_turn(lift: LimitedMotion) -> None:
    mass = 1.2 / 3 + 0.1  # of a leg
    up, down = 0.2 / (30 / mass - 9.81), 0.2 / (30 / mass + 9.81)
    share = lift.active([0.5 * up, lift.duration / 2, lift.duration - 0.5 * down])
    names = [{SIDES[i] for i in np.flatnonzero(row)} for row in share]
    for name, what in zip(names, ("push", "speed", "pull"), strict=True):
        assert name == {f"actuator {leg} {what}" for leg in (1, 2, 3)}
    shares = lift.shares()
    assert shares["actuator 1 push"] == pytest.approx(up / lift.duration, abs=3e-3)
    assert shares["actuator 2 pull"] == pytest.approx(down / lift.duration, abs=3e-3)
    assert shares["none"] < 1e-2
    assert set(shares) == {*SIDES, "none"}


def test_the_report_names_what_is_reached(lift: LimitedMotion) -> None:
    report = lift.report()
    assert f"{lift.duration:.6g} s" in report
    for what in ("push", "pull", "speed"):
        assert f"actuator 3 {what}" in report
    assert "LimitedMotion(LineCurve" in repr(lift)


def test_it_knows_its_robot_and_limits(lift: LimitedMotion) -> None:
    assert lift.limits == ActuatorLimits(30.0, 0.2)
    assert lift.robot.parameters.name == "micro"
    use = lift.use(lift.duration / 2)
    assert use.force.shape == use.speed.shape == (3,)
    np.testing.assert_allclose(use.speed, 1.0, atol=1e-6)


@pytest.mark.parametrize("within", [0, 1, -0.1, float("nan")])
def test_a_nearness_out_of_range_is_refused(lift: LimitedMotion, within: float) -> None:
    with pytest.raises(InputError, match="within"):
        lift.active(0.0, within)


def test_times_outside_are_refused(lift: LimitedMotion) -> None:
    with pytest.raises(InputError, match="outside the trajectory"):
        lift.use(lift.duration + 1)
