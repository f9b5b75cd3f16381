"""Which readings of a pose are wrong, told by the others.

The readings that are left out are those for which

    min over dx of |r - A dx|^2 of the others,  plus  L^2 for each that is left out,

is least, over all sets of at most `MOST` readings of a pose, and the set of all of them: a reading
is left out if that lowers the sum of squares by more than L^2. Of a pose in which it cannot be told
which readings are wrong, all are left out: more than the pose's coordinates must be left, or none.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.special import chdtri, ndtr

from rps_pin.arrays import Array, Bools

#: Residual, over its own deviation, beyond which a reading is an outlier.
LIMIT = 4.0
#: Of two sets of as many readings, the better one is told if its sum of squares is less by this.
MARGIN = 9.0
#: Chance that the readings of a pose that are right agree less than is asked for: that of a
#: residual of `LIMIT` deviations.
_SURE = 2 * ndtr(-LIMIT)
#: Readings of a pose that are left out at most.
MOST = 3


def outliers(r: Array, A: Array, known: Bools) -> Bools:
    """Return which readings are outliers, shape (poses, sensors).

    Parameters
    ----------
    r
        Residuals over their deviations, shape (poses, sensors).
    A
        Their slopes by the pose, shape (poses, sensors, m).
    known
        What was read, shape (poses, sensors).
    """
    found = np.zeros(r.shape, dtype=bool)
    every = [one for size in range(MOST + 1) for one in combinations(range(r.shape[1]), size)]
    sets = np.zeros((len(every), r.shape[1]), dtype=bool)
    for row, one in zip(sets, every, strict=True):
        row[list(one)] = True
    for i in np.flatnonzero(_squares(r, A, known[:, None])[:, 0] > LIMIT**2):
        out = np.vstack([sets[~(sets & ~known[i]).any(axis=1)], known[i]])
        kept = known[i] & ~out
        told = (kept.sum(axis=1) > A.shape[2]) | ~out.any(axis=1) | ~kept.any(axis=1)
        out, kept = out[told], kept[told]
        squares = _squares(r[i, None], A[i, None], kept[None])[0]
        redundant = np.maximum(kept.sum(axis=1) - A.shape[2], 0)
        agree = (squares <= chdtri(np.maximum(redundant, 1), _SURE)) | ~kept.any(axis=1)
        total = np.where(agree, squares + LIMIT**2 * out.sum(axis=1), np.inf)
        best = int(np.argmin(total))
        alike = (total < total[best] + MARGIN) & (out.sum(axis=1) == out[best].sum())
        found[i] = out[best] if alike.sum() == 1 else known[i]
    return found


def _squares(r: Array, A: Array, kept: Bools) -> Array:
    """Return least sums of squares of readings that are kept, shapes (n, s), (n, k, s): (n, k)."""
    B, b = A[:, None] * kept[..., None], r[:, None] * kept
    left = b - (B @ (np.linalg.pinv(B) @ b[..., None]))[..., 0]
    return np.asarray((left**2).sum(axis=-1))
