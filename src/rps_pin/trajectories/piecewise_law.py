"""Piecewise laws of time: polynomials of third degree, of constant jerk."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from rps_pin.trajectories.curve import LawSample
from rps_pin.trajectories.path import checked_times


class PiecewiseLaw:
    """A law of time in pieces of constant jerk (or, without jerk, of constant acceleration).

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
        h, j, a = (np.asarray(x, np.float64)[steps > 0] for x in (steps, jerks, accelerations))
        self.knots = np.concatenate([[0.0], np.cumsum(h)])
        self.knots.setflags(write=False)
        self.duration = float(self.knots[-1])
        speed = np.concatenate([[0.0], np.cumsum(a * h + j * h**2 / 2)])
        u = np.concatenate([[0.0], np.cumsum(speed[:-1] * h + a * h**2 / 2 + j * h**3 / 6)])
        self.distance = float(u[-1])
        v, o = speed[:-1], np.zeros_like(h)
        # u, u' and u'' of each piece, evaluated together.
        c = np.stack([[j / 6, o, o], [a / 2, j / 2, o], [v, a, j], [u[:-1], v, a]]).swapaxes(1, 2)
        # Times are counted from the nearer end: a short last piece would vanish in the rounding of
        # the time from the start.
        before_end = np.concatenate([-np.cumsum(h[::-1])[::-1], [0.0]])
        self._from_start, self._from_end = PPoly(c, self.knots), PPoly(c, before_end)

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}(distance={self.distance:.6g}, duration={self.duration:.6g})"

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s; where u'' jumps, the later piece's."""
        times = checked_times(t, self.duration)
        before_end = times - self.duration
        early = (times < -before_end)[..., None]
        values = np.where(early, self._from_start(times), self._from_end(before_end))
        return LawSample(*np.moveaxis(values, -1, 0))
