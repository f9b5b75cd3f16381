"""The pose of the 3-RPS's platform: position, rotation, and their time derivatives.

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
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kernels import platform, tips
from rps_pin.rps.kernels.tilt_functions import TiltFunctions, tilt_functions
from rps_pin.validation import one_shape, real_array

#: tilt_x, tilt_y (rad) and the functions of the tilt, of poses of shape (..., 3): shape (...) each.
Tilt = tuple[Number, Number, TiltFunctions]


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
    """Return a pose, or one of its time derivatives, as finite numbers of shape (..., 3)."""
    return real_array(value, name, (3,), "height, tilt_x, tilt_y")


def checked_motion(
    pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[Array, Array, Array]:
    """Return pose, rate and acceleration as finite numbers of one shape (..., 3)."""
    x, dx, ddx = one_shape(
        pose=checked_pose(pose),
        rate=checked_pose(rate, "rate"),
        acceleration=checked_pose(acceleration, "acceleration"),
    )
    return x, dx, ddx


def components(vectors: Array) -> list[Number]:
    """Return the entries of vectors (..., k): floats of one vector, contiguous arrays of many."""
    if vectors.ndim == 1:
        entries: list[Number] = vectors.tolist()
        return entries
    return list(np.ascontiguousarray(vectors.transpose(-1, *range(vectors.ndim - 1))))


def stacked(*numbers: Number) -> Array:
    """Return numbers of one shape (...), or constants among them, as an array (..., k)."""
    return np.stack(np.broadcast_arrays(*numbers), axis=-1)


def tilt_of(pose: Array) -> Tilt:
    """Return tilt_x, tilt_y and the functions of the tilt, of poses (..., 3).

    Raises `InputError` for one pose with a tilt above 1e154 rad, whose square is not finite.
    """
    _, x, y = components(pose)
    square = x * x + y * y
    if type(square) is float and square == math.inf:
        raise InputError(f"tilt = ({x:.3g}, {y:.3g}) rad: it is too large to compute with")
    return x, y, tilt_functions(square)


def rotation(pose: Array) -> Array:
    """Return the rotation from platform to base axes, shape (..., 3, 3), of poses (..., 3)."""
    first, second, third = platform.rotation(*tilt_of(pose))
    return stacked(*first, *second, *third).reshape(*pose.shape, 3)


def quaternion(pose: Array) -> Array:
    """Return the unit quaternion (x, y, z, w) of the rotation, shape (..., 4)."""
    _, x, y = components(pose)
    q_x, q_y, q_w = platform.quaternion(x, y)
    return stacked(q_x, q_y, 0.0, q_w)


def position(pose: Array, platform_radius: float) -> Array:
    """Return the platform's centre in base axes, shape (..., 3), m: Eq. 4."""
    z = components(pose)[0]
    radial, _ = tips.tips(z, *tilt_of(pose), platform_radius)
    return stacked(0.5 * radial[1], 0.5 * radial[2], z)


def platform_pose(configuration: Array) -> Array:
    """Return (z, tilt_x, tilt_y) of Pinocchio configurations (..., 13), shape (..., 3).

    The tilt is the rotation vector of the platform's quaternion, whose third component is zero.
    """
    q = np.asarray(configuration)
    x, y, z, w = np.moveaxis(q[..., 9:13], -1, 0)
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2 * np.arctan2(sine, np.abs(w))
    factor = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 1e-9)
    factor = np.where(w < 0, -factor, factor)
    return np.stack([q[..., 8], factor * x, factor * y], axis=-1)


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
    x, y, tilt = tilt_of(pose)
    (z, _, _), (dz, dx, dy) = components(pose), components(rate)
    ddz, ddx, ddy = components(acceleration)
    h = platform_radius
    place, _ = tips.tips(z, x, y, tilt, h)
    velocity, _ = tips.tip_rates(tips.tip_slopes(x, y, tilt), dz, h * dx, h * dy)
    change, _ = tips.tip_accelerations((x, y, dx, dy, ddx, ddy), ddz, tilt, h)
    return PlatformMotion(
        stacked(0.5 * place[1], 0.5 * place[2], z),
        stacked(0.5 * velocity[1], 0.5 * velocity[2], dz),
        stacked(0.5 * change[1], 0.5 * change[2], ddz),
        rotation(pose),
        stacked(*platform.angular_velocity(x, y, dx, dy, tilt)),
        stacked(*platform.angular_acceleration(x, y, dx, dy, ddx, ddy, tilt)),
    )
