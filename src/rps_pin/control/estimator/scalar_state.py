"""The whole Pinocchio state of a motion of the platform, in plain floats: `RPSRobot.state`.

The tips of `rps_pin.control.estimator.place` are differentiated twice, and made polar coordinates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.control.estimator.place import Place
from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.tracking import Triple

(_E1, _E2, _E3) = ((float(x), float(y)) for x, y, _ in RADIAL)

#: How a leg moves: phi', d', phi'', d''. A plain tuple: it is made thrice a tick.
LegMotion = tuple[float, float, float, float]
#: A, A', A'', B, B', B'', D, D' along the motion.
_Changing = tuple[float, float, float, float, float, float, float, float]


class RobotState(NamedTuple):
    """Legs 1, 2, 3, and the platform as Pinocchio's free-flyer has it."""

    place: Place
    legs: tuple[LegMotion, LegMotion, LegMotion]
    placement: tuple[float, ...]
    """Centre and quaternion (x, y, z, w), seven numbers."""
    velocity: tuple[float, ...]
    """In platform axes: linear, then angular, six numbers."""
    acceleration: tuple[float, ...]
    """Spatial, in platform axes, six numbers."""


@compiled
def state_at(place: Place, rate: Triple, acceleration: Triple, h: float) -> RobotState:
    """Return the state at a place, of the pose's first and second derivative."""
    pose, _, _, _, coefficient = place
    _, wx, wy = pose
    _, dwx, dwy = rate
    _, ddwx, ddwy = acceleration
    a, b, _, d, a_s, b_s, d_s, a_ss, b_ss = coefficient
    ds = 2.0 * (wx * dwx + wy * dwy)
    dds = 2.0 * (dwx * dwx + dwy * dwy + wx * ddwx + wy * ddwy)
    da, dda = a_s * ds, a_ss * ds * ds + a_s * dds
    db, ddb = b_s * ds, b_ss * ds * ds + b_s * dds
    changing = (a, da, dda, b, db, ddb, d, d_s * ds)
    legs = (
        _leg(0, _E1, place, rate, acceleration, changing, h),
        _leg(1, _E2, place, rate, acceleration, changing, h),
        _leg(2, _E3, place, rate, acceleration, changing, h),
    )
    placement, velocity, spatial = _platform(pose, rate, acceleration, changing, coefficient[2], h)
    return RobotState(place, legs, placement, velocity, spatial)


@compiled
def leg_motion(place: Place, rate: Triple, acceleration: Triple, h: float) -> tuple[Triple, Triple]:
    """Return the legs' speeds and accelerations: those of `state_at`, in less time."""
    leg1, leg2, leg3 = state_at(place, rate, acceleration, h).legs
    return (leg1[1], leg2[1], leg3[1]), (leg1[3], leg2[3], leg3[3])


@compiled
def _platform(
    pose: Triple, rate: Triple, acceleration: Triple, changing: _Changing, c: float, h: float
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Return placement, velocity and acceleration; the formulas of `kinematics.pose`."""
    z, wx, wy = pose
    dz, dwx, dwy = rate
    ddz, ddwx, ddwy = acceleration
    a, _, _, b, db, ddb, d, dd = changing
    f, df = wx * wx - wy * wy, 2.0 * (wx * dwx - wy * dwy)
    ddf = 2.0 * (dwx * dwx - dwy * dwy + wx * ddwx - wy * ddwy)
    k, dk = wx * wy, dwx * wy + wx * dwy
    ddk = ddwx * wy + 2.0 * dwx * dwy + wx * ddwy
    half = h / 2.0
    px, py = half * b * f, -h * b * k
    dpx, dpy = half * (db * f + b * df), -h * (db * k + b * dk)
    ddpx = half * (ddb * f + 2.0 * db * df + b * ddf)
    ddpy = -h * (ddb * k + 2.0 * db * dk + b * ddk)

    m, dm = wx * dwy - wy * dwx, wx * ddwy - wy * ddwx
    n, dn = d * m, dd * m + d * dm
    spin_x, spin_y, spin_z = dwx + n * wy, dwy - n * wx, -b * m
    turn_x = ddwx + dn * wy + n * dwy
    turn_y = ddwy - dn * wx - n * dwx
    turn_z = -db * m - b * dm

    # R = [u v n]; a free-flyer's velocity is R' p', its spatial acceleration R' p'' - w x R' p'.
    ux, uy, uz = c + b * wx * wx, b * k, -a * wy
    vy, vz = c + b * wy * wy, a * wx
    lx = ux * dpx + uy * dpy + uz * dz
    ly = uy * dpx + vy * dpy + vz * dz
    lz = -uz * dpx - vz * dpy + c * dz
    pull_x = ux * ddpx + uy * ddpy + uz * ddz - (spin_y * lz - spin_z * ly)
    pull_y = uy * ddpx + vy * ddpy + vz * ddz - (spin_z * lx - spin_x * lz)
    pull_z = -uz * ddpx - vz * ddpy + c * ddz - (spin_x * ly - spin_y * lx)

    half_tilt = math.hypot(wx, wy) / 2.0
    sine = math.sin(half_tilt) / (2.0 * half_tilt) if half_tilt > 0.0 else 0.5
    return (
        (px, py, z, wx * sine, wy * sine, 0.0, math.cos(half_tilt)),
        (lx, ly, lz, spin_x, spin_y, spin_z),
        (pull_x, pull_y, pull_z, turn_x, turn_y, turn_z),
    )


@compiled
def _leg(
    number: int,
    radial: tuple[float, float],
    place: Place,
    rate: Triple,
    acceleration: Triple,
    changing: _Changing,
    h: float,
) -> LegMotion:
    """Return how a leg moves."""
    ex, ey = radial
    _, wx, wy = place.pose
    dz, dwx, dwy = rate
    ddz, ddwx, ddwy = acceleration
    a, da, dda, b, db, ddb, _, _ = changing
    e, t = wx * ex + wy * ey, wy * ex - wx * ey
    de, dt = dwx * ex + dwy * ey, dwy * ex - dwx * ey
    dde, ddt = ddwx * ex + ddwy * ey, ddwy * ex - ddwx * ey
    f, df = e * e - 3.0 * t * t, 2.0 * (e * de - 3.0 * t * dt)
    ddf = 2.0 * (de * de - 3.0 * dt * dt + e * dde - 3.0 * t * ddt)
    d_in, d_up = -h / 2.0 * (db * f + b * df), dz - h * (da * t + a * dt)
    dd_in = -h / 2.0 * (ddb * f + 2.0 * db * df + b * ddf)
    dd_up = ddz - h * (dda * t + 2.0 * da * dt + a * ddt)
    # Polar coordinates: radial d'' - d phi'^2, across d phi'' + 2 d' phi'.
    d, cosine, sine = place.length[number], place.way[number], place.way[number + 3]
    speed = cosine * d_in + sine * d_up
    angle_rate = (cosine * d_up - sine * d_in) / d
    return (
        angle_rate,
        speed,
        (cosine * dd_up - sine * dd_in - 2.0 * speed * angle_rate) / d,
        cosine * dd_in + sine * dd_up + d * angle_rate * angle_rate,
    )
