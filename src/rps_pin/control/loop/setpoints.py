"""Setpoints of a control loop: valid targets, held targets, and the return from a hold.

A target is refused if it is not finite, if a leg's length, angle or ball joint would be beyond its
limits, or if it is too near a singularity or beyond one (the determinant of Eq. 8 must keep the
sign that it had at the start). While targets are refused the setpoint is the last one, at rest.
From there the setpoint returns to the next valid target smoothly
(`rps_pin.control.loop.rejoining`), if every pose on the way is valid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from rps_pin.control.estimator.leg_geometry import (
    LARGEST_LENGTH,
    LegGeometry,
    closure_determinant,
    in_range,
    leg_geometry,
)
from rps_pin.control.estimator.loop_arguments import three_floats
from rps_pin.control.loop.limits import RobotLimits
from rps_pin.control.loop.rejoining import Rejoining, rejoining_time
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.parameters import RPSParameters

_ZERO = (0.0, 0.0, 0.0)


class Setpoint(NamedTuple):
    """A desired motion at one time, checked."""

    geometry: LegGeometry
    rate: Triple
    acceleration: Triple


class Setpoints:
    """The setpoints of one robot.

    Parameters
    ----------
    parameters
        The robot's. Half of its actuators' speed limit is used for the return to a target.
    near_singular
        Least absolute value of Eq. 8's determinant, 0 to 1.
    """

    def __init__(self, parameters: RPSParameters, near_singular: float) -> None:
        self._limits, self._near = RobotLimits(parameters), near_singular
        self._g, self._h = float(parameters.base_radius), float(parameters.platform_radius)
        self._speed_limit = parameters.actuator_speed_limit
        self._held = False
        self._refused: Triple | None = None
        self._rejoining: Rejoining | None = None
        # Entry of rate and acceleration, in SI units.
        self._largest = LARGEST_LENGTH * (self._g + self._h)

    def reset(self, geometry: LegGeometry) -> None:
        """Start at rest in a pose, the setpoint until there is a target."""
        self.follow(Setpoint(geometry, _ZERO, _ZERO))
        self.side = math.copysign(1.0, closure_determinant(geometry, self._g, self._h))

    @property
    def followed(self) -> bool:
        """Whether the setpoint is the last target: there is no hold, and no return."""
        return not self._held and self._rejoining is None

    def follow(self, setpoint: Setpoint) -> None:
        """Set a valid target as the setpoint."""
        self.current = self._target = setpoint
        self._held, self._refused, self._rejoining = False, None, None

    def update(self, target: Any, elapsed: float) -> bool:
        """Set `current`, and return whether it is the target; it is not during hold and return.

        Parameters
        ----------
        target
            Pose (m, rad, rad), rate and acceleration, (3,) each; None for the last valid one.
        elapsed
            Time since the last call, s.
        """
        wanted = self._target if target is None else self._valid(target)
        if wanted is None:
            self._hold()
        elif self._held or self._rejoining is not None:
            return self._return_to(wanted, elapsed)
        elif target is not None:
            self.current = self._target = wanted
        return wanted is not None

    def _valid(self, target: Any) -> Setpoint | None:
        """Return a target as floats; None, and the pose in `_refused`, if it is not valid."""
        self._refused = None
        try:
            pose, rate, acceleration = target
        except Exception:  # of whatever object
            return None
        x, dx, ddx = three_floats(pose), three_floats(rate), three_floats(acceleration)
        if x is None or dx is None or ddx is None:
            return None
        self._refused = x
        geometry = self._allowed(x)
        if geometry is None or not all_below((*dx, *ddx), self._largest):
            return None
        return Setpoint(geometry, dx, ddx)

    def _return_to(self, target: Setpoint, elapsed: float) -> bool:
        """Advance from the held setpoint towards a valid target."""
        self._target = target
        if self._held or self._rejoining is None:
            held, self._held = self.current, False
            legs = difference(held.geometry.length, target.geometry.length)
            self._rejoining = Rejoining(
                difference(held.geometry.pose, target.geometry.pose),
                difference(held.rate, target.rate),
                difference(held.acceleration, target.acceleration),
                rejoining_time(max(map(abs, legs)), self._speed_limit),
            )
        offset = self._rejoining.after(elapsed if 0.0 < elapsed < math.inf else 0.0)
        if offset is None:
            self._rejoining, self.current = None, target
            return True
        pose = _sum(target.geometry.pose, offset[0])
        geometry = self._allowed(pose)
        if geometry is None:
            self._refused = pose
            self._hold()
            return False
        rate, acceleration = _sum(target.rate, offset[1]), _sum(target.acceleration, offset[2])
        self.current = Setpoint(geometry, rate, acceleration)
        return False

    def _allowed(self, pose: Triple) -> LegGeometry | None:
        """Return the leg geometry of a pose, None if the pose is not allowed."""
        geometry = leg_geometry(pose, self._g, self._h)
        if geometry is None or self._limits.violated(geometry):
            return None
        return geometry if self._determinant(geometry) >= self._near else None

    def _determinant(self, geometry: LegGeometry) -> float:
        """Return Eq. 8's determinant, positive on the side of the start."""
        return float(self.side * closure_determinant(geometry, self._g, self._h))

    def messages(self) -> list[str]:
        """Return why the setpoint is not the last target."""
        if self._rejoining is not None:
            return [f"returning to the target: {self._rejoining.left:.3g} s remain"]
        return [*self._refusals(self._refused), "the last valid target is held"]

    def _refusals(self, x: Triple | None) -> list[str]:
        if x is None:
            return ["the target is not three finite triples: pose, rate and acceleration"]
        target = "the target (" + ", ".join(f"{value:.6g}" for value in x) + ") m, rad, rad"
        if not in_range(x, self._g, self._h):
            return [f"{target} is out of range"]
        geometry = leg_geometry(x, self._g, self._h)
        if geometry is None:
            return [f"{target} makes the length of a leg zero"]
        found = [f"at {target}, {one}" for one in self._limits.messages(geometry)]
        determinant = self._determinant(geometry)
        if not determinant >= self._near:
            found.append(
                f"{target} is too near a singularity, or beyond one: determinant "
                f"{determinant:.3g}, at least {self._near:.3g} is required"
            )
        return found or [f"{target} has a rate or acceleration out of range"]

    def _hold(self) -> None:
        self._held, self._rejoining = True, None
        self.current = Setpoint(self.current.geometry, _ZERO, _ZERO)


def all_below(values: Sequence[Number], limit: Number) -> Number:
    """Return whether the size of every number is below a limit."""
    found: Number = True
    for value in values:
        found = found * (abs(value) < limit)
    return found


def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def difference(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
