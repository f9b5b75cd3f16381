"""The pose of the 3-RPS's platform: where it is and how it moves.

A pose is ``(z, tilt_x, tilt_y)``: the height of the platform's centre and the platform's rotation
vector w = (tilt_x, tilt_y, 0), which lies in the base plane. With beta = |w|, s = beta^2 and

    A = sin(beta)/beta,  B = (1 - cos(beta))/beta^2,  C = cos(beta),  D = (beta - sin(beta))/beta^3

- the rotation is R = C I + A [w]x + B w w',
- the centre follows from Eq. 4, p_x = h/2 (u_x - v_y) and p_y = -h u_y, with u and v the first two
  columns of R: p_x = h/2 B (w_x^2 - w_y^2), p_y = -h B w_x w_y: the *parasitic* motion,
- the angular velocity in the platform's axes is the right Jacobian of the rotation vector times its
  rate: w' - B w x w' + D w x (w x w').

All of them are even in beta: written with s they are smooth through the level pose, where the
paper's angles (alpha, beta) are not. The paper's R = Rz(alpha) Ry(beta) Rz(-alpha) is the same
rotation for w = beta (-sin(alpha), cos(alpha), 0).

The 3-RPS can also be assembled in poses that are half turns about axes *outside* the base plane
(its other operation mode); those have no such pose and are not described here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError

#: Below this square of the tilt the coefficients are summed as power series: there the closed
#: forms cancel, and ten terms are exact to rounding.
_SERIES_BELOW = 1.0
_TERMS = range(12)
_SERIES_A = np.array([(-1.0) ** k / math.factorial(2 * k + 1) for k in _TERMS])
_SERIES_B = np.array([(-1.0) ** k / math.factorial(2 * k + 2) for k in _TERMS])
_SERIES_D = np.array([(-1.0) ** k / math.factorial(2 * k + 3) for k in _TERMS])


class PlatformMotion(NamedTuple):
    """Position and orientation of the platform with their first and second time derivatives.

    Base axes unless said otherwise; leading batch dimensions are those of the pose.
    """

    position: Array
    """Of the centre, shape (..., 3), m."""
    velocity: Array
    """Of the centre, shape (..., 3), m/s."""
    acceleration: Array
    """Of the centre, shape (..., 3), m/s^2."""
    rotation: Array
    """From platform axes to base axes, shape (..., 3, 3)."""
    angular_velocity: Array
    """In *platform* axes, shape (..., 3), rad/s."""
    angular_acceleration: Array
    """In *platform* axes, shape (..., 3), rad/s^2."""


def checked_pose(value: ArrayLike, name: str = "pose") -> Array:
    """Return a pose, or one of its time derivatives, as a finite float array of shape (..., 3).

    Raises
    ------
    InputError
        If the last dimension is not 3, or an entry is not a finite number.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers of shape (..., 3)") from None
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(
            f"{name} has shape {array.shape}; it must be (..., 3): height, tilt_x, tilt_y"
        )
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} is not finite: entry {where} is {array[where]}")
    return array


def checked_motion(
    pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> tuple[Array, Array, Array]:
    """Return pose, rate and acceleration as finite arrays of one common shape (..., 3).

    Raises
    ------
    InputError
        As `checked_pose`, or if the three cannot be broadcast to one shape.
    """
    arrays = (
        checked_pose(pose),
        checked_pose(rate, "rate"),
        checked_pose(acceleration, "acceleration"),
    )
    try:
        x, rate_, acceleration_ = np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise InputError(
            f"pose, rate and acceleration have shapes {shapes}, which do not go together"
        ) from None
    return x, rate_, acceleration_


def rotation(pose: Array) -> Array:
    """Return the rotation from platform to base axes, shape (..., 3, 3), of poses (..., 3)."""
    wx, wy = pose[..., 1], pose[..., 2]
    a, b, _ = exp_coefficients(wx**2 + wy**2)
    c = 1 - (wx**2 + wy**2) * b
    rows = [
        [c + b * wx**2, b * wx * wy, a * wy],
        [b * wx * wy, c + b * wy**2, -a * wx],
        [-a * wy, a * wx, c],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion(pose: Array) -> Array:
    """Return the unit quaternion (x, y, z, w) of the rotation, shape (..., 4)."""
    wx, wy = pose[..., 1], pose[..., 2]
    half_squared = (wx**2 + wy**2) / 4
    a, _, _ = exp_coefficients(half_squared)  # sin(beta/2) / (beta/2)
    return np.stack(
        [wx * a / 2, wy * a / 2, np.zeros_like(wx), np.cos(np.sqrt(half_squared))], axis=-1
    )


def position(pose: Array, platform_radius: float) -> Array:
    """Return the platform's centre in base axes, shape (..., 3), m: Eq. 4."""
    z, wx, wy = pose[..., 0], pose[..., 1], pose[..., 2]
    _, b, _ = exp_coefficients(wx**2 + wy**2)
    h = platform_radius
    return np.stack([h / 2 * b * (wx**2 - wy**2), -h * b * wx * wy, z], axis=-1)


def platform_motion(
    pose: Array, rate: Array, acceleration: Array, platform_radius: float
) -> PlatformMotion:
    """Return the platform's motion from its pose and the pose's derivatives, in closed form.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
    platform_radius
        The paper's h, m.
    """
    z, wx, wy = np.moveaxis(pose, -1, 0)
    dz, dwx, dwy = np.moveaxis(rate, -1, 0)
    ddz, ddwx, ddwy = np.moveaxis(acceleration, -1, 0)
    s = wx**2 + wy**2
    ds = 2 * (wx * dwx + wy * dwy)
    dds = 2 * (dwx**2 + dwy**2 + wx * ddwx + wy * ddwy)

    _, b, d = exp_coefficients(s)
    b_s, b_ss, d_s = exp_slopes(s)
    db, ddb, dd = b_s * ds, b_ss * ds**2 + b_s * dds, d_s * ds

    # Centre: p_x = h/2 B f, p_y = -h B k, with f = w_x^2 - w_y^2 and k = w_x w_y.
    h = platform_radius
    f, df = wx**2 - wy**2, 2 * (wx * dwx - wy * dwy)
    ddf = 2 * (dwx**2 - dwy**2 + wx * ddwx - wy * ddwy)
    k, dk = wx * wy, dwx * wy + wx * dwy
    ddk = ddwx * wy + 2 * dwx * dwy + wx * ddwy
    centre = np.stack([h / 2 * b * f, -h * b * k, z], axis=-1)
    velocity = np.stack([h / 2 * (db * f + b * df), -h * (db * k + b * dk), dz], axis=-1)
    centre_acceleration = np.stack(
        [
            h / 2 * (ddb * f + 2 * db * df + b * ddf),
            -h * (ddb * k + 2 * db * dk + b * ddk),
            ddz,
        ],
        axis=-1,
    )

    # Angular velocity, platform axes: w x w' = (0, 0, m), w x (w x w') = m (w_y, -w_x, 0).
    m, dm = wx * dwy - wy * dwx, wx * ddwy - wy * ddwx
    n, dn = d * m, dd * m + d * dm
    angular_velocity = np.stack([dwx + n * wy, dwy - n * wx, -b * m], axis=-1)
    angular_acceleration = np.stack(
        [ddwx + dn * wy + n * dwy, ddwy - dn * wx - n * dwx, -db * m - b * dm], axis=-1
    )
    return PlatformMotion(
        centre,
        velocity,
        centre_acceleration,
        rotation(pose),
        angular_velocity,
        angular_acceleration,
    )


def exp_coefficients(s: Array) -> tuple[Array, Array, Array]:
    """Return A, B and D of the squared tilt s: the coefficients of the exponential map."""
    far = np.maximum(s, _SERIES_BELOW)
    beta = np.sqrt(far)
    a, b = np.sin(beta) / beta, (1 - np.cos(beta)) / far
    d = (1 - a) / far
    near = np.minimum(s, _SERIES_BELOW)
    small = s < _SERIES_BELOW
    return (
        np.where(small, polyval(near, _SERIES_A), a),
        np.where(small, polyval(near, _SERIES_B), b),
        np.where(small, polyval(near, _SERIES_D), d),
    )


def exp_slopes(s: Array) -> tuple[Array, Array, Array]:
    """Return dB/ds, d2B/ds2 and dD/ds of the squared tilt s."""
    far = np.maximum(s, _SERIES_BELOW)
    a, b, d = exp_coefficients(far)
    a_s = (np.cos(np.sqrt(far)) - a) / (2 * far)
    b_s = (a / 2 - b) / far
    b_ss = (a_s / 2 - 2 * b_s) / far
    d_s = (-a_s - d) / far
    near = np.minimum(s, _SERIES_BELOW)
    small = s < _SERIES_BELOW
    return (
        np.where(small, polyval(near, polyder(_SERIES_B)), b_s),
        np.where(small, polyval(near, polyder(_SERIES_B, 2)), b_ss),
        np.where(small, polyval(near, polyder(_SERIES_D)), d_s),
    )
