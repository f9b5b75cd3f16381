"""Inverse kinematics: the legs of a pose, and whether they keep their limits (Eq. 1, 4, 6, 7)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import UnreachableError
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips
from rps_pin.rps.kinematics import legs as leg_kinematics
from rps_pin.rps.kinematics.pose import Tilt, checked_pose, tilt_of
from rps_pin.rps.kinematics.samples import Errors, check_errors_option, refuse
from rps_pin.rps.parameters import RPSParameters


def inverse_kinematics(
    parameters: RPSParameters, pose: ArrayLike, *, errors: Errors = "raise"
) -> leg_kinematics.Legs:
    """Return leg lengths and angles; see `RPSRobot.inverse_kinematics`."""
    check_errors_option(errors)
    x = checked_pose(pose)
    legs = leg_kinematics.geometry_of_pose(x, parameters.base_radius, parameters.platform_radius)
    reachable = _reachable(parameters, x, legs, errors)
    return leg_kinematics.Legs(legs.length, legs.angle, reachable & ~legs.vanishing.any(axis=-1))


def reachable_motion(
    parameters: RPSParameters,
    pose: Array,
    rate: Array,
    acceleration: Array,
    legs: leg_kinematics.PoseLegs | None = None,
) -> leg_kinematics.LegMotion:
    """Return how the legs (of the poses, if known) move, or refuse a pose beyond their limits."""
    g, h = parameters.base_radius, parameters.platform_radius
    legs = legs or leg_kinematics.legs_of_pose(pose, g, h)
    _reachable(parameters, pose, legs.geometry, "raise", legs.tilt)
    return leg_kinematics.leg_motion(pose, rate, acceleration, h, g, legs)


def spherical_angles(
    parameters: RPSParameters,
    pose: Array,
    legs: leg_kinematics.LegGeometry,
    known: Tilt | None = None,
) -> Array:
    """Return the angle between each leg and its joint's rest axis, shape (..., 3 legs), rad."""
    x, y, tilt = known or tilt_of(pose)
    rest = math.cos(parameters.spherical_rest_angle), math.sin(parameters.spherical_rest_angle)
    e, t = (np.asarray(tips.at_legs(ring)) for ring in ((0.0, x, y), (0.0, y, -x)))
    out, across, up = kernels.rest_axis(e, t, tilt, *rest)
    cosine, sine = np.moveaxis(legs.cosine, -1, 0), np.moveaxis(legs.sine, -1, 0)
    angles = np.arctan2(
        kernels.cone_sine(cosine, sine, out, across, up),
        kernels.cone_cosine(cosine, sine, out, up),
    )
    return np.moveaxis(angles, 0, -1)


def _reachable(
    parameters: RPSParameters,
    pose: Array,
    legs: leg_kinematics.LegGeometry,
    errors: Errors,
    tilt: Tilt | None = None,
) -> Bools:
    """Return whether each pose keeps its limits, or refuse the first that does not."""
    if errors == "raise":
        leg_kinematics.refuse_vanishing(legs.length, legs.vanishing)
    length, angle, cone = legs.length, legs.angle, spherical_angles(parameters, pose, legs, tilt)
    reachable = leg_kinematics.within_limits(parameters, length, angle, cone)

    def error(first: tuple[int, ...], where: str) -> UnreachableError:
        broken = leg_kinematics.violations(parameters, length[first], angle[first], cone[first])
        z, tilt_x, tilt_y = pose[first]
        return UnreachableError(
            f"pose z = {z:.6g} m, tilt = ({tilt_x:.6g}, {tilt_y:.6g}) rad{where} is out of "
            f"reach: {'; '.join(map(str, broken))}",
            broken,
        )

    if errors == "raise":
        refuse(~reachable, error)
    return reachable
