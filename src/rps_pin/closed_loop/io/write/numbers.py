"""Numbers as text that reads back as the same number, and rotations as angles and quaternions."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array

#: The largest number of a file: what stands for "no limit" where a limit must be given.
LARGEST = float(np.finfo(np.float64).max)


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


def finite(value: float) -> float:
    """Return a limit as a finite number."""
    return float(np.clip(value, -LARGEST, LARGEST))


def roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Return the angles of R = R_z(yaw) R_y(pitch) R_x(roll), exact to rounding at any R.

    Near a pitch of a quarter turn only the sum or difference of yaw and roll is determined; the yaw
    found there is used to find the others, so that its error does not matter.
    """
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    rest = pin.rpy.rpyToMatrix(0.0, 0.0, -yaw) @ rotation
    pitch = math.atan2(-rest[2, 0], rest[0, 0])
    roll = math.atan2(-rest[1, 2], rest[1, 1])
    return roll, pitch, yaw


def quaternion(rotation: Array) -> Array:
    """Return (w, x, y, z) of a rotation."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).coeffs()
    return np.array([w, x, y, z])
