"""The legs of the 3-RPS in closed form: lengths, angles and their derivatives (Eq. 6 and 7).

Leg i moves in the vertical plane through its radial direction e_i. With the tip at B_i,

    g - d cos(phi) = e_i . B_i,     d sin(phi) = z . B_i,

so d and phi are the polar coordinates of (g - e_i . B_i, z . B_i), and so are their derivatives.
Legs are counted 1 to 3 in messages, as in the paper, and 0 to 2 in arrays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import LimitViolation, UnreachableError
from rps_pin.rps.kinematics.pose import PlatformMotion
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.urdf import LEG_DIRECTIONS

#: Limits are kept to rounding error, m or rad.
_ROUNDING = 1e-12

#: e_i, shape (3 legs, 3): the radial directions in the base plane, and in the platform.
RADIAL = np.array([[math.cos(angle), math.sin(angle), 0.0] for angle in LEG_DIRECTIONS])
RADIAL.setflags(write=False)
_UP = np.array([0.0, 0.0, 1.0])


class Legs(NamedTuple):
    """Leg lengths and angles, the answer of inverse kinematics."""

    length: Array
    """The paper's d, shape (..., 3), m."""
    angle: Array
    """The paper's phi, shape (..., 3), rad: 0 points at the base's centre, pi/2 straight up."""
    reachable: Bools
    """Whether every limit holds, shape (...)."""


class LegMotion(NamedTuple):
    """Leg lengths and angles with their first and second time derivatives, shape (..., 3) each."""

    length: Array
    angle: Array
    speed: Array
    """d', m/s; positive is out."""
    angle_rate: Array
    """phi', rad/s."""
    acceleration: Array
    """d'', m/s^2."""
    angle_acceleration: Array
    """phi'', rad/s^2."""


def tips(position: Array, rotation: Array, platform_radius: float) -> Array:
    """Return the spherical joints B_i in base axes, shape (..., 3 legs, 3), m: Eq. 1."""
    return position[..., None, :] + _turned(rotation, platform_radius * RADIAL)


def leg_angles_and_lengths(tip: Array, base_radius: float) -> tuple[Array, Array]:
    """Return lengths and angles, shape (..., 3) each, from the tips (..., 3 legs, 3): Eq. 7.

    Raises
    ------
    UnreachableError
        If a tip lies on its revolute joint, where the leg has no direction.
    """
    inwards, up = base_radius - _radial(tip), tip[..., 2]
    length = np.hypot(inwards, up)
    vanishing = length < 1e-9 * base_radius
    if vanishing.any():
        leg = int(np.argwhere(vanishing)[0][-1]) + 1
        raise UnreachableError(
            f"leg {leg} would have length {length[vanishing][0]:.3g} m: its tip lies on its "
            "revolute joint, and it has no direction"
        )
    return length, np.arctan2(up, inwards)


def leg_motion(motion: PlatformMotion, platform_radius: float, base_radius: float) -> LegMotion:
    """Return the legs' motion that carries the platform's, in closed form.

    Parameters
    ----------
    motion
        The platform's motion.
    platform_radius, base_radius
        The paper's h and g, m.

    Raises
    ------
    UnreachableError
        If a leg has no length.
    """
    arm = platform_radius * RADIAL  # platform axes
    spin = motion.angular_velocity[..., None, :]
    spin_rate = motion.angular_acceleration[..., None, :]
    turning = np.cross(spin, arm)
    # B' = p' + R (w x b),  B'' = p'' + R (w' x b + w x (w x b))
    tip = tips(motion.position, motion.rotation, platform_radius)
    velocity = motion.velocity[..., None, :] + _turned(motion.rotation, turning)
    acceleration = motion.acceleration[..., None, :] + _turned(
        motion.rotation, np.cross(spin_rate, arm) + np.cross(spin, turning)
    )

    d, phi = leg_angles_and_lengths(tip, base_radius)
    cosine, sine = np.cos(phi), np.sin(phi)
    inwards, up = -_radial(velocity), velocity[..., 2]
    speed = cosine * inwards + sine * up
    angle_rate = (-sine * inwards + cosine * up) / d
    inwards, up = -_radial(acceleration), acceleration[..., 2]
    # Polar coordinates: radial d'' - d phi'^2, across d phi'' + 2 d' phi'.
    return LegMotion(
        d,
        phi,
        speed,
        angle_rate,
        cosine * inwards + sine * up + d * angle_rate**2,
        (-sine * inwards + cosine * up - 2 * speed * angle_rate) / d,
    )


def rest_axes(rest_angle: float) -> Array:
    """Return the rest axes of the spherical joints in platform axes, shape (3 legs, 3).

    A leg that stands at phi under the level platform runs along -cos(phi) e_i + sin(phi) z (Eq. 7).
    With the rest angle r = pi/2 - phi, that is cos(r) z - sin(r) e_i: the joint's middle setting.

    Parameters
    ----------
    rest_angle
        r, rad: 0 for the platform's normal, positive for legs that lean inwards (phi < pi/2).
    """
    axes: Array = math.cos(rest_angle) * _UP - math.sin(rest_angle) * RADIAL
    return axes


def cone_angles(angle: Array, rotation: Array, rest_angle: float = 0.0) -> Array:
    """Return the angle between each leg and its spherical joint's rest axis, shape (..., 3), rad.

    Parameters
    ----------
    angle
        The paper's phi, shape (..., 3), rad.
    rotation
        From platform to base axes, shape (..., 3, 3).
    rest_angle
        ``RPSParameters.spherical_rest_angle``, rad; at 0 the rest axis is the platform's normal.
    """
    leg = -np.cos(angle)[..., None] * RADIAL + np.sin(angle)[..., None] * _UP
    rest = _turned(rotation, rest_axes(rest_angle))
    along = np.einsum("...ij,...ij->...i", leg, rest)
    across = np.linalg.norm(np.cross(leg, rest), axis=-1)
    angles: Array = np.arctan2(across, along)
    return angles


def within_limits(parameters: RPSParameters, length: Array, angle: Array, cone: Array) -> Bools:
    """Return for each pose whether every leg keeps its limits, shape (...)."""
    inside = np.ones(length.shape, dtype=bool)
    for _, _, value, lower, upper in _limits(parameters, length, angle, cone):
        inside &= (value >= lower - _ROUNDING) & (value <= upper + _ROUNDING)
    return np.asarray(inside.all(axis=-1))


def violations(
    parameters: RPSParameters, length: Array, angle: Array, cone: Array
) -> list[LimitViolation]:
    """Return every limit that one pose breaks; its lengths, angles and cones have shape (3,)."""
    return [
        LimitViolation(leg + 1, quantity, float(value[leg]), lower, upper, unit)
        for quantity, unit, value, lower, upper in _limits(parameters, length, angle, cone)
        for leg in range(3)
        if not lower - _ROUNDING <= value[leg] <= upper + _ROUNDING
    ]


def _limits(
    parameters: RPSParameters, length: Array, angle: Array, cone: Array
) -> list[tuple[str, str, Array, float, float]]:
    return [
        ("length", "m", length, *parameters.leg_length_limits),
        ("angle", "rad", angle, *parameters.leg_angle_limits),
        ("spherical joint", "rad", cone, 0.0, parameters.spherical_cone_limit),
    ]


def _turned(rotation: Array, vectors: Array) -> Array:
    """Turn row vectors (..., n, 3) from platform to base axes."""
    turned: Array = vectors @ np.swapaxes(rotation, -1, -2)
    return turned


def _radial(vectors: Array) -> Array:
    """Return each leg's vector component along its radial direction, shape (..., 3)."""
    along: Array = np.einsum("...ij,ij->...i", vectors, RADIAL)
    return along
