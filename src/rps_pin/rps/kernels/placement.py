"""The platform from its tips: centre, axes, tilt.

The centre is the tips' mean; the axes follow from u = (B_1 - P)/h and v = (B_2 - B_3)/(sqrt(3) h).
With legs in their planes u_y = v_x, and u_x + v_y is 1 + cos(beta) if the platform is turned by
beta about an axis in the base plane.
"""

from __future__ import annotations

import math

from rps_pin.numerics.elementary import Number, atan2, less, select, sqrt
from rps_pin.rps.kernels.platform import Vector
from rps_pin.rps.kernels.tips import Three

#: Cosines, then sines, of the three leg angles.
Direction = tuple[Number, Number, Number, Number, Number, Number]

_ROOT_3 = math.sqrt(3.0)


def platform_axes(rho: Three, z: Three, h: Number) -> tuple[Vector, Vector, Vector]:
    """Return the centre (m) and the platform's first two axes u and v, in base axes."""
    outwards, across = 0.5 * (rho[1] + rho[2]), 0.5 * (rho[1] - rho[2])
    p_x, p_y, p_z = (rho[0] - outwards) / 3.0, across / _ROOT_3, (z[0] + z[1] + z[2]) / 3.0
    u_y = -p_y / h
    return (
        (p_x, p_y, p_z),
        ((rho[0] - p_x) / h, u_y, (z[0] - p_z) / h),
        (u_y, outwards / h, (z[1] - z[2]) / (_ROOT_3 * h)),
    )


def tilt_of_axes(
    u_x: Number, u_y: Number, u_z: Number, v_y: Number, v_z: Number
) -> tuple[Number, Number]:
    """Return the rotation vector (tilt_x, tilt_y), rad, of axes turned about the base plane.

    With the quaternion (q_x, q_y, 0, q_w): v_z = 2 q_x q_w, u_z = -2 q_y q_w, u_x = 1 - 2 q_y^2,
    v_y = 1 - 2 q_x^2, u_y = 2 q_x q_y, and sin(beta/2) is the length of (q_x, q_y).
    """
    doubled = u_x + v_y  # 2 q_w^2: rounding may leave 0 to 2
    doubled = select(less(doubled, 0.0), 0.0, doubled)
    # Up to a quarter turn q_w divides well; beyond, the larger of q_x and q_y does.
    large = less(doubled, 1.0)
    twice_w = 2.0 * sqrt(select(large, 0.5, 0.5 * doubled))
    x_leads = less(v_y, u_x)
    least = select(x_leads, v_y, u_x)
    lead = sqrt(select(large, 0.5 * (1.0 - least), 0.5))
    sign = select(less(select(x_leads, v_z, -u_z), 0.0), -1.0, 1.0)
    lead, other = sign * lead, 0.5 * u_y / (sign * lead)
    q_x = select(large, select(x_leads, lead, other), v_z / twice_w)
    q_y = select(large, select(x_leads, other, lead), -u_z / twice_w)
    square = q_x * q_x + q_y * q_y
    level = less(square, 1e-18)
    half_sine = sqrt(select(level, 1.0, square))
    # Near half a turn q_w is the root of a difference: the sine 2 |(q_x, q_y)| q_w has it sharp.
    sine = sqrt(select(large, u_z * u_z + v_z * v_z, 1.0))
    q_w = select(large, 0.5 * sine / half_sine, 0.5 * twice_w)
    # beta / sin(beta/2), which tends to 2.
    factor = select(level, 2.0, 2.0 * atan2(half_sine, q_w) / half_sine)
    return q_x * factor, q_y * factor


def pose_of_legs(d: Three, direction: Direction, g: Number, h: Number) -> Vector:
    """Return (z, tilt_x, tilt_y) of legs that close the robot: their lengths and directions."""
    c1, c2, c3, s1, s2, s3 = direction
    rho = (g - d[0] * c1, g - d[1] * c2, g - d[2] * c3)
    centre, u, v = platform_axes(rho, (d[0] * s1, d[1] * s2, d[2] * s3), h)
    x, y = tilt_of_axes(u[0], u[1], u[2], v[1], v[2])
    return centre[2], x, y
