"""Forces that move the legs, and actuator forces that do a given virtual work.

The virtual work of the legs' axial forces F in the motions x = (z, h tilt_x, h tilt_y) is K' F,
with K = d(length)/dx. F of K' F = needed is found by cofactors; so is x' of K x' = d'.
"""

from __future__ import annotations

from collections.abc import Sequence

from rps_pin.closed_loop.dynamics.passive_joint_forces import friction_force
from rps_pin.numerics.elementary import Number, less, select
from rps_pin.rps.kernels.platform import Vector
from rps_pin.rps.kernels.tilt_functions import TiltFunctions
from rps_pin.rps.kernels.tips import Slopes, Three

__all__ = ["friction_force"]
#: Rows of a 3 x 3 matrix: K by legs, columns z, h tilt_x and h tilt_y.
Rows = Sequence[Three]


def rod_force(
    mass: Number, com: Number, d: Number, motion: tuple[Number, Number, Number], weight: Number
) -> Number:
    """Return the force along the leg that moves its rod.

    `com` is the distance of the rod's centre of mass behind the tip; `motion` holds phi', phi'' and
    d''; `weight` is gravity along the leg, s . gravity.
    """
    angle_rate, _, acceleration = motion
    return mass * (acceleration - (d - com) * (angle_rate * angle_rate) - weight)


def cylinder_moment(
    moment: Number, inertia: Number, angle_acceleration: Number, fall: Number
) -> Number:
    """Return the moment about the revolute joint that turns a cylinder.

    `moment` is its mass times its centre of mass, `inertia` that about the joint, `fall` gravity
    across the leg, t . gravity.
    """
    return inertia * angle_acceleration - moment * fall


def rod_moment(
    mass: Number, reach: Number, coriolis: Number, angle_acceleration: Number, fall: Number
) -> Number:
    """Return the moment about the revolute joint that moves a rod's centre of mass.

    `reach` is its distance from the joint, `coriolis` is 2 d' phi'.
    """
    return mass * reach * (reach * angle_acceleration + coriolis - fall)


def virtual_work(
    slopes: Slopes, radial: Three, height: Three, force: Vector, couple: tuple[Number, Number]
) -> Three:
    """Return the virtual work needed by z, h tilt_x and h tilt_y.

    Parameters
    ----------
    slopes
        Of the tips.
    radial, height
        `resultant` of the forces that push the tips across their legs, along e_i and up.
    force
        On the platform at its centre, base axes.
    couple
        Generalised moment by tilt_x and tilt_y over h; see `tilt_couple`.
    """
    (rx_m, rx_x, rx_y), (ry_m, ry_x, ry_y), (_, zx_x, zx_y), (_, zy_x, zy_y) = slopes
    # The rings' vectors are twice the centre's displacement.
    pull_x, pull_y = radial[1] + 0.5 * force[0], radial[2] + 0.5 * force[1]
    return (
        height[0] + force[2],
        radial[0] * rx_m
        + (pull_x * rx_x + pull_y * rx_y)
        + (height[1] * zx_x + height[2] * zx_y)
        + couple[0],
        radial[0] * ry_m
        + (pull_x * ry_x + pull_y * ry_y)
        + (height[1] * zy_x + height[2] * zy_y)
        + couple[1],
    )


def tilt_couple(x: Number, y: Number, tilt: TiltFunctions, moment: Vector) -> tuple[Number, Number]:
    """Return the generalised moment by tilt_x and tilt_y of a moment in platform axes.

    d(omega)/dw' = 1 + (w_y, -w_x) (D (w_y, -w_x, 0) + B z)'.
    """
    spin = tilt[3] * (moment[1] * x - moment[0] * y) + tilt[1] * moment[2]
    return moment[0] + y * spin, moment[1] - x * spin


def cofactors(rows: Rows) -> tuple[tuple[Vector, Vector, Vector], Number]:
    """Return the cofactors of a 3 x 3 matrix, row by row, and its determinant.

    With C the cofactors: the inverse is C' / det.
    """
    (a, b, c), (d, e, f), (g, h, i) = rows
    first = (e * i - f * h, f * g - d * i, d * h - e * g)
    return (
        (
            first,
            (c * h - b * i, a * i - c * g, b * g - a * h),
            (b * f - c * e, c * d - a * f, a * e - b * d),
        ),
        a * first[0] + b * first[1] + c * first[2],
    )


def is_regular(
    cofactor: Rows, over_determinant: Number, shortest: Number, cosine: Number, most: float
) -> Number:
    """Return whether the legs hold the platform by far.

    Parameters
    ----------
    cofactor, over_determinant
        Of K, and one over its determinant.
    shortest
        The least leg length over h.
    cosine
        Of the tilt's angle.
    most
        Size of the legs' forces for a unit force on the platform.
    """
    gain = squared_norm(cofactor) * (over_determinant * over_determinant)
    # The legs' planes hold the platform with forces that grow like 1 / cos(|w| / 2), whose square
    # is (1 + C) / 2, and a leg turns as fast as its tip moves over its length.
    lever = select(less(shortest, 1.0), shortest, 1.0)
    return gain < most**2 * (lever * lever) * (0.5 + 0.5 * cosine)


def row_products(rows: Rows, vector: Three) -> Vector:
    """Return M v: of K, the legs' speeds of a pose's rate."""
    first, second, third = rows
    x, y, z = vector
    return (
        first[0] * x + first[1] * y + first[2] * z,
        second[0] * x + second[1] * y + second[2] * z,
        third[0] * x + third[1] * y + third[2] * z,
    )


def column_products(rows: Rows, vector: Three) -> Vector:
    """Return M' v: of K, the wrench on the pose of actuator forces."""
    first, second, third = rows
    x, y, z = vector
    return (
        first[0] * x + second[0] * y + third[0] * z,
        first[1] * x + second[1] * y + third[1] * z,
        first[2] * x + second[2] * y + third[2] * z,
    )


def squared_norm(rows: Rows) -> Number:
    """Return the sum of the squares of a matrix's entries."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
