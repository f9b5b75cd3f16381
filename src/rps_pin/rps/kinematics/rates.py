"""Rates of the 3-RPS in closed form: legs from poses, poses from legs, and the platform's twist.

With the tip of a leg at (rho, z_i) in the leg's plane (`rps_pin.rps.kernels.tips`), Eq. 7 says g -
rho = d cos(phi) and z_i = d sin(phi), so that

    d'   = K pose',    K = -cos(phi) d(rho)/d(pose) + sin(phi) d(z_i)/d(pose),
    phi' = N pose',    N = (sin(phi) d(rho)/d(pose) + cos(phi) d(z_i)/d(pose)) / d.

Rates are those of poses ``(z, tilt_x, tilt_y)``: m/s, rad/s, rad/s. Legs are counted 1 to 3 in
messages, 0 to 2 in arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import MAX_CONDITION
from rps_pin.errors import InputError, SingularityError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kinematics import pose as poses
from rps_pin.rps.kinematics.legs import at_legs, leg_geometry, refuse_vanishing
from rps_pin.rps.kinematics.samples import Errors, check_errors_option, maskable, refuse
from rps_pin.rps.parameters import RPSParameters
from rps_pin.validation import one_shape, real_array


class TipJacobians(NamedTuple):
    """Tips in the planes of their legs, and their derivatives by the pose."""

    radial: Array
    """rho, along e_i from the base's centre, shape (..., 3 legs), m."""
    height: Array
    """z_i, above the base, shape (..., 3 legs), m."""
    radial_jacobian: Array
    """d(rho)/d(pose), shape (..., 3 legs, 3): 1, m/rad, m/rad."""
    height_jacobian: Array
    """d(z_i)/d(pose), shape (..., 3 legs, 3): 1, m/rad, m/rad."""


class LegJacobians(NamedTuple):
    """Leg lengths and angles with their derivatives with respect to the pose."""

    length: Array
    """The paper's d, shape (..., 3 legs), m."""
    angle: Array
    """The paper's phi, shape (..., 3 legs), rad."""
    length_jacobian: Array
    """K = d(length)/d(pose), shape (..., 3 legs, 3): 1, m/rad, m/rad."""
    angle_jacobian: Array
    """N = d(angle)/d(pose), shape (..., 3 legs, 3): rad/m, 1, 1."""


class LegJacobianRates(NamedTuple):
    """Time derivatives of the legs' Jacobians."""

    length_jacobian: Array
    """K', shape (..., 3 legs, 3): 1/s, m/rad/s, m/rad/s."""
    angle_jacobian: Array
    """N', shape (..., 3 legs, 3): rad/m/s, 1/s, 1/s."""


class PoseDerivative(NamedTuple):
    """A pose's rate or acceleration, found from the legs."""

    value: Array
    """Shape (..., 3); zero where it is not determined."""
    determined: Bools
    """Whether the legs determine it, shape (...): not at a singularity."""


class PlatformTwist(NamedTuple):
    """The platform's twist, in two parts, and its time derivative, in base axes.

    A twist is the velocity of the centre (m/s) above the angular velocity (rad/s), shape (..., 6).
    The robot has three freedoms: the height, and tilts about the horizontal axes. The rest of its
    motion is *parasitic*: it follows from the planes of the legs.
    """

    commanded: Array
    """(0, 0, p_z', omega_x, omega_y, 0), shape (..., 6)."""
    parasitic: Array
    """(p_x', p_y', 0, 0, 0, omega_z), shape (..., 6); omega_z is the torsion about the vertical."""
    commanded_rate: Array
    """Time derivative of `commanded`, shape (..., 6), m/s^2 and rad/s^2."""
    parasitic_rate: Array
    """Time derivative of `parasitic`, shape (..., 6), m/s^2 and rad/s^2."""

    @property
    def total(self) -> Array:
        """The twist, shape (..., 6)."""
        return self.commanded + self.parasitic

    @property
    def total_rate(self) -> Array:
        """The twist's time derivative, shape (..., 6)."""
        return self.commanded_rate + self.parasitic_rate


# Jacobians ----------------------------------------------------------------------------------------


def tip_jacobians(parameters: RPSParameters, pose: ArrayLike) -> TipJacobians:
    """Return the tips in their legs' planes and their derivatives: Eq. 1 and 4.

    Parameters
    ----------
    pose
        Shape (..., 3).

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    """
    x = poses.checked_pose(pose)
    h, z = parameters.platform_radius, poses.components(x)[0]
    tilt_x, tilt_y, tilt = poses.tilt_of(x)
    radial, height = ring.tips(z, tilt_x, tilt_y, tilt, h)
    slopes = ring.tip_slopes(tilt_x, tilt_y, tilt)
    return TipJacobians(at_legs(radial), at_legs(height), *_by_pose(slopes, h, by_z=1.0))


def tip_jacobian_rates(
    parameters: RPSParameters, pose: ArrayLike, rate: ArrayLike
) -> tuple[Array, Array]:
    """Return the time derivatives of `TipJacobians.radial_jacobian` and ``height_jacobian``.

    Parameters
    ----------
    pose, rate
        Pose and its time derivative, shape (..., 3) each.

    Returns
    -------
    arrays
        Shape (..., 3 legs, 3) each: 1/s, m/rad/s, m/rad/s.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite.
    """
    x, dx, _ = poses.checked_motion(pose, rate)
    tilt_x, tilt_y, tilt = poses.tilt_of(x)
    _, tilt_x_rate, tilt_y_rate = poses.components(dx)
    slope_rates = ring.tip_slope_rates(tilt_x, tilt_y, tilt_x_rate, tilt_y_rate, tilt)
    return _by_pose(slope_rates, parameters.platform_radius, by_z=0.0)


@refuses_other_kinds
@maskable(pose=1)
def leg_jacobians(
    parameters: RPSParameters, pose: ArrayLike, *, errors: Errors = "raise"
) -> LegJacobians:
    """Return leg lengths and angles with their 3x3 Jacobians, in closed form: Eq. 1, 4 and 7.

    Limits are not considered.

    Parameters
    ----------
    pose
        Shape (..., 3).
    errors
        ``"raise"`` refuses a pose with a leg of no length; with ``"mask"`` its results are NaN.

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    UnreachableError
        If a leg has no length, and so no direction.
    """
    legs, vanishing = masked_leg_jacobians(parameters, pose)
    refuse_vanishing(legs.length, vanishing)
    return legs


@refuses_other_kinds
@maskable(pose=1, rate=1)
def leg_jacobian_rates(
    parameters: RPSParameters, pose: ArrayLike, rate: ArrayLike, *, errors: Errors = "raise"
) -> LegJacobianRates:
    """Return the time derivatives of the legs' Jacobians, in closed form.

    With them, d'' = K pose'' + K' pose' and phi'' = N pose'' + N' pose'.

    Parameters
    ----------
    pose, rate
        Pose and its time derivative, shape (..., 3) each.
    errors
        As for `leg_jacobians`.

    Raises
    ------
    InputError, UnreachableError
        As `leg_jacobians`.
    """
    x, dx, _ = poses.checked_motion(pose, rate)
    legs = leg_jacobians(parameters, x)
    return jacobian_rates_of_legs(parameters, x, dx, legs)


def masked_leg_jacobians(parameters: RPSParameters, pose: ArrayLike) -> tuple[LegJacobians, Bools]:
    """Return `leg_jacobians`, and which legs have no length, shape (..., 3 legs).

    Their angle and their rows of the Jacobians have no meaning; they are finite.
    """
    tip = tip_jacobians(parameters, pose)
    legs = leg_geometry(tip.radial, tip.height, parameters.base_radius)
    direction = legs.cosine[..., None], legs.sine[..., None]
    lever = np.where(legs.vanishing, parameters.base_radius, legs.length)[..., None]
    slopes = tip.radial_jacobian, tip.height_jacobian
    K = kernels.along_leg(*direction, *slopes)
    N = kernels.across_leg(*direction, *slopes) / lever
    return LegJacobians(legs.length, legs.angle, K, N), legs.vanishing


def jacobian_rates_of_legs(
    parameters: RPSParameters, pose: Array, rate: Array, legs: LegJacobians
) -> LegJacobianRates:
    """Return `leg_jacobian_rates` of poses whose `leg_jacobians` are at hand."""
    changes = tip_jacobian_rates(parameters, pose, rate)
    lever = np.maximum(legs.length, 1e-9 * parameters.base_radius)[..., None]
    K, N = legs.length_jacobian, legs.angle_jacobian
    speed, turning = times(K, rate)[..., None], times(N, rate)[..., None]
    cosine, sine = np.cos(legs.angle)[..., None], np.sin(legs.angle)[..., None]
    return LegJacobianRates(
        # (cos)' = -sin phi', (sin)' = cos phi'; sin d(rho) + cos d(z) = d N.
        kernels.along_leg(cosine, sine, *changes) + turning * lever * N,
        (kernels.across_leg(cosine, sine, *changes) - turning * K - speed * N) / lever,
    )


# Poses from legs ----------------------------------------------------------------------------------


@refuses_other_kinds
def pose_rate(
    parameters: RPSParameters,
    pose: ArrayLike,
    leg_speed: ArrayLike,
    *,
    errors: Errors = "raise",
    max_gain: float = MAX_CONDITION,
) -> PoseDerivative:
    """Return the pose's rate for given speeds of the legs: K pose' = d'.

    Parameters
    ----------
    pose
        Shape (..., 3).
    leg_speed
        d' of legs 1, 2, 3, shape (..., 3), m/s; positive is out.
    errors
        ``"raise"`` refuses a pose where the legs do not determine the rate; with ``"mask"`` the
        rate is zero there and `PoseDerivative.determined` is false.
    max_gain
        Largest accepted speed of the platform for a unit of leg speed, tilt rates made speeds by h:
        1 over K's smallest singular value. (K's condition number would not do: in a flat robot, all
        of K vanishes evenly.)

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite.
    UnreachableError
        If a leg has no length.
    SingularityError
        If K is too near a singular matrix: the gain and its limit are in the message.
    """
    speeds = real_array(leg_speed, "leg_speed", (3,), "legs 1, 2, 3")
    x, speed = one_shape(pose=poses.checked_pose(pose), leg_speed=speeds)
    return _solved(parameters, masked_leg_jacobians(parameters, x), speed, errors, max_gain)


@refuses_other_kinds
def pose_acceleration(
    parameters: RPSParameters,
    pose: ArrayLike,
    rate: ArrayLike,
    leg_acceleration: ArrayLike,
    *,
    errors: Errors = "raise",
    max_gain: float = MAX_CONDITION,
) -> PoseDerivative:
    """Return the pose's acceleration from those of the legs: K pose'' = d'' - K' pose'.

    Parameters
    ----------
    pose, rate
        Pose and its time derivative (see `pose_rate`), shape (..., 3) each.
    leg_acceleration
        d'' of legs 1, 2, 3, shape (..., 3), m/s^2.
    errors, max_gain
        As in `pose_rate`.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `pose_rate`.
    """
    x, dx, acceleration = one_shape(
        pose=poses.checked_pose(pose),
        rate=poses.checked_pose(rate, "rate"),
        leg_acceleration=real_array(leg_acceleration, "leg_acceleration", (3,), "legs 1, 2, 3"),
    )
    legs = masked_leg_jacobians(parameters, x)
    change = jacobian_rates_of_legs(parameters, x, dx, legs[0])
    needed = acceleration - times(change.length_jacobian, dx)
    return _solved(parameters, legs, needed, errors, max_gain)


# The platform -------------------------------------------------------------------------------------


@refuses_other_kinds
def platform_twist(
    parameters: RPSParameters,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
) -> PlatformTwist:
    """Return the platform's twist and its derivative, base axes, with the parasitic part apart.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite.
    """
    given = poses.checked_motion(pose, rate, acceleration)
    motion = poses.platform_motion(*given, parameters.platform_radius)
    # omega = R omega_platform, and omega' = R omega_platform' since omega x omega = 0.
    commanded = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
    parts = []
    for linear, angular in (
        (motion.velocity, motion.angular_velocity),
        (motion.acceleration, motion.angular_acceleration),
    ):
        twist = np.concatenate([linear, times(motion.rotation, angular)], axis=-1)
        parts += [commanded * twist, (1 - commanded) * twist]
    return PlatformTwist(*parts)


# Inner workings -----------------------------------------------------------------------------------


def _by_pose(slopes: ring.Slopes, h: float, by_z: float) -> tuple[Array, Array]:
    """Return the derivatives of rho and z_i by the pose, (..., 3 legs, 3), from rings of slopes."""
    rho_x, rho_y, z_x, z_y = (h * at_legs(one) for one in slopes)
    zero = np.zeros_like(rho_x)
    return np.stack([zero, rho_x, rho_y], axis=-1), np.stack([zero + by_z, z_x, z_y], axis=-1)


def times(matrix: Array, vector: Array) -> Array:
    """Return matrices (..., m, n) times vectors (..., n)."""
    product: Array = np.einsum("...ij,...j->...i", matrix, vector)
    return product


def _solved(
    parameters: RPSParameters,
    masked: tuple[LegJacobians, Bools],
    right_side: Array,
    errors: Errors,
    max_gain: float,
) -> PoseDerivative:
    """Solve K x = right side, with the tilts made lengths by h."""
    legs, vanishing = masked
    if errors == "raise":
        refuse_vanishing(legs.length, vanishing)
    units = np.array([1.0, *2 * [1 / parameters.platform_radius]])
    scaled = legs.length_jacobian * units
    determined = ~vanishing.any(axis=-1) & accepted_gains(
        scaled,
        max_gain,
        "the legs do not determine how the platform moves here{where}: it could move {gain:.3g} "
        "times as fast as they, and at most {limit:.3g} times is accepted",
        errors,
    )
    regular = np.where(determined[..., None, None], scaled, np.eye(3))
    right = np.where(determined[..., None], right_side, 0.0)
    return PoseDerivative(units * np.linalg.solve(regular, right[..., None])[..., 0], determined)


def accepted_gains(
    matrices: Array, max_gain: float, message: str, errors: Errors = "raise"
) -> Bools:
    """Return which matrices have an inverse of accepted size, shape (...).

    Parameters
    ----------
    matrices
        Shape (..., n, n), in one unit.
    max_gain
        Largest norm of the inverse, the gain, that is accepted; positive.
    message
        Of the error, with the fields ``{where}``, ``{gain}`` and ``{limit}``.
    errors
        ``"raise"`` refuses the first matrix whose gain is larger.

    Raises
    ------
    InputError
        If an option is not possible.
    SingularityError
        With ``errors="raise"``, if a gain is larger.
    """
    check_errors_option(errors)
    if not max_gain > 0:
        raise InputError(f"max_gain = {max_gain}: it must be positive")
    smallest = np.linalg.svd(matrices, compute_uv=False)[..., -1]
    accepted = np.asarray(smallest * max_gain >= 1)

    def error(first: tuple[int, ...], where: str) -> SingularityError:
        gain = 1 / float(smallest[first]) if smallest[first] > 0 else float("inf")
        text = message.format(where=where, gain=gain, limit=max_gain)
        return SingularityError(text, gain, max_gain)

    if errors == "raise":
        refuse(~accepted, error)
    return accepted
