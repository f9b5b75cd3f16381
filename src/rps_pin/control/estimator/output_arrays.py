"""Output arrays of a state estimate, which the caller may own."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError


class Answers(NamedTuple):
    """Float arrays that `RealTimeRobot` writes its results to; SI units."""

    pose: Array
    """(z, tilt_x, tilt_y), shape (3,)."""
    rate: Array
    """Time derivative of the pose, shape (3,)."""
    twist: Array
    """Velocity of the platform's centre, then its angular velocity, base axes, shape (6,)."""
    angle: Array
    """Leg angles phi, shape (3,)."""
    speed: Array
    """Leg speeds, measured or filtered, shape (3,)."""
    forces: Array
    """Actuator forces of the last inverse dynamics, shape (3,)."""
    reactions: Array
    """Force of each leg on the platform in base axes, of the same call, shape (9,)."""

    @classmethod
    def new(cls) -> Answers:
        """Return arrays of zeros."""
        return cls(*(np.zeros(size) for size in _SIZES))

    def checked(self) -> Answers:
        """Return these arrays if a loop can write to them.

        Raises
        ------
        InputError
            If one is not a writeable float64 array of its shape, or two share memory.
        """
        named = self._asdict()
        for (name, array), size in zip(named.items(), _SIZES, strict=True):
            if not (isinstance(array, np.ndarray) and array.dtype == np.float64):
                raise InputError(f"answers.{name} must be a float64 array")
            if array.shape != (size,) or not array.flags.writeable:
                raise InputError(
                    f"answers.{name} has shape {array.shape}, writeable: {array.flags.writeable}; "
                    f"it must be ({size},) and writeable"
                )
        for (name, array), (other, second) in combinations(named.items(), 2):
            if np.shares_memory(array, second):
                raise InputError(f"answers.{name} and answers.{other} share memory")
        return self


_SIZES = (3, 3, 6, 3, 3, 3, 9)
