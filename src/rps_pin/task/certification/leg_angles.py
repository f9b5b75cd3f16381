"""Room of the angles of a leg's universal joint to their limits, from the leg's direction alone.

With the direction u in the axes x, y, z of the joint (`rps_pin.task.point_legs`),

    u = (sin(t), -cos(t) sin(s), cos(t) cos(s)),      cos(t) = sqrt(u_y^2 + u_z^2) > 0,

s and t are known up to whole turns, which make no difference. Between limits a and b no further
apart than half a turn, s is where sin(s - a) and sin(b - s) are positive; t, between right angles,
where sin(t) is between sin(a) and sin(b). Of limits further apart, with m their middle and h half
of their distance, s is below the lower one, by less than half a turn, if

    max(cos(s - m) - cos(h), sin(s - m)) < 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rps_pin.numerics.boxes import Bounds, either

Number = Any


@dataclass(frozen=True)
class AngleRoom:
    """The room of one angle to its limits.

    Parameters
    ----------
    lower, upper
        The limits, rad.
    names
        The reasons of a box below the lower limit and above the upper one.
    second
        Whether it is t.
    """

    lower: float
    upper: float
    names: tuple[str, str]
    second: bool

    @property
    def limited(self) -> bool:
        """Whether an angle can be beyond the limits by all whole turns."""
        return self.upper - self.lower < 2 * math.pi

    @property
    def simple(self) -> bool:
        """Whether each side is a margin by itself, linear in the direction."""
        if not self.second:
            return self.upper - self.lower <= math.pi
        quarter, turn, (low, high) = math.pi / 2, 2 * math.pi, self._ends()
        near = low < quarter and high > -quarter
        return near and low + turn >= quarter and high - turn <= -quarter

    def _ends(self) -> tuple[float, float]:
        """Return the limits with their middle within half a turn of zero."""
        shift = 2 * math.pi * round((self.lower + self.upper) / (4 * math.pi))
        return self.lower - shift, self.upper - shift

    def numbers(self, x: Number, y: Number, z: Number, r: Number) -> list[Number]:
        """Return the functions whose signs decide, of u and r = cos(t)."""
        low, high = self._ends()
        if self.simple and self.second:
            low, high = max(low, -math.pi / 2), min(high, math.pi / 2)
            return [x - math.sin(low), math.sin(high) - x]
        if self.simple:
            below = -y * math.cos(low) - z * math.sin(low)
            return [below, z * math.sin(high) + y * math.cos(high)]
        middle, least = (low + high) / 2, math.cos((high - low) / 2)
        c, s = math.cos(middle), math.sin(middle)
        # Sine and cosine of the angle, times r for s.
        sine, cosine, size = (x, r, 1.0) if self.second else (-y, z, r)
        above = sine * c - cosine * s
        return [cosine * c + sine * s - least * size, above, -above]

    def bounds(self, of_numbers: Iterator[Bounds]) -> list[Bounds]:
        """Return bounds of the room below and above, from those of the numbers."""
        if self.simple:
            return [next(of_numbers), next(of_numbers)]
        within, above, below = (next(of_numbers) for _ in range(3))
        return [either(within, above), either(within, below)]


def angle_rooms(
    limits: Sequence[Sequence[float]], names: Sequence[tuple[str, str]]
) -> list[AngleRoom]:
    """Return the rooms of s and t of a leg, of limits (2, 2), where they have any."""
    found = [
        AngleRoom(float(low), float(high), name, second)
        for (low, high), name, second in zip(limits, names, (False, True), strict=True)
    ]
    return [one for one in found if one.limited]
