"""Closing the loops of a mechanism: from a rough guess to a configuration without gaps.

The gaps e(q) are brought to zero by the Levenberg-Marquardt method on the configuration manifold,

    dq = - J' (J J' + mu I)^-1 e,

in coordinates scaled to one unit. Every step is the smallest that does its work; mu falls to zero
as the loops close, so that the last steps are Newton's and the answer is closed to rounding.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e8
_SMALLEST_STEP = 1e-15


def close_gaps(
    guess: Array,
    gaps: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    integrate: Callable[[Array, Array], Array],
    tolerance: float,
    iterations: int = 200,
) -> Array:
    """Return the configuration that Levenberg-Marquardt steps from a guess end in.

    Parameters
    ----------
    guess
        Configuration to start from, shape (nq,).
    gaps
        e(q), shape (nc,), in one unit.
    jacobian
        de/dv at q, shape (nc, nv), scaled like `integrate`'s steps.
    integrate
        (q, step) to configuration; the step in scaled coordinates, shape (nv,).
    tolerance
        The steps end once they no longer reduce a gap norm below this.
    iterations
        At most so many steps.

    Returns
    -------
    array
        The best configuration met, shape (nq,). Whether its loops are closed is for the caller to
        judge.
    """
    q, error, damping = guess, gaps(guess), _FIRST_DAMPING
    for _ in range(iterations):
        left, values, right = np.linalg.svd(jacobian(q), full_matrices=False)
        along = left.T @ error
        size = float(np.linalg.norm(error))
        while True:
            step = -right.T @ (_filter(values, damping * size) * along)
            candidate = integrate(q, step)
            candidate_error = gaps(candidate)
            if np.linalg.norm(candidate_error) < size:
                break
            if size <= tolerance or np.linalg.norm(step) < _SMALLEST_STEP:
                return q
            damping = 10 * max(damping, 1e-6)
            if damping > _LARGEST_DAMPING:
                return q
        q, error, damping = candidate, candidate_error, damping / 10
        if not error.any():
            return q
    return q


def _filter(values: Array, damping: float) -> Array:
    """Return s / (s^2 + mu^2) of singular values s, and 0 where s is rounding error."""
    floor = values[0] * 1e-12 if values.size else 0.0
    safe = np.maximum(values, floor)
    return np.where(values > floor, safe / (safe**2 + damping**2), 0.0)
