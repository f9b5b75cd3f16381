"""The way back to a moving target after it was held: without a step in pose, rate or acceleration.

The goal is the target plus a gap. The gap begins as what separates the two, at rest on one side and
moving on the other, and is nothing after a time T, as smoothly: with s = t / T and u = 1 - s,

    gap = u^3 q,   q = g + (3 g + g' T) s + (6 g + 3 g' T + g'' T^2 / 2) s^2

is the polynomial of degree five whose value and first two derivatives are g, g', g'' at first and
zero at the end.
"""

from __future__ import annotations

from rps_pin.rps.kinematics.tracking import Triple

#: The way back takes no less, s.
SHORTEST = 0.1
#: Its speed is 1.875 gap / T at most, where nothing moves: T leaves it half the actuators' speed.
_SLOW = 2 * 1.875


class Rejoining:
    """A gap that closes.

    Parameters
    ----------
    gap, rate, acceleration
        At first: the goal less the target.
    duration
        Until it is closed, s.
    """

    def __init__(self, gap: Triple, rate: Triple, acceleration: Triple, duration: float) -> None:
        T = self._duration = duration
        rows = zip(gap, rate, acceleration, strict=True)
        self._q = [(g, 3 * g + v * T, 6 * g + 3 * v * T + a * T * T / 2) for g, v, a in rows]
        self._elapsed = 0.0

    @property
    def left(self) -> float:
        """Time until the gap is closed, s."""
        return max(0.0, self._duration - self._elapsed)

    def after(self, elapsed: float) -> tuple[Triple, Triple, Triple] | None:
        """Return the gap and its two derivatives after a further time, s; None if it is closed."""
        self._elapsed += elapsed
        T = self._duration
        s = self._elapsed / T
        u = 1.0 - s
        if not u > 0.0:
            return None
        gap, rate, acceleration = [], [], []
        for c0, c1, c2 in self._q:
            q, dq, ddq = c0 + (c1 + c2 * s) * s, c1 + 2 * c2 * s, 2 * c2
            gap.append(u * u * u * q)
            rate.append(u * u * (u * dq - 3 * q) / T)
            acceleration.append(u * (6 * q - 6 * u * dq + u * u * ddq) / (T * T))
        return _triple(gap), _triple(rate), _triple(acceleration)


def rejoining_time(farthest: float, speed_limit: float) -> float:
    """Return how long to take, s, where a leg has a way of `farthest` (m) to go at most."""
    return max(SHORTEST, _SLOW * farthest / speed_limit)


def _triple(values: list[float]) -> Triple:
    one, two, three = values
    return one, two, three
