"""A law of time in pieces, each a polynomial of third degree: the jerk is steady in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.trajectories.curve import LawSample
from rps_pin.trajectories.path import checked_times


class PiecewiseLaw:
    """A law of pieces of steady jerk (or, without any jerk, of steady acceleration).

    Parameters
    ----------
    durations
        Of the pieces, s; none negative.
    jerks
        u''' in each piece.
    accelerations
        u'' at the start of each piece; it may jump.

    Attributes
    ----------
    knots : array
        Times at which the pieces begin, and the end, s.
    distance, duration : float
        Where u ends, and when (s).
    """

    def __init__(self, durations: ArrayLike, jerks: ArrayLike, accelerations: ArrayLike) -> None:
        steps = np.asarray(durations, dtype=np.float64)
        kept = steps > 0
        self._steps = steps[kept]
        self._jerk = np.asarray(jerks, dtype=np.float64)[kept]
        self._acceleration = np.asarray(accelerations, dtype=np.float64)[kept]
        self.knots = np.concatenate([[0.0], np.cumsum(self._steps)])
        self.knots.setflags(write=False)
        #: Time left at the end of each piece: exact near the end, where the knots are rounded.
        self._left = np.concatenate([np.cumsum(self._steps[:0:-1])[::-1], [0.0]])
        self.duration = float(self.knots[-1])
        h, a, j = self._steps, self._acceleration, self._jerk
        self._speed = np.concatenate([[0.0], np.cumsum(a * h + j * h**2 / 2)])
        moved = self._speed[:-1] * h + a * h**2 / 2 + j * h**3 / 6
        self._u = np.concatenate([[0.0], np.cumsum(moved)])
        self.distance = float(self._u[-1])

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}(distance={self.distance:.6g}, duration={self.duration:.6g})"

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s; where u'' jumps, the later piece's."""
        i, h = self._piece(checked_times(t, self.duration))
        v, a, j = self._speed[i], self._acceleration[i], self._jerk[i]
        return LawSample(
            self._u[i] + h * (v + h * (a / 2 + h * j / 6)), v + h * (a + h * j / 2), a + h * j
        )

    def _piece(self, times: Array) -> tuple[Indices, Array]:
        """Return in which piece times are, and for how long, reckoned from the nearer end."""
        left = self.duration - times
        early = times < left
        i = np.where(
            early,
            np.searchsorted(self.knots[1:-1], times, side="right"),
            len(self._steps) - 1 - np.searchsorted(self._left[-2::-1], left, side="left"),
        )
        return i, np.where(early, times - self.knots[i], self._steps[i] - (left - self._left[i]))
