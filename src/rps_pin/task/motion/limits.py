"""Limits that a motion of a task is to keep, and what they are for a mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.task.motion.curve_dynamics import CurveLimits
from rps_pin.task.task import Task
from rps_pin.validation import numbers

#: Unit of a quantity of a translation, and of a rotation.
_UNITS = {
    "force": ("N", "N m"),
    "speed": ("m/s", "rad/s"),
    "acceleration": ("m/s^2", "rad/s^2"),
    "jerk": ("m/s^3", "rad/s^3"),
}


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the actuators and of the coordinates of a task.

    Each is one number for all, both ways; or one for each, shape (n,), both ways; or the least and
    the largest of each, shape (2, n). Infinite where there is none.
    """

    force: ArrayLike | None = None
    """Of the actuators, N or N m; left out, the model's effort limits."""
    speed: ArrayLike | None = None
    """Of the actuators, m/s or rad/s; left out, the model's."""
    acceleration: ArrayLike | None = None
    """Of the actuators, m/s^2 or rad/s^2; left out, none."""
    coordinate_speed: ArrayLike | None = None
    """Of the task's coordinates, m/s or rad/s; left out, none."""
    coordinate_acceleration: ArrayLike | None = None
    """Of the task's coordinates, m/s^2 or rad/s^2; left out, none."""
    jerk: ArrayLike | None = None
    """Of the actuators, m/s^3 or rad/s^3; left out, none."""
    coordinate_jerk: ArrayLike | None = None
    """Of the task's coordinates, m/s^3 or rad/s^3; left out, none."""

    def of(self, task: Task) -> CurveLimits:
        """Return the least and largest of each quantity of a task.

        Raises
        ------
        InputError
            If a limit is not a number, of another shape, on the wrong side of zero, or infinite in
            one direction only; if there is none of forces, accelerations or jerks.
        """
        model, actuated = task.mechanism.model, task.mechanism.actuated_indices
        force = np.asarray(model.effortLimit, dtype=np.float64)[actuated]
        speed = np.asarray(model.velocityLimit, dtype=np.float64)[actuated]
        count, size = len(actuated), task.size
        found = CurveLimits(
            _ranges(force if self.force is None else self.force, count, "force"),
            _ranges(self.acceleration, count, "acceleration"),
            _ranges(self.coordinate_acceleration, size, "coordinate_acceleration"),
            _ranges(speed if self.speed is None else self.speed, count, "speed"),
            _ranges(self.coordinate_speed, size, "coordinate_speed"),
            _finite_ranges(self.jerk, count, "jerk"),
            _finite_ranges(self.coordinate_jerk, size, "coordinate_jerk"),
        )
        if not (np.isfinite(found.levels).any() or found.jerks.size):
            raise InputError(
                "the actuators have no limit of force, and nothing has one of acceleration or "
                "jerk: any time can be made shorter. Give limits=MotionLimits(force=...)"
            )
        return found


def sides_of(task: Task, limits: CurveLimits) -> tuple[str, ...]:
    """Return names of the limits, in the order of `LimitUse.sides`."""
    actuators, coordinates = task.mechanism.actuated, task.coordinates
    levels = _named(limits.force, actuators, "force")
    levels += _named(limits.acceleration, actuators, "acceleration")
    levels += _named(limits.coordinate_acceleration, coordinates, "acceleration")
    speeds = _named(limits.speed, actuators, "speed")
    speeds += _named(limits.coordinate_speed, coordinates, "speed")
    jerks = _named(limits.jerk, actuators, "jerk")
    jerks += _named(limits.coordinate_jerk, coordinates, "jerk")
    return (*(f"{one} +" for one in levels), *(f"{one} -" for one in levels), *speeds, *jerks)


def unit(quantity: str, angular: bool) -> str:
    """Return the unit of a force, speed or acceleration."""
    return _UNITS[quantity][angular]


def _named(ranges: Array, names: tuple[str, ...], what: str) -> list[str]:
    return [f"{name} {what}" for name in names[: ranges.shape[-1]]]


def _finite_ranges(given: Any, size: int, what: str) -> Array:
    """Return the ranges, or none if all of them are infinite."""
    found = _ranges(given, size, what)
    return found if np.isfinite(found).any() else np.empty((2, 0))


def _ranges(given: Any, size: int, what: str) -> Array:
    """Return the least and largest of one quantity, shape (2, size), or (2, 0) without limits."""
    if given is None:
        return np.empty((2, 0))
    shapes = f"one number, or numbers of shape ({size},) or (2, {size})"
    found = numbers(given, f"{what} limit", shapes)
    if found.shape in ((), (size,)):
        largest = np.broadcast_to(found, (size,))
        if not (largest > 0).all():  # nor NaN
            raise InputError(f"{what} limit = {found.tolist()}: it must be positive")
        return np.stack([-largest, largest])
    if found.shape != (2, size):
        raise InputError(
            f"{what} limit has shape {found.shape}; expected {shapes}: the least and the largest"
        )
    least, largest = found
    if not (least < largest).all():
        raise InputError(f"{what} limit: the least {least.tolist()} must be below the largest")
    if "force" not in what and not ((least < 0) & (largest > 0)).all():
        raise InputError(f"{what} limit: the least must be negative, and the largest positive")
    either = "speed" in what or "jerk" in what  # which have a limit in one direction each
    if not either and (np.isfinite(least) != np.isfinite(largest)).any():
        raise InputError(f"{what} limit: both the least and the largest must be finite, or neither")
    return found
