"""Time laws u(t) of finite jerk: u''' is constant on each piece of the time.

Pieces are given by their shares of the duration. On a piece, u is a cubic: all laws with the same
pieces are linear in their jerks. Quantities without a unit are u / length, and its derivatives by
t / duration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.trajectories.curve import LawSample
from rps_pin.trajectories.path import checked_times
from rps_pin.trajectories.piecewise_law import PiecewiseLaw
from rps_pin.validation import read_only


class Passages(NamedTuple):
    """Places between the ends where the law has a knot: there pieces of a curve meet."""

    knot: Indices
    """Which knots, shape (p,), increasing."""
    place: Array
    """u / length there, shape (p,)."""


class LawPieces(NamedTuple):
    """A law within its pieces, shape (n, m) each."""

    u: Array
    rate: Array
    acceleration: Array
    jerk: Array


#: Without places between the ends.
NONE = Passages(np.empty(0, dtype=np.intp), np.empty(0))


class JerkProfile:
    """A time law from rest to rest, with u' and u'' continuous, and zero at both ends.

    Parameters
    ----------
    shares
        Of the duration, one of each piece, shape (n,), n of p + 3 or more; their sum is 1.
    jerks
        Third derivatives on the pieces, without unit, shape (n,). They are corrected, as little as
        possible, so that the law ends at rest at the length, and passes places at their knots.
    length, duration
        Where u ends, and when, s.
    passages
        Those places.

    Attributes
    ----------
    shares, jerks : (n,) arrays
        As above, read-only.
    times : (n + 1,) array
        Times of the knots, s; read-only.
    length, duration, passages
        As given.
    """

    def __init__(
        self,
        shares: Array,
        jerks: Array,
        length: float,
        duration: float,
        passages: Passages = NONE,
    ) -> None:
        self.shares, self.length, self.duration = read_only(shares), length, duration
        self.passages = passages
        self.jerks = read_only(_corrected(shares, jerks, passages))
        by_time = length / duration ** np.arange(4)
        starts = self.states()[2][:-1]
        self._law = PiecewiseLaw(shares * duration, self.jerks * by_time[3], starts * by_time[2])
        self.times = self._law.knots

    @property
    def pieces(self) -> int:
        """How many pieces there are."""
        return len(self.shares)

    @property
    def phase(self) -> Indices:
        """Between which of the passages each piece lies, shape (n,), from 0 to p."""
        return np.searchsorted(self.passages.knot, np.arange(self.pieces), side="right")

    def __repr__(self) -> str:
        return (
            f"JerkProfile(<{self.pieces} pieces>, length={self.length:.6g}, "
            f"duration={self.duration:.6g})"
        )

    def states(self) -> tuple[Array, Array, Array]:
        """Return u, u' and u'' at the knots, without unit, shape (n + 1,) each."""
        return _states(self.shares, self.jerks)

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s.

        Raises
        ------
        InputError
            If a time lies outside the law.
        """
        times = checked_times(t, self.duration).clip(0.0, self._law.duration)  # rounding
        u, rate, acceleration = self._law.at(times)
        return LawSample(u.clip(0.0, self.length), rate, acceleration)

    def jerk_at(self, t: ArrayLike) -> Array:
        """Return u''' at times of shape (...), s; where it jumps, the later piece's."""
        times = checked_times(t, self.duration)
        i = np.searchsorted(self.times[1:-1], times, side="right")
        found: Array = self.jerks[i] * (self.length / self.duration**3)
        return found

    def within(self, share: Array) -> LawPieces:
        """Return the law in each piece, at shares (m,) of it from 0 to 1."""
        x, v, a = (part[:-1, None] for part in self.states())
        d, j = self.shares[:, None] * share, self.jerks[:, None]
        parts = x + d * (v + d * (a / 2 + d * j / 6)), v + d * (a + d * j / 2), a + d * j
        scale = self.length / self.duration ** np.arange(4)
        u, rate, acceleration = (part * by for part, by in zip(parts, scale, strict=False))
        jerk = np.broadcast_to(j * scale[3], u.shape)
        return LawPieces(u.clip(0.0, self.length), rate, acceleration, jerk)

    def slower(self, times: float) -> JerkProfile:
        """Return the law that takes so many times as long."""
        return JerkProfile(
            self.shares, self.jerks, self.length, self.duration * times, self.passages
        )

    def divided(self, parts: Indices) -> JerkProfile:
        """Return the same law, each piece divided into so many alike, shape (n,)."""
        ends = np.append(0, np.cumsum(parts))
        passages = Passages(ends[self.passages.knot], self.passages.place)
        shares, jerks = np.repeat(self.shares / parts, parts), np.repeat(self.jerks, parts)
        return JerkProfile(shares, jerks, self.length, self.duration, passages)


def _states(w: Array, j: Array) -> tuple[Array, Array, Array]:
    a = np.append(0.0, np.cumsum(j * w))
    v = np.append(0.0, np.cumsum(w * (a[:-1] + w * j / 2)))
    x = np.append(0.0, np.cumsum(w * (v[:-1] + w * (a[:-1] / 2 + w * j / 6))))
    return x, v, a


def _corrected(shares: Array, jerks: Array, passages: Passages) -> Array:
    """Return jerks of a law that meets its end and its passages."""
    ends = np.cumsum(shares)
    knots = np.append(passages.knot, len(shares))
    # After each piece and before it, the time that is left until a knot.
    left = np.maximum(ends[knots - 1][:, None] - ends, 0.0)
    before = np.where(np.arange(len(shares)) < knots[:, None], left + shares, 0.0)
    rows = np.concatenate(
        [(before**3 - left**3) / 6, (before[-1:] ** 2 - left[-1:] ** 2) / 2, shares[None]]
    )
    target = np.concatenate([passages.place, [1.0, 0.0, 0.0]])
    by_share = rows / shares
    found = jerks
    for _ in range(2):  # the second time for rounding
        x, v, a = _states(shares, found)
        missing = target - np.concatenate([x[knots], v[-1:], a[-1:]])
        found = found + by_share.T @ np.linalg.lstsq(by_share @ rows.T, missing, rcond=None)[0]
    return found
