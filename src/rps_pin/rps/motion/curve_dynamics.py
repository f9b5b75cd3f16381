"""Actuator forces and leg speeds of a 3-RPS along a curve, by `RPSRobot.actuator_forces`."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.rps.dynamics.friction import has_friction
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.motion.curve_dynamics import CurveDynamics as AnyCurveDynamics
from rps_pin.task.motion.curve_dynamics import CurveLimits, LimitUse
from rps_pin.task.motion.curve_dynamics import CurveTerms as AnyCurveTerms
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.curve import Curve, CurveSample
from rps_pin.trajectories.path import PathSample

__all__ = ["SIDES", "CurveDynamics", "CurveTerms", "LimitUse"]

#: Names of the limits, in the order of `LimitUse.sides`.
SIDES = tuple(f"actuator {leg} {what}" for what in ("push", "pull", "speed") for leg in (1, 2, 3))

_NONE = np.empty((2, 0))
_EITHER_WAY = np.array([[-1.0] * 3, [1.0] * 3])


class CurveTerms(AnyCurveTerms):
    """Terms of the forces and speeds at points of a curve, shape (..., 3) each."""

    @property
    def length_slope(self) -> Array:
        """d_u: derivative of the leg lengths by u."""
        return self.speed_slope


class CurveDynamics(AnyCurveDynamics):
    """The actuator forces and speeds of a robot that moves along a curve.

    Parameters
    ----------
    robot
        The 3-RPS, with its payload and friction.
    curve
        The curve.
    limits
        Of its actuators.
    wrench
        Constant wrench on the platform, shape (6,), or None.
    """

    def __init__(
        self, robot: RPSRobot, curve: Curve, limits: ActuatorLimits, wrench: Array | None
    ) -> None:
        self.robot = robot
        self.limits = limits
        self.wrench = wrench
        force, speed = limits.force * _EITHER_WAY, limits.speed * _EITHER_WAY
        bounds = CurveLimits(force, _NONE, _NONE, speed, _NONE)
        super().__init__(curve, bounds, SIDES, has_friction(robot.parameters))

    def terms(self, u: Array) -> CurveTerms:
        """Return the terms at parameters of shape (...)."""
        return CurveTerms(*super().terms(u))

    def place(self, u: Array) -> CurveSample:
        """Return poses and derivatives of the curve."""
        return self.curve.at(u)

    def levels(self, place: CurveSample, rate: Array, acceleration: Array) -> Array:
        """Return actuator forces, shape (..., 3); positive pushes the leg out."""
        x, first, second = place
        r, a = rate[..., None], acceleration[..., None]
        return self._forces(x, first * r, first * a + second * r**2)

    def speed_slopes(self, place: CurveSample) -> Array:
        """Return derivatives of the leg lengths by u, shape (..., 3)."""
        jacobian = leg_jacobians(self.robot.parameters, place.pose).length_jacobian
        return np.asarray(np.einsum("...ij,...j->...i", jacobian, place.first))

    def jerk_slopes(self, place: CurveSample) -> tuple[Array, Array]:
        """Return nothing: limits of jerk are those of a task."""
        none = np.empty((*place.pose.shape[:-1], 0))
        return none, none

    def use_along(
        self, u: Array, square: Array, acceleration: Array, jerk: Array | None = None
    ) -> LimitUse:
        """Return forces and speeds over their limits at parameters, u'^2 and u'' of shape (...)."""
        return self.use(self.sample(u, square, acceleration))

    def use(self, motion: PathSample) -> LimitUse:
        """Return forces and speeds of a sampled motion over their limits."""
        force, speed = self._forces(*motion), self.robot.motion(*motion)[1].speed
        return self.use_of(force, speed, np.empty((*force.shape[:-1], 0)))

    def _forces(self, x: Array, rate: Array, acceleration: Array) -> Array:
        return self.robot.actuator_forces(x, rate, acceleration, wrench=self.wrench)
