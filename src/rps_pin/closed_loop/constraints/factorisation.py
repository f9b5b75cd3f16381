"""Factorisation of the passive joints' Jacobian J_p, memory allocated once.

A mechanism with as many actuators as mobility has a J_p of full column rank. Where it is square, LU
serves. With redundant rows it is taller than wide and, scaled to one unit and its columns permuted,
J_p = Q R. Then

- J_p' lambda = f_p has the solution of least norm lambda = Q R^-T f_p;
- J_p x_p = b has the least-squares solution x_p = R^-1 Q' b, and b lies in the range of J_p if the
  rest of Q' b vanishes.

Near a singularity, and with more or fewer actuators than mobility, there is no such solution.

In a rounded file nearly redundant rows count as redundant (see `RankRule`): x_p = R^-1 Q' b meets
all rows in the least-squares sense. That is the motion of the truncated singular value
decomposition but for the square of what is left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import eigenpy
import numpy as np
from scipy.linalg.blas import dasum, dtrsm
from scipy.linalg.lapack import dgecon, dgeqp3, dgetrf, dgetrs, dormqr

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.least_squares import PassiveLeastSquares
from rps_pin.closed_loop.constraints.rank_rule import EXACT, RankRule
from rps_pin.numerics.linear_algebra import condition_number, rank

#: Size of a solution, relative to the right side, that no well conditioned J_p gives in one unit.
HUGE = 1e12


class Scales(NamedTuple):
    """Scaling of J_p to one unit, and the tolerance of its rank."""

    rows: Array
    """Shape (nc, 1)."""
    columns: Array
    """Shape (np,)."""
    tolerance: float


class PassiveFactorisation:
    """Solves J_p x_p = b and J_p' lambda = f_p of one mechanism, at one J after another.

    Parameters
    ----------
    passive, actuated
        Indices of the velocities, shapes (np,) and (na,).
    rows, columns
        Scaling of J to one unit, shapes (nc,) and (nv,).
    max_condition
        Of `ClosedLoopModel`.
    rule
        By which the rank of J is decided.
    """

    def __init__(
        self,
        passive: Indices,
        actuated: Indices,
        rows: Array,
        columns: Array,
        max_condition: float,
        rule: RankRule = EXACT,
    ) -> None:
        self.passive, self._actuated, self._max_condition = passive, actuated, max_condition
        #: Scaling of J_p to one unit, shapes (nc, 1) and (np,), and tolerance of its rank.
        self.scales = Scales(rows[:, None], columns[passive], rule.tolerance)
        self._rows = rows[:, None]
        # Largest entries on both sides are those of these scales.
        self._huge = self.huge_force = HUGE
        if passive.size and rows.size:
            self._huge *= float(columns[passive].max() * rows.min())
            #: `HUGE` of lambda by f, as that of x_p by b.
            self.huge_force *= float(columns.min() * rows.max())
        # eigenpy takes a vector of one number for a matrix: one row is not counted as square.
        self._rounded = rule.rank is not None
        self._tall = self._rounded or rows.size != passive.size
        self._square = not self._tall and passive.size > 1
        #: Whether J_p may have full rank, in a rounded file.
        self._determined = rule.rank is None or rule.rank == passive.size
        self._lu = eigenpy.PartialPivLU(passive.size)
        # Above this estimate of the reciprocal condition no closer look is needed. The estimate is
        # in the 1-norm, without scaling, and rarely off by more than a factor of 3 (Higham). The
        # norms differ by at most a factor of the size, the scaling by at most the ratios of its
        # factors; one of 100 is for the estimate.
        self._harmless_rcond, self._norm = 0.0, 0.0
        if not self._tall and passive.size:
            spread = math.exp(sum(float(np.ptp(np.log(scale))) for scale in self.scales[:2]))
            self._harmless_rcond = min(100 * passive.size * spread / max_condition, 1.0)

    @property
    def meets_all_rows(self) -> bool:
        """Whether J_p has as many columns as rows, and so full row rank where it is regular."""
        return not self._rounded and self._rows.size == self.passive.size

    def least_squares(self, passive: Indices, columns: Array) -> PassiveLeastSquares:
        """Return the solver for other passive velocities, columns (nv,) scaled to one unit."""
        return PassiveLeastSquares(passive, self._rows[:, 0], columns, self._max_condition)

    def factors(self, jacobian: Array) -> Factors | None:
        """Return factors of J_p for any number of solutions, or None near a singularity."""
        passive_jacobian = jacobian.take(self.passive, axis=1)
        if not self.passive.size:
            return _NoFactors(jacobian.shape[0])
        if self._tall:
            return self._tall_factors(jacobian, passive_jacobian)
        found = _SquareFactors(passive_jacobian)
        if not self._norm:  # that of J_p at any configuration is of this size
            self._norm = float(np.abs(passive_jacobian).sum(axis=0).max())
        return found if found.rcond(self._norm) > self._harmless_rcond else None

    def condition(self, passive_jacobian: Array, idle: int = 0) -> float:
        """Return the condition number of J_p, shape (nc, np), in one unit, idle freedoms left out.

        ``idle`` is how many these are.
        """
        rows, columns, tolerance = self.scales
        return condition_number(rows * passive_jacobian * columns, idle, tolerance)

    def multipliers(self, jacobian: Array, passive_jacobian: Array, force: Array) -> Array | None:
        """Return lambda (nc,), of least norm in one unit, with J_p' lambda = f_p.

        None near a singularity, and where the actuators are more or fewer than the mobility.

        Parameters
        ----------
        jacobian, passive_jacobian
            J (nc, nv), and its passive columns (nc, np).
        force
            f, shape (nv,).
        """
        if not self._square:
            factors = self._tall_factors(jacobian, passive_jacobian)
            return None if factors is None else factors.multipliers(force.take(self.passive))
        lu = self._lu
        lu.compute(passive_jacobian.T)
        multipliers: Array = lu.solve(force.take(self.passive))
        if not lu.rcond() > self._harmless_rcond and not (
            self.condition(passive_jacobian) <= self._max_condition
        ):
            return None
        return multipliers

    def passive_motion(self, jacobian: Array, right: Array) -> Array | None:
        """Return x_p (np, k) with J_p x_p = b (nc, k), or None as `multipliers`.

        Of a b that no x_p solves, the least-squares solution.
        """
        passive_jacobian = jacobian.take(self.passive, axis=1)
        if not self._square:
            factors = self._tall_factors(jacobian, passive_jacobian)
            return None if factors is None else factors.passive_motion(right)[0]
        self._lu.compute(passive_jacobian)
        solved: Array = self._lu.solve(right).reshape(right.shape)  # one column comes flat
        # The estimate does not see a pivot that is exactly zero, nor a matrix of rounding errors;
        # the solution does.
        well = self._lu.rcond() > self._harmless_rcond and (
            not right.size  # of no columns BLAS has no sum
            or dasum(solved.ravel("K")) <= self._huge * dasum(right.ravel("K"))
        )
        return solved if well else None

    def _tall_factors(self, jacobian: Array, passive_jacobian: Array) -> _TallFactors | None:
        """Return the factors of J_p where they determine the motion well."""
        rows, columns, tolerance = self.scales
        if not (rows.size >= columns.size > 0 and self._determined):
            return None
        factors = _TallFactors(passive_jacobian, rows, columns, tolerance)
        well = factors.condition < np.inf and (
            100 * factors.condition <= self._max_condition
            or self.condition(passive_jacobian) <= self._max_condition
        )
        # The actuators move independently if J_a lies in the range of J_p.
        if not well or factors.passive_motion(jacobian[:, self._actuated])[1] > tolerance:
            return None
        return factors


class Factors(Protocol):
    """Factors of a J_p, shape (nc, np)."""

    def solve(self, right: Array) -> Array:
        """Return x_p (np, k) with J_p x_p = b (nc, k), in the least-squares sense."""

    def multipliers(self, force: Array) -> Array:
        """Return lambda (nc,) of least norm (in one unit) with J_p' lambda = f_p (np,)."""


class _SquareFactors:
    """L, U and the permutation of a J_p, shape (np, np)."""

    __slots__ = ("_lu", "_pivots", "_zero")

    def __init__(self, jacobian: Array) -> None:
        self._lu, self._pivots, self._zero = dgetrf(jacobian)

    def rcond(self, norm: float) -> float:
        """Return an estimate of the reciprocal condition number, given the 1-norm of J_p."""
        return 0.0 if self._zero else float(dgecon(self._lu, norm)[0])

    def solve(self, right: Array) -> Array:
        solved: Array = dgetrs(self._lu, self._pivots, right)[0]
        return solved

    def multipliers(self, force: Array) -> Array:
        solved: Array = dgetrs(self._lu, self._pivots, force, trans=1)[0]
        return solved


class _NoFactors:
    """Of a J_p without columns."""

    __slots__ = ("_rows",)

    def __init__(self, rows: int) -> None:
        self._rows = rows

    def solve(self, right: Array) -> Array:
        return np.zeros((0, *right.shape[1:]))

    def multipliers(self, force: Array) -> Array:
        return np.zeros(self._rows)


class _TallFactors:
    """Q, R and the permutation of a J_p, shape (nc, np), nc >= np > 0; scaled to one unit."""

    def __init__(self, jacobian: Array, rows: Array, columns: Array, tolerance: float) -> None:
        self._rows, self._columns = rows[:, 0], columns
        self._size = columns.size
        packed, order, reflectors, _, _ = dgeqp3(rows * jacobian * columns)
        self._packed, self._reflectors = packed, reflectors
        self._order = order - 1
        self._work = 64 * max(packed.shape)
        pivots = np.abs(packed.diagonal())
        self._largest, smallest = float(pivots.max()), float(pivots.min())
        #: Estimate of the condition number by the pivots; the true one is rarely 10 times larger.
        self.condition = np.inf
        # Pivots stand for singular values.
        if rank(np.array([self._largest, smallest]), tolerance) == 2:
            self.condition = self._largest / smallest

    def multipliers(self, force: Array) -> Array:
        """Return lambda (nc,) of least norm (in one unit) with J_p' lambda = f_p (np,)."""
        right = np.zeros((self._rows.size, 1))
        right[: self._size] = self._solve((self._columns * force)[self._order, None], transposed=1)
        turned: Array = self._turn(right, "N")[:, 0]
        return self._rows * turned

    def solve(self, right: Array) -> Array:
        """Return x_p (np, k) with J_p x_p = b (nc, k) in the least-squares sense."""
        solved, _ = self.passive_motion(right.reshape(right.shape[0], -1))
        return solved.reshape(self._size, *right.shape[1:])

    def passive_motion(self, right: Array) -> tuple[Array, float]:
        """Return x_p (np, k) with J_p x_p = b (nc, k) in the least-squares sense, and the rest.

        The rest is the largest entry of b outside the range of J_p, relative to J_p.
        """
        turned = self._turn(np.asfortranarray(self._rows[:, None] * right), "T")
        solved = np.empty((self._size, right.shape[1]))
        solved[self._order] = self._solve(turned[: self._size], transposed=0)
        left = float(np.abs(turned[self._size :]).max(initial=0.0)) / self._largest
        return self._columns[:, None] * solved, left

    def _solve(self, right: Array, transposed: int) -> Array:
        return dtrsm(1.0, self._packed[: self._size], right, trans_a=transposed)

    def _turn(self, right: Array, transposed: str) -> Array:
        turned, _, _ = dormqr("L", transposed, self._packed, self._reflectors, right, self._work)
        product: Array = turned
        return product
