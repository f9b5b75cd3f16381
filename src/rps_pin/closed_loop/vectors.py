"""Vectors as they come from a caller, checked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dasum

from rps_pin.arrays import Array
from rps_pin.errors import InputError


def checked_vector(value: ArrayLike, size: int, name: str) -> Array:
    """Return a value as a finite float array of shape (size,).

    Raises
    ------
    InputError
        If it is not; says how.
    """
    if (  # the fast way, for control loops
        isinstance(value, np.ndarray)
        and value.dtype == np.float64
        and value.shape == (size,)
        and math.isfinite(dasum(value))
    ):
        return value
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be {size} numbers") from None
    if array.shape != (size,):
        raise InputError(f"{name} has shape {array.shape}; it must be ({size},)")
    if not np.isfinite(array).all():
        where = int(np.argmin(np.isfinite(array)))
        raise InputError(f"{name} is not finite: entry {where} is {array[where]}")
    return array
