"""Leg geometry of a pose: lengths, angles and directions, and the determinant of Eq. 8.

Compositions of `rps_pin.rps.kernels` on floats in a loop, and on CasADi expressions from which
its generated code is made; so are the other modules here whose functions take numbers. Conditions
are multiplied: the product is whether all hold.

Compositions of `rps_pin.rps.kernels` on floats, compiled as a whole.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.numerics.elementary import Number, atan2
from rps_pin.rps.kernels import leg_equations, legs
from rps_pin.rps.kernels.tilt_functions import TiltFunctions, tilt_functions
from rps_pin.rps.kernels.tips import Three, at_legs, tips
from rps_pin.rps.kinematics.tracking import LegDirections, Triple

#: Largest height and leg length, in radii: powers of larger ones leave the range of floats.
LARGEST_LENGTH = 1e6
#: (tilt_x, tilt_y) are coordinates below a whole turn; see `rps_pin.rps.singularity.measures`.
_LARGEST_TILT_SQUARED = (2 * math.pi * (1 - 1e-6)) ** 2


#: A pose with its tilt functions, and its tips: rho and z_i, m.
PlatformTips = tuple[Triple, TiltFunctions, Three, Three]


class LegGeometry(NamedTuple):
    """A pose and its legs."""

    pose: Triple
    """(z, tilt_x, tilt_y)."""
    length: Triple
    """d, m."""
    angle: Triple
    """phi, rad."""
    direction: LegDirections
    """Cosines, then sines of phi."""
    tilt: TiltFunctions
    """Coefficients of the rotation and their derivatives."""


def in_range(pose: Triple, g: Number, h: Number) -> Number:
    """Return whether a pose's height is below `LARGEST_LENGTH` and its tilt below a whole turn."""
    z, x, y = pose
    return (abs(z) < LARGEST_LENGTH * (g + h)) * (x * x + y * y < _LARGEST_TILT_SQUARED)


def leg_geometry(pose: Triple, g: float, h: float) -> LegGeometry | None:
    """Return the leg geometry; None if the pose is out of range, or a leg has no length."""
    if not in_range(pose, g, h):
        return None
    platform = platform_tips(pose, h)
    return legs_to(platform, g) if legs_have_length(platform, g) else None


def platform_tips(pose: Triple, h: Number) -> PlatformTips:
    """Return the tips of a pose."""
    z, x, y = pose
    tilt = tilt_functions(x * x + y * y)
    radial, height = tips(z, x, y, tilt, h)
    return pose, tilt, at_legs(radial), at_legs(height)


def legs_have_length(platform: PlatformTips, g: Number) -> Number:
    """Return whether no leg has a length of zero."""
    _, _, (r1, r2, r3), (z1, z2, z3) = platform
    in1, in2, in3, least = g - r1, g - r2, g - r3, 1e-18 * g * g
    return (
        (in1 * in1 + z1 * z1 >= least)
        * (in2 * in2 + z2 * z2 >= least)
        * (in3 * in3 + z3 * z3 >= least)
    )


def legs_to(platform: PlatformTips, g: Number) -> LegGeometry:
    """Return the legs that carry the platform; none may have a length of zero."""
    pose, tilt, (r1, r2, r3), (z1, z2, z3) = platform
    d1, c1, s1 = legs.leg_geometry(r1, z1, g)
    d2, c2, s2 = legs.leg_geometry(r2, z2, g)
    d3, c3, s3 = legs.leg_geometry(r3, z3, g)
    angle = (atan2(s1, c1), atan2(s2, c2), atan2(s3, c3))
    return LegGeometry(pose, (d1, d2, d3), angle, (c1, c2, c3, s1, s2, s3), tilt)


def closure_determinant(geometry: LegGeometry, g: Number, h: Number) -> Number:
    """Return Eq. 8's determinant without unit, -1 to 1: `leg_equations.determinant`.

    It is 0 at type II and constraint singularities.
    """
    d, (c1, c2, c3, s1, s2, s3) = geometry.length, geometry.direction
    w = (d[0] * c1, d[1] * c2, d[2] * c3)
    z = (d[0] * s1, d[1] * s2, d[2] * s3)
    determinant = leg_equations.determinant(leg_equations.slopes(w, z, g))
    return determinant / leg_equations.determinant_scale(d, h)
