"""Actuator forces of many samples in closed form: virtual work, a body at a time.

The legs' axial forces F must do the work that the bodies' motion takes, for the three virtual
motions x = (z, h tilt_x, h tilt_y):

    K' (F - F_rod) = sum over legs of (d(phi_i)/dx)' M_i  +  the platform's part,

with K = d(length)/dx, F_rod what the rods' own acceleration along the legs takes, and M_i the
moment about the revolute joint that turning cylinder and rod takes. With the tip in its leg's plane
at rho_i = e_i . B_i and z_i = z . B_i, s = (-cos(phi), sin(phi)) along the leg and t = (sin(phi),
cos(phi)) across it, in that plane,

    K_i = s . d(rho_i, z_i)/dx,      d d(phi_i)/dx = t . d(rho_i, z_i)/dx.

**Rings.** What makes this cheap: with w the tilt, C = cos(|w|), and P the centre, Eq. 1 and 4 give

    rho_i = h (1 + C)/2 + 2 e_i . P,     z_i = z + e_i . U,     U = h A (-w_y, w_x)

(A, B, C, D of `rps_pin.rps.kinematics.pose`): three numbers for three legs, a mean and a horizontal
vector. The same holds for all their derivatives, and sums over the legs need only the forces' sum
and their first moment along e_i. Arrays are components of all samples of a block, contiguous, few
enough to stay in the processor's cache.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.rps.dynamics.friction import friction_force
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.tip_rings import (
    TiltFunctions,
    Tips,
    Triple,
    resultant,
    tilt_functions,
    tips_of,
)
from rps_pin.rps.parameters import RPSParameters

#: A pose is looked at closely from this size of the legs' forces for a unit force on the platform.
CLOSE = 1e4


@dataclass(frozen=True)
class ForceTerms:
    """What an actuator force is made of; any of it may be zero. SI units."""

    base_radius: float
    platform_radius: float
    platform_mass: float
    """With the payload."""
    platform_moment: tuple[float, float, float]
    """Mass times centre of mass, platform axes, kg m: of a payload beside the platform's centre."""
    platform_inertia: tuple[float, ...]
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


def inertia_entries(inertia: Array) -> tuple[float, ...]:
    """Return xx, yy, zz, xy, xz, yz of a symmetric matrix (3, 3)."""
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    return tuple(inertia[rows, columns].tolist())


class BlockState(NamedTuple):
    """Where a block's legs are, and what moving its bodies takes; n samples."""

    tilt: TiltFunctions
    tips: Tips
    length: Array
    """d, shape (3 legs, n), m."""
    cosine: Array
    """cos(phi), shape (3 legs, n)."""
    sine: Array
    """sin(phi), shape (3 legs, n)."""
    along: Array
    """F_rod, which the rod takes along the leg, prismatic friction included, shape (3 legs, n)."""
    across: Array
    """M/d at the tip across the leg, revolute friction included, shape (3 legs, n), N."""
    force: Triple
    """What the legs must exert on the platform, base axes, N."""
    moment: Triple
    """Likewise about the platform's centre, platform axes, N m."""


def block_state(
    terms: ForceTerms, pose: Array, rate: Array, acceleration: Array, wrench: Array | None
) -> BlockState:
    """Return what moving the bodies of a block takes.

    Parameters
    ----------
    terms
        What takes part.
    pose, rate, acceleration
        Components (z, tilt_x, tilt_y) and their time derivatives, shape (3, n) each.
    wrench
        On the platform, components of shape (6, n), or none.
    """
    tilt = tilt_functions(pose[1] * pose[1] + pose[2] * pose[2])
    tips = tips_of(terms.platform_radius, tilt, pose, rate, acceleration)
    inwards = terms.base_radius - tips.radial.at_legs()  # d cos(phi)
    up = tips.height.at_legs()  # d sin(phi)
    length = np.sqrt(inwards * inwards + up * up)
    over_length = 1.0 / length
    way = inwards * over_length, up * over_length
    along, across = _leg_forces(terms, tips, length, over_length, way)
    force, moment = _platform_wrench(terms, tilt, pose, rate, (tips, acceleration), wrench)
    return BlockState(tilt, tips, length, *way, along, across, force, moment)


def solved_forces(terms: ForceTerms, pose: Array, state: BlockState) -> tuple[Array, Bools]:
    """Return a block's actuator forces, and the samples that must be looked at closely.

    Returns
    -------
    force
        Of the actuators, shape (3 legs, n), N; of no meaning at a singularity.
    close
        Whether a pose may be singular, or a leg has no length, shape (n,).
    """
    tilt, cosine, sine = state.tilt, state.cosine, state.sine
    rho_x, rho_y = state.tips.radial_slopes
    z_x, z_y = state.tips.height_slopes
    by_x = sine * z_x.at_legs() - cosine * rho_x.at_legs()
    by_y = sine * z_y.at_legs() - cosine * rho_y.at_legs()
    force, gain = _by_cofactors(sine, by_x, by_y, _needed(terms, pose, state))
    force += state.along
    # The legs' planes hold the platform with forces that grow like 1 / cos(|w| / 2), whose square
    # is (1 + C) / 2, and a leg turns as fast as its tip moves over its length.
    lever = np.minimum(1.0, state.length.min(axis=0) / terms.platform_radius)
    return force, ~(gain < CLOSE**2 * (lever * lever) * (0.5 + 0.5 * tilt.c))


def _needed(terms: ForceTerms, pose: Array, state: BlockState) -> Triple:
    """Return the virtual work that K' (F - F_rod) must do, by z, h tilt_x and h tilt_y."""
    # The tips must be pushed with t M/d besides: of that, the sum and the moments along e_i.
    radial = resultant(state.sine * state.across)
    height = resultant(state.cosine * state.across)
    force, moment, tilt = state.force, state.moment, state.tilt
    pull_x, pull_y = radial[1] + 0.5 * force[0], radial[2] + 0.5 * force[1]  # rings hold 2 P
    # d(omega)/dw' = 1 + (w_y, -w_x) (D (w_y, -w_x, 0) + B z)'
    spin = tilt.d * (moment[1] * pose[1] - moment[0] * pose[2]) + tilt.b * moment[2]
    couple = moment[0] + pose[2] * spin, moment[1] - pose[1] * spin
    by_tilt = [
        radial[0] * rho.mean
        + (pull_x * rho.x + pull_y * rho.y)
        + (height[1] * z.x + height[2] * z.y)
        + part / terms.platform_radius
        for rho, z, part in zip(
            state.tips.radial_slopes, state.tips.height_slopes, couple, strict=True
        )
    ]
    return height[0] + force[2], by_tilt[0], by_tilt[1]


def _leg_forces(
    terms: ForceTerms, tips: Tips, length: Array, over_length: Array, way: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return F_rod and M/d of the legs, shape (3, n) each, N.

    With the polar coordinates' d'' - d phi'^2 = s . tip'' and d phi'' + 2 d' phi' = t . tip''.
    """
    cosine, sine = way
    radial, height = tips.radial_rate.at_legs(), tips.height_rate.at_legs()
    speed = sine * height - cosine * radial  # d'
    turning = (sine * radial + cosine * height) * over_length  # phi'
    radial, height = tips.radial_acceleration.at_legs(), tips.height_acceleration.at_legs()
    outwards, downwards = RADIAL @ terms.gravity, terms.gravity[2]
    fall = sine * outwards[:, None] + cosine * downwards  # t . gravity
    twice = 2 * speed * turning
    angular = (sine * radial + cosine * height - twice) * over_length  # phi''
    inertia: Array | float = terms.leg_inertia
    moment = -terms.leg_moment * fall
    along = np.zeros_like(length)
    if terms.rod_mass:
        reach = length - terms.rod_com
        swing = terms.rod_mass * reach
        weight = sine * downwards - cosine * outwards[:, None]  # s . gravity
        pull = sine * height - cosine * radial
        along = terms.rod_mass * (pull + terms.rod_com * (turning * turning) - weight)
        inertia = inertia + swing * reach
        moment += swing * (twice - fall)
    moment += inertia * angular
    if terms.prismatic_damping or terms.prismatic_friction:
        along += friction_force(
            speed, terms.prismatic_damping, terms.prismatic_friction, terms.friction_speed
        )
    if terms.revolute_damping or terms.revolute_friction:
        moment += friction_force(
            turning, terms.revolute_damping, terms.revolute_friction, terms.friction_speed
        )
    return along, moment * over_length


def _platform_wrench(
    terms: ForceTerms,
    tilt: TiltFunctions,
    pose: Array,
    rate: Array,
    rest: tuple[Tips, Array],
    wrench: Array | None,
) -> tuple[Triple, Triple]:
    """Return what moving platform and payload takes: force, base axes; moment, platform axes.

    About the platform's centre. With gamma the centre's acceleration less gravity and S the mass
    times the centre of mass: m gamma + alpha x S + omega x (omega x S), and
    I alpha + omega x I omega + S x gamma.
    """
    tips, acceleration = rest
    _, x, y = pose
    _, dx, dy = rate
    _, ddx, ddy = acceleration
    # omega = (w', 0) + n (w_y, -w_x, 0) - (0, 0, B m), m = (w x w')_z, n = D m; platform axes.
    ds = 2 * (x * dx + y * dy)
    m, dm = x * dy - y * dx, x * ddy - y * ddx
    n = tilt.d * m
    dn = tilt.d_s * ds * m + tilt.d * dm
    omega = (dx + n * y, dy - n * x, -tilt.b * m)
    alpha = (
        ddx + dn * y + n * dy,
        ddy - dn * x - n * dx,
        -(tilt.b_s * ds * m + tilt.b * dm),
    )
    spin = _times(terms.platform_inertia, omega)
    moment = _sum(_times(terms.platform_inertia, alpha), _cross(omega, spin))
    centre = tips.radial_acceleration
    g_x, g_y, g_z = terms.gravity
    gamma = (0.5 * centre.x - g_x, 0.5 * centre.y - g_y, tips.height_acceleration.mean - g_z)
    mass = terms.platform_mass
    force = (mass * gamma[0], mass * gamma[1], mass * gamma[2])
    if any(terms.platform_moment):
        # alpha x S = -S x alpha, and omega x (omega x S) = -omega x (S x omega)
        lever = terms.platform_moment
        local = _sum(_cross(lever, alpha), _cross(omega, _cross(lever, omega)))
        force = _sum(force, _turned(tilt, x, y, (-local[0], -local[1], -local[2]), 1.0))
        moment = _sum(moment, _cross(lever, _turned(tilt, x, y, gamma, -1.0)))
    if wrench is not None:
        force = _sum(force, (-wrench[0], -wrench[1], -wrench[2]))
        moment = _sum(moment, _turned(tilt, x, y, (-wrench[3], -wrench[4], -wrench[5]), -1.0))
    return force, moment


def _turned(tilt: TiltFunctions, x: Array, y: Array, vector: Triple, sign: float) -> Triple:
    """Return R v (sign 1, to base axes) or R' v (sign -1): C v + A w x v + B w (w . v)."""
    v_x, v_y, v_z = vector
    a = sign * tilt.a
    along = tilt.b * (x * v_x + y * v_y)
    lift = a * v_z
    return (
        tilt.c * v_x + y * lift + along * x,
        tilt.c * v_y - x * lift + along * y,
        tilt.c * v_z + a * (x * v_y - y * v_x),
    )


def _by_cofactors(k_z: Array, k_x: Array, k_y: Array, needed: Triple) -> tuple[Array, Array]:
    """Return F of K' F = needed, shape (3, n), by cofactors, and the squared norm of K^-1."""
    force = np.empty_like(k_z)
    norm, det = np.zeros_like(k_z[0]), np.zeros_like(k_z[0])
    for leg in range(3):
        i, j = (leg + 1) % 3, (leg + 2) % 3
        by_z = k_x[i] * k_y[j] - k_y[i] * k_x[j]
        by_x = k_y[i] * k_z[j] - k_z[i] * k_y[j]
        by_y = k_z[i] * k_x[j] - k_x[i] * k_z[j]
        force[leg] = by_z * needed[0] + by_x * needed[1] + by_y * needed[2]
        norm += by_z * by_z + by_x * by_x + by_y * by_y
        if leg == 0:
            det += k_z[0] * by_z + k_x[0] * by_x + k_y[0] * by_y
    over = 1.0 / det
    force *= over
    return force, norm * over * over


def _times(inertia: tuple[float, ...], v: Triple) -> Triple:
    """Return a symmetric matrix times a vector."""
    xx, yy, zz, xy, xz, yz = inertia
    if xy == xz == yz == 0:
        return xx * v[0], yy * v[1], zz * v[2]
    return (
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    )


def _cross(a: Triple | tuple[float, float, float], b: Triple) -> Triple:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
