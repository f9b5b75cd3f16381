"""The largest error of many, which is NaN if any of them is: ``max(0.0, nan)`` is 0.0."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike


def worst(*errors: ArrayLike) -> float:
    """Return the largest absolute value in numbers and arrays; NaN if one is NaN, or none is given.

    A comparison ``worst(...) < tolerance`` is false for NaN, so a test that computed nothing, or
    nonsense, fails.
    """
    entries = [np.abs(np.ravel(np.asarray(error))) for error in errors]
    together = np.concatenate(entries) if entries else np.zeros(0)
    return float(np.max(together)) if together.size else math.nan
