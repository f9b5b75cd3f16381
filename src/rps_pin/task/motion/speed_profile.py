"""Speed profiles: time laws u(t) given by the squared rate as a function of the parameter u.

On pieces of the parameter u, the squared rate b = u'^2 is a parabola, so that the acceleration
u'' = b'/2 is a straight line in u, u'' = alpha + kappa s, with s from the piece's beginning. That
equation is solved in closed form: with r the rate at the beginning and w^2 = kappa,

    s = r sinh(w t)/w + alpha (cosh(w t) - 1)/w^2,

sin and cos for a negative kappa. A piece of length h, run through from the rate r_0 to r_1, takes

    2 artanh(w h / (r_0 + r_1)) / w,

which is 2 h / (r_0 + r_1) at a steady acceleration, and holds from and to rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError
from rps_pin.trajectories.curve import LawSample
from rps_pin.trajectories.path import checked_parameters, checked_times
from rps_pin.validation import fixed_array, read_only


class SpeedProfile:
    """A time law whose squared rate is continuous, and a parabola on each piece of u.

    Parameters
    ----------
    knots
        Ends of the pieces; increasing from 0, shape (n + 1,), in the unit of u.
    squared
        b = u'^2 at the knots, shape (n + 1,); zero at most at the two ends.
    bump
        Height of b above its chord in the middle of each piece, shape (n,).

    Attributes
    ----------
    knots, squared, bump : arrays
        As given, read-only.
    times : (n + 1,) array
        Times of the knots, s; read-only.

    Raises
    ------
    InputError
        If shapes do not fit, knots do not increase from 0, or the rate is zero between the ends.
    """

    def __init__(self, knots: ArrayLike, squared: ArrayLike, bump: ArrayLike) -> None:
        self.knots = fixed_array(knots, "knots", (None,), "a row of numbers")
        self.squared = fixed_array(squared, "squared rates", (None,), "a row of numbers")
        self.bump = fixed_array(bump, "bumps", (None,), "a row of numbers")
        n = len(self.bump)
        if n == 0 or self.knots.shape != (n + 1,) or self.squared.shape != (n + 1,):
            raise InputError(
                f"{len(self.knots)} knots and {len(self.squared)} squared rates for {n} bumps: "
                "there must be one more of them than bumps"
            )
        self._width = np.diff(self.knots)
        if self.knots[0] != 0 or not (self._width > 0).all():
            raise InputError("the knots of a speed profile must increase, from 0")
        rise = np.diff(self.squared)
        self._start = (rise + 4 * self.bump) / (2 * self._width)  # alpha
        self._slope = -4 * self.bump / self._width**2  # kappa
        self._refuse_stops()
        self._rate = np.sqrt(self.squared)
        mean = (self._rate[:-1] + self._rate[1:]) / 2
        steps = self._width / mean * _artanhc(self._slope * (self._width / (2 * mean)) ** 2)
        self.times = read_only(np.append(0.0, np.cumsum(steps)))

    @property
    def pieces(self) -> int:
        """How many pieces there are."""
        return len(self.bump)

    @property
    def length(self) -> float:
        """Largest u."""
        return float(self.knots[-1])

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.times[-1])

    def __repr__(self) -> str:
        return (
            f"SpeedProfile(<{len(self.bump)} pieces>, length={self.length:.6g}, "
            f"duration={self.duration:.6g})"
        )

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s; where u'' jumps, the later piece's.

        Raises
        ------
        InputError
            If a time lies outside the law.
        """
        times = checked_times(t, self.duration)
        i = np.searchsorted(self.times[1:-1], times, side="right")
        since = times - self.times[i]
        rate, start, slope = self._rate[i], self._start[i], self._slope[i]
        angle = slope * since**2
        way = rate * since * _sinhc(angle) + start * since**2 / 2 * _sinhc(angle / 4) ** 2
        s = way.clip(0.0, self._width[i])  # rounding
        speed = rate * _cosh(angle) + start * since * _sinhc(angle)
        return LawSample(self.knots[i] + s, speed, start + slope * s)

    def along(self, u: ArrayLike) -> tuple[Array, Array]:
        """Return b = u'^2 and u'' at parameters of shape (...), the later piece's where it jumps.

        Raises
        ------
        InputError
            If a parameter lies outside the curve.
        """
        place = checked_parameters(u, self.length)
        i = np.searchsorted(self.knots[1:-1], place, side="right")
        return self._in_piece(i, (place - self.knots[i]) / self._width[i])

    def within(self, share: Array) -> tuple[Array, Array, Array]:
        """Return u, b and u'' in each piece, at shares (m,) of it from 0 to 1; shape (n, m) each.

        At 0 and 1, u'' is that of the piece, also where it jumps.
        """
        i = np.arange(len(self.bump))[:, None]
        u = (1 - share) * self.knots[:-1, None] + share * self.knots[1:, None]
        return (u, *self._in_piece(i, np.broadcast_to(share, u.shape)))

    def _in_piece(self, i: Indices, share: Array) -> tuple[Array, Array]:
        chord = (1 - share) * self.squared[i] + share * self.squared[i + 1]
        b = chord + 4 * share * (1 - share) * self.bump[i]
        return b, self._start[i] + self._slope[i] * share * self._width[i]

    def _refuse_stops(self) -> None:
        """Refuse a squared rate that is not positive between the ends, or negative at them."""
        inner = self.squared[1:-1]
        # Where the parabola turns within a piece: the least of it.
        turn = np.clip(-self._start / np.where(self._slope > 0, self._slope, 1.0), 0, self._width)
        least = self.squared[:-1] + turn * (2 * self._start + self._slope * turn)
        turns = (self._slope > 0) & (turn > 0) & (turn < self._width)
        # From rest, b must rise; to rest, it must fall.
        end = self._start[-1] + self._slope[-1] * self._width[-1]
        stuck = (self.squared[0] == 0 and self._start[0] <= 0) or (self.squared[-1] == 0 <= end)
        if (inner <= 0).any() or (self.squared < 0).any() or stuck or (least[turns] <= 0).any():
            raise InputError("the squared rate of a speed profile must be positive inside")


def _cosh(x: Array) -> Array:
    """Return cosh(sqrt(x)), which is cos(sqrt(-x)) for a negative x."""
    root = np.sqrt(np.abs(x))
    return np.where(x > 0, np.cosh(np.where(x > 0, root, 0.0)), np.cos(root))


def _by_root(x: Array, hyperbolic: np.ufunc, circular: np.ufunc) -> Array:
    """Return f(sqrt(x)) / sqrt(x): 1 at 0, and for a negative x the circular function's."""
    root = np.where(x == 0, 1.0, np.sqrt(np.abs(x)))
    below = np.where(x < 0, circular(root) / root, 1.0)
    return np.where(x > 0, hyperbolic(np.where(x > 0, root, 0.0)) / root, below)


def _sinhc(x: Array) -> Array:
    """Return sinh(sqrt(x)) / sqrt(x); sin for a negative x."""
    return _by_root(x, np.sinh, np.sin)


def _artanhc(x: Array) -> Array:
    """Return artanh(sqrt(x)) / sqrt(x), for x below 1; arctan for a negative x."""
    return _by_root(x, np.arctanh, np.arctan)
