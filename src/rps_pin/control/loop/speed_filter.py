"""Leg speeds from encoder lengths alone: backward differences through a first-order low pass.

With T the time since the last reading and f the cut-off frequency,

    s += (1 - exp(-2 pi f T)) ((d - d_last) / T - s),

which is the exact answer of s' = 2 pi f (d' - s) while d' is constant. A constant speed v is
reached as v (1 - exp(-2 pi f t)); of a ramp of speed the answer lags by 1 / (2 pi f) + T / 2.
"""

from __future__ import annotations

import math

from rps_pin.rps.kinematics.tracking import Triple


class SpeedFilter:
    """Filtered speeds of three legs; the first reading only starts it.

    Parameters
    ----------
    cut_off
        f, Hz; infinite for the bare difference.
    """

    def __init__(self, cut_off: float) -> None:
        self._rate = 2 * math.pi * cut_off
        self._last: Triple | None = None
        self.speed: Triple = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Forget everything: the speed is zero until the second reading."""
        self._last, self.speed = None, (0.0, 0.0, 0.0)

    def after(self, length: Triple, elapsed: float) -> Triple:
        """Return the speeds (m/s) at a reading (m) so long (s) after the last; changes nothing."""
        if self._last is None:
            return self.speed
        share = -math.expm1(-self._rate * elapsed)
        (d1, d2, d3), (e1, e2, e3), (s1, s2, s3) = length, self._last, self.speed
        return (
            s1 + share * ((d1 - e1) / elapsed - s1),
            s2 + share * ((d2 - e2) / elapsed - s2),
            s3 + share * ((d3 - e3) / elapsed - s3),
        )

    def follow(self, length: Triple, speed: Triple) -> None:
        """Continue from a reading and its speeds, measured or from `after`."""
        self._last, self.speed = length, speed
