"""Limits of lengths, angles and cones: their tolerance, and by how much a pose keeps them.

The margins are made of cosines where the limits are angles, so that they take no arctangents. A
pose with positive margins keeps its limits; any other has to be checked by its angles.
"""

from __future__ import annotations

from rps_pin.numerics.elementary import Number, greatest, least, less, select
from rps_pin.rps.kernels.tips import Three

#: Limits are kept to rounding error: angles in rad, lengths relative to their limits.
LIMIT_TOLERANCE = 1e-12
_LESS, _MORE = 1.0 - LIMIT_TOLERANCE, 1.0 + LIMIT_TOLERANCE


def within(value: Number, lower: Number, upper: Number) -> Number:
    """Return whether an angle keeps its limits, to rounding: a product of two conditions."""
    return (value >= lower - LIMIT_TOLERANCE) * (value <= upper + LIMIT_TOLERANCE)


def length_within(value: Number, lower: Number, upper: Number) -> Number:
    """Return whether a length keeps its limits, which are not negative, to rounding."""
    return (value >= lower * _LESS) * (value <= upper * _MORE)


def length_margin(d: Three, lower: Number, upper: Number) -> Number:
    """Return how far the lengths, m, are within their limits, at most."""
    below, above = least(*d) - lower, upper - greatest(*d)
    return select(less(below, above), below, above) - LIMIT_TOLERANCE * greatest(*d)


def angle_margin(
    cosine: Three, sine: Three, middle: tuple[Number, Number], cosine_of_half: Number
) -> Number:
    """Return how far the leg angles are within their limits, as a difference of cosines.

    cos(phi - middle) >= cos(half), where `middle` is the cosine and sine of the middle between the
    limits, and half is half of what lies between them.
    """
    c, s = middle
    inside = [c * one + s * other for one, other in zip(cosine, sine, strict=True)]
    return least(*inside) - cosine_of_half - LIMIT_TOLERANCE


def cone_margin(cone_cosine: Three, cosine_of_limit: Number) -> Number:
    """Return how far the spherical joints are within their cones, as a difference of cosines."""
    return least(*cone_cosine) - cosine_of_limit - LIMIT_TOLERANCE
