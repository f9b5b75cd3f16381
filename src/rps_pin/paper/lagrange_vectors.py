"""The platform's centre and axes as functions of the paper's six coordinates (d, phi).

With s_i = -cos(phi_i) e_i + sin(phi_i) z along leg i and t_i = ds_i/dphi_i, Eq. 7 puts the tips at

    B_i = g e_i + d_i s_i,    dB_i/dd_i = s_i,    dB_i/dphi_i = d_i t_i,

and the tips hold the platform (Eq. 2):

    P = (B_1 + B_2 + B_3)/3,   u = (B_1 - P)/h,   v = (B_2 - B_3)/(sqrt(3) h),   n = u x v.

Where the robot is closed (Eq. 8), (u, v, n) are the columns of the platform's rotation. Elsewhere
they are not orthonormal; all the same they are smooth, which is all that Lagrange's equations of
the first kind ask: what they say of the forces depends only on the energy of closed motions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.rates import times

_UP = np.array([0.0, 0.0, 1.0])


class LegVectors(NamedTuple):
    """Unit vectors in the plane of each leg, base axes."""

    along: Array
    """s_i, towards the tip, shape (..., 3 legs, 3)."""
    across: Array
    """t_i = ds_i/dphi_i, shape (..., 3 legs, 3)."""


class MovingVectors(NamedTuple):
    """Vectors that depend on the coordinates x = (d, phi), with their derivatives; base axes."""

    value: Array
    """Shape (..., k, 3)."""
    jacobian: Array
    """dr/dx, shape (..., k, 3, 6)."""
    jacobian_rate: Array
    """Its time derivative at the rate x', shape (..., k, 3, 6)."""


def leg_vectors(angle: Array) -> LegVectors:
    """Return the legs' unit vectors for leg angles of shape (..., 3), rad."""
    cosine, sine = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return LegVectors(-cosine * RADIAL + sine * _UP, sine * RADIAL + cosine * _UP)


def tip_vectors(
    base_radius: float, length: Array, angle: Array, speed: Array, angle_rate: Array
) -> MovingVectors:
    """Return the tips B_i (m) with their derivatives; k = 3 legs.

    Parameters
    ----------
    base_radius
        The paper's g, m.
    length, angle, speed, angle_rate
        d, phi, d' and phi', shape (..., 3) each.
    """
    s, t = leg_vectors(angle)
    d, dd, dphi = length[..., None], speed[..., None], angle_rate[..., None]
    # By (d, phi), and its time derivative with s' = phi' t and t' = -phi' s.
    by_leg = (s, d * t), (dphi * t, dd * t - d * dphi * s)
    own = np.eye(3)[:, None, :]  # a tip moves with its own leg only
    jacobians = (np.concatenate([part[..., None] * own for part in pair], -1) for pair in by_leg)
    return MovingVectors(base_radius * RADIAL + d * s, *jacobians)


def platform_vectors(tips: MovingVectors, platform_radius: float, rate: Array) -> MovingVectors:
    """Return P (m), u, v and n, in this order, with their derivatives; k = 4.

    Parameters
    ----------
    tips
        As `tip_vectors` returns them.
    platform_radius
        The paper's h, m.
    rate
        x' = (d', phi'), shape (..., 6).
    """
    third, root = 1 / 3, math.sqrt(3.0)
    weights = np.array([[third] * 3, [2 * third, -third, -third], [0, 1 / root, -1 / root]])
    weights[1:] /= platform_radius
    value = weights @ tips.value
    jacobian = np.einsum("al,...lki->...aki", weights, tips.jacobian)
    jacobian_rate = np.einsum("al,...lki->...aki", weights, tips.jacobian_rate)

    u, v = skew(value[..., 1, :]), skew(value[..., 2, :])
    u_x, v_x = jacobian[..., 1, :, :], jacobian[..., 2, :, :]
    du, dv = skew(times(u_x, rate)), skew(times(v_x, rate))
    # n = u x v: dn/dx = u x dv/dx - v x du/dx, and its time derivative by the product rule.
    n_x = u @ v_x - v @ u_x
    n_x_rate = (
        du @ v_x - dv @ u_x + u @ jacobian_rate[..., 2, :, :] - v @ jacobian_rate[..., 1, :, :]
    )
    n = np.cross(value[..., 1, :], value[..., 2, :])
    return MovingVectors(
        np.concatenate([value, n[..., None, :]], axis=-2),
        np.concatenate([jacobian, n_x[..., None, :, :]], axis=-3),
        np.concatenate([jacobian_rate, n_x_rate[..., None, :, :]], axis=-3),
    )


def skew(vector: Array) -> Array:
    """Return [a]x with [a]x b = a x b, shape (..., 3, 3), of vectors (..., 3)."""
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix
