"""What a reading of the encoders says, once its legs' directions are followed, in plain floats."""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.control.estimator.exponential_map import coefficients
from rps_pin.control.estimator.place import Place
from rps_pin.control.estimator.scalar_rates import (
    LegGains,
    Twist,
    leg_gains,
    platform_twist,
    pose_rate,
)
from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kinematics.tracking import Lengths, Triple, Way, pose_of


class Reading(NamedTuple):
    """Where the robot is, and how it moves."""

    place: Place
    rate: Triple
    """Of the pose."""
    twist: Twist
    """Of the platform."""
    gains: LegGains


@compiled
def reading_of(d: Lengths, way: Way, speed: Triple, g: float, h: float) -> Reading | None:
    """Return what lengths and speeds say; None where speeds give no rate (type II)."""
    pose = pose_of(d, way, g, h)
    _, wx, wy = pose
    coefficient = coefficients(wx * wx + wy * wy)
    gains = leg_gains(pose, way, coefficient, h)
    if gains.determinant == 0.0:
        return None
    rate = pose_rate(gains, speed)
    twist = platform_twist(pose, rate, coefficient, h)
    angle = (math.atan2(way[3], way[0]), math.atan2(way[4], way[1]), math.atan2(way[5], way[2]))
    return Reading(Place(pose, d, angle, way, coefficient), rate, twist, gains)
