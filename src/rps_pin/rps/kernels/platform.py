"""The platform: rotation, quaternion, angular velocity and acceleration, and the wrench it needs.

With w = (x, y, 0) the rotation vector, and A, B, C, D of `tilt_functions`,

    R v = C v + A w x v + B w (w . v),     omega = w' - B w x w' + D w x (w x w')  (platform axes).

Since w x w' is vertical, the angular velocity in base axes differs only in the sign of its third
component. Vectors are triples of numbers; the moment of inertia is (xx, yy, zz, xy, xz, yz).
"""

from __future__ import annotations

from rps_pin.numerics.elementary import Number
from rps_pin.numerics.stumpff import stumpff
from rps_pin.rps.kernels.tilt_functions import TiltFunctions

Vector = tuple[Number, Number, Number]
Inertia = tuple[Number, Number, Number, Number, Number, Number]


def rotation(x: Number, y: Number, tilt: TiltFunctions) -> tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation from platform to base axes."""
    a, b, c = tilt[0], tilt[1], tilt[2]
    bxy = b * x * y
    return (
        (c + b * x * x, bxy, a * y),
        (bxy, c + b * y * y, -a * x),
        (-a * y, a * x, c),
    )


def quaternion(x: Number, y: Number) -> Vector:
    """Return the components x, y and w of the unit quaternion; z is zero."""
    half = stumpff(0.25 * (x * x + y * y))
    return 0.5 * x * half[1], 0.5 * y * half[1], half[0]


def to_base(x: Number, y: Number, tilt: TiltFunctions, vector: Vector) -> Vector:
    """Return R v: a vector in platform axes turned to base axes."""
    v_x, v_y, v_z = vector
    a, b, c = tilt[0], tilt[1], tilt[2]
    along, lift = b * (x * v_x + y * v_y), a * v_z
    return (
        c * v_x + y * lift + along * x,
        c * v_y - x * lift + along * y,
        c * v_z + a * (x * v_y - y * v_x),
    )


def to_platform(x: Number, y: Number, tilt: TiltFunctions, vector: Vector) -> Vector:
    """Return R' v: a vector in base axes turned to platform axes."""
    return to_base(-x, -y, tilt, vector)


def angular_velocity(x: Number, y: Number, dx: Number, dy: Number, tilt: TiltFunctions) -> Vector:
    """Return the angular velocity in platform axes."""
    m = x * dy - y * dx
    n = tilt[3] * m
    return dx + n * y, dy - n * x, -tilt[1] * m


def angular_acceleration(
    x: Number,
    y: Number,
    dx: Number,
    dy: Number,
    ddx: Number,
    ddy: Number,
    tilt: TiltFunctions,
) -> Vector:
    """Return the time derivative of the angular velocity in platform axes."""
    b, d, b_s, d_s = tilt[1], tilt[3], tilt[5], tilt[6]
    ds = 2.0 * (x * dx + y * dy)
    m, dm = x * dy - y * dx, x * ddy - y * ddx
    n, dn = d * m, d_s * ds * m + d * dm
    return (
        ddx + dn * y + n * dy,
        ddy - dn * x - n * dx,
        -(b_s * ds * m + b * dm),
    )


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def total(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def inertia_times(inertia: Inertia, vector: Vector) -> Vector:
    """Return the moment of inertia times a vector."""
    xx, yy, zz, xy, xz, yz = inertia
    v_x, v_y, v_z = vector
    return (
        xx * v_x + xy * v_y + xz * v_z,
        xy * v_x + yy * v_y + yz * v_z,
        xz * v_x + yz * v_y + zz * v_z,
    )


def principal_times(inertia: Inertia, vector: Vector) -> Vector:
    """Return the same for an inertia without products: xy = xz = yz = 0."""
    return inertia[0] * vector[0], inertia[1] * vector[1], inertia[2] * vector[2]


def turning_moment(omega: Vector, spin: Vector, spin_rate: Vector) -> Vector:
    """Return I alpha + omega x I omega, with spin = I omega and spin_rate = I alpha (Euler)."""
    return total(spin_rate, cross(omega, spin))


def offset_force(moment: Vector, omega: Vector, alpha: Vector) -> Vector:
    """Return alpha x S + omega x (omega x S), S the mass times the offset of its centre."""
    return total(cross(alpha, moment), cross(omega, cross(omega, moment)))
