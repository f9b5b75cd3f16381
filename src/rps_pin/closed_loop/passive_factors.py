"""The passive joints' Jacobian J_p with redundant rows, factorised.

A mechanism with as many actuators as mobility has a J_p of full column rank; with redundant rows it
is taller than wide. Scaled to one unit and with its columns permuted, J_p = Q R. Then

- J_p' lambda = f_p has the solution of least norm lambda = Q R^-T f_p;
- J_p x_p = b has the least-squares solution x_p = R^-1 Q' b, and b lies in the range of J_p if the
  rest of Q' b vanishes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgeqp3, dormqr, dtrtrs

from rps_pin.closed_loop.inverse_dynamics import RANK_TOLERANCE

Array = NDArray[np.float64]


class PassiveFactors:
    """Q, R and the permutation of one J_p.

    Parameters
    ----------
    jacobian
        J_p, shape (nc, np), nc >= np > 0.
    rows, columns
        Its scaling to one unit, shapes (nc, 1) and (np,).
    """

    def __init__(self, jacobian: Array, rows: Array, columns: Array) -> None:
        self._rows, self._columns = rows[:, 0], columns
        self._size = columns.size
        packed, order, reflectors, _, _ = dgeqp3(rows * jacobian * columns)
        self._packed, self._reflectors = packed, reflectors
        self._order = order - 1
        self._work = 64 * max(packed.shape)
        pivots = np.abs(packed.diagonal())
        self._largest, smallest = float(pivots.max()), float(pivots.min())
        #: Estimate of the condition number from the pivots; the true one is rarely 10 times larger.
        self.condition = self._largest / smallest if smallest > 0 else np.inf

    def multipliers(self, force: Array) -> Array:
        """Return lambda (nc,) of least norm (in one unit) with J_p' lambda = f_p (np,)."""
        right = np.zeros((self._rows.size, 1))
        right[: self._size] = self._solve((self._columns * force)[self._order, None], transposed=1)
        turned: Array = self._turn(right, "N")[:, 0]
        return self._rows * turned

    def passive(self, right: Array) -> tuple[Array, float]:
        """Return x_p (np, k) with J_p x_p = b (nc, k) in the least-squares sense, and what is left.

        What is left is the largest entry of b outside the range of J_p, relative to J_p.
        """
        turned = self._turn(np.asfortranarray(self._rows[:, None] * right), "T")
        solved = np.empty((self._size, right.shape[1]))
        solved[self._order] = self._solve(turned[: self._size], transposed=0)
        left = float(np.abs(turned[self._size :]).max(initial=0.0)) / self._largest
        return self._columns[:, None] * solved, left

    def determines(self, actuated_columns: Array) -> bool:
        """Return whether J_a lies in the range of J_p: whether the actuators move independently."""
        _, left = self.passive(actuated_columns)
        return left <= RANK_TOLERANCE

    def _solve(self, right: Array, transposed: int) -> Array:
        solution, _ = dtrtrs(self._packed[: self._size], right, trans=transposed)
        solved: Array = solution
        return solved

    def _turn(self, right: Array, transposed: str) -> Array:
        turned, _, _ = dormqr("L", transposed, self._packed, self._reflectors, right, self._work)
        product: Array = turned
        return product
