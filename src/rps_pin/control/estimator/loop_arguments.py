"""Arguments of calls in a control loop, converted to floats without exceptions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.rps.kinematics.tracking import Triple

#: Three numbers; None where they are missing.
Numbers = ArrayLike | None


#: What has no order, or is text; and what Python would turn into a number nevertheless.
_NO_ROWS = (str, bytes, bytearray, set, frozenset, dict)
_NO_NUMBERS = (
    str,
    bytes,
    bytearray,
    bool,
    np.bool_,
    np.timedelta64,
    np.ndarray,
    type(np.ma.masked),
)


def three_floats(values: Numbers) -> Triple | None:
    """Return three finite floats, or None if the argument is anything else.

    What is a number is decided as in `rps_pin.validation`: text, truth values, times, complex
    numbers, objects and masked entries are none.
    """
    try:
        three: Any = values
        if isinstance(values, np.ndarray):
            three = values.tolist() if values.dtype.kind in "fiu" else None
        elif isinstance(values, _NO_ROWS):
            return None
        a, b, c = three
        if not type(a) is type(b) is type(c) is float:
            a, b, c = _number(a), _number(b), _number(c)
    except Exception:  # of whatever object
        return None
    return (a, b, c) if math.isfinite(a + b + c) else None


def elapsed_time(value: Any) -> float:
    """Return a time as a float, or NaN if the argument is anything else."""
    try:
        return value if type(value) is float else _number(value)
    except Exception:  # of whatever object
        return math.nan


def _number(value: Any) -> float:
    """Return a real number as a float; TypeError if it is none."""
    if isinstance(value, _NO_NUMBERS):
        raise TypeError
    return float(value)


def floats(values: Numbers, count: int) -> Array | None:
    """Return finite numbers, shape (count,), by the rules of `three_floats`; None otherwise."""
    try:
        rows: Any = values
        if isinstance(values, np.ndarray):
            rows = values.tolist() if values.dtype.kind in "fiu" else None
        elif isinstance(values, _NO_ROWS):
            return None
        found = [one if type(one) is float else _number(one) for one in rows]
    except Exception:  # of whatever object
        return None
    if len(found) != count or not all(map(math.isfinite, found)):
        return None
    return np.array(found)
