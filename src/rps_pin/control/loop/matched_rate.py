"""The target's rate as the filter of measured speeds would show it.

A filtered speed lags behind. Taken from a target's rate that does not, it leaves an error by
itself: Kd times the lag times the acceleration. So the target's rate goes through the same filter
(see `rps_pin.control.loop.speed_filter`), and the law's derivative is the filtered difference of
the error. The mean of two ticks stands for the difference of two positions, which a target that
steps would make a kick.
"""

from __future__ import annotations

import math

from rps_pin.rps.kinematics.tracking import Triple


class MatchedRate:
    """Three rates through the low pass of a filter.

    Parameters
    ----------
    cut_off
        Hz; infinite for none.
    """

    def __init__(self, cut_off: float) -> None:
        self._rate = 2 * math.pi * cut_off
        self.reset()

    def reset(self) -> None:
        """Start anew at rest."""
        self._last: Triple = (0.0, 0.0, 0.0)
        self._slow: Triple = (0.0, 0.0, 0.0)

    def after(self, rate: Triple, elapsed: float) -> Triple:
        """Return the rates so long, s, after the last ones."""
        share = -math.expm1(-self._rate * elapsed)
        (x1, x2, x3), (y1, y2, y3), (s1, s2, s3) = rate, self._last, self._slow
        self._last = rate
        self._slow = slow = (
            s1 + share * ((x1 + y1) / 2.0 - s1),
            s2 + share * ((x2 + y2) / 2.0 - s2),
            s3 + share * ((x3 + y3) / 2.0 - s3),
        )
        return slow
