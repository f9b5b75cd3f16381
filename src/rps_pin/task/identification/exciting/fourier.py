"""Periodic motions of a task that start and end at rest: Fourier series.

    x(t) = x_0 + sum_k c_k (cos k w t - 1) + s_k sin k w t,     w = 2 pi / period,

with sum_k k s_k = 0 and sum_k k^2 c_k = 0: rates and accelerations are zero at the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import null_space
from rps_pin.trajectories.path import PathSample, checked_times


@dataclass(frozen=True, eq=False)
class FourierMotion:
    """A trajectory; see the module's text.

    Attributes
    ----------
    start : (m,) array
        x_0, m and rad.
    cosines, sines : (harmonics, m) arrays
        c_k and s_k, m and rad.
    period : float
        s.
    repeats : int
        How often the period is run through.
    """

    start: Array
    cosines: Array
    sines: Array
    period: float
    repeats: int = 1

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return self.period * self.repeats

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times of shape (...), s, shapes (..., m).

        Raises
        ------
        InputError
            If a time is not finite, or outside the motion.
        """
        time = checked_times(t, self.duration)
        w = 2 * np.pi / self.period * np.arange(1, len(self.cosines) + 1)
        angle = time[..., None] * w
        cos, sin = np.cos(angle), np.sin(angle)
        c, s = self.cosines, self.sines
        return PathSample(
            self.start + (cos - 1) @ c + sin @ s,
            (-w * sin) @ c + (w * cos) @ s,
            (-(w**2) * cos) @ c - (w**2 * sin) @ s,
        )


def free_coefficients(harmonics: int) -> tuple[Array, Array]:
    """Return bases of the c_k, and of the s_k, that start at rest, (harmonics, harmonics - 1)."""
    k = np.arange(1, harmonics + 1)[None].astype(np.float64)
    return null_space(k**2 / np.linalg.norm(k**2)), null_space(k / np.linalg.norm(k))
