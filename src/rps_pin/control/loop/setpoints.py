"""Setpoints of a control loop: valid targets, held targets, and the return from a hold.

A target is refused if it is not finite, if it would be beyond the robot's limits (the 3-RPS's: a
leg's length, angle or ball joint), or if it is too near a singularity or beyond one (the
determinant, of the 3-RPS that of Eq. 8, must keep the sign that it had at the start). While targets
are refused the setpoint is the last one, at rest. From there the setpoint returns to the next valid
target smoothly (`rps_pin.control.loop.rejoining`), if every pose on the way is valid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from rps_pin.control.loop.rejoining import Rejoining
from rps_pin.control.model import ControlModel
from rps_pin.numerics.elementary import Number
from rps_pin.plain_text import listed

#: Rates whose squares are not finite, or nearly, have no forces: m/s and rad/s.
LARGEST_RATE = 1e150


class Setpoint(NamedTuple):
    """A desired motion at one time, checked."""

    geometry: Any
    """`LegGeometry` of the 3-RPS, `TaskGeometry` of a task."""
    rate: Any
    acceleration: Any


class Setpoints:
    """The setpoints of one robot.

    Parameters
    ----------
    model
        What is known of the robot.
    near_singular
        Least absolute value of the determinant.
    """

    def __init__(self, model: ControlModel, near_singular: float) -> None:
        self._model, self._near = model, near_singular
        self._held = False
        self._refused: Any = None
        self._rejoining: Rejoining | None = None

    def reset(self, geometry: Any) -> None:
        """Start at rest in a pose, the setpoint until there is a target."""
        zero = self._model.vectors.zero
        self.follow(Setpoint(geometry, zero, zero))
        self.side = math.copysign(1.0, self._model.determinant(geometry))

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
            Pose, rate and acceleration, (m,) each; None for the last valid one.
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
        floats = self._model.coordinates
        x, dx, ddx = floats(pose), floats(rate), floats(acceleration)
        if x is None or dx is None or ddx is None:
            return None
        self._refused = x
        geometry = self._allowed(x)
        if geometry is None or not all_below((*dx, *ddx), self._model.largest):
            return None
        return Setpoint(geometry, dx, ddx)

    def _return_to(self, target: Setpoint, elapsed: float) -> bool:
        """Advance from the held setpoint towards a valid target."""
        self._target = target
        difference, total = self._model.vectors.difference, self._model.vectors.total
        if self._held or self._rejoining is None:
            held, self._held = self.current, False
            self._rejoining = Rejoining(
                difference(held.geometry.pose, target.geometry.pose),
                difference(held.rate, target.rate),
                difference(held.acceleration, target.acceleration),
                self._model.rejoining_time(held.geometry, target.geometry),
            )
        offset = self._rejoining.after(elapsed if 0.0 < elapsed < math.inf else 0.0)
        if offset is None:
            self._rejoining, self.current = None, target
            return True
        pose = total(target.geometry.pose, offset[0])
        geometry = self._allowed(pose)
        if geometry is None:
            self._refused = pose
            self._hold()
            return False
        rate = total(target.rate, offset[1])
        acceleration = total(target.acceleration, offset[2])
        self.current = Setpoint(geometry, rate, acceleration)
        return False

    def _allowed(self, pose: Any) -> Any:
        """Return the geometry of a pose, None if the pose is not allowed."""
        geometry = self._model.geometry(pose, self.current.geometry)
        if geometry is None or self._model.violated(geometry):
            return None
        return geometry if self._determinant(geometry) >= self._near else None

    def _determinant(self, geometry: Any) -> float:
        """Return the determinant, positive on the side of the start."""
        return float(self.side * self._model.determinant(geometry))

    def messages(self) -> list[str]:
        """Return why the setpoint is not the last target."""
        if self._rejoining is not None:
            return [f"returning to the target: {self._rejoining.left:.3g} s remain"]
        return [*self._refusals(self._refused), "the last valid target is held"]

    def _refusals(self, x: Any) -> list[str]:
        model = self._model
        if x is None:
            return [f"the target is not three finite {model.rows}: pose, rate and acceleration"]
        target = f"the target {listed(x, model.units)}"
        geometry = model.geometry(x, self.current.geometry)
        if geometry is None:
            return [f"{target} {model.out_of_reach(x, self.current.geometry)}"]
        found = [f"at {target}, {one}" for one in model.messages(geometry)]
        determinant = self._determinant(geometry)
        if not determinant >= self._near:
            found.append(
                f"{target} is too near a singularity, or beyond one: determinant "
                f"{determinant:.3g}, at least {self._near:.3g} is required"
            )
        return found or [f"{target} has a rate or acceleration out of range"]

    def _hold(self) -> None:
        self._held, self._rejoining = True, None
        zero = self._model.vectors.zero
        self.current = Setpoint(self.current.geometry, zero, zero)


def all_below(values: Sequence[Number], limit: Number) -> Number:
    """Return whether the size of every number is below a limit."""
    found: Number = True
    for value in values:
        found = found * (abs(value) < limit)
    return found
