"""Rejoining of a moving target after a hold, continuous in pose, rate and acceleration.

The setpoint is the target plus an offset. The offset starts as the difference of held setpoint and
target, with its first two derivatives, and vanishes with its derivatives after a time T. With
s = t / T and u = 1 - s,

    offset = u^3 q,   q = g + (3 g + g' T) s + (6 g + 3 g' T + g'' T^2 / 2) s^2

is the quintic whose value and derivatives are g, g', g'' at the start and zero at the end.
"""

from __future__ import annotations

from typing import Any

#: Shortest duration, s.
SHORTEST = 0.1
#: The offset's speed is at most 1.875 g / T for an offset at rest; half the actuators' speed is
#: allowed for it.
_SPEED_FACTOR = 2 * 1.875


class Rejoining:
    """An offset that vanishes.

    Parameters
    ----------
    offset, rate, acceleration
        At the start: held setpoint minus target.
    duration
        T, s.
    """

    def __init__(self, offset: Any, rate: Any, acceleration: Any, duration: float) -> None:
        T = self._duration = duration
        rows = zip(offset, rate, acceleration, strict=True)
        self._q = [(g, 3 * g + v * T, 6 * g + 3 * v * T + a * T * T / 2) for g, v, a in rows]
        self._elapsed = 0.0

    @property
    def left(self) -> float:
        """Remaining time, s."""
        return max(0.0, self._duration - self._elapsed)

    def after(self, elapsed: float) -> tuple[Any, Any, Any] | None:
        """Return the offset and its two derivatives a further time (s) on; None after the end."""
        self._elapsed += elapsed
        T = self._duration
        s = self._elapsed / T
        u = 1.0 - s
        if not u > 0.0:
            return None
        rows = [
            (
                u * u * u * (q := c0 + (c1 + c2 * s) * s),
                u * u * (u * (dq := c1 + 2 * c2 * s) - 3 * q) / T,
                u * (6 * q - 6 * u * dq + u * u * 2 * c2) / (T * T),
            )
            for c0, c1, c2 in self._q
        ]
        x, v, a = zip(*rows, strict=True)
        return x, v, a


def rejoining_time(distance: float, speed_limit: float) -> float:
    """Return the duration (s) for the largest difference of positions `distance` (m)."""
    return max(SHORTEST, _SPEED_FACTOR * distance / speed_limit)
