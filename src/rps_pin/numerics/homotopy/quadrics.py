"""Quadrics x' Q_i x = 0 in a chart c . x = 1, over boxes: for proofs of their solutions."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.numerics.homotopy.krawczyk import proven_zero
from rps_pin.numerics.intervals import Interval


def proven_solutions(forms: Interval, chart: Array, x: Array) -> list[Interval | None]:
    """Return boxes in the chart that hold one solution each; none where that is not proven.

    Parameters
    ----------
    forms
        Symmetric matrices Q, shape (n - 1, n, n).
    chart
        c, shape (n,).
    x
        Solutions nearby, of any size, shape (m, n).
    """

    def system(box: Interval) -> tuple[Interval, Interval]:
        slopes = Interval(np.zeros(forms.lower.shape[:2]))
        for k in range(len(chart)):
            slopes = slopes + 2.0 * forms[:, :, k] * box[k]
        values, linear = Interval(np.zeros(len(forms.lower))), Interval(np.array([-1.0]))
        for k in range(len(chart)):
            values = values + 0.5 * slopes[:, k] * box[k]
            linear = linear + Interval(chart[k : k + 1]) * box[k]
        return _joined(values, linear), _joined(slopes, Interval(chart[None]))

    return [proven_zero(system, one / float(chart @ one)) for one in x]


def _joined(one: Interval, other: Interval) -> Interval:
    return Interval(
        np.concatenate([one.lower, other.lower]), np.concatenate([one.upper, other.upper])
    )
