"""Actuator forces of many samples in closed form: virtual work, a body at a time.

The legs' axial forces F must do the work that the bodies' motion takes, for the three virtual
motions x = (z, h tilt_x, h tilt_y):

    K' (F - F_rod) = sum over legs of (d(phi_i)/dx)' M_i  +  the platform's part,

with K = d(length)/dx, F_rod what the rods' own acceleration along the legs takes, and M_i the
moment about the revolute joint that turning cylinder and rod takes. With the tip in its leg's plane
at rho_i = e_i . B_i and z_i = z . B_i, s = (-cos(phi), sin(phi)) along the leg and t = (sin(phi),
cos(phi)) across it, in that plane,

    K_i = s . d(rho_i, z_i)/dx,      d d(phi_i)/dx = t . d(rho_i, z_i)/dx.

The numbers are those of `rps_pin.rps.kernels`; arrays are components of all samples of a block,
contiguous, few enough to stay in the processor's cache, and those of the legs are (3 legs, n).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.elementary import is_zero
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.kernels import forces, legs, platform, tips
from rps_pin.rps.kernels.platform import Inertia, Vector
from rps_pin.rps.kernels.tilt_functions import TiltFunctions
from rps_pin.rps.kinematics.legs import PoseLegs
from rps_pin.rps.parameters import RPSParameters

#: A pose is looked at closely from this size of the legs' forces for a unit force on the platform.
CLOSE = 1e4


@dataclass(frozen=True)
class ForceTerms:
    """Parameters of the actuator forces; any of them may be zero. SI units."""

    base_radius: float
    platform_radius: float
    platform_mass: float
    """With the payload."""
    platform_moment: tuple[float, float, float]
    """Mass times centre of mass, platform axes, kg m: of a payload beside the platform's centre."""
    platform_inertia: Inertia
    """With the payload, about the platform's centre, platform axes: xx, yy, zz, xy, xz, yz."""
    leg_moment: float
    """Mass times centre of mass of a cylinder, from its revolute joint."""
    leg_inertia: float
    """Of a cylinder about its revolute joint, and of a rod about its own centre of mass."""
    rod_mass: float
    rod_com: float
    gravity: tuple[float, float, float]
    prismatic_damping: float
    prismatic_friction: float
    revolute_damping: float
    revolute_friction: float
    friction_speed: float

    @classmethod
    def of(cls, p: RPSParameters, payload: Payload | None = None) -> ForceTerms:
        """Return the terms of a robot, and of what it carries."""
        mass, moment, inertia = p.platform_mass, np.zeros(3), np.array(p.platform_inertia)
        if payload is not None:
            mass += payload.mass
            moment = payload.first_moment
            inertia = inertia + payload.inertia_about_platform
        return cls(
            base_radius=p.base_radius,
            platform_radius=p.platform_radius,
            platform_mass=mass,
            platform_moment=vector_entries(moment),
            platform_inertia=inertia_entries(inertia),
            leg_moment=p.leg_mass * p.leg_com,
            leg_inertia=p.leg_inertia_about_com + p.leg_mass * p.leg_com**2 + p.rod_inertia,
            rod_mass=p.rod_mass,
            rod_com=p.rod_com,
            gravity=vector_entries(p.gravity),
            prismatic_damping=p.prismatic_damping,
            prismatic_friction=p.prismatic_friction,
            revolute_damping=p.revolute_damping,
            revolute_friction=p.revolute_friction,
            friction_speed=p.friction_speed,
        )


def vector_entries(vector: Array) -> tuple[float, float, float]:
    """Return the components of a vector (3,)."""
    x, y, z = vector.tolist()
    return x, y, z


def inertia_entries(inertia: Array) -> Inertia:
    """Return xx, yy, zz, xy, xz, yz of a symmetric matrix (3, 3)."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    return xx, yy, zz, xy, xz, yz


class LegBlock(NamedTuple):
    """The legs of a block of poses, and what solves for their forces; n samples."""

    x: Array
    y: Array
    tilt: TiltFunctions
    slopes: tips.Slopes
    """Of the tips, by h tilt_x and h tilt_y."""
    length: Array
    """d, shape (3 legs, n), m."""
    cosine: Array
    """cos(phi), shape (3 legs, n)."""
    sine: Array
    """sin(phi), shape (3 legs, n)."""
    cofactors: forces.Rows
    """Of K, d(length)/d(z, h tilt_x, h tilt_y)."""
    over_determinant: Array
    """One over its determinant, shape (n,)."""


def leg_block(of_poses: PoseLegs) -> LegBlock:
    """Return the legs of poses (n, 3) as a block, with what solves for their forces."""
    (x, y, tilt), slopes, geometry = of_poses
    return legs_of_tilt(
        *(x, y, tilt, slopes),
        *(geometry.length.T, geometry.cosine.T, geometry.sine.T),
    )


def legs_of_tilt(
    x: Array,
    y: Array,
    tilt: TiltFunctions,
    slopes: tips.Slopes,
    d: Array,
    cosine: Array,
    sine: Array,
) -> LegBlock:
    """Return the same from the tilt, the tips' slopes, and the legs, shape (3, n) each.

    The arrays may be of CasADi expressions, with the dtype object and n = 1; so may those of
    `forces_of_motion`.
    """
    rho_x, rho_y, z_x, z_y = (tips.at_legs(ring) for ring in slopes)
    by_x = legs.along_leg(cosine, sine, rho_x, z_x)
    by_y = legs.along_leg(cosine, sine, rho_y, z_y)
    cofactors, det = forces.cofactors([*zip(sine, by_x, by_y, strict=True)])
    return LegBlock(x, y, tilt, slopes, d, cosine, sine, cofactors, 1.0 / det)


def may_be_singular(block: LegBlock, platform_radius: float) -> Bools:
    """Return which poses may be singular, or have a leg without length, shape (n,)."""
    shortest = block.length.min(axis=0) / platform_radius
    regular = forces.is_regular(
        block.cofactors, block.over_determinant, shortest, block.tilt[2], CLOSE
    )
    close: Bools = ~regular
    return close


class MotionForces(NamedTuple):
    """Forces of a motion; n samples."""

    axial: Array
    """Of the actuators, shape (3 legs, n), N; meaningless at a singularity."""
    push: Array
    """Of each leg on the platform along the leg, shape (3 legs, n), N."""
    across: Array
    """Of the platform on each leg across it in its plane, shape (3 legs, n), N."""
    force: Vector
    """Of the legs on the platform, base axes, N."""
    moment: Vector
    """Of the legs on the platform about its centre, platform axes, N m."""


def forces_of_motion(
    terms: ForceTerms, block: LegBlock, rate: Array, acceleration: Array, wrench: Array | None
) -> MotionForces:
    """Return the forces of a block's motion.

    Parameters
    ----------
    terms
        Masses, friction and gravity that are included.
    block
        The legs.
    rate, acceleration
        Time derivatives of the pose's components, shape (3, n) each.
    wrench
        On the platform, components of shape (6, n), or none.
    """
    h = terms.platform_radius
    x, y, tilt, slopes, _, cosine, sine, cofactors, over = block
    (dz, dx, dy), (ddz, ddx, ddy) = rate, acceleration
    rates = tips.tip_rates(slopes, dz, h * dx, h * dy)
    changes = tips.tip_accelerations((x, y, dx, dy, ddx, ddy), ddz, tilt, h)
    along, across = _leg_forces(terms, block, rates, changes)
    (_, p_x, p_y), (p_z, _, _) = changes
    centre = (0.5 * p_x, 0.5 * p_y, p_z)
    omega = platform.angular_velocity(x, y, dx, dy, tilt)
    alpha = platform.angular_acceleration(x, y, dx, dy, ddx, ddy, tilt)
    force, moment = platform_wrench(terms, (x, y, tilt), (centre, omega, alpha), wrench)
    by_tilt = forces.tilt_couple(x, y, tilt, moment)
    needed = forces.virtual_work(
        slopes,
        tips.resultant(sine * across),
        tips.resultant(cosine * across),
        force,
        (by_tilt[0] / h, by_tilt[1] / h),
    )
    push: Array = np.array(forces.row_products(cofactors, needed))
    push *= over
    return MotionForces(push + along, push, across, force, moment)


def _leg_forces(
    terms: ForceTerms,
    block: LegBlock,
    rates: tuple[tips.Ring, tips.Ring],
    changes: tuple[tips.Ring, tips.Ring],
) -> tuple[Array, Array]:
    """Return F_rod and M/d of the legs, shape (3, n) each, N."""
    d, cosine, sine = block.length, block.cosine, block.sine
    velocity, change = ([tips.at_legs(ring) for ring in pair] for pair in (rates, changes))
    motion = legs.leg_motion(cosine, sine, d, velocity, change)
    speed, angle_rate, acceleration, angle_acceleration = motion
    g_x, g_y, downwards = terms.gravity
    outwards = np.reshape(tips.at_legs((0.0, g_x, g_y)), (3, -1))
    fall = legs.across_leg(cosine, sine, outwards, downwards)
    moment = forces.cylinder_moment(terms.leg_moment, terms.leg_inertia, angle_acceleration, fall)
    force = np.zeros_like(d)
    if not is_zero(terms.rod_mass):
        weight = legs.along_leg(cosine, sine, outwards, downwards)
        turning = angle_rate, angle_acceleration, acceleration
        force = forces.rod_force(terms.rod_mass, terms.rod_com, d, turning, weight)
        coriolis = 2.0 * speed * angle_rate
        moment += forces.rod_moment(
            terms.rod_mass, d - terms.rod_com, coriolis, angle_acceleration, fall
        )
    if not (is_zero(terms.prismatic_damping) and is_zero(terms.prismatic_friction)):
        force += forces.friction_force(
            speed, terms.prismatic_damping, terms.prismatic_friction, terms.friction_speed
        )
    if not (is_zero(terms.revolute_damping) and is_zero(terms.revolute_friction)):
        moment += forces.friction_force(
            angle_rate, terms.revolute_damping, terms.revolute_friction, terms.friction_speed
        )
    return force, moment / d


def platform_wrench(
    terms: ForceTerms,
    tilt: tuple[Array, Array, TiltFunctions],
    motion: tuple[Vector, Vector, Vector],
    wrench: Array | None,
) -> tuple[Vector, Vector]:
    """Return what moving platform and payload takes: force, base axes; moment, platform axes.

    About the platform's centre. With gamma the centre's acceleration less gravity and S the mass
    times the centre of mass: m gamma + alpha x S + omega x (omega x S), and
    I alpha + omega x I omega + S x gamma.

    Parameters
    ----------
    terms
        Mass, first moment, inertia and gravity.
    tilt
        tilt_x, tilt_y and the functions of the tilt.
    motion
        The centre's acceleration in base axes, angular velocity and acceleration in platform axes.
    wrench
        On the platform, six components, or none.
    """
    (a_x, a_y, a_z), omega, alpha = motion
    g_x, g_y, g_z = terms.gravity
    mass, inertia = terms.platform_mass, terms.platform_inertia
    principal = all(is_zero(product) for product in inertia[3:])
    times = platform.principal_times if principal else platform.inertia_times
    gamma = (a_x - g_x, a_y - g_y, a_z - g_z)
    force = (mass * gamma[0], mass * gamma[1], mass * gamma[2])
    moment = platform.turning_moment(omega, times(inertia, omega), times(inertia, alpha))
    if not all(is_zero(moment) for moment in terms.platform_moment):
        offset = terms.platform_moment
        local = platform.offset_force(offset, omega, alpha)
        force = platform.total(force, platform.to_base(*tilt, local))
        moment = platform.total(moment, platform.cross(offset, platform.to_platform(*tilt, gamma)))
    if wrench is not None:
        f_x, f_y, f_z, *outside = wrench
        m_x, m_y, m_z = outside
        force = (force[0] - f_x, force[1] - f_y, force[2] - f_z)
        moment = platform.total(moment, platform.to_platform(*tilt, (-m_x, -m_y, -m_z)))
    return force, moment
