"""Eq. 8: residuals, slopes, determinant and Newton's step of the equations that close the robot.

A leg of length d_i at angle phi_i carries its tip w_i = d_i cos(phi_i) inwards and z_i = d_i
sin(phi_i) up. For the pairs (1, 2), (2, 3), (3, 1), with m_i = 3 g - w_i,

    f_ij = |B_i - B_j|^2 - 3 h^2 = m_i m_j - 2 z_i z_j + d_i^2 + d_j^2 - 6 g^2 - 3 h^2,
    df_ij/dphi_i = m_j z_i - 2 z_j w_i.

Each equation has two of the three angles in it: the Jacobian is

    [ a1 a2  0 ]
    [  0 b2 b3 ]     determinant  a1 b2 c3 + a2 b3 c1.
    [ c1  0 c3 ]

Norms are the greatest sum of a row's sizes, angles in rad. They judge, and are not differentiated:
of complex numbers they take the modulus.
"""

from __future__ import annotations

import math

from rps_pin.numerics.elementary import Number, greatest, sqrt
from rps_pin.rps.kernels.tips import Ring, Three

#: a1, a2, b2, b3, c3, c1.
Slopes = tuple[Number, Number, Number, Number, Number, Number]
#: Row by row.
Matrix = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]

_ROOT_3 = math.sqrt(3.0)


def constants(d: Three, g: Number, h: Number) -> Ring:
    """Return what of f_12, f_23 and f_31 does not change with the angles, m^2."""
    square_1, square_2, square_3 = d[0] * d[0], d[1] * d[1], d[2] * d[2]
    rest = 6.0 * g * g + 3.0 * h * h
    return square_1 + square_2 - rest, square_2 + square_3 - rest, square_3 + square_1 - rest


def residuals(w: Three, z: Three, g: Number, constant: Three) -> Ring:
    """Return f_12, f_23 and f_31, m^2."""
    m1, m2, m3 = 3.0 * g - w[0], 3.0 * g - w[1], 3.0 * g - w[2]
    return (
        m1 * m2 - 2.0 * z[0] * z[1] + constant[0],
        m2 * m3 - 2.0 * z[1] * z[2] + constant[1],
        m3 * m1 - 2.0 * z[2] * z[0] + constant[2],
    )


def slopes(w: Three, z: Three, g: Number) -> Slopes:
    """Return the derivatives by the angles, a1, a2, b2, b3, c3, c1, m^2."""
    m1, m2, m3 = 3.0 * g - w[0], 3.0 * g - w[1], 3.0 * g - w[2]
    w1, w2, w3 = 2.0 * w[0], 2.0 * w[1], 2.0 * w[2]
    z1, z2, z3 = z
    return (
        m2 * z1 - z2 * w1,
        m1 * z2 - z1 * w2,
        m3 * z2 - z3 * w2,
        m2 * z3 - z2 * w3,
        m1 * z3 - z1 * w3,
        m3 * z1 - z3 * w1,
    )


def determinant(by_angle: Slopes) -> Number:
    """Return the determinant of the Jacobian, m^6."""
    a1, a2, b2, b3, c3, c1 = by_angle
    return a1 * b2 * c3 + a2 * b3 * c1


def determinant_scale(d: Three, h: Number) -> Number:
    """Return the unit in which the determinant is one of cosines, -1 to 1: m^6."""
    side = 2.0 * _ROOT_3 * h
    return side * side * side * d[0] * d[1] * d[2]


def adjugate(by_angle: Slopes) -> Matrix:
    """Return the adjugate of the Jacobian, m^4: the inverse times the determinant."""
    a1, a2, b2, b3, c3, c1 = by_angle
    return (
        *(b2 * c3, -a2 * c3, a2 * b3),
        *(b3 * c1, a1 * c3, -a1 * b3),
        *(-b2 * c1, a2 * c1, a1 * b2),
    )


def matrix_times(matrix: Matrix, f: Three, scale: Number) -> Ring:
    """Return a matrix times three residuals, times a number."""
    m11, m12, m13, m21, m22, m23, m31, m32, m33 = matrix
    f12, f23, f31 = f
    return (
        (m11 * f12 + m12 * f23 + m13 * f31) * scale,
        (m21 * f12 + m22 * f23 + m23 * f31) * scale,
        (m31 * f12 + m32 * f23 + m33 * f31) * scale,
    )


def turned(w: Number, z: Number, t: Number) -> tuple[Number, Number]:
    """Return the vector (w, z) turned by 2 atan(t): a Newton step of 2 t, to second order."""
    sine = 2.0 * t / (1.0 + t * t)  # 1 - cosine is t sine
    return w - sine * (z + t * w), z + sine * (w - t * z)


def unit_length(w: Number, z: Number) -> tuple[Number, Number]:
    """Return a vector of length close to 1 with the length 1, to second order."""
    scale = 1.5 - 0.5 * (w * w + z * z)
    return scale * w, scale * z


def distance_errors(w: Three, z: Three, g: Number, h: Number) -> Ring:
    """Return |B_i - B_j| - sqrt(3) h for each pair, m, without the cancellation of Eq. 8."""
    r1, r2, r3 = g - w[0], g - w[1], g - w[2]
    z12, z23, z31 = z[0] - z[1], z[1] - z[2], z[2] - z[0]
    side = _ROOT_3 * h
    return (
        sqrt(r1 * r1 + r2 * (r1 + r2) + z12 * z12) - side,
        sqrt(r2 * r2 + r3 * (r2 + r3) + z23 * z23) - side,
        sqrt(r3 * r3 + r1 * (r3 + r1) + z31 * z31) - side,
    )


def jacobian_norm(by_angle: Slopes) -> Number:
    """Return the norm of the Jacobian, m^2."""
    a1, a2, b2, b3, c3, c1 = by_angle
    return greatest(abs(a1) + abs(a2), abs(b2) + abs(b3), abs(c3) + abs(c1))


def matrix_norm(matrix: Matrix) -> Number:
    """Return the norm of a full matrix."""
    m11, m12, m13, m21, m22, m23, m31, m32, m33 = matrix
    return greatest(
        abs(m11) + abs(m12) + abs(m13),
        abs(m21) + abs(m22) + abs(m23),
        abs(m31) + abs(m32) + abs(m33),
    )


def largest(values: Three) -> Number:
    """Return the largest size of three numbers."""
    return greatest(abs(values[0]), abs(values[1]), abs(values[2]))


def curvature_bound(d: Three, g: Number) -> Number:
    """Return L, a bound of |f''|, m^2: f_ij'' is at most 3 g (d_i + d_j) + 8 d_i d_j."""
    d1, d2, d3 = d
    reach = 3.0 * g
    return greatest(
        reach * (d1 + d2) + 8.0 * d1 * d2,
        reach * (d2 + d3) + 8.0 * d2 * d3,
        reach * (d3 + d1) + 8.0 * d3 * d1,
    )
