"""Numbers as text that reads back as the same number, and rotations as quaternions."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array


def number(value: float) -> str:
    """Return the shortest text that reads back as the same float, at most 17 digits.

    Whole numbers are written without a point; those with an exponent have one in the mantissa,
    which older YAML readers want.
    """
    value = float(value)
    if value == 0:
        return "0"
    if value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    text = repr(value)
    mantissa, exponent, power = text.partition("e")
    if exponent and "." not in mantissa:
        mantissa += ".0"
    return mantissa + exponent + power


def numbers(values: Iterable[float]) -> str:
    """Return numbers with spaces between."""
    return " ".join(number(value) for value in values)


def quaternion(rotation: Array) -> Array:
    """Return (w, x, y, z) of a rotation."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).coeffs()
    return np.array([w, x, y, z])
