"""Motions of the 3-RPS at the limits of its actuators, as `time_optimal` returns them."""

from __future__ import annotations

from rps_pin.rps.motion.curve_dynamics import SIDES, CurveDynamics
from rps_pin.task.motion.curve_dynamics import ACTIVE
from rps_pin.task.motion.limited_motion import LimitedMotion as AnyLimitedMotion
from rps_pin.task.motion.speed_profile import SpeedProfile

__all__ = ["ACTIVE", "SIDES", "LimitedMotion"]


class LimitedMotion(AnyLimitedMotion):
    """A motion of the 3-RPS along a curve in the shortest time, made by `time_optimal`.

    Attributes
    ----------
    curve : Curve
        The curve of poses.
    law : SpeedProfile
        Its time law: pieces, and the squared rate at their ends.
    robot : RPSRobot
        The robot.
    limits : ActuatorLimits
        The limits of its actuators.
    """

    def __init__(self, dynamics: CurveDynamics, law: SpeedProfile) -> None:
        super().__init__(dynamics, law)
        self.robot, self.limits = dynamics.robot, dynamics.limits
