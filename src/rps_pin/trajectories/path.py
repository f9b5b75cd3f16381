"""What every trajectory offers."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError


class PathSample(NamedTuple):
    """A trajectory at given times; poses are ``(z, tilt_x, tilt_y)`` in m and rad."""

    pose: Array
    """Shape (..., 3)."""
    rate: Array
    """First time derivative, shape (..., 3)."""
    acceleration: Array
    """Second time derivative, shape (..., 3)."""


class Trajectory(Protocol):
    """A motion of the platform from time 0 to `duration`."""

    @property
    def duration(self) -> float:
        """Length in time, s."""
        ...

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times of shape (...), s."""
        ...


def checked_times(t: ArrayLike, duration: float) -> Array:
    """Return times as a float array.

    Raises
    ------
    InputError
        If a time is no finite number, or outside [0, duration] by more than rounding.
    """
    times = _numbers(t, "times must be numbers, in seconds")
    outside = _outside(times, duration)
    if outside is not None:
        raise InputError(
            f"time {outside:.9g} s is outside the trajectory, which runs from 0 to {duration:.9g} s"
        )
    return times.clip(0.0, duration)


def checked_parameters(u: ArrayLike, length: float) -> Array:
    """Return parameters of a curve as a float array.

    Raises
    ------
    InputError
        If one is no finite number, or outside [0, length] by more than rounding.
    """
    parameters = _numbers(u, "parameters of a curve must be numbers")
    outside = _outside(parameters, length)
    if outside is not None:
        raise InputError(
            f"u = {outside:.9g} is outside the curve, which runs from 0 to {length:.9g}"
        )
    return parameters.clip(0.0, length)


def _numbers(values: ArrayLike, wanted: str) -> Array:
    try:
        given = np.asarray(values)
    except ValueError:  # ragged
        raise InputError(wanted) from None
    if given.dtype.kind not in "iuf":
        raise InputError(wanted)
    return given.astype(np.float64)


def _outside(values: Array, end: float) -> float | None:
    """Return the first value outside [0, end] by more than rounding, if there is one."""
    slack = 1e-12 * end
    outside = ~((values >= -slack) & (values <= end + slack))
    return float(values[outside].flat[0]) if outside.any() else None
