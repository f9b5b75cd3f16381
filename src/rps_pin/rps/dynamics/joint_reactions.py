"""Joint reactions of a 3-RPS along a motion, in closed form, all samples at once.

**Leg axes** of leg i are those of its joints' frames in the URDF: x along the leg towards its tip,
s_i; z across it in the leg's plane, t_i, to where phi grows; y = z x x = -a_i, against the axis a_i
of the revolute joint. Every wrench is (force, moment), N and N m, at a point that its field names.

The revolute joint turns freely about a_i (but for friction) and the rod slides freely along s_i
(but for friction), which gives the tip's force in the leg's plane: with M_i what turning the leg
about its joint takes, and F_rod what its rod takes along the leg,

    s_i . f_i = F_i - F_rod,     t_i . f_i = -M_i / d_i,

f_i on the platform. Across the planes, a_i . f_i = 2/3 a_i . r + mu, with r the force on the
platform that is left, since the sum of a_i a_i' over the legs is 3/2 in the base plane; mu, the
same in all legs, bears the couple that is left, since the sum of a_i vanishes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.force_equations import platform_wrench
from rps_pin.rps.dynamics.loads import checked_wrench
from rps_pin.rps.kernels import platform
from rps_pin.rps.kernels.forces import friction_force
from rps_pin.rps.kinematics import pose as poses
from rps_pin.rps.kinematics.legs import ACROSS, RADIAL, LegMotion
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot

_UP = np.array([0.0, 0.0, 1.0])


class JointReactions(NamedTuple):
    """Forces and wrenches in the joints of samples (...); legs on the axis after the batch."""

    actuator: Array
    """Force of each actuator, shape (..., 3), N; positive pushes the leg out."""
    spherical: Array
    """Force of each leg on the platform in base axes, shape (..., 3 legs, 3), N."""
    spherical_in_leg: Array
    """The same in leg axes, shape (..., 3 legs, 3), N."""
    prismatic: Array
    """What each cylinder exerts on its rod, at the tip, leg axes, shape (..., 3 legs, 6). The force
    along x is the actuator's, less the joint's friction."""
    revolute: Array
    """What the base exerts on each cylinder, at the revolute joint, leg axes, shape
    (..., 3 legs, 6)."""
    leg_axes: Array
    """From leg axes to base axes, shape (..., 3 legs, 3, 3): columns x, y, z."""
    length: Array
    """d, shape (..., 3 legs), m."""

    def bending_moment(self, reach: ArrayLike | None = None) -> Array:
        """Return the bending moment on each leg at a distance behind its tip, in leg axes.

        What the cylinder exerts on the rod across the leg, about a point of the leg's axis. Of a
        massless rod it is the bending moment at that section; of one with mass, at a section that
        has all of the rod on the tip's side.

        Parameters
        ----------
        reach
            Distance of the section behind the tip, of a shape that broadcasts with (..., 3 legs),
            m. Left out: the leg's length, that is, at the revolute joint.

        Returns
        -------
        array
            Moments about y and z, shape (..., 3 legs, 2), N m: y bends the leg in its own plane, z
            out of it.

        Raises
        ------
        InputError
            If a distance is negative or not finite.
        """
        x = np.asarray(self.length if reach is None else reach, dtype=np.float64)
        if not (np.isfinite(x) & (x >= 0)).all():
            raise InputError("reach must be finite distances behind the tip, not negative, in m")
        force, moment = self.prismatic[..., :3], self.prismatic[..., 3:]
        # About a point x behind the tip: M + (x, 0, 0) x F.
        return np.stack(
            [moment[..., 1] - x * force[..., 2], moment[..., 2] + x * force[..., 1]], -1
        )


@refuses_other_kinds
@maskable(pose=1, rate=1, acceleration=1, wrench=1)
def joint_reactions(
    robot: RPSRobot,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    errors: Errors = "raise",
) -> JointReactions:
    """Return the reactions in all joints: forces at the tips, wrenches in the legs.

    Parameters
    ----------
    robot
        The 3-RPS, with its payload and friction.
    pose, rate, acceleration, wrench
        As for `RPSRobot.actuator_forces`.
    errors
        ``"raise"`` refuses the first sample that is out of reach or singular; with ``"mask"`` the
        results of such samples are NaN.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `RPSRobot.actuator_forces`.
    """
    x, dx, ddx = poses.checked_motion(pose, rate, acceleration)
    actuator = robot.actuator_forces(x, dx, ddx, wrench=wrench)
    motion, legs = robot.motion(x, dx, ddx)
    axes = leg_axes(np.cos(legs.angle), np.sin(legs.angle))
    p = robot.parameters
    weight = np.einsum("...ji,j->...i", axes, p.gravity)  # gravity in leg axes
    rod = p.rod_mass * (_point_acceleration(legs, legs.length - p.rod_com, sliding=True) - weight)
    cylinder = p.leg_mass * (_point_acceleration(legs, p.leg_com, sliding=False) - weight)
    sliding = friction_force(
        legs.speed, p.prismatic_damping, p.prismatic_friction, p.friction_speed
    )
    turning = friction_force(
        legs.angle_rate, p.revolute_damping, p.revolute_friction, p.friction_speed
    )

    inertia = p.leg_inertia_about_com + p.rod_inertia
    moment = inertia * legs.angle_acceleration + turning
    moment += p.leg_com * cylinder[..., 2] + (legs.length - p.rod_com) * rod[..., 2]
    tip = np.zeros((*legs.length.shape, 3))
    tip[..., 0] = actuator - sliding - rod[..., 0]
    tip[..., 2] = -moment / legs.length
    load = None if wrench is None else checked_wrench(wrench, x.shape[:-1])
    force, couple = _platform_wrench(robot, x, motion, load)
    arms = p.platform_radius * RADIAL @ np.swapaxes(motion.rotation, -1, -2)
    spherical = in_balance(axes, arms, tip, force, couple)
    prismatic = _prismatic(p, legs, tip, rod)
    revolute = _revolute(p, legs, prismatic, cylinder)
    return JointReactions(actuator, spherical, tip, prismatic, revolute, axes, legs.length)


def leg_axes(cosine: Array, sine: Array) -> Array:
    """Return s, -a and t of legs of directions (..., 3 legs) as columns, (..., 3 legs, 3, 3)."""
    cosine, sine = cosine[..., None], sine[..., None]
    along = -cosine * RADIAL + sine * _UP
    upwards = sine * RADIAL + cosine * _UP
    return np.stack([along, np.broadcast_to(-ACROSS, along.shape), upwards], axis=-1)


def in_balance(axes: Array, arms: Array, tip: Array, force: Array, couple: Array) -> Array:
    """Return the legs' forces on the platform in base axes, shape (..., 3 legs, 3).

    The arrays may be of CasADi expressions, with the dtype object.

    Parameters
    ----------
    axes
        Of `leg_axes`.
    arms
        From the platform's centre to its joints, base axes, shape (..., 3 legs, 3).
    tip
        The forces in leg axes, shape (..., 3 legs, 3), but for y, which is put there.
    force, couple
        What the legs must exert on the platform, about its centre, base axes, shape (..., 3).
    """
    known = (axes @ tip[..., None])[..., 0]
    across = _across_planes(arms, force - known.sum(-2), couple - np.cross(arms, known).sum(-2))
    tip[..., 1] = -across  # y is against the joint's axis
    spherical: Array = known + across[..., None] * ACROSS
    return spherical


def _point_acceleration(legs: LegMotion, distance: Array | float, *, sliding: bool) -> Array:
    """Return the acceleration of a point of cylinder or rod, in leg axes, (..., 3 legs, 3)."""
    speed, push = (legs.speed, legs.acceleration) if sliding else (0.0, 0.0)
    acceleration = np.zeros((*legs.length.shape, 3))
    acceleration[..., 0] = push - distance * legs.angle_rate**2
    acceleration[..., 2] = distance * legs.angle_acceleration + 2 * speed * legs.angle_rate
    return acceleration


def _platform_wrench(
    robot: RPSRobot, pose: Array, motion: poses.PlatformMotion, wrench: Array | None
) -> tuple[Array, Array]:
    """Return what the legs must exert on platform and payload, about its centre, base axes."""
    load = None if wrench is None else np.moveaxis(wrench, -1, 0)
    x, y, tilt = poses.tilt_of(pose)
    vectors = motion.acceleration, motion.angular_velocity, motion.angular_acceleration
    a, omega, alpha = (_vector(vector) for vector in vectors)
    force, moment = platform_wrench(robot.force_terms, (x, y, tilt), (a, omega, alpha), load)
    return poses.stacked(*force), poses.stacked(*platform.to_base(x, y, tilt, moment))


def _vector(vectors: Array) -> platform.Vector:
    x, y, z = poses.components(vectors)
    return x, y, z


def _across_planes(arms: Array, force: Array, couple: Array) -> Array:
    """Return the legs' forces along their joints' axes that make up a wrench, (..., 3 legs)."""
    across = 2 / 3 * force @ ACROSS.T
    left = couple - np.cross(arms, across[..., None] * ACROSS).sum(axis=-2)
    unit = np.cross(arms, ACROSS).sum(axis=-2)  # couple of unit forces in all legs
    mu = (left * unit).sum(-1) / (unit * unit).sum(-1)
    total: Array = across + mu[..., None]
    return total


def _prismatic(p: RPSParameters, legs: LegMotion, tip: Array, rod: Array) -> Array:
    """Return the wrench of cylinder on rod at the tip: the rod's balance."""
    wrench = np.zeros((*tip.shape[:-1], 6))
    wrench[..., :3] = tip + rod
    # About the tip, the rod's centre at (-r, 0, 0); it turns with phi'' about -y.
    wrench[..., 4] = -p.rod_inertia * legs.angle_acceleration + p.rod_com * rod[..., 2]
    wrench[..., 5] = -p.rod_com * rod[..., 1]
    return wrench


def _revolute(p: RPSParameters, legs: LegMotion, prismatic: Array, cylinder: Array) -> Array:
    """Return the wrench of the base on the cylinder at the revolute joint: its balance."""
    force, d = prismatic[..., :3], legs.length
    wrench = prismatic.copy()
    wrench[..., :3] += cylinder
    wrench[..., 4] -= d * force[..., 2] + p.leg_com * cylinder[..., 2]
    wrench[..., 4] -= p.leg_inertia_about_com * legs.angle_acceleration
    wrench[..., 5] += d * force[..., 1] + p.leg_com * cylinder[..., 1]
    return wrench
