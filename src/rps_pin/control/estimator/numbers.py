"""What a loop is given, made plain floats without ever raising."""

from __future__ import annotations

import math
from math import isfinite as _isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.rps.kinematics.tracking import Triple

#: Three numbers; None where there are none.
Numbers = ArrayLike | None


def three_floats(values: Numbers) -> Triple | None:
    """Return three finite floats, or None if these are not."""
    try:
        three: Any = values.tolist() if isinstance(values, np.ndarray) else values
        a, b, c = three
        if not type(a) is type(b) is type(c) is float:
            a, b, c = float(a), float(b), float(c)
    except (TypeError, ValueError, OverflowError):
        return None
    return (a, b, c) if _isfinite(a + b + c) else None


def elapsed_time(value: Any) -> float:
    """Return a time as a float; NaN if it is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
