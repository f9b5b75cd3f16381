"""Trajectories: the protocol, samples of one, and the checks of times, parameters and poses.

A pose has m coordinates: ``(z, tilt_x, tilt_y)`` of the 3-RPS, or those of a task, m or rad each.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import fixed_array, numbers

POSE = "coordinates, as z, tilt_x, tilt_y"


class PathSample(NamedTuple):
    """A trajectory at given times; poses of m coordinates, m and rad."""

    pose: Array
    """Shape (..., m)."""
    rate: Array
    """First time derivative, shape (..., m)."""
    acceleration: Array
    """Second time derivative, shape (..., m)."""


class Trajectory(Protocol):
    """A motion of the platform, or of a task's coordinates, from time 0 to `duration`."""

    @property
    def duration(self) -> float:
        """Length in time, s."""
        ...

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times of shape (...), s."""
        ...


#: A rate below this share of the trajectory's largest one is zero.
_AT_REST = 1e-9


@refuses_other_kinds
def end_states(trajectory: Trajectory) -> tuple[str, str]:
    """Return how a trajectory starts and how it ends, for reports.

    ``"at rest"``, or ``"moving"``. A `SampledPath` also says where its rates come from: it has the
    two as its attributes `starts` and `ends`.
    """
    known = getattr(trajectory, "starts", None), getattr(trajectory, "ends", None)
    times = np.linspace(0.0, trajectory.duration, 65)
    speeds = np.linalg.norm(trajectory.sample(times).rate, axis=-1)
    resting = speeds <= _AT_REST * speeds.max()
    starts, ends = (
        str(given) if given else "at rest" if still else "moving"
        for given, still in zip(known, resting[[0, -1]], strict=True)
    )
    return starts, ends


def checked_times(t: ArrayLike, duration: float) -> Array:
    """Return times as a float array.

    Raises
    ------
    InputError
        If a time is not a finite number, or outside [0, duration] by more than rounding.
    """
    message = "time {:.9g} s is outside the trajectory, which runs from 0 to {:.9g} s"
    return _within(numbers(t, "times", "numbers, in seconds"), duration, message)


def checked_parameters(u: ArrayLike, length: float) -> Array:
    """Return parameters of a curve as a float array.

    Raises
    ------
    InputError
        If one is not a finite number, or outside [0, length] by more than rounding.
    """
    message = "u = {:.9g} is outside the curve, which runs from 0 to {:.9g}"
    return _within(numbers(u, "parameters of a curve", "numbers"), length, message)


def _within(values: Array, end: float, message: str) -> Array:
    slack = 1e-12 * end
    outside = ~((values >= -slack) & (values <= end + slack))
    if outside.any():
        raise InputError(message.format(values[outside].flat[0], end))
    return values.clip(0.0, end)


def checked_poses(value: ArrayLike, name: str) -> Array:
    """Return two or more poses, shape (n, m), m and rad, read-only."""
    poses = fixed_array(value, name, (None, None), POSE)
    if not poses.shape[1]:
        raise InputError(f"{name} has shape {poses.shape}; poses have a coordinate or more")
    if len(poses) < 2:
        raise InputError(f"{name} has shape {poses.shape}; two poses or more are needed")
    return poses


def times_from_zero(value: ArrayLike, count: int) -> Array:
    """Return increasing times of `count` poses, shifted to begin at 0, shape (count,), s."""
    given = fixed_array(value, "times", (None,))
    if given.shape != (count,):
        raise InputError(f"{len(given)} times for {count} poses: one each is needed")
    times: Array = given - given[0]
    rising = np.diff(times) > 0
    if not rising.all():
        i = int(np.argmin(rising))
        raise InputError(f"times must increase: {given[i]:.9g} s, then {given[i + 1]:.9g} s")
    times.setflags(write=False)
    return times


def length_scale(scale: ArrayLike | None, size: int, tilt_scale: float) -> Array:
    """Return what a unit of each coordinate counts for as a length, shape (size,).

    Parameters
    ----------
    scale
        Positive, shape (size,), m/rad for angles and 1 for lengths. Left out: 1 for each; but three
        coordinates are (z, tilt_x, tilt_y), whose tilts count for `tilt_scale`.
    tilt_scale
        m/rad.
    """
    if scale is None:
        return np.array([1.0, tilt_scale, tilt_scale]) if size == 3 else np.ones(size)
    found = fixed_array(scale, "scale", (size,), "a length for a unit of each coordinate")
    if not (found > 0).all():
        raise InputError(f"scale = {shown(scale)}: it must be positive")
    return found
