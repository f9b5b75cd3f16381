"""Leg lengths, leg angles and d(length)/d(pose) of many poses, in closed form.

With the tilt w = beta n (n a unit vector of the base plane), a = sin(beta)/beta,
b = (1 - cos(beta))/beta^2 and c = cos(beta), tip i is in the plane of its leg at

    height          z_i   = z + h a (w x e_i)_z,
    radial distance rho_i = h (c + b w' Q_i w),
    with            Q_i   = e_i e_i' + 1/2 [[e_x, -e_y], [-e_y, -e_x]],

where the second term of Q_i is the centre's parasitic motion (Eq. 4) along e_i. Then (Eq. 7)

    d_i cos(phi_i) = g - rho_i,     d_i sin(phi_i) = z_i,

and row i of the Jacobian is the leg's direction dotted with the tip's velocity,

    d(d_i)/dx = -cos(phi_i) d(rho_i)/dx + sin(phi_i) d(z_i)/dx,     x = (z, w_x, w_y).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.rps.kinematics.legs import RADIAL

#: Q_i as (Q_xx, Q_xy, Q_yy), shape (3 legs, 3).
_Q = np.stack(
    [
        RADIAL[:, 0] ** 2 + RADIAL[:, 0] / 2,
        RADIAL[:, 0] * RADIAL[:, 1] - RADIAL[:, 1] / 2,
        RADIAL[:, 1] ** 2 - RADIAL[:, 0] / 2,
    ],
    axis=-1,
)


class LegJacobian(NamedTuple):
    """Legs of many poses and how their lengths change with the pose."""

    length: Array
    """The paper's d, shape (..., 3), m."""
    angle: Array
    """The paper's phi, shape (..., 3), rad."""
    jacobian: Array
    """d(length)/d(z, h tilt_x, h tilt_y), shape (..., 3 legs, 3), dimensionless: the tilt's columns
    are divided by the platform's radius h."""


def leg_jacobian(pose: Array, base_radius: float, platform_radius: float) -> LegJacobian:
    """Return leg lengths, leg angles and the scaled Jacobian of their lengths.

    Parameters
    ----------
    pose
        (z, tilt_x, tilt_y), shape (..., 3), m and rad.
    base_radius, platform_radius
        The paper's g and h, m.
    """
    g, h = base_radius, platform_radius
    z, wx, wy = np.moveaxis(pose, -1, 0)
    beta = np.hypot(wx, wy)
    level = beta == 0
    safe = np.where(level, 1.0, beta)
    nx, ny = np.where(level, 1.0, wx / safe), wy / safe  # a level pose has any direction
    a = np.sinc(beta / np.pi)
    b = np.sinc(beta / (2 * np.pi)) ** 2 / 2
    c = np.cos(beta)

    length, angle = np.empty(pose.shape), np.empty(pose.shape)
    jacobian = np.empty((*pose.shape, 3))
    for i in range(3):
        (ex, ey, _), (qxx, qxy, qyy) = RADIAL[i], _Q[i]
        across = nx * ey - ny * ex  # (n x e_i)_z
        qx, qy = qxx * wx + qxy * wy, qxy * wx + qyy * wy  # Q w
        q = nx * (qxx * nx + qxy * ny) + ny * (qxy * nx + qyy * ny)  # n' Q n
        height = z + h * a * beta * across
        inwards = g - h * (c + b * beta**2 * q)
        d = np.hypot(inwards, height)
        length[..., i] = d
        angle[..., i] = np.arctan2(height, inwards)
        d = np.where(d == 0, 1.0, d)  # a leg of no length has no direction: a row of zeros
        cosine, sine = inwards / d, height / d
        # da = (c - a) n/beta . dw, dc = -a w . dw, db = (a - 2 b) w/beta^2 . dw
        radial = (a - 2 * b) * q - a
        jacobian[..., i, 0] = sine
        jacobian[..., i, 1] = sine * (a * ey + (c - a) * across * nx)
        jacobian[..., i, 1] -= cosine * (2 * b * qx + radial * wx)
        jacobian[..., i, 2] = sine * (-a * ex + (c - a) * across * ny)
        jacobian[..., i, 2] -= cosine * (2 * b * qy + radial * wy)
    return LegJacobian(length, angle, jacobian)
