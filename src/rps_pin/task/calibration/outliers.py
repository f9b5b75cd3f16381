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
#: Eigenvalues of a part of a projection below this part of the largest are none.
_NONE = 1e-9


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
    rest, projection = _projected(r, A, known)
    for i in np.flatnonzero((rest**2).sum(axis=1) > LIMIT**2):
        out = np.vstack([sets[~(sets & ~known[i]).any(axis=1)], known[i]])
        kept = known[i] & ~out
        told = (kept.sum(axis=1) > A.shape[2]) | ~out.any(axis=1) | ~kept.any(axis=1)
        out, kept = out[told], kept[told]
        squares = _squares(rest[i], projection[i], out)
        redundant = np.maximum(kept.sum(axis=1) - A.shape[2], 0)
        agree = (squares <= chdtri(np.maximum(redundant, 1), _SURE)) | ~kept.any(axis=1)
        total = np.where(agree, squares + LIMIT**2 * out.sum(axis=1), np.inf)
        best = int(np.argmin(total))
        alike = (total < total[best] + MARGIN) & (out.sum(axis=1) == out[best].sum())
        found[i] = out[best] if alike.sum() == 1 else known[i]
    return found


def _projected(r: Array, A: Array, known: Bools) -> tuple[Array, Array]:
    """Return P r, (n, s), and P = 1 - A A^+ of the readings that are known, (n, s, s)."""
    A = A * known[..., None]
    P = np.eye(r.shape[1]) - A @ np.linalg.pinv(A)
    return (P @ (r * known)[..., None])[..., 0], P


def _squares(rest: Array, P: Array, out: Bools) -> Array:
    """Return a pose's least sum of squares without some readings, of each set, (k, s): (k,).

    Leaving readings S out is correcting them freely: |P r|^2 falls by (P r)_S' (P_SS)^+ (P r)_S.
    """
    squares = np.full(len(out), float(rest @ rest))
    for size in np.unique(out.sum(axis=1)):
        sets = np.flatnonzero(out.sum(axis=1) == size)
        at = np.nonzero(out[sets])[1].reshape(len(sets), size)
        part, block = rest[at], P[at[:, :, None], at[:, None, :]]
        gain = np.linalg.pinv(block, rcond=_NONE, hermitian=True) @ part[..., None]
        squares[sets] -= (part * gain[..., 0]).sum(axis=1)
    return np.asarray(np.maximum(squares, 0.0))
