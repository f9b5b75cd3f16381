"""From one pose to another, straight in pose space: x(u) = start + u (end - start), u in [0, 1]."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import checked_parameters
from rps_pin.trajectories.poses import checked_pose
from rps_pin.trajectories.time_laws import Profile, time_law


class LineCurve:
    """The straight line between two poses, u from 0 to 1.

    Attributes
    ----------
    start, end : (3,) arrays
        (z, tilt_x, tilt_y), m and rad; read-only.
    """

    length = 1.0

    def __init__(self, start: ArrayLike, end: ArrayLike) -> None:
        self.start = checked_pose(start, "start")
        self.end = checked_pose(end, "end")
        if (self.start == self.end).all():
            raise InputError(f"start and end are the same pose, {tuple(self.start.tolist())}")

    def __repr__(self) -> str:
        return f"LineCurve({self.start.tolist()}, {self.end.tolist()})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...)."""
        along = checked_parameters(u, self.length)[..., None]
        way = self.end - self.start
        pose = (1 - along) * self.start + along * self.end
        return CurveSample(pose, np.broadcast_to(way, pose.shape), np.zeros_like(pose))


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
        (z, tilt_x, tilt_y), shape (3,), m and rad.
    profile
        ``"quintic"``, ``"trapezoidal"`` (speed) or ``"s-curve"``; see `time_laws`.
    duration
        In s. Without it, the shortest that keeps the limits below is found.
    max_rate, max_acceleration, max_jerk
        Of z (m/s, ...) and of the tilts (rad/s, ...): shape (3,), or one number for all. A
        trapezoidal profile needs the acceleration's and knows no jerk, an S-curve needs the jerk's.

    Raises
    ------
    InputError
        If a pose is not finite or of another shape, start and end are equal, a limit is not
        positive, or it is unclear how long the motion shall take.
    """
    line = LineCurve(start, end)
    way = np.abs(line.end - line.start)
    law = time_law(
        line.length,
        profile,
        duration=duration,
        speed=_along(max_rate, way, "max_rate"),
        acceleration=_along(max_acceleration, way, "max_acceleration"),
        jerk=_along(max_jerk, way, "max_jerk"),
    )
    return TimedCurve(line, law)


def _along(limit: ArrayLike, way: Array, name: str) -> float:
    """Return the limit on u of limits on coordinates that change by `way` in all."""
    try:
        given = np.asarray(limit)
    except ValueError:  # ragged
        given = np.asarray("ragged")
    if given.dtype.kind not in "iuf" or given.shape not in ((), (3,)):
        raise InputError(f"{name} = {shown(limit)}: it must be a number, or three")
    limits = np.broadcast_to(given.astype(np.float64), (3,))
    if not (limits > 0).all():
        raise InputError(f"{name} = {shown(limit)}: it must be positive")
    moving = way > 0
    with np.errstate(over="ignore"):  # of a way so short that it cannot matter
        return float((limits[moving] / way[moving]).min())
