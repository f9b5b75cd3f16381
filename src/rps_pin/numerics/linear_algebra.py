"""Linear algebra with one rule of rank: null space, pseudo-inverse, least norm, condition number.

**The rule of rank.** Of a matrix whose entries have one unit, so that a row or column that says
anything has entries of the order of 1, a singular value counts if

    s_i > tolerance * max(s_0, 1),

s_0 the largest. Where all singular values are far below 1 the whole matrix is rounding error and
its rank is 0: such are the rows of a closure that keeps a planar mechanism in its plane. A matrix
of another size (weighted, for example) is compared with `size` instead of 1. Every rank, null
space and pseudo-inverse in the package is determined by `rank`. The tolerance is that of rounding
errors, or of the file where a mechanism's numbers are rounded (see `RankRule`).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.lapack import dgesdd

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError

#: A singular value below this, relative to the largest (or to 1 if that is less), counts as zero.
RANK_TOLERANCE = 1e-10
#: Least square of the least singular value, of the largest, for which the eigenvalues of A'A give
#: it to 1e-12: eps / 1e-3, times a factor of the size.
_WELL_CONDITIONED = 1e-3


def rank(values: Array, tolerance: float = RANK_TOLERANCE, size: float = 1.0) -> int:
    """Return the rank of a matrix by its singular values; see the module's text.

    Parameters
    ----------
    values
        Singular values, largest first.
    tolerance
        What counts as zero, relative to the largest or to `size`.
    size
        Largest singular value of a matrix of this kind that is not rounding error.
    """
    if not values.size:
        return 0
    least = tolerance * max(float(values[0]), size)
    return values.size if values[-1] > least else int(np.count_nonzero(values > least))


def singular_values(matrix: Array) -> Array:
    """Return the singular values, largest first."""
    return np.asarray(np.linalg.svd(matrix, compute_uv=False), np.float64)


def many_singular_values(matrices: Array) -> Array:
    """Return the singular values of matrices (n, rows, columns), rows >= columns, largest first.

    The roots of the eigenvalues of A'A, in half the time of the SVD, where their rounding error,
    some eps s_1^2 each, is at most 1e-12 of the least; else by the SVD.
    """
    squares = np.linalg.eigvalsh(np.swapaxes(matrices, -1, -2) @ matrices)[:, ::-1]
    found = np.sqrt(np.maximum(squares, 0.0))
    poor = np.flatnonzero(~(squares[:, -1] >= _WELL_CONDITIONED * squares[:, 0]))
    if poor.size:
        found[poor] = np.linalg.svd(matrices[poor], compute_uv=False)
    return np.asarray(found, np.float64)


def full_svd(matrix: Array) -> tuple[Array, Array, Array]:
    """Return U, the singular values and V' of a matrix, U and V square; finite entries only.

    LAPACK's own routine: NumPy's wrapper costs several times as much on matrices of this size.
    """
    rows, columns = matrix.shape
    if not (rows and columns):
        return np.eye(rows), np.zeros(0), np.eye(columns)
    left, values, right, info = dgesdd(matrix)
    if info:
        raise np.linalg.LinAlgError(f"LAPACK's dgesdd did not converge (info = {info})")
    return left, values, right


class Decomposition:
    """Singular values of a matrix A of finite entries, its rank, and solutions of least norm.

    Parameters
    ----------
    matrix
        A.
    tolerance
        As for `rank`.

    Attributes
    ----------
    left, values, right : arrays
        U, the singular values and V', as `full_svd` returns them.
    rank : int
    """

    def __init__(self, matrix: Array, tolerance: float = RANK_TOLERANCE) -> None:
        self.left, self.values, self.right = full_svd(matrix)
        self.rank = rank(self.values, tolerance)

    def null_space(self) -> Array:
        """Return an orthonormal basis N of all x with A x = 0, shape (n, n - rank)."""
        return self.right[self.rank :].T

    def least_norm(self, right: Array) -> Array:
        """Return the least-squares solution x of A x = b of least norm, shape (n,) or (n, k)."""
        along = (right.T @ self.left[:, : self.rank]) / self.values[: self.rank]
        return np.asarray((along @ self.right[: self.rank]).T)

    def transposed_least_norm(self, right: Array) -> Array:
        """Return the same of A' x = b."""
        along = (right.T @ self.right[: self.rank].T) / self.values[: self.rank]
        return np.asarray((along @ self.left[:, : self.rank].T).T)


def solve_transposed(matrix: Array, right: Array, limit: float, reason: str) -> Array:
    """Return x with A' x = b of a square A whose singular values are at most 1.

    A smallest one below 1 / limit raises `SingularityError` for a reason.
    """
    smallest = float(singular_values(matrix).min(initial=1.0))
    refuse_condition(1 / smallest if smallest > 0 else math.inf, limit, reason)
    return np.asarray(np.linalg.solve(matrix.T, right), np.float64)


def null_space(matrix: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return an orthonormal basis N of all x with A x = 0, shape (n, n - rank)."""
    _, values, right = np.linalg.svd(matrix)
    return right[rank(values, tolerance) :].T


def condition_number(matrix: Array, lost: int = 0, tolerance: float = RANK_TOLERANCE) -> float:
    """Return the largest singular value over the smallest of a matrix that must not lose a column.

    ``inf`` where A x = 0 for some x other than 0: fewer rows than columns, a singular value of
    zero, or nothing but rounding error. With a tolerance above that of rounding errors also where
    the rank is lower. 1 without columns.

    Parameters
    ----------
    matrix
        A.
    lost
        So many independent x with A x = 0 are left out.
    tolerance
        As for `rank`.
    """
    rows, columns = matrix.shape
    needed = columns - lost
    if needed <= 0:
        return 1.0
    if rows < needed:
        return math.inf
    values = singular_values(matrix)
    found = rank(values, tolerance)
    if found == 0 or not values[needed - 1] > 0 or (tolerance > RANK_TOLERANCE and found < needed):
        return math.inf
    return float(values[0] / values[needed - 1])


def refuse_condition(condition: float, limit: float, reason: str) -> None:
    """Raise `SingularityError`, for a reason, if a condition number exceeds its limit or is NaN."""
    if not condition <= limit:
        raise SingularityError(
            f"{reason}: the condition number is {condition:.3g}, and at most {limit:.3g} is "
            "accepted",
            condition,
            limit,
        )
