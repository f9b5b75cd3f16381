"""What readings tell of parameters: the information that is left when the poses are unknown.

With residuals r = (read - predicted) / deviation, A = dr/dx of a pose and B = dr/dp, the poses'
best corrections leave N'B of each, where the columns of N span what A cannot change (N'A = 0,
N'N = 1). The information about p is the sum of B'N N'B.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import rank

#: Singular values below this part of the largest are none.
_NONE = 1e-9


class Identifiable(NamedTuple):
    """Which combinations of parameters readings determine."""

    rank: int
    """How many combinations."""
    seen: Array
    """Combinations that are seen, in one unit, orthonormal columns, shape (p, rank)."""
    unseen: Array
    """Combinations that are not, or that would open the loops, shape (p, p - rank)."""
    singular_values: Array
    """Of the residuals by the combinations that open no loop, falling; over a length, 1/m."""
    opening: int = 0
    """How many combinations open loops: the last of those that are not seen."""
    weak: int = 0
    """How many are seen, but by less than was asked for: the first of those that are not seen."""

    @property
    def condition(self) -> float:
        """The largest singular value over the least of a combination that is seen."""
        values = self.singular_values[: self.rank]
        return float(values[0] / values[-1]) if self.rank else 1.0

    def within(self, widest: float) -> Identifiable:
        """Return it with combinations whose deviation is larger, m, taken as not seen."""
        kept = int(np.count_nonzero(self.singular_values[: self.rank] * widest >= 1.0))
        unseen = np.hstack([self.seen[:, kept:], self.unseen])
        return self._replace(
            rank=kept, seen=self.seen[:, :kept], unseen=unseen, weak=self.rank - kept
        )


def reduced(by_pose: Array, by_parameters: Array) -> Array:
    """Return N'B of each pose, shape (poses, sensors, p), zero rows where A takes a row.

    Parameters
    ----------
    by_pose
        A, shape (poses, sensors, m); rows of what was not read are zero.
    by_parameters
        B, shape (poses, sensors, p).
    """
    u, s, _ = np.linalg.svd(by_pose, full_matrices=False)
    u = u * (s > _NONE * s.max(axis=1, keepdims=True))[:, None]
    # B less its part in the columns of A: N N'B, which has the same B'N N'B.
    return np.asarray(by_parameters - u @ (np.swapaxes(u, 1, 2) @ by_parameters))


def identifiable(rows: Array, opening: Array, tolerance: float = _NONE) -> Identifiable:
    """Return which combinations are determined.

    Parameters
    ----------
    rows
        Residuals by parameters, without what poses can take, shape (n, p).
    opening
        Gaps by parameters, without what joints can take, shape (k, p): combinations that open the
        loops stay as they are.
    tolerance
        Singular values below this part of the largest are none.
    """
    _, values, across = svd(opening)
    kept = across[rank(values, tolerance) :]
    _, values, within = svd(rows @ kept.T)
    count = rank(values, tolerance)
    seen = within[:count] @ kept
    unseen = np.vstack([within[count:] @ kept, across[: len(across) - len(kept)]])
    return Identifiable(count, seen.T, unseen.T, values, len(across) - len(kept))


def svd(rows: Array) -> tuple[Array, Array, Array]:
    """Return U, (n, p), the singular values and all right vectors as rows, V', of (n, p).

    By QR, then LAPACK's gesvd: for some matrices with many singular values near zero its gesdd,
    which NumPy calls, does not converge.
    """
    n, p = rows.shape
    q, R = np.linalg.qr(np.vstack([rows, np.zeros((max(p - n, 0), p))]))
    u, values, across = linalg.svd(R, lapack_driver="gesvd") if p else (R, np.zeros(0), R)
    return np.asarray(q[:n] @ u), np.asarray(values), np.asarray(across)
