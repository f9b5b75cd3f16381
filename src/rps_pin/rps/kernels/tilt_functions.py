"""The coefficients of a rotation by its squared tilt, from Stumpff functions.

With s the squared tilt, the coefficients of the rotation and of the angular velocity (see
`rps_pin.rps.kinematics.pose`) are A = c_1, B = c_2, C = c_0 and D = c_3 (see
`rps_pin.numerics.stumpff`).
"""

from __future__ import annotations

import numpy as np

from rps_pin.numerics.elementary import Number
from rps_pin.numerics.intervals import Enclosure, Interval, is_enclosing
from rps_pin.numerics.stumpff import Stumpff, bounds_at_ends, stumpff

#: A, B, C, D, dA/ds, dB/ds, dD/ds, d2A/ds2, d2B/ds2.
TiltFunctions = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]


def tilt_functions(s: Number) -> TiltFunctions:
    """Return A, B, C, D, dA/ds, dB/ds, dD/ds, d2A/ds2, d2B/ds2 of a squared tilt, rad^2."""
    if is_enclosing(s):
        return _enclosed(s)
    return _of_stumpff(stumpff(s))


def _of_stumpff(c: Stumpff) -> TiltFunctions:
    c0, c1, c2, c3, c4, c5, c6 = c
    b_s, d_s = c4 - 0.5 * c3, 1.5 * c5 - 0.5 * c4
    return (
        *(c1, c2, c0, c3, 0.5 * (c3 - c2), b_s, d_s, 0.5 * (d_s - b_s)),
        2.0 * c6 - 1.25 * c5 + 0.25 * c4,
    )


def _enclosed(s: Interval | Enclosure) -> TiltFunctions:
    """Return enclosures over boxes: each function is monotone, so that the ends of s bound it."""
    values = s.values if isinstance(s, Enclosure) else s
    ends = [_of_stumpff(end) for end in bounds_at_ends(values)]
    found = [one.hull(other) for one, other in zip(*ends, strict=True)]
    if not isinstance(s, Enclosure):
        return tuple(found)
    a, _, _, _, a_s, b_s, d_s, a_ss, b_ss = found
    unknown = Interval(np.full(a.lower.shape, -np.inf), np.full(a.lower.shape, np.inf))
    slopes = (a_s, b_s, -0.5 * a, d_s, a_ss, b_ss, unknown, unknown, unknown)
    return tuple(s.through(one, slope) for one, slope in zip(found, slopes, strict=True))  # type: ignore[return-value]
