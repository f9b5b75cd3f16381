"""Closing the loops of a mechanism: from a rough guess to a configuration without gaps.

The gaps e(q) are brought to zero by the Levenberg-Marquardt method on the configuration manifold,

    dq = - J' (J J' + mu I)^-1 e,

in coordinates scaled to one unit. Every step is the smallest that does its work; mu falls to zero
as the loops close, so that the last steps are Newton's and the answer is closed to rounding. Joints
that a step would drive through a limit are held there, and the step is found anew without them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from rps_pin.arrays import Array, Bools

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e8
_SMALLEST_STEP = 1e-15


class Box(Protocol):
    """Limits that the configuration stays within; see `limits.JointLimits`."""

    def clip(self, q: Array) -> Array:
        """Return q brought within the limits."""

    def blocked(self, q: Array, step: Array) -> Bools:
        """Return which entries of a step would leave the limits at once."""


def close_gaps(
    guess: Array,
    gaps: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    integrate: Callable[[Array, Array], Array],
    tolerance: float,
    iterations: int = 200,
    *,
    held: Bools | None = None,
    box: Box | None = None,
) -> Array:
    """Return the configuration that Levenberg-Marquardt steps from a guess end in.

    Parameters
    ----------
    guess
        Configuration to start from, shape (nq,); within the box.
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
    held
        Velocities that stay zero, shape (nv,); none if left out.
    box
        Limits to stay within; none if left out.

    Returns
    -------
    array
        The best configuration met, shape (nq,). Whether its loops are closed is for the caller to
        judge.
    """
    q, error, damping = guess, gaps(guess), _FIRST_DAMPING
    for _ in range(iterations):
        size = float(np.linalg.norm(error))
        step_for = _Steps(jacobian(q), error, q, held, box)
        while True:
            step = step_for(damping * size)
            candidate = integrate(q, step)
            candidate = candidate if box is None else box.clip(candidate)
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


class _Steps:
    """The steps from one configuration, of any damping."""

    def __init__(
        self,
        jacobian: Array,
        error: Array,
        q: Array,
        held: Bools | None,
        box: Box | None,
    ) -> None:
        self._jacobian, self._error, self._q, self._box = jacobian, error, q, box
        self._held = np.zeros(jacobian.shape[1], dtype=bool) if held is None else held.copy()
        self._factorise()

    def __call__(self, damping: float) -> Array:
        step = self._free_step(damping)
        while self._box is not None:
            blocked = self._box.blocked(self._q, step) & ~self._held
            if not blocked.any():
                break
            self._held |= blocked
            self._factorise()
            step = self._free_step(damping)
        return step

    def _factorise(self) -> None:
        left, self._values, self._right = np.linalg.svd(
            np.where(self._held, 0.0, self._jacobian), full_matrices=False
        )
        self._along = left.T @ self._error

    def _free_step(self, damping: float) -> Array:
        step: Array = -self._right.T @ (_filter(self._values, damping) * self._along)
        step[self._held] = 0.0
        return step


def _filter(values: Array, damping: float) -> Array:
    """Return s / (s^2 + mu^2) of singular values s, and 0 where s is rounding error."""
    floor = values[0] * 1e-12 if values.size else 0.0
    safe = np.maximum(values, floor)
    return np.where(values > floor, safe / (safe**2 + damping**2), 0.0)
