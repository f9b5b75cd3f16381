"""Where a pose puts the legs, in plain floats.

A leg's tip stands at rho_i = h (1 + B f / 2), f = e^2 - 3 t^2, and z_i = z - h A t in its plane
(see `rps_pin.rps.kinematics.rates`): Eq. 1 and 4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.control.estimator.exponential_map import Coefficients, coefficients
from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.tracking import Lengths, Triple, Way

(_E1, _E2, _E3) = ((float(x), float(y)) for x, y, _ in RADIAL)


class Place(NamedTuple):
    """A pose and its legs."""

    pose: Triple
    """(z, tilt_x, tilt_y)."""
    length: Lengths
    angle: Triple
    """Leg angles phi, rad."""
    way: Way
    """Their cosines, then their sines."""
    coefficient: Coefficients
    """Of the exponential map."""


@compiled
def place_of(pose: Triple, g: float, h: float) -> Place | None:
    """Return where a pose puts the legs, or None where one has no length."""
    z, wx, wy = pose
    coefficient = coefficients(wx * wx + wy * wy)
    a, b = coefficient[:2]
    in1, up1 = _tip(_E1, z, wx, wy, a, b, g, h)
    in2, up2 = _tip(_E2, z, wx, wy, a, b, g, h)
    in3, up3 = _tip(_E3, z, wx, wy, a, b, g, h)
    d1, d2, d3 = math.hypot(in1, up1), math.hypot(in2, up2), math.hypot(in3, up3)
    if min(d1, d2, d3) < 1e-9 * g:
        return None
    return Place(
        pose,
        (d1, d2, d3),
        (math.atan2(up1, in1), math.atan2(up2, in2), math.atan2(up3, in3)),
        (in1 / d1, in2 / d2, in3 / d3, up1 / d1, up2 / d2, up3 / d3),
        coefficient,
    )


@compiled
def turning_determinant(place: Place, g: float, h: float) -> float:
    """Return Eq. 8's determinant without unit, at least -1 and at most 1.

    The cosines' determinant of `leg_equations.determinant`: 0 at type II and constraint
    singularities.
    """
    d1, d2, d3 = place.length
    cos1, cos2, cos3, sin1, sin2, sin3 = place.way
    reach, side = 3.0 * g, 2.0 * math.sqrt(3.0) * h
    m1, m2, m3 = reach - d1 * cos1, reach - d2 * cos2, reach - d3 * cos3
    z1, z2, z3 = 2.0 * d1 * sin1, 2.0 * d2 * sin2, 2.0 * d3 * sin3
    a1, a2 = m2 * sin1 - z2 * cos1, m1 * sin2 - z1 * cos2
    b2, b3 = m3 * sin2 - z3 * cos2, m2 * sin3 - z2 * cos3
    c3, c1 = m1 * sin3 - z1 * cos3, m3 * sin1 - z3 * cos1
    return (a1 * b2 * c3 + a2 * b3 * c1) / (side * side * side)


@compiled
def _tip(
    radial: tuple[float, float],
    z: float,
    wx: float,
    wy: float,
    a: float,
    b: float,
    g: float,
    h: float,
) -> tuple[float, float]:
    """Return how far a tip is inwards of its base joint, and above."""
    ex, ey = radial
    e, t = wx * ex + wy * ey, wy * ex - wx * ey
    return g - h * (1.0 + b * (e * e - 3.0 * t * t) / 2.0), z - h * a * t
