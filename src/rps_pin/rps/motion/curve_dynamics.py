"""Actuator forces and speeds of a motion along a curve, by the curve's parameter u and its rates.

Along a curve x(u), the actuator forces and the legs' speeds are

    F = m(u) u'' + c(u) u'^2 + g(u) + friction(u, u'),    d' = d_u(u) u'.

All come from `RPSRobot.actuator_forces`. Reversing the motion changes the sign of friction, and
leaves the other forces as they are: this separates the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.rps.dynamics.sizing_sheet import ActuatorLimits
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.curve import Curve
from rps_pin.trajectories.path import PathSample

#: Relative step of the rate in the slope of friction: errors of about its square.
_STEP = 1e-5
#: Places along a curve where its size is looked for.
_PLACES = 33


class LimitUse(NamedTuple):
    """Forces and speeds over their limits: 1 is at the limit."""

    force: Array
    """Force over its limit, shape (..., 3); positive pushes the leg out."""
    speed: Array
    """Speed over its limit, shape (..., 3); positive is out. Zero without a limit."""

    @property
    def sides(self) -> Array:
        """Use of each limit: 3 pushes, 3 pulls, 3 speeds in either direction, shape (..., 9)."""
        return np.concatenate([self.force, -self.force, np.abs(self.speed)], axis=-1)

    @property
    def most(self) -> Array:
        """The largest of them, shape (...)."""
        most: Array = self.sides.max(axis=-1)
        return most


class CurveTerms(NamedTuple):
    """Terms of the forces at points of a curve, shape (..., 3) each; N, m and the curve's unit."""

    inertia: Array
    """m: force by u''."""
    velocity_product: Array
    """c: force by u'^2."""
    holding: Array
    """g: force at rest, against gravity and the wrench."""
    length_slope: Array
    """d_u: derivative of the leg lengths by u."""


class CurveDynamics:
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
        self.curve = curve
        self.limits = limits
        self.wrench = wrench
        #: u'^2 and u'' at which forces of inertia are of the size of the weight, 1/s^2.
        self._square = self._size_of_square()

    def _size_of_square(self) -> float:
        p = self.robot.parameters
        _, first, _ = self.curve.at(np.linspace(0.0, self.curve.length, _PLACES))
        moved = first * [1.0, p.platform_radius, p.platform_radius]
        largest = float(np.abs(moved).max())
        acceleration = float(np.linalg.norm(p.gravity))
        if not acceleration and math.isfinite(self.limits.force):
            acceleration = self.limits.force / p.platform_mass
        elif not acceleration:
            acceleration = self.limits.speed**2 / p.platform_radius
        square = acceleration / largest if largest > 0 else 1.0
        return square if 0 < square < math.inf else 1.0

    def terms(self, u: Array) -> CurveTerms:
        """Return the terms at parameters of shape (...)."""
        x, first, second = self.curve.at(u)
        square, still = self._square, np.zeros_like(x)
        rate, change = math.sqrt(square) * first, square * second
        jacobian = leg_jacobians(self.robot.parameters, x).length_jacobian
        holding = self._forces(x, still, still)
        there, back = self._forces(x, rate, change), self._forces(x, -rate, change)
        return CurveTerms(
            (self._forces(x, still, square * first) - holding) / square,
            ((there + back) / 2 - holding) / square,
            holding,
            np.einsum("...ij,...j->...i", jacobian, first),
        )

    def friction(self, u: Array, square: Array) -> tuple[Array, Array]:
        """Return the force of friction at u'^2 of shape (...), and its slope by u'^2, (..., 3)."""
        x, first, _ = self.curve.at(u)
        rate = np.sqrt(square)[..., None]
        more = self._friction(x, first * rate * (1 + _STEP))
        less = self._friction(x, first * rate * (1 - _STEP))
        # d/d(r^2) = (d/dr) / (2 r), and (d/dr) is the difference over 2 _STEP r
        over = 4 * _STEP * square[..., None]
        slope = np.divide(more - less, over, out=np.zeros_like(more), where=over > 0)
        return self._friction(x, first * rate), slope

    def use(self, motion: PathSample) -> LimitUse:
        """Return forces and speeds of a sampled motion over their limits."""
        force = self._forces(*motion)
        speed = self.robot.motion(*motion)[1].speed
        return LimitUse(force / self.limits.force, speed / self.limits.speed)

    def sample(self, u: Array, square: Array, acceleration: Array) -> PathSample:
        """Return the motion at parameters, u'^2 and u'' of shape (...)."""
        x, first, second = self.curve.at(u)
        rate = first * np.sqrt(square)[..., None]
        change = first * acceleration[..., None] + second * square[..., None]
        return PathSample(x, rate, change)

    def _forces(self, x: Array, rate: Array, acceleration: Array) -> Array:
        return self.robot.actuator_forces(x, rate, acceleration, wrench=self.wrench)

    def _friction(self, x: Array, rate: Array) -> Array:
        still = np.zeros_like(x)
        return (self._forces(x, rate, still) - self._forces(x, -rate, still)) / 2
