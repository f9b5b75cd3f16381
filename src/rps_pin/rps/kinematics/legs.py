"""Legs of the 3-RPS: lengths, angles, their derivatives and their limits (Eq. 6 and 7).

Leg i moves in the vertical plane through its radial direction e_i. With the tip at B_i,

    g - d cos(phi) = e_i . B_i,     d sin(phi) = z . B_i,

so d and phi are the polar coordinates of (g - e_i . B_i, z . B_i), and so are their derivatives.
Legs are counted 1 to 3 in messages, as in the paper, and 0 to 2 in arrays.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, LimitViolation, UnreachableError, shown
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kernels.limits import length_within, within
from rps_pin.rps.kinematics.pose import Tilt, components, tilt_of
from rps_pin.rps.kinematics.samples import refuse
from rps_pin.rps.leg_frames import LEG_DIRECTIONS
from rps_pin.rps.parameters import RPSParameters

#: e_i, shape (3 legs, 3): the radial directions in the base plane, and in the platform.
RADIAL = np.array([[math.cos(angle), math.sin(angle), 0.0] for angle in LEG_DIRECTIONS])
RADIAL.setflags(write=False)
#: t_i = z x e_i, shape (3 legs, 3): the axes of the revolute joints.
ACROSS = np.stack([-RADIAL[:, 1], RADIAL[:, 0], np.zeros(3)], axis=-1)
ACROSS.setflags(write=False)
_UP = np.array([0.0, 0.0, 1.0])
#: A leg shorter than this part of g has no direction.
VANISHING = 1e-9
#: How limits of a unit are kept.
_KEPT = {"m": length_within, "rad": within}
#: A limit that no cosine is below.
ANY_ANGLE = -2.0


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


class LegGeometry(NamedTuple):
    """Lengths and directions of the legs."""

    length: Array
    """d, shape (..., 3 legs), m."""
    cosine: Array
    """cos(phi), shape (..., 3 legs); 1 where the leg has no length."""
    sine: Array
    """sin(phi), shape (..., 3 legs); 0 where the leg has no length."""
    vanishing: Bools
    """Whether a leg has no length, and so no direction, shape (..., 3 legs)."""

    @property
    def angle(self) -> Array:
        """phi, shape (..., 3 legs), rad."""
        angles: Array = np.arctan2(self.sine, self.cosine)
        return angles


class PoseLegs(NamedTuple):
    """Legs of poses (..., 3), and how their tips move with the tilt."""

    tilt: Tilt
    """tilt_x and tilt_y (rad) with the functions of the tilt, shape (...) each."""
    slopes: ring.Slopes
    """Of the tips, by h tilt_x and h tilt_y, shape (...) each, or constants; without unit."""
    geometry: LegGeometry
    """Lengths and directions, shape (..., 3 legs) each."""

    def part(self, part: slice) -> PoseLegs:
        """Return the legs of a part of the poses, as one batch (n, 3) in C order."""
        shape = self.geometry.length.shape[:-1]

        def cut(numbers: Any) -> Any:
            if isinstance(numbers, tuple):
                return tuple(map(cut, numbers))
            return np.broadcast_to(numbers, shape).reshape(-1)[part]

        geometry = LegGeometry._make(of.reshape(-1, 3)[part] for of in self.geometry)
        return PoseLegs(cut(self.tilt), cut(self.slopes), geometry)


def leg_geometry(radial: Array, height: Array, base_radius: float) -> LegGeometry:
    """Return the legs of tips at (rho, z_i) in their planes, shape (..., 3 legs) each, m: Eq. 7."""
    with np.errstate(divide="ignore", invalid="ignore"):
        length, cosine, sine = kernels.leg_geometry(radial, height, base_radius)
    vanishing: Bools = length < VANISHING * base_radius
    if vanishing.any():
        cosine, sine = np.where(vanishing, 1.0, cosine), np.where(vanishing, 0.0, sine)
    return LegGeometry(length, cosine, sine, vanishing)


def geometry_of_pose(
    pose: Array, base_radius: float, platform_radius: float, tilt: Tilt | None = None
) -> LegGeometry:
    """Return the legs of poses (..., 3), whose tilt may be known: Eq. 1, 4 and 7."""
    radial, height = ring.tips(components(pose)[0], *(tilt or tilt_of(pose)), platform_radius)
    return leg_geometry(at_legs(radial), at_legs(height), base_radius)


def legs_of_pose(pose: Array, base_radius: float, platform_radius: float) -> PoseLegs:
    """Return the legs of poses (..., 3), and how their tips move with the tilt."""
    tilt = tilt_of(pose)
    geometry = geometry_of_pose(pose, base_radius, platform_radius, tilt)
    return PoseLegs(tilt, ring.tip_slopes(*tilt), geometry)


def check_legs(legs: PoseLegs | None, pose: Array) -> None:
    """Raise `InputError` if legs are given and are not as many as the poses (..., 3)."""
    if legs is None:
        return
    if not isinstance(legs, PoseLegs):
        raise InputError(f"legs = {shown(legs)}: it must be what legs_of_pose returns")
    if legs.geometry.length.shape != pose.shape:
        raise InputError(
            f"legs are those of poses of shape {legs.geometry.length.shape}; they must be those "
            f"of the poses given, of shape {pose.shape}"
        )


def at_legs(numbers: ring.Ring) -> Array:
    """Return a ring's number for each leg, shape (..., 3 legs)."""
    legs = np.asarray(ring.at_legs(numbers))
    return legs.transpose(*range(1, legs.ndim), 0)


def leg_angles_and_lengths(tip: Array, base_radius: float) -> tuple[Array, Array]:
    """Return lengths and angles, shape (..., 3) each, from the tips (..., 3 legs, 3): Eq. 7.

    Raises
    ------
    UnreachableError
        If a tip lies on its revolute joint, where the leg has no direction.
    """
    radial: Array = np.einsum("...ij,ij->...i", tip, RADIAL)
    legs = leg_geometry(radial, tip[..., 2], base_radius)
    refuse_vanishing(legs.length, legs.vanishing)
    return legs.length, legs.angle


def refuse_vanishing(length: Array, vanishing: Bools) -> None:
    """Raise `UnreachableError` if a leg, (..., 3 legs), has no length."""

    def error(first: tuple[int, ...], _: str) -> UnreachableError:
        leg = int(np.argmax(vanishing[first]))
        return UnreachableError(
            f"leg {leg + 1} would have length {length[first][leg]:.3g} m: its tip lies on its "
            "revolute joint, and it has no direction"
        )

    refuse(vanishing.any(axis=-1), error)


def leg_motion(
    pose: Array,
    rate: Array,
    acceleration: Array,
    platform_radius: float,
    base_radius: float,
    legs: PoseLegs | None = None,
) -> LegMotion:
    """Return how the legs move with the platform, in closed form.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
    platform_radius, base_radius
        The paper's h and g, m.
    legs
        `legs_of_pose` of the poses, if they are known.

    Raises
    ------
    UnreachableError
        If a leg has no length.
    """
    (x, y, tilt), slopes, geometry = legs or legs_of_pose(pose, base_radius, platform_radius)
    d, cosine, sine, vanishing = geometry
    refuse_vanishing(d, vanishing)
    (dz, dx, dy), (ddz, ddx, ddy) = components(rate), components(acceleration)
    h = platform_radius
    rates = [at_legs(one) for one in ring.tip_rates(slopes, dz, h * dx, h * dy)]
    moving = (x, y, dx, dy, ddx, ddy)
    changes = [at_legs(one) for one in ring.tip_accelerations(moving, ddz, tilt, h)]
    return LegMotion(d, geometry.angle, *kernels.leg_motion(cosine, sine, d, rates, changes))


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
    axis = _turned(rotation, rest_axes(rest_angle))
    out, across = ((axis * direction).sum(axis=-1) for direction in (RADIAL, ACROSS))
    cosine, sine = np.cos(angle), np.sin(angle)
    sharp = kernels.cone_sine(cosine, sine, out, across, axis[..., 2])
    angles: Array = np.arctan2(sharp, kernels.cone_cosine(cosine, sine, out, axis[..., 2]))
    return angles


def within_limits(parameters: RPSParameters, length: Array, angle: Array, cone: Array) -> Bools:
    """Return for each pose whether every leg keeps its limits, shape (...)."""
    inside = np.ones(length.shape, dtype=bool)
    for _, unit, value, lower, upper in _limits(parameters, length, angle, cone):
        inside &= _KEPT[unit](value, lower, upper)
    return np.asarray(inside.all(axis=-1))


def violations(
    parameters: RPSParameters, length: Array, angle: Array, cone: Array
) -> list[LimitViolation]:
    """Return every limit that one pose breaks; its lengths, angles and cones have shape (3,)."""
    return [
        LimitViolation(leg + 1, quantity, float(value[leg]), lower, upper, unit)
        for quantity, unit, value, lower, upper in _limits(parameters, length, angle, cone)
        for leg in range(3)
        if not _KEPT[unit](value[leg], lower, upper)
    ]


def cosine_of_half(lower: float, upper: float) -> float:
    """Return the cosine of half of what lies between two angles, or `ANY_ANGLE` of a full turn."""
    half = (upper - lower) / 2
    return math.cos(half) if half < math.pi else ANY_ANGLE


def cosine_of_cone(limit: float) -> float:
    """Return the cosine of a spherical joint's limit, or `ANY_ANGLE` where there is none."""
    return math.cos(limit) if limit < math.pi else ANY_ANGLE


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
