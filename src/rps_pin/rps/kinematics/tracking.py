"""Lengths followed one step after the other, in plain floats: for calls in a loop.

Ten times faster than arrays of three. The steps are those of `rps_pin.rps.kernels.continuation`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kernels.continuation import follow_legs, newton_step
from rps_pin.rps.kernels.placement import pose_of_legs

Triple = tuple[float, float, float]
#: Three leg lengths, m.
Lengths = Triple
#: Cosines, then sines, of the three leg angles.
Way = tuple[float, float, float, float, float, float]


class Followed(NamedTuple):
    """How far lengths were followed."""

    way: Way
    """Directions of the legs there."""
    condition: float
    """Condition number of Eq. 8's Jacobian there (before the last Newton step, below 2e-9 rad)."""
    fraction: float
    """How much of the line was gone: 1 where the lengths wanted were reached."""


def direction_of_legs(angle: Triple) -> Way:
    """Return the cosines, then the sines, of the leg angles, rad."""
    phi1, phi2, phi3 = angle
    return (
        *(math.cos(phi1), math.cos(phi2), math.cos(phi3)),
        *(math.sin(phi1), math.sin(phi2), math.sin(phi3)),
    )


@compiled
def condition_of(d: Lengths, way: Way, g: float, h: float) -> float:
    """Return the condition number of Eq. 8's Jacobian by leg angles, in greatest row sums."""
    condition: float = newton_step(d, way, g, h)[2]
    return condition


@compiled
def follow(
    begin: Lengths, way: Way, goal: Lengths, g: float, h: float, limit: float, most: int
) -> Followed:
    """Follow leg lengths in at most so many steps; see `continuation.follow_legs`."""
    start = (0.0, 1.0, math.inf)
    there, progress = follow_legs(begin, way, goal, (g, h), limit, start, most)
    return Followed(there, progress[2], progress[0])


@compiled
def pose_of(d: Lengths, way: Way, g: float, h: float) -> Triple:
    """Return the pose (z, tilt_x, tilt_y) of lengths and directions that close the robot."""
    return pose_of_legs(d, way, g, h)
