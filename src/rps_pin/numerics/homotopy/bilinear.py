"""All solutions of bilinear equations y' B_i z = 0 in two projective spaces, by homotopy.

Of 2 r equations with y and z in spaces of r dimensions each, r + 1 homogeneous coordinates, there
are at most C(2 r, r) solutions that are isolated: the Bezout number of two groups of variables
(Morgan and Sommese, 1987). As many start from products (l_i . y)(m_i . z) of linear forms, where r
of the l_i and the m_i of the other equations vanish.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from rps_pin.arrays import Array, ComplexArray
from rps_pin.numerics.homotopy.tracking import Ends, tracked


class _Bilinear:
    """The homotopy between two systems of bilinear equations, in charts p . y = 1, q . z = 1."""

    def __init__(self, start: ComplexArray, end: ComplexArray, charts: ComplexArray) -> None:
        self._start, self._change, self._charts = start, end - start, charts

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Homotopy`."""
        k, m = len(x), self._start.shape[1]
        y, z = x[:, :m], x[:, m:]
        forms = self._start + s[:, None, None, None] * self._change
        by_y = (forms @ z[:, None, :, None])[..., 0]
        by_z = (y[:, None, None, :] @ forms)[..., 0, :]
        values = np.concatenate(
            [
                (by_y @ y[:, :, None])[..., 0],
                y @ self._charts[:1].T - 1,
                z @ self._charts[1:].T - 1,
            ],
            axis=1,
        )
        slopes = np.zeros((k, 2 * m, 2 * m), dtype=np.complex128)
        slopes[:, :-2, :m], slopes[:, :-2, m:] = by_y, by_z
        slopes[:, -2, :m], slopes[:, -1, m:] = self._charts
        by_s = np.zeros((k, 2 * m), dtype=np.complex128)
        by_s[:, :-2] = np.einsum("ijk,nj,nk->ni", self._change, y, z, optimize=True)
        return values, slopes, by_s


def bilinear_solutions(
    forms: ComplexArray, seed: int = 0
) -> tuple[ComplexArray, ComplexArray, Ends]:
    """Return the ends of all paths to the solutions of y' B_i z = 0.

    Parameters
    ----------
    forms
        B, shape (2 r, r + 1, r + 1), of about one in size.
    seed
        Of the start's linear forms and the charts.

    Returns
    -------
    y, z : arrays
        Shape (C(2 r, r), r + 1).
    ends : Ends
        How the paths ended, of y and z in one.
    """
    count, m, _ = forms.shape
    rng = np.random.default_rng(seed)
    one, two, charts = (np.exp(2j * np.pi * rng.random((n, m))) for n in (count, count, 2))
    start = []
    for chosen in combinations(range(count), m - 1):
        others = [i for i in range(count) if i not in chosen]
        rows = [np.vstack([one[list(chosen)], charts[:1]]), np.vstack([two[others], charts[1:]])]
        start.append(np.concatenate([np.linalg.solve(r, np.eye(m)[-1]) for r in rows]))
    products = one[:, :, None] * two[:, None, :]
    ends = tracked(_Bilinear(products, forms.astype(np.complex128), charts), np.array(start))
    return ends.x[:, :m], ends.x[:, m:], ends
