"""First-order low-pass filters of leg speeds and of the setpoint's rate.

Both integrate s' = 2 pi f (u - s) exactly over a tick of length T with a constant input u:

    s += (1 - exp(-2 pi f T)) (u - s).

`SpeedFilter` estimates leg speeds from encoder lengths: u is the lengths' backward difference. The
response to a constant speed v is v (1 - exp(-2 pi f t)); the lag behind a ramp of speed is
1 / (2 pi f) + T / 2.

`SetpointRateFilter` applies the same filter to the setpoint's rate, so that a law's derivative term
is the filtered difference of the error. An unfiltered rate would leave an error of Kd times the lag
times the acceleration. Its input is the mean of two ticks' rates, not the difference of two
positions, which would turn a step of the setpoint into an impulse.
"""

from __future__ import annotations

import math

from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple

_ZERO = (0.0, 0.0, 0.0)


def low_pass(u: Triple, s: Triple, share: Number) -> Triple:
    """Return s + share (u - s), the filter's next output; share is 1 - exp(-2 pi f T)."""
    (u1, u2, u3), (s1, s2, s3) = u, s
    return s1 + share * (u1 - s1), s2 + share * (u2 - s2), s3 + share * (u3 - s3)


def backward_difference(length: Triple, last: Triple, elapsed: Number) -> Triple:
    """Return the mean speed between two readings, a time (s) apart."""
    (d1, d2, d3), (e1, e2, e3) = length, last
    return (d1 - e1) / elapsed, (d2 - e2) / elapsed, (d3 - e3) / elapsed


def mean(one: Triple, other: Triple) -> Triple:
    """Return the mean of two rates."""
    (x1, x2, x3), (y1, y2, y3) = one, other
    return (x1 + y1) / 2.0, (x2 + y2) / 2.0, (x3 + y3) / 2.0


class _LowPass:
    """A first-order low-pass filter of three numbers, at rest after `reset`.

    Parameters
    ----------
    cut_off
        f, Hz; infinite for no filter.
    """

    def __init__(self, cut_off: float) -> None:
        self._rate = 2 * math.pi * cut_off
        self.reset()

    def reset(self) -> None:
        """Start again at rest."""
        self.last: Triple | None = None
        self.speed: Triple = _ZERO

    def share(self, elapsed: float) -> float:
        """Return 1 - exp(-2 pi f T)."""
        return -math.expm1(-self._rate * elapsed)


class SpeedFilter(_LowPass):
    """Filtered speeds of three legs, zero until the second reading."""

    def after(self, length: Triple, elapsed: float) -> Triple:
        """Return the speeds (m/s) at lengths (m), a time (s) after the last; changes nothing."""
        if self.last is None:
            return self.speed
        change = backward_difference(length, self.last, elapsed)
        return low_pass(change, self.speed, self.share(elapsed))

    def update(self, length: Triple, speed: Triple) -> None:
        """Set the last reading and its speeds, measured or from `after`."""
        self.last, self.speed = length, speed


class SetpointRateFilter(_LowPass):
    """Filtered rates of three coordinates, starting at rest."""

    def after(self, rate: Triple, elapsed: float) -> Triple:
        """Return the filtered rates, a time (s) after the last call."""
        u = mean(rate, self.last or _ZERO)
        self.last = rate
        self.speed = filtered = low_pass(u, self.speed, self.share(elapsed))
        return filtered
