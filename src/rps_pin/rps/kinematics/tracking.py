"""Leg lengths followed one step at a time, on floats, for calls in a control loop.

Ten times faster than on arrays of three. The steps are those of `rps_pin.rps.kernels.continuation`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.rps.kernels.continuation import follow_legs, newton_step
from rps_pin.rps.kernels.placement import pose_of_legs

Triple = tuple[float, float, float]
#: Three leg lengths, m.
Lengths = Triple
#: Cosines, then sines, of the three leg angles.
LegDirections = tuple[float, float, float, float, float, float]


class Followed(NamedTuple):
    """Result of following leg lengths."""

    directions: LegDirections
    """Of the legs at its end."""
    condition: float
    """Condition number of Eq. 8's Jacobian there (before the last Newton step, below 2e-9 rad)."""
    fraction: float
    """Part of the line that was followed, 1 where its end was reached."""


def condition_of(d: Lengths, directions: LegDirections, g: float, h: float) -> float:
    """Return the condition number of Eq. 8's Jacobian by leg angles, in greatest row sums."""
    condition: float = newton_step(d, directions, g, h)[2]
    return condition


def follow(
    begin: Lengths,
    directions: LegDirections,
    goal: Lengths,
    g: float,
    h: float,
    limit: float,
    most: int,
) -> Followed:
    """Follow leg lengths in at most so many steps; see `continuation.follow_legs`."""
    start = (0.0, 1.0, math.inf)
    there, progress = follow_legs(begin, directions, goal, (g, h), limit, start, most)
    return Followed(there, progress[2], progress[0])


def pose_of(d: Lengths, directions: LegDirections, g: float, h: float) -> Triple:
    """Return the pose (z, tilt_x, tilt_y) of lengths and directions that close the robot."""
    return pose_of_legs(d, directions, g, h)
