"""Inverse dynamics of the 3-RPS by virtual work of all bodies, moving rods included.

Of the pose's rate p' every body's velocities are linear functions. In a virtual motion the
actuators' work is what the bodies' inertia and weight take up (d'Alembert),

    F . K p' = sum over bodies of  m (a - G) . v  +  (I alpha + omega x I omega) . omega,

for every p', with the leg rates d' = K p', phi' = N p' of `rps_pin.rps.kinematics.rates`. Hence

    K' F = Q = sum over bodies of  (dv/dp')' m (a - G) + (domega/dp')' (I alpha + omega x I omega).

Legs move in planes: with s_i along the leg and t_i = ds_i/dphi_i across it, at a fixed distance l
(cylinder) or at l = d - rod_com (rod) from the revolute joint,

    v = l' s + l phi' t,    a = (l'' - l phi'^2) s + (l phi'' + 2 l' phi') t.

The platform's sideways and twisting motion, which the legs' planes force upon it, is in its partial
velocities. Without mass in the rods this is the robot of the paper's Lagrangian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import MAX_CONDITION
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics import rates
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.pose import checked_motion, platform_motion
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.parameters import RPSParameters


class PoseForces(NamedTuple):
    """Generalised forces of the bodies' inertia and weight on the pose (z, tilt_x, tilt_y).

    Shape (..., 3) each: N, N m, N m.
    """

    platform: Array
    cylinders: Array
    """The parts of the legs that only turn."""
    rods: Array
    """The parts of the legs that slide as well."""

    @property
    def total(self) -> Array:
        """Q, shape (..., 3): N, N m, N m."""
        return self.platform + self.cylinders + self.rods


@refuses_other_kinds
@maskable(pose=1, rate=1, acceleration=1)
def virtual_work_forces(
    parameters: RPSParameters,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    max_gain: float = MAX_CONDITION,
    errors: Errors = "raise",
) -> Array:
    """Return the actuators' forces, shape (..., 3), N; positive pushes the leg out.

    Limits of the robot are not considered.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
    max_gain
        Largest accepted speed of the platform for a unit of leg speed, tilt rates made speeds by h
        (see `rps_pin.rps.kinematics.rates.pose_rate`): as many times larger than the load can a
        force be.
    errors
        ``"raise"`` refuses the first sample with a leg of no length or at a singularity; with
        ``"mask"`` the forces of such samples are NaN.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite, or `max_gain` is not positive.
    UnreachableError
        If a leg has no length.
    SingularityError
        At a parallel singularity, where forces are infinite: says the gain and its limit.
    """
    motion = checked_motion(pose, rate, acceleration)
    needed = pose_forces(parameters, *motion).total
    legs = rates.leg_jacobians(parameters, motion[0])
    # Tilts made lengths by h, on both sides.
    units = np.array([1.0, *2 * [1 / parameters.platform_radius]])
    scaled = legs.length_jacobian * units
    rates.accepted_gains(
        scaled,
        max_gain,
        "the actuators cannot hold the platform here{where}: it could move {gain:.3g} times as "
        "fast as they, and at most {limit:.3g} times is accepted",
    )
    force: Array = np.linalg.solve(np.swapaxes(scaled, -1, -2), (units * needed)[..., None])[..., 0]
    return force


def pose_forces(
    parameters: RPSParameters, pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> PoseForces:
    """Return the generalised forces Q of a motion, by body.

    Their work in a motion of the pose is that of the actuators: Q . p' = F . d'. They are finite at
    singularities too.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite.
    UnreachableError
        If a leg has no length.
    """
    x, dx, ddx = checked_motion(pose, rate, acceleration)
    legs = rates.leg_jacobians(parameters, x)
    return PoseForces(
        _platform_force(parameters, x, dx, ddx), *_leg_forces(parameters, x, dx, ddx, legs)
    )


# Inner workings -----------------------------------------------------------------------------------


def _platform_force(parameters: RPSParameters, x: Array, dx: Array, ddx: Array) -> Array:
    """Return the platform's Q; forces in base axes, moments in platform axes."""
    h = parameters.platform_radius
    now = platform_motion(x, dx, ddx, h)
    inertia, spin = parameters.platform_inertia, now.angular_velocity
    force = parameters.platform_mass * (now.acceleration - parameters.gravity)
    moment = now.angular_acceleration @ inertia + np.cross(spin, spin @ inertia)  # I = I'
    # Velocities are linear in the rate: those of unit rates are the partial velocities.
    at, still = np.broadcast_arrays(x[..., None, :], np.zeros((3, 3)))
    unit = platform_motion(at, np.broadcast_to(np.eye(3), at.shape), still, h)
    return rates.times(unit.velocity, force) + rates.times(unit.angular_velocity, moment)


def _leg_forces(
    parameters: RPSParameters, x: Array, dx: Array, ddx: Array, legs: rates.LegJacobians
) -> tuple[Array, Array]:
    """Return Q of the cylinders and of the rods."""
    p = parameters
    K, N = legs.length_jacobian, legs.angle_jacobian
    change = rates.jacobian_rates_of_legs(p, x, dx, legs)
    speed, turning = rates.times(K, dx), rates.times(N, dx)
    speed_rate = rates.times(K, ddx) + rates.times(change.length_jacobian, dx)
    turning_rate = rates.times(N, ddx) + rates.times(change.angle_jacobian, dx)
    cosine, sine = np.cos(legs.angle), np.sin(legs.angle)
    inwards, up = -(RADIAL @ p.gravity), p.gravity[2]
    # s = -cos(phi) e + sin(phi) z and t = sin(phi) e + cos(phi) z
    gravity_along, gravity_across = cosine * inwards + sine * up, -sine * inwards + cosine * up

    cylinder_moment = (
        p.leg_mass * p.leg_com * (p.leg_com * turning_rate - gravity_across)
        + p.leg_inertia_about_com * turning_rate
    )
    lever = legs.length - p.rod_com
    along = p.rod_mass * (speed_rate - lever * turning**2 - gravity_along)
    across = p.rod_mass * (lever * turning_rate + 2 * speed * turning - gravity_across)
    rod_moment = lever * across + p.rod_inertia * turning_rate
    to_angle, to_length = np.swapaxes(N, -1, -2), np.swapaxes(K, -1, -2)
    return (
        rates.times(to_angle, cylinder_moment),
        rates.times(to_length, along) + rates.times(to_angle, rod_moment),
    )
