"""Measures of the scaled Jacobian: determinant, conditioning and force transmission.

All three come from the dimensionless Jacobian K = d(length)/d(z, h tilt_x, h tilt_y) and are zero
exactly at a parallel (type II) singularity, where the platform can move with its legs locked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.rps.kernels.platform import cross


class Measures(NamedTuple):
    """Measures of K, each dimensionless and of shape (...); zero at a type II singularity."""

    determinant: Array
    """det K; its sign tells the two sides of a singularity apart."""
    conditioning: Array
    """1 / cond(K), smallest over largest singular value: 0 at a singularity, 1 at best."""
    transmission: Array
    """Load carried per unit of actuator force. A load of norm 1 N, as (F_z, M_x/h, M_y/h) in the
    pose's coordinates, asks at most 1/transmission N of any actuator."""


def measures(jacobian: Array | Sequence[Sequence[Array]]) -> Measures:
    """Return determinant, conditioning and force transmission of K, shape (3 legs, 3, ...).

    The actuator forces f that hold a load w satisfy K' f = w. Actuator i's largest force for
    |w| = 1 is the norm of column i of K^-1, |k_j x k_k| / |det K| with k the rows of K, so that
    transmission = |det K| / max_i |k_j x k_k|: the least distance of a row from the plane of the
    other two.

    The singular values s_1 >= s_2 >= s_3 of K come from the eigenvalues of K K' in closed form
    (the trigonometric solution of the cubic) for the two large ones, and s_3 = |det K|/(s_1 s_2),
    which does not lose digits near a singularity.
    """
    k1, k2, k3 = ((row[0], row[1], row[2]) for row in jacobian)
    normal = (cross(k2, k3), cross(k3, k1), cross(k1, k2))
    determinant = _dot(k1, normal[0])
    largest_area = np.sqrt(np.maximum.reduce([_dot(n, n) for n in normal]))

    # A = K K': mean eigenvalue m, A - m I = p B with tr(B^2) = 6 and det(B) = 2 cos(3 t).
    a11, a22, a33 = _dot(k1, k1), _dot(k2, k2), _dot(k3, k3)
    a12, a13, a23 = _dot(k1, k2), _dot(k1, k3), _dot(k2, k3)
    m = (a11 + a22 + a33) / 3
    b11, b22, b33 = a11 - m, a22 - m, a33 - m
    p = np.sqrt((b11**2 + b22**2 + b33**2 + 2 * (a12**2 + a13**2 + a23**2)) / 6)
    det_b = (
        b11 * (b22 * b33 - a23**2) - a12 * (a12 * b33 - a23 * a13) + a13 * (a12 * a23 - b22 * a13)
    )
    cosine = np.clip(_ratio(det_b, 2 * p**3), -1.0, 1.0)  # rounding only
    turn = np.arccos(cosine) / 3
    first = m + 2 * p * np.cos(turn)  # s_1^2
    third = m + 2 * p * np.cos(turn + 2 * np.pi / 3)
    second = 3 * m - first - third  # s_2^2
    # s_3 / s_1 = |det K| / (s_1^2 s_2)
    conditioning = _ratio(np.abs(determinant), first * np.sqrt(np.maximum(second, 0.0)))
    return Measures(
        determinant,
        np.minimum(conditioning, 1.0),  # rounding only
        _ratio(np.abs(determinant), largest_area),
    )


def _ratio(numerator: Array, denominator: Array) -> Array:
    """Return the quotient, and 0 where the denominator is 0 (then the numerator is 0 too)."""
    out = np.zeros_like(numerator)
    np.divide(numerator, denominator, out=out, where=denominator > 0)
    return out


def _dot(u: tuple[Array, ...], v: tuple[Array, ...]) -> Array:
    product: Array = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    return product
