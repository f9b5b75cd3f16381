"""Where a control loop's answers go: arrays that the caller may own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError


class Answers(NamedTuple):
    """Arrays of floats that `RealTimeRobot` writes into; SI units."""

    pose: Array
    """(z, tilt_x, tilt_y), shape (3,)."""
    rate: Array
    """The pose's time derivative, shape (3,)."""
    twist: Array
    """Velocity of the platform's centre, then its angular velocity, base axes, shape (6,)."""
    angle: Array
    """Leg angles phi, shape (3,)."""
    speed: Array
    """Leg speeds, as given or filtered, shape (3,)."""
    forces: Array
    """Actuator forces of the last `RealTimeRobot.inverse_dynamics`, shape (3,)."""
    reactions: Array
    """Force of each leg on the platform in base axes, of the same call, shape (9,)."""

    @classmethod
    def new(cls) -> Answers:
        """Return arrays of zeros."""
        return cls(*(np.zeros(size) for size in _SIZES))

    def checked(self) -> Answers:
        """Return these arrays if a loop can write into them.

        Raises
        ------
        InputError
            If one is no writeable float64 array of its shape, or two share memory.
        """
        for name, array, size in zip(self._fields, self, _SIZES, strict=True):
            if not (isinstance(array, np.ndarray) and array.dtype == np.float64):
                raise InputError(f"answers.{name} must be a float64 array")
            if array.shape != (size,) or not array.flags.writeable:
                raise InputError(
                    f"answers.{name} has shape {array.shape}, writeable: {array.flags.writeable}; "
                    f"it must be ({size},) and writeable"
                )
        for place, array in enumerate(self):
            for name, other in list(zip(self._fields, self, strict=True))[place + 1 :]:
                if np.shares_memory(array, other):
                    raise InputError(
                        f"answers.{self._fields[place]} and answers.{name} share memory"
                    )
        return self


_SIZES = (3, 3, 6, 3, 3, 3, 9)
