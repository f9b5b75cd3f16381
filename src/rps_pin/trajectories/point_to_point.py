"""Straight motions between two poses: x(u) = start + u (end - start), u in [0, 1]."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import POSE, checked_parameters
from rps_pin.trajectories.time_laws import Profile, time_law
from rps_pin.validation import fixed_array, numbers


@refuses_other_kinds
class LineCurve:
    """The straight line between two poses, u from 0 to 1.

    Attributes
    ----------
    start, end : (m,) arrays
        Poses: (z, tilt_x, tilt_y), or a task's coordinates, m and rad; read-only.
    """

    length = 1.0

    def __init__(self, start: ArrayLike, end: ArrayLike) -> None:
        self.start = fixed_array(start, "start", (None,), POSE)
        self.end = fixed_array(end, "end", self.start.shape, POSE)
        if (self.start == self.end).all():
            raise InputError(f"start and end are the same pose, {tuple(self.start.tolist())}")

    def __repr__(self) -> str:
        return f"LineCurve({self.start.tolist()}, {self.end.tolist()})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...)."""
        along = checked_parameters(u, self.length)[..., None]
        pose = (1 - along) * self.start + along * self.end
        slope = np.broadcast_to(self.end - self.start, pose.shape)
        return CurveSample(pose, slope, np.zeros_like(pose))


@refuses_other_kinds
def point_to_point(
    start: ArrayLike,
    end: ArrayLike,
    *,
    profile: Profile = "quintic",
    duration: float | None = None,
    max_rate: ArrayLike = math.inf,
    max_acceleration: ArrayLike = math.inf,
    max_jerk: ArrayLike = math.inf,
) -> TimedCurve:
    """Return the straight motion between two poses, from rest to rest.

    Parameters
    ----------
    start, end
        (z, tilt_x, tilt_y), or a task's coordinates, shape (m,), m and rad.
    profile
        ``"quintic"``, ``"trapezoidal"`` (speed) or ``"s-curve"``; see `time_laws`.
    duration
        In s. If left out, the shortest within the limits below.
    max_rate, max_acceleration, max_jerk
        Of each coordinate (m/s or rad/s, ...): shape (m,), or one number for all. A trapezoidal
        profile needs the acceleration's and takes no jerk, an S-curve needs the jerk's.

    Raises
    ------
    InputError
        If a pose is not finite or of another shape, start and end are equal, a limit is not
        positive, or not exactly one of a duration and limits is given.
    """
    line = LineCurve(start, end)
    change = np.abs(line.end - line.start)
    law = time_law(
        line.length,
        profile,
        duration=duration,
        speed=_along(max_rate, change, "max_rate"),
        acceleration=_along(max_acceleration, change, "max_acceleration"),
        jerk=_along(max_jerk, change, "max_jerk"),
    )
    return TimedCurve(line, law)


def _along(limit: ArrayLike, change: Array, name: str) -> float:
    """Return the limit of u for limits of coordinates that change by `change` from 0 to 1."""
    count = "three" if change.size == 3 else str(change.size)
    given = numbers(limit, name, f"a number, or {count}")
    if given.shape not in ((), change.shape):
        raise InputError(f"{name} = {shown(limit)}: it must be a number, or {count}")
    limits = np.broadcast_to(given, change.shape)
    if not (limits > 0).all():
        raise InputError(f"{name} = {shown(limit)}: it must be positive")
    moving = change > 0
    with np.errstate(over="ignore"):  # a change so small that it cannot matter
        return float((limits[moving] / change[moving]).min())
