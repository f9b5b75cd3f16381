"""The passive joints' Jacobian J_p, factorised.

A mechanism with as many actuators as mobility has a J_p of full column rank. Where it is square,
LU serves; with redundant rows it is taller than wide, and, scaled to one unit and its columns
permuted, J_p = Q R. Then

- J_p' lambda = f_p has the solution of least norm lambda = Q R^-T f_p;
- J_p x_p = b has the least-squares solution x_p = R^-1 Q' b, and b lies in the range of J_p if the
  rest of Q' b vanishes.
"""

from __future__ import annotations

import math

import eigenpy
import numpy as np
from scipy.linalg.blas import dasum, dtrsm
from scipy.linalg.lapack import dgeqp3, dormqr

from rps_pin.arrays import Array, Indices
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, condition_number, rank

#: What no well conditioned J_p, in one unit, makes of a right side of 1.
_HUGE = 1e12


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
        self.condition = np.inf
        if rank(np.array([self._largest, smallest])) == 2:  # the pivots stand for singular values
            self.condition = self._largest / smallest

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
        solved: Array = dtrsm(1.0, self._packed[: self._size], right, trans_a=transposed)
        return solved

    def _turn(self, right: Array, transposed: str) -> Array:
        turned, _, _ = dormqr("L", transposed, self._packed, self._reflectors, right, self._work)
        product: Array = turned
        return product


class PassiveSolver:
    """Solves J_p x_p = b of one mechanism, memory allocated once.

    Parameters
    ----------
    passive, actuated
        Indices of the velocities, shapes (np,) and (na,).
    rows, columns
        Scaling of J_p to one unit, shapes (nc, 1) and (np,).
    max_condition
        Of `ClosedLoopModel`.

    Attributes
    ----------
    square : bool
        Whether J_p is square. (eigenpy takes a vector of one number for a matrix: one row is not
        counted as square.)
    lu
        Space for the factors of a square J_p.
    harmless_rcond : float
        Its reciprocal condition estimate above which no closer look is needed.
    """

    def __init__(
        self,
        passive: Indices,
        actuated: Indices,
        rows: Array,
        columns: Array,
        max_condition: float,
    ) -> None:
        self._passive, self._actuated = passive, actuated
        self._scales, self._max_condition = (rows, columns), max_condition
        self.square = rows.size == passive.size > 1
        self.lu = eigenpy.PartialPivLU(passive.size)
        self.harmless_rcond = self._least_harmless_rcond()

    def solve(self, jacobian: Array, right: Array) -> Array | None:
        """Return x_p (np, k) with J_p x_p = b, if the actuators well determine the motion.

        None near a singularity, and where they are more or fewer than the mobility. Of a b that no
        x_p solves, the least-squares solution.
        """
        if self.square:
            self.lu.compute(jacobian.take(self._passive, axis=1))
            solved: Array = self.lu.solve(right).reshape(right.shape)  # one column comes flat
            # Of a pivot that is exactly zero, and of a matrix that is all rounding, the estimate
            # knows nothing: the solution does.
            size = dasum(solved.ravel("K"))
            well = self.lu.rcond() > self.harmless_rcond and size <= _HUGE * (
                1.0 + dasum(right.ravel("K"))
            )
            return solved if well else None
        factors = self.factors(jacobian)
        return None if factors is None else factors.passive(right)[0]

    def factors(self, jacobian: Array) -> PassiveFactors | None:
        """Return the factors of a J_p taller than wide, or None in the same cases."""
        rows, columns = self._scales
        if not rows.size >= columns.size > 0:
            return None
        passive = jacobian[:, self._passive]
        factors = PassiveFactors(passive, rows, columns)
        well = factors.condition < np.inf and (
            100 * factors.condition <= self._max_condition
            or condition_number(rows * passive * columns) <= self._max_condition
        )
        return factors if well and factors.determines(jacobian[:, self._actuated]) else None

    def _least_harmless_rcond(self) -> float:
        """Return the reciprocal condition estimate above which no closer look is needed.

        The estimate is in the 1-norm, without scaling, and rarely off by more than a factor of 3
        (Higham). The norms differ by at most a factor of the size, the scaling by at most the
        ratios of its factors; one of 100 is for the estimate.
        """
        if not self.square:
            return 0.0
        spread = sum(float(np.ptp(np.log(scale))) for scale in self._scales)
        return min(100 * self._passive.size * math.exp(spread) / self._max_condition, 1.0)
