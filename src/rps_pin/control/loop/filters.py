"""First-order low-pass filters of the actuators' speeds and of the setpoint's rate.

Both integrate s' = 2 pi f (u - s) exactly over a tick of length T with a constant input u:

    s += (1 - exp(-2 pi f T)) (u - s).

`SpeedFilter` estimates speeds from encoder positions: u is the positions' backward difference. The
response to a constant speed v is v (1 - exp(-2 pi f t)); the lag behind a ramp of speed is
1 / (2 pi f) + T / 2.

`SetpointRateFilter` applies the same filter to the setpoint's rate, so that a law's derivative term
is the filtered difference of the error. An unfiltered rate would leave an error of Kd times the lag
times the acceleration. Its input is the mean of two ticks' rates, not the difference of two
positions, which would turn a step of the setpoint into an impulse.
"""

from __future__ import annotations

import math
from typing import Any

from rps_pin.control.loop.vectors import TRIPLES, Vectors


class _LowPass:
    """A first-order low-pass filter of a vector, at rest after `reset`.

    Parameters
    ----------
    cut_off
        f, Hz; infinite for no filter.
    vectors
        Of which kind; default: three numbers.
    """

    def __init__(self, cut_off: float, vectors: Vectors = TRIPLES) -> None:
        self._rate, self._of = 2 * math.pi * cut_off, vectors
        self.reset()

    def reset(self) -> None:
        """Start again at rest."""
        self.last: Any = None
        self.speed: Any = self._of.zero

    def share(self, elapsed: float) -> float:
        """Return 1 - exp(-2 pi f T)."""
        return -math.expm1(-self._rate * elapsed)


class SpeedFilter(_LowPass):
    """Filtered speeds of actuators, zero until the second reading."""

    def after(self, length: Any, elapsed: float) -> Any:
        """Return the speeds (m/s) at lengths (m), a time (s) after the last; changes nothing."""
        if self.last is None:
            return self.speed
        change = self._of.backward_difference(length, self.last, elapsed)
        return self._of.low_pass(change, self.speed, self.share(elapsed))

    def update(self, length: Any, speed: Any) -> None:
        """Set the last reading and its speeds, measured or from `after`."""
        self.last, self.speed = length, speed


class SetpointRateFilter(_LowPass):
    """Filtered rates of coordinates, starting at rest."""

    def after(self, rate: Any, elapsed: float) -> Any:
        """Return the filtered rates, a time (s) after the last call."""
        last = self._of.zero if self.last is None else self.last
        u = self._of.mean(rate, last)
        self.last = rate
        self.speed = filtered = self._of.low_pass(u, self.speed, self.share(elapsed))
        return filtered
