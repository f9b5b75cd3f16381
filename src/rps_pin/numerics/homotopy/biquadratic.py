"""All solutions of three equations between three unknowns in pairs, by homotopy.

Each unknown is w = p / q, in the projective line, and an equation between two of them is of degree
two in each:

    m_i' M m_j = 0,   m = (p q, p^2, q^2).

Of the three equations, of unknowns 1 and 2, 2 and 3, 3 and 1, there are 16 isolated solutions at
most: the Bezout number of three groups of variables (Morgan and Sommese, 1987). As many start from
products of linear forms in p and q.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from rps_pin.arrays import Array, ComplexArray
from rps_pin.numerics.homotopy.tracking import Ends, tracked

PATHS = 16
_PAIRS = ((0, 1), (1, 2), (2, 0))


class _Biquadratic:
    """The homotopy between two systems, in charts c . (p, q) = 1."""

    def __init__(self, start: ComplexArray, end: ComplexArray, charts: ComplexArray) -> None:
        self._start, self._change, self._charts = start, end - start, charts

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Homotopy`."""
        k = len(x)
        unknowns = x.reshape(k, 3, 2)
        p, q = unknowns[..., 0], unknowns[..., 1]
        m = np.stack([p * q, p * p, q * q], axis=-1)
        by_p = np.stack([q, 2 * p, 0 * p], axis=-1)
        by_q = np.stack([p, 0 * p, 2 * q], axis=-1)
        forms = self._start + s[:, None, None, None] * self._change
        values, by_s = np.zeros((2, k, 6), dtype=np.complex128)
        slopes = np.zeros((k, 6, 6), dtype=np.complex128)
        for row, (i, j) in enumerate(_PAIRS):
            right = (forms[:, row] @ m[:, j, :, None])[..., 0]
            left = (m[:, i, None] @ forms[:, row])[:, 0]
            values[:, row] = (m[:, i] * right).sum(axis=1)
            by_s[:, row] = np.einsum("nj,jk,nk->n", m[:, i], self._change[row], m[:, j])
            for column, derivative in enumerate((by_p, by_q)):
                slopes[:, row, 2 * i + column] = (derivative[:, i] * right).sum(axis=1)
                slopes[:, row, 2 * j + column] = (derivative[:, j] * left).sum(axis=1)
            slopes[:, 3 + row, 2 * row : 2 * row + 2] = self._charts[row]
            values[:, 3 + row] = unknowns[:, row] @ self._charts[row] - 1
        return values, slopes, by_s


def biquadratic_solutions(forms: ComplexArray, seed: int = 0) -> tuple[ComplexArray, Ends]:
    """Return the ends of all paths.

    Parameters
    ----------
    forms
        M of the pairs of unknowns 1 and 2, 2 and 3, 3 and 1, shape (3, 3, 3), of about one in size.
    seed
        Of the start's linear forms and the charts.

    Returns
    -------
    x : array
        p and q of each unknown, shape (16, 3, 2).
    ends : Ends
        How the paths ended.
    """
    rng = np.random.default_rng(seed)
    # Two linear forms in p and q for each equation and each of its two unknowns.
    factors = np.exp(2j * np.pi * rng.random((3, 2, 2, 2)))
    charts = np.exp(2j * np.pi * rng.random((3, 2)))
    one, two = factors[:, :, 0], factors[:, :, 1]
    mixed = one[..., 0] * two[..., 1] + one[..., 1] * two[..., 0]
    products = np.stack([mixed, one[..., 0] * two[..., 0], one[..., 1] * two[..., 1]], axis=-1)
    starts = []
    # Each equation's zero comes from its first unknown, or from its second one in all equations.
    for side, chosen in product((0, 1), product((0, 1), repeat=3)):
        x = np.empty((3, 2), dtype=np.complex128)
        for row, pair in enumerate(_PAIRS):
            rows = np.array([factors[row, side, chosen[row]], charts[pair[side]]])
            x[pair[side]] = np.linalg.solve(rows, [0.0, 1.0])
        starts.append(x.ravel())
    start = products[:, 0, :, None] * products[:, 1, None, :]
    homotopy = _Biquadratic(start, forms.astype(np.complex128), charts)
    ends = tracked(homotopy, np.array(starts))
    return ends.x.reshape(-1, 3, 2), ends
