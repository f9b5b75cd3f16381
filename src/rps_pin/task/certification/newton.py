"""Interval Newton over boxes of task coordinates: one closed configuration for each x, proven.

About the middle (x_0, y = 0) of a box, with C about the inverse of F_y and S = -C F_x there,

    y = S d + z,   d = x - x_0,       N(z) = z - C F(x, S d + z).

With G(d) = C F(x_0 + d, S d), by Taylor's theorem with bounds of second derivatives over the box of
x and |z_i| <= R_i,

    |N(z)| <= |G(0)| + |G'(0)| |d| + |G''| |d| |d| / 2 + |1 - C F_y| |z| = r,

and F_y(x, y) is bounded by F_y(x_0, 0) and its slopes. If r < R in each part, N maps these z into
themselves and contracts them: for each x there is one z, within r, and F_y is regular there
(Krawczyk 1969; Neumaier, Interval Methods for Systems of Equations, 1990, section 5.1). In the norm
of R, |1 - C F_y| <= rho < 1, and with A and B bounds of |1 - C F_y| and |C (F_x + F_y S)|,

    dy/dx = S - (C F_y)^-1 C (F_x + F_y S)

lies within D = B + A R beta / (1 - rho) of S, beta_k the largest of B_ik / R_i.

Products of floats have errors of at most (k + 2) 2^-53 times the product of the sizes, k terms
(Higham, Accuracy and Stability of Numerical Algorithms, section 3.5), which are added; sums of what
is not negative are raised by 1e-12 of themselves.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.equations import Equations, inverses

#: First R: this part of |S| |x - x_0|, of its largest entry, and at least the last.
_OWN, _ANY, LEAST = 0.1, 0.05, 1e-8
_RAISED = 1.0 + 1e-12


class Sheets(NamedTuple):
    """Configurations over boxes of task coordinates: y = S (x - x_0) + z, |z| <= r; n boxes."""

    x: Array
    """Middles, shape (n, m)."""
    half: Array
    """Half widths, shape (n, m)."""
    z: Array
    """States at the middles, shape (n, nz)."""
    slopes: Array
    """S, shape (n, unknowns, m)."""
    spread: Array
    """D: bounds of |dy/dx - S|, shape (n, unknowns, m)."""
    within: Array
    """r, shape (n, unknowns)."""
    at_middle: Array
    """Bounds of |y| at the middles, shape (n, unknowns)."""
    alone: Array
    """R: no other configuration has |z| <= R, shape (n, unknowns)."""
    proven: Bools
    """Whether r < R; else nothing of this holds, shape (n,)."""

    def taken(self, which: Any) -> Sheets:
        """Return some of them."""
        return Sheets._make(one[which] for one in self)


def sheets(equations: Equations, z: Array, x: Array, half: Array) -> Sheets:
    """Return what is proven over boxes of middles x and half widths (n, m), of closed states z."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        middle = _Middle(equations, z, x, half)
        R = _OWN * middle.moved + _ANY * middle.moved.max(axis=-1, keepdims=True) + LEAST
        found, start = middle.proven(R)
        again = np.flatnonzero(~found.proven & np.isfinite(start).all(axis=-1))
        if again.size:
            part = _Middle(equations, z[again], x[again], half[again])
            other, _ = part.proven(2.0 * start[again] + LEAST)
            for one, new in zip(found, other, strict=True):
                one[again] = new
    return found


class _Middle:
    """What is known at the middles of boxes."""

    def __init__(self, equations: Equations, z: Array, x: Array, half: Array) -> None:
        self._equations, self._z, self._x, self._half = equations, z, x, half
        (y_mid, y_rad), (x_mid, x_rad) = equations.exact_slopes(z, x)
        self._C = C = inverses(y_mid)
        self._S = S = -C @ x_mid
        self.moved = _sum(np.abs(S), half)
        self._size = size = np.abs(C)
        self._gamma = g = (equations.size + equations.coordinates + 8) * 2.0**-52
        unit = np.eye(equations.size)
        error = y_rad + g * np.abs(y_mid)
        #: Bounds of |1 - C F_y| and |C (F_x + F_y S)| at the middle.
        self._A = np.abs(unit - C @ y_mid) + size @ error + g * (unit + size @ np.abs(y_mid))
        shear = x_rad + y_rad @ np.abs(S) + g * (np.abs(x_mid) + np.abs(y_mid) @ np.abs(S))
        sheared = x_mid + y_mid @ S
        self._B = np.abs(C @ sheared) + size @ (shear + g * np.abs(sheared))
        self._first = _sum(size, equations.largest_gaps(z, x))

    def proven(self, R: Array) -> tuple[Sheets, Array]:
        """Return sheets with R given, and |N(0)|."""
        equations, half, C, S, g = self._equations, self._half, self._C, self._S, self._gamma
        n, m = half.shape
        over = (self.moved + R) * _RAISED
        box = Interval((self._x - half).T, (self._x + half).T).widened(0.0)
        H, spread, closed = equations.second(self._z, box, Interval(-over.T, over.T))
        # Along d, w = (x, y) moves by T; along z, by its last part.
        T = np.concatenate([np.broadcast_to(np.eye(m), (n, m, m)), S], axis=1)
        size, along = self._size, np.abs(T)
        P = H @ T[:, None]
        error = (spread + g * np.abs(H)) @ along[:, None]
        CP = _times(C, P)
        CP_error = _times(size, error + g * np.abs(P))
        by_z = _times(size, (np.abs(H) + spread)[..., m:] @ R[:, None, :, None])[..., 0] * _RAISED
        # Slopes of C F_y and of C (F_x + F_y S) times half widths, and what z adds.
        bent = ((np.abs(CP) + CP_error) @ half[:, None, :, None])[..., 0]
        A = (self._A + bent[:, :, m:] + by_z[:, :, m:]) * _RAISED
        turned = np.swapaxes(T, 1, 2)[:, None]
        Q = np.abs(turned @ CP) + np.abs(turned) @ (CP_error + g * np.abs(CP))
        curved = (Q @ half[:, None, :, None])[..., 0] * _RAISED
        B = (self._B + curved + by_z @ along) * _RAISED
        start = (self._first + _sum(self._B, half) + _sum(curved, half) / 2) * _RAISED
        r = (start + _sum(A, R)) * _RAISED
        proven = np.asarray(closed & (r < R).all(axis=-1))  # not where r is NaN
        rho = (_sum(A, R) / R).max(axis=-1) * _RAISED
        beta = (B / R[:, :, None]).max(axis=1) * _RAISED
        growth = beta / (1.0 - rho[:, None])
        D = (B + _sum(A, R)[:, :, None] * growth[:, None, :]) * _RAISED
        r = np.where(proven[:, None], (start + _sum(A, r)) * _RAISED, r)
        least = (self._first / R).max(axis=-1) / (1.0 - rho)
        middle = (self._first + _sum(A, R) * least[:, None]) * _RAISED
        return Sheets(self._x, half, self._z, S, D, r, middle, R, proven), start


def _times(C: Array, stacked: Array) -> Array:
    """Return products of matrices (n, p, i) and (n, i, j, k), shape (n, p, j, k)."""
    n, i, j, k = stacked.shape
    return np.asarray((C @ stacked.reshape(n, i, j * k)).reshape(n, -1, j, k))


def _sum(matrices: Array, vectors: Array) -> Array:
    """Return products of what is not negative, raised."""
    return np.asarray((matrices @ vectors[..., None])[..., 0] * _RAISED)
