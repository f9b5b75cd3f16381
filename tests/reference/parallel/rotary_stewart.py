"""The rotary Stewart platform of urdf/rotary_stewart.urdf, 6-RUS, in closed form.

A crank of length a turns about a horizontal axis from the horizontal direction e up. With d from
its axis to the ball of its rod, of length L,

    |d - a (cos t e + sin t z)|^2 = L^2,
    2 a (d . e) cos t + 2 a d_z sin t = d^2 + a^2 - L^2:

A cos t + B sin t = C, of which the crank takes the solution farther from the platform.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.reference import jets
from tests.reference.newton_euler import Jet, rotation_of
from tests.reference.parallel.legs import on_universal, part
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

BASE, CRANK, ROD, PLATFORM = 0.2, 0.08, 0.24, 0.15
BASE_HALF, PLATFORM_HALF = 0.25, 0.2
PLATFORM_BODY = (2.0, (0.006, -0.004, 0.02), (0.012, 0.0125, 0.022, 0.0002, -0.0003, 0.0001))
CRANK_BODY = (0.1, (0.04, 0, 0.0025), (5e-06, 5.5833e-05, 5.5833e-05))
CROSS_BODY = (0.015, (0, 0, 0), (2e-06, 1.5e-06, 3e-06))
ROD_BODY = (0.08, (0, 0, 0.12125), (0.0003845, 0.0003845, 1e-06))


def _circle(radius: float, angle: float) -> Array:
    return radius * np.array([np.cos(angle), np.sin(angle), 0.0])


_CENTRES = np.repeat(np.deg2rad([0.0, 120.0, 240.0]), 2)
_SIGNS = np.tile([1.0, -1.0], 3)
PIVOTS = [_circle(BASE, t) for t in _CENTRES + _SIGNS * BASE_HALF]
OUT = [_circle(1.0, t) for t in _CENTRES + _SIGNS * np.pi / 2]
BALLS = [_circle(PLATFORM, t) for t in _CENTRES + _SIGNS * (np.pi / 3 - PLATFORM_HALF)]
UP = np.array([0.0, 0.0, 1.0])


def platform(x: Jet) -> tuple[Jet, Jet]:
    """Place and rotation of x, y, z and the rotation vector."""
    return part(x, 0, 1, 2), rotation_of(part(x, 3, 4, 5))


def crank(i: int, x: Jet) -> tuple[Jet, Jet]:
    """The direction (along e, up) of crank i, and the unit vector along its rod."""
    position, rotation = platform(x)
    d = (position + jets.applied(rotation, BALLS[i])).shift(-PIVOTS[i])
    plane = d.map(lambda v: np.array([v @ OUT[i], v[2]]))
    half = jets.dot(d, d).shift(CRANK**2 - ROD**2).map(lambda v: v / (2 * CRANK))
    u = jets.meeting(plane, half, -1)
    arm = u.map(lambda v: CRANK * (v[0] * OUT[i] + v[1] * UP))
    return u, jets.minus(d, arm).map(lambda v: v / ROD)


def drives(x: Jet) -> Jet:
    """Inverse kinematics: the six cranks' angles."""
    return jets.stacked(*(jets.angle_of(crank(i, x)[0]) for i in range(6)))


def _leg(i: int, x: Jet) -> tuple[list[Body], list[Jet]]:
    u, s = crank(i, x)
    along = u.map(lambda v: v[0] * OUT[i] + v[1] * UP)
    y = jets.constant(np.cross(UP, OUT[i]))
    turn = jets.frame(along, y, jets.cross(along, y))
    cross, rod, first, second = on_universal(turn, s)
    pivot = jets.constant(PIVOTS[i])
    tip = pivot + along.map(lambda v: CRANK * v)
    bodies = [
        body(*CRANK_BODY, pivot, turn),
        body(*CROSS_BODY, tip, cross),
        body(*ROD_BODY, tip, rod),
    ]
    return bodies, [jets.angle_of(u), first, second]


def bodies(x: Jet) -> list[Body]:
    found = [body(*PLATFORM_BODY, *platform(x))]
    for i in range(6):
        found += _leg(i, x)[0]
    return found


def joints(x: Jet) -> dict[str, Jet]:
    """Every joint but the platform's."""
    found = {}
    for i in range(6):
        names = [f"{part}_{i + 1}_joint" for part in ("crank", "cross", "rod")]
        found |= dict(zip(names, _leg(i, x)[1], strict=True))
    return found


def static_torques(x: Array, wrench: Array) -> Array:
    """Torques that bear a wrench (force, moment at the platform's origin) without gravity.

    A rod without weight transmits a force along itself: six equations for the six, whose moments
    about the cranks' axes are the torques.
    """
    at = jets.constant(x)
    turn = platform(at)[1].value
    both = [crank(i, at) for i in range(6)]
    arms = [turn @ ball for ball in BALLS]
    rods = [s.value for _, s in both]
    matrix = np.column_stack(
        [np.concatenate([s, np.cross(arm, s)]) for s, arm in zip(rods, arms, strict=True)]
    )
    push = np.linalg.solve(matrix, wrench)
    found = []
    for i, (u, s) in enumerate(both):
        tip = CRANK * (u.value[0] * OUT[i] + u.value[1] * UP)
        axis = np.cross(OUT[i], UP)  # from e up
        found.append(push[i] * axis @ np.cross(tip, s.value))
    return np.array(found)
