"""One step of `forward_kinematics` after the other, in plain floats: for calls in a loop.

Ten times faster than arrays of three. The steps are those the Newton-Kantorovich theorem allows
(see `rps_pin.rps.kinematics.forward_kinematics`); within one, the first inverse of the Jacobian
serves twice, for a Newton and a chord step, both of which the theorem covers. What is then left of
Eq. 8 is of third order in the step, and one more Newton step reaches rounding error.

Whole numbers are written as floats: Python multiplies two floats faster than a float and an
integer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rps_pin.numerics.compiled import compiled

#: Three leg lengths, m.
Lengths = tuple[float, float, float]
#: Cosines, then sines, of the three leg angles.
Way = tuple[float, float, float, float, float, float]
Triple = tuple[float, float, float]
#: Half of the inverse Jacobian by leg angles, row by row, sign turned.
_Inverse = tuple[float, float, float, float, float, float, float, float, float]
_Step = tuple[Triple, float, float, float, _Inverse]

#: Largest beta L eta of a step: half of what the theorem asks for.
TRUST = 0.25
_MOST_NEWTON = 12
#: Half a Newton step, rad, after which another would only move rounding errors.
_LAST_STEP = 1e-9
_SQRT3 = math.sqrt(3.0)
_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Followed(NamedTuple):
    """How far lengths were followed."""

    way: Way
    """Directions of the legs there."""
    condition: float
    """Condition number of Eq. 8's Jacobian there (before the last Newton step, below 2e-9 rad)."""
    fraction: float
    """How much of the way was gone: 1 where the lengths wanted were reached."""


def direction_of_legs(angle: Triple) -> Way:
    """Return the cosines, then the sines, of the leg angles, rad."""
    phi1, phi2, phi3 = angle
    return (
        *(math.cos(phi1), math.cos(phi2), math.cos(phi3)),
        *(math.sin(phi1), math.sin(phi2), math.sin(phi3)),
    )


def condition_of(d: Lengths, way: Way, g: float, h: float) -> float:
    """Return the condition number of Eq. 8's Jacobian by leg angles, in greatest row sums."""
    return _newton_step(d, way, g, h)[2]


@compiled
def follow(
    begin: Lengths, way: Way, goal: Lengths, g: float, h: float, limit: float, most: int
) -> Followed:
    """Follow leg lengths on the straight way from known ones, in at most so many steps.

    Parameters
    ----------
    begin, way
        Lengths and directions that satisfy Eq. 8.
    goal
        Lengths wanted, m.
    g, h
        Radii of base and platform, m.
    limit
        Largest condition number that is followed through.
    most
        Largest number of steps, those that had to be shortened among them.
    """
    done, share, condition = 0.0, 1.0, math.inf
    for _ in range(most):
        to = min(1.0, done + share)
        d = goal if to == 1.0 else _between(begin, goal, to)
        solved, there, worth, growth = _solve(d, way, g, h, limit)
        if solved:
            way, condition, done = there, worth, to
        if done == 1.0:
            break
        share *= growth
    return Followed(way, condition, done)


@compiled
def pose_of(d: Lengths, way: Way, g: float, h: float) -> Triple:
    """Return (z, tilt_x, tilt_y): as `placement_from_angles`, where the formulas are explained."""
    rho_1, rho_2, rho_3 = g - d[0] * way[0], g - d[1] * way[1], g - d[2] * way[2]
    z1, z2, z3 = d[0] * way[3], d[1] * way[4], d[2] * way[5]
    z = (z1 + z2 + z3) / 3.0
    outwards, across = (rho_2 + rho_3) / 2.0, (rho_2 - rho_3) / 2.0
    u_x, u_y, u_z = (2.0 * rho_1 + outwards) / (3.0 * h), -across / (_SQRT3 * h), (z1 - z) / h
    v_y, v_z = outwards / h, (z2 - z3) / (_SQRT3 * h)
    q_w = math.sqrt(max(0.0, u_x + v_y) / 2.0)
    if u_x + v_y >= 1:
        q_x, q_y = v_z / (2.0 * q_w), -u_z / (2.0 * q_w)
    elif v_y <= u_x:
        q_x = math.copysign(math.sqrt((1.0 - v_y) / 2.0), v_z)
        q_y = u_y / (2.0 * q_x)
    else:
        q_y = math.copysign(math.sqrt((1.0 - u_x) / 2.0), -u_z)
        q_x = u_y / (2.0 * q_y)
    half_sine = math.hypot(q_x, q_y)
    if u_x + v_y < 1:
        q_w = math.hypot(u_z, v_z) / (2.0 * half_sine)
    factor = 2.0 * math.atan2(half_sine, q_w) / half_sine if half_sine > 1e-9 else 2.0
    return z, q_x * factor, q_y * factor


# Inner workings -----------------------------------------------------------------------------------


@compiled
def _solve(
    d: Lengths, way: Way, g: float, h: float, limit: float
) -> tuple[bool, Way, float, float]:
    """Return whether it is solved, directions, condition, and by how much to change the step."""
    t, det, condition, kantorovich, inverse = _newton_step(d, way, g, h)
    if not (kantorovich <= TRUST and condition <= limit):
        shorter = max(0.02, min(0.5, 0.8 * TRUST / kantorovich)) if kantorovich > 0.0 else 0.5
        return False, way, condition, shorter
    at = _turned(way, t)
    if max(t) > _LAST_STEP or min(t) < -_LAST_STEP:
        at = _turned(at, _chord_step(d, at, g, h, inverse))
    for _ in range(_MOST_NEWTON):
        t, there, condition, _, _ = _newton_step(d, at, g, h)
        at = _turned(at, t)
        if max(t) < _LAST_STEP and min(t) > -_LAST_STEP:
            # What is left is its square: lost in rounding.
            if condition <= limit and (there > 0) == (det > 0):
                growth = 0.8 * TRUST / max(kantorovich, 1e-9)
                return True, at, condition, max(0.5, min(4.0, growth))
            break
    return False, way, condition, 0.5


@compiled
def _newton_step(d: Lengths, way: Way, g: float, h: float) -> _Step:
    """Return half Newton's step of Eq. 8 in each angle, and what it is worth.

    That is the determinant, the condition, beta L eta and half of the negative inverse;
    `rps_pin.rps.kinematics.leg_equations` has the equations.
    """
    d1, d2, d3 = d
    c1, c2, c3, s1, s2, s3 = way
    w1, w2, w3 = d1 * c1, d2 * c2, d3 * c3
    z1, z2, z3 = d1 * s1, d2 * s2, d3 * s3
    reach = 3.0 * g
    m1, m2, m3 = reach - w1, reach - w2, reach - w3
    rest = 6.0 * g * g + 3.0 * h * h
    square1, square2, square3 = d1 * d1, d2 * d2, d3 * d3
    f12 = m1 * m2 - 2.0 * z1 * z2 + square1 + square2 - rest
    f23 = m2 * m3 - 2.0 * z2 * z3 + square2 + square3 - rest
    f31 = m3 * m1 - 2.0 * z3 * z1 + square3 + square1 - rest
    a1, a2 = m2 * z1 - 2.0 * z2 * w1, m1 * z2 - 2.0 * z1 * w2
    b2, b3 = m3 * z2 - 2.0 * z3 * w2, m2 * z3 - 2.0 * z2 * w3
    c3, c1 = m1 * z3 - 2.0 * z1 * w3, m3 * z1 - 2.0 * z3 * w1
    det = a1 * b2 * c3 + a2 * b3 * c1
    if det == 0.0:
        return (0.0, 0.0, 0.0), 0.0, math.inf, math.inf, _NOTHING
    half = -0.5 / det
    i11, i12, i13 = b2 * c3 * half, -a2 * c3 * half, a2 * b3 * half
    i21, i22, i23 = b3 * c1 * half, a1 * c3 * half, -a1 * b3 * half
    i31, i32, i33 = -b2 * c1 * half, a2 * c1 * half, a1 * b2 * half
    t1 = i11 * f12 + i12 * f23 + i13 * f31
    t2 = i21 * f12 + i22 * f23 + i23 * f31
    t3 = i31 * f12 + i32 * f23 + i33 * f31
    beta = 2.0 * max(
        abs(i11) + abs(i12) + abs(i13),
        abs(i21) + abs(i22) + abs(i23),
        abs(i31) + abs(i32) + abs(i33),
    )
    size = max(abs(a1) + abs(a2), abs(b2) + abs(b3), abs(c3) + abs(c1))
    # L = max of 3 g (d_i + d_j) + 8 d_i d_j: that of the two longest legs.
    shortest = min(d)
    both = d1 + d2 + d3 - shortest
    product = d1 * d2 if shortest == d3 else d2 * d3 if shortest == d1 else d1 * d3
    eta = 2.0 * max(t1, t2, t3, -t1, -t2, -t3)
    kantorovich = beta * eta * (reach * both + 8.0 * product)
    inverse = (i11, i12, i13, i21, i22, i23, i31, i32, i33)
    return (t1, t2, t3), det, size * beta, kantorovich, inverse


@compiled
def _chord_step(d: Lengths, way: Way, g: float, h: float, inverse: _Inverse) -> Triple:
    """Return half a step of Eq. 8 in each angle, by an inverse Jacobian from before."""
    d1, d2, d3 = d
    c1, c2, c3, s1, s2, s3 = way
    z1, z2, z3 = d1 * s1, d2 * s2, d3 * s3
    m1, m2, m3 = 3.0 * g - d1 * c1, 3.0 * g - d2 * c2, 3.0 * g - d3 * c3
    rest = 6.0 * g * g + 3.0 * h * h
    square1, square2, square3 = d1 * d1, d2 * d2, d3 * d3
    f12 = m1 * m2 - 2.0 * z1 * z2 + square1 + square2 - rest
    f23 = m2 * m3 - 2.0 * z2 * z3 + square2 + square3 - rest
    f31 = m3 * m1 - 2.0 * z3 * z1 + square3 + square1 - rest
    i11, i12, i13, i21, i22, i23, i31, i32, i33 = inverse
    return (
        i11 * f12 + i12 * f23 + i13 * f31,
        i21 * f12 + i22 * f23 + i23 * f31,
        i31 * f12 + i32 * f23 + i33 * f31,
    )


@compiled
def _turned(way: Way, t: Triple) -> Way:
    """Return the legs' directions turned by 2 atan(t) each."""
    c1, c2, c3, s1, s2, s3 = way
    t1, t2, t3 = t
    sine1, sine2, sine3 = (
        2.0 * t1 / (1.0 + t1 * t1),
        2.0 * t2 / (1.0 + t2 * t2),
        2.0 * t3 / (1.0 + t3 * t3),
    )
    c1, s1 = c1 - sine1 * (s1 + t1 * c1), s1 + sine1 * (c1 - t1 * s1)
    c2, s2 = c2 - sine2 * (s2 + t2 * c2), s2 + sine2 * (c2 - t2 * s2)
    c3, s3 = c3 - sine3 * (s3 + t3 * c3), s3 + sine3 * (c3 - t3 * s3)
    # Back to length one: the errors of millions of turns would add up.
    k1 = 1.5 - 0.5 * (c1 * c1 + s1 * s1)
    k2 = 1.5 - 0.5 * (c2 * c2 + s2 * s2)
    k3 = 1.5 - 0.5 * (c3 * c3 + s3 * s3)
    return k1 * c1, k2 * c2, k3 * c3, k1 * s1, k2 * s2, k3 * s3


@compiled
def _between(begin: Lengths, goal: Lengths, part: float) -> Lengths:
    return (
        begin[0] + part * (goal[0] - begin[0]),
        begin[1] + part * (goal[1] - begin[1]),
        begin[2] + part * (goal[2] - begin[2]),
    )
