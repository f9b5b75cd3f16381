"""What is limited along a curve as functions of its parameter: splines, with their slopes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from rps_pin.arrays import Array, Indices
from rps_pin.task.motion.curve_dynamics import CurveDynamics, breaks_of

#: Points along the whole curve, and least points of one of its pieces.
_POINTS, _FEWEST = 601, 17


class TableRow(NamedTuple):
    """Values at parameters (...), or their slopes by u."""

    inertia: Array
    """m, levels by u'', shape (..., k)."""
    velocity_product: Array
    """c, levels by u'^2, shape (..., k)."""
    holding: Array
    """g, levels at rest, shape (..., k)."""
    speed_slope: Array
    """d_u of what has limits of speed, shape (..., l)."""
    first: Array
    """d_u of what has limits of jerk, shape (..., j)."""
    second: Array
    """d_uu of what has limits of jerk, shape (..., j)."""

    def levels(self, rate: Array, acceleration: Array) -> Array:
        """Return levels without friction, shape (..., k)."""
        r, a = rate[..., None], acceleration[..., None]
        found: Array = self.inertia * a + self.velocity_product * r**2 + self.holding
        return found

    def jerks(self, third: Array, rate: Array, acceleration: Array, jerk: Array) -> Array:
        """Return jerks, with d_uuu of shape (..., j)."""
        r, a, j = rate[..., None], acceleration[..., None], jerk[..., None]
        found: Array = self.first * j + 3 * self.second * r * a + third * r**3
        return found


class CurveTable:
    """Terms along a curve, interpolated between some hundreds of points.

    Parameters
    ----------
    dynamics
        What is limited.

    Attributes
    ----------
    breaks : array
        Where pieces of the curve begin and end.
    """

    def __init__(self, dynamics: CurveDynamics) -> None:
        self.breaks = breaks_of(dynamics.curve)
        width = np.diff(self.breaks)
        counts = np.maximum(_FEWEST, np.ceil(_POINTS * width / self.breaks[-1])).astype(int)
        self._splines = []
        for low, high, count in zip(self.breaks[:-1], self.breaks[1:], counts, strict=True):
            # Just inside: derivatives may jump at the ends of pieces.
            inside = 1e-9 * (high - low)
            u = np.linspace(low + inside, high - inside, count)
            terms, slopes = dynamics.terms(u), dynamics.jerk_slopes(dynamics.place(u))
            parts = [*terms, *slopes]
            self._ends = np.cumsum([part.shape[-1] for part in parts])[:-1]
            self._splines.append(CubicSpline(u, np.concatenate(parts, axis=-1)))

    def at(self, u: Array, piece: Indices) -> tuple[TableRow, TableRow, Array]:
        """Return values, slopes, and d_uuuu of what has limits of jerk.

        Parameters
        ----------
        u
            Parameters, shape (n, m).
        piece
            Of which piece of the curve, or of its continuation, shape (n,).
        """
        orders = []
        for order in range(3):
            found = np.empty((*u.shape, self._splines[0].c.shape[-1]))
            for i in np.unique(piece):
                found[piece == i] = self._splines[i](u[piece == i], order)
            orders.append(np.split(found, self._ends, axis=-1))
        return TableRow(*orders[0]), TableRow(*orders[1]), orders[2][-1]
