"""Arguments of calls in a control loop, converted to floats without exceptions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.rps.kinematics.tracking import Triple

#: Three numbers; None where they are missing.
Numbers = ArrayLike | None


def three_floats(values: Numbers) -> Triple | None:
    """Return three finite floats, or None if the argument is anything else."""
    try:
        three: Any = values.tolist() if isinstance(values, np.ndarray) else values
        a, b, c = three
        if not type(a) is type(b) is type(c) is float:
            a, b, c = float(a), float(b), float(c)
    except (TypeError, ValueError, OverflowError):
        return None
    return (a, b, c) if math.isfinite(a + b + c) else None


def elapsed_time(value: Any) -> float:
    """Return a time as a float, or NaN if the argument is anything else."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
