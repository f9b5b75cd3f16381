"""Differences that are exact for polynomials up to the sixth degree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WEIGHTS = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60


def difference(f: Callable[[Array], Any], x: Array, step: float | Array) -> Array:
    """Central difference over x - 3 step to x + 3 step, f of shape (...) or (..., k)."""
    step = np.broadcast_to(step, x.shape)
    values = [np.asarray(f(x + k * step)) for k in range(-3, 4)]
    total = np.tensordot(_WEIGHTS, np.stack(values), 1)
    found: Array = total / step.reshape(step.shape + (1,) * (total.ndim - step.ndim))
    return found
