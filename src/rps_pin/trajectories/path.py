"""What every trajectory offers."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.errors import InputError

Array = NDArray[np.float64]


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
    try:
        times = np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("times must be numbers, in seconds") from None
    slack = 1e-12 * max(duration, 1.0)
    outside = ~((times >= -slack) & (times <= duration + slack))
    if outside.any():
        raise InputError(
            f"time {times[outside].flat[0]:.9g} s is outside the trajectory, "
            f"which runs from 0 to {duration:.9g} s"
        )
    return times.clip(0.0, duration)
