"""Tolerance of the limits of lengths, angles and cones."""

from __future__ import annotations

from rps_pin.numerics.elementary import Number

#: Limits are kept to rounding error, m or rad.
LIMIT_TOLERANCE = 1e-12


def within(value: Number, lower: Number, upper: Number) -> Number:
    """Return whether a value keeps its limits, to rounding: a product of two conditions."""
    return (value >= lower - LIMIT_TOLERANCE) * (value <= upper + LIMIT_TOLERANCE)
