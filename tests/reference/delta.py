"""The Delta of urdf/delta.urdf and delta_rods.urdf: closed forms, d'Alembert, Lagrange by SymPy.

The platform only translates: its centre P is the independent coordinate. In the plane of arm i,
with x outwards, let b = (x, z) go from the shoulder to the platform's rim. The arm's direction
u = (cos, -sin) of its angle, a unit vector, and the rod of length L from the elbow l u to the rim
give

    |b - l u|^2 + y^2 = L^2    so that    u . b = (b^2 + y^2 + l^2 - L^2) / 2 l,

a line that meets the unit circle twice; the elbow is the outer one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from tests.reference import jets, virtual_power
from tests.reference.lagrange import Lagrange, Moving
from tests.reference.newton_euler import Jet
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

BASE, ARM, ROD, PLATFORM, HALF = 0.2, 0.25, 0.6, 0.06, 0.04
ARM_MASS, ARM_COM, ARM_INERTIA = 0.8, (0.1, 0.004, -0.006), (0.0008, 0.006, 0.0062)
PLATFORM_MASS, PLATFORM_INERTIA = 0.7, (0.0011, 0.0012, 0.002)
CROSS_MASS, CROSS_INERTIA = 0.02, (0.000004, 0.000003, 0.000005)
ROD_MASS, ROD_COM, ROD_INERTIA = 0.15, (0.28, 0.0, 0.0), (0.00002, 0.0045, 0.0045)

ANGLES = np.arange(3) * 2 * np.pi / 3
#: From an arm's axes (x outwards, z up) to the base's.
TURNS = [
    np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in ANGLES
]
SIDES = {"left": 1.0, "right": -1.0}


def arm(i: int, position: Jet) -> tuple[Jet, Jet]:
    """The direction u = (x, z) of arm i, and its angle down from the horizontal."""
    local = position.map(lambda p: TURNS[i].T @ p).shift([PLATFORM - BASE, 0, 0])
    b, y = local.map(lambda p: p[[0, 2]]), local.map(lambda p: p[1])
    square = jets.dot(b, b) + jets.scaled(y, y)
    along = square.shift(ARM**2 - ROD**2).map(lambda x: x / (2 * ARM))
    # b points down, so that a quarter turn from x towards z of it points outwards.
    u = jets.meeting(b, along, 1)
    return u, jets.angle_of(u).map(np.negative)


def arm_frame(i: int, u: Jet) -> tuple[Jet, Jet]:
    """Origin and rotation of arm i: x along it, y its axis."""

    def spatial(plane: Array) -> Array:
        return TURNS[i] @ np.array([plane[0], 0.0, plane[1]])

    shoulder = jets.constant(TURNS[i] @ [BASE, 0, 0])
    y = jets.constant(TURNS[i] @ [0, 1, 0])
    return shoulder, jets.frame(u.map(spatial), y, jets.turned(u).map(spatial))


def angles(position: Jet) -> Jet:
    """Inverse kinematics: the three arms' angles."""
    return jets.stacked(*(arm(i, position)[1] for i in range(3)))


def platform_position(arms: ArrayLike) -> Array:
    """Direct kinematics: the lower intersection of three spheres of radius L.

    They are about the elbows, each brought inwards by the platform's radius.
    """
    centres = [
        T @ [BASE - PLATFORM + ARM * np.cos(t), 0, -ARM * np.sin(t)]
        for T, t in zip(TURNS, np.asarray(arms, dtype=float), strict=True)
    ]
    return min(meeting_of_spheres(centres, ROD), key=lambda point: float(point[2]))


def meeting_of_spheres(centres: Sequence[Array], radius: float) -> Array:
    """The two points (2, 3) at one distance from three."""
    x = centres[1] - centres[0]
    width = np.linalg.norm(x)
    x = x / width
    out = centres[2] - centres[0]
    i = x @ out
    y = out - i * x
    j = np.linalg.norm(y)
    y = y / j
    along = width / 2
    across = (i**2 + j**2 - 2 * i * along) / (2 * j)
    height = np.sqrt(radius**2 - along**2 - across**2)
    foot = centres[0] + along * x + across * y
    return foot + np.outer([height, -height], np.cross(x, y))


def rod_frame(i: int, sign: float, position: Jet) -> tuple[Jet, Jet, Jet, Jet]:
    """Of a rod on its universal joint: elbow, rotation, and the joint's two angles.

    The joint turns about the arm's y, then about its own z, and the rod lies along x: its direction
    in the arm's axes is (cos t2 cos t1, sin t2, -cos t2 sin t1).
    """
    u, _ = arm(i, position)
    shoulder, rotation = arm_frame(i, u)
    elbow = shoulder + jets.applied(rotation, [ARM, sign * HALF, 0])
    ball = position.shift(TURNS[i] @ [PLATFORM, sign * HALF, 0])
    x = jets.minus(ball, elbow).map(lambda d: d / ROD)
    first = rotation.map(lambda R: R[:, 1])
    z = jets.unit(jets.cross(x, first))
    y = jets.cross(z, x)
    in_arm = [jets.dot(rotation.map(lambda R, k=k: R[:, k]), x) for k in range(3)]
    flat = jets.root(jets.scaled(in_arm[0], in_arm[0]) + jets.scaled(in_arm[2], in_arm[2]))
    return (
        elbow,
        jets.frame(x, y, z),
        _down(in_arm[0], in_arm[2], flat),
        jets.angle_of(jets.stacked(flat, in_arm[1])),
    )


def _down(x: Jet, z: Jet, flat: Jet) -> Jet:
    """The angle t1 with (cos, -sin) = (x, z) / flat."""
    return jets.angle_of(jets.over(jets.stacked(x, z), flat)).map(np.negative)


def bodies(position: Jet) -> list[Body]:
    """Platform and arms."""
    found = [body(PLATFORM_MASS, [0, 0, 0], PLATFORM_INERTIA, position, jets.constant(np.eye(3)))]
    for i in range(3):
        origin, rotation = arm_frame(i, arm(i, position)[0])
        found.append(body(ARM_MASS, ARM_COM, ARM_INERTIA, origin, rotation))
    return found


def joints_with_rods(position: Jet) -> dict[str, Jet]:
    """Every joint of urdf/delta_rods.urdf but the platform's."""
    found = {f"arm_{i + 1}_joint": arm(i, position)[1] for i in range(3)}
    for i in range(3):
        for side, sign in SIDES.items():
            _, _, first, second = rod_frame(i, sign, position)
            found[f"rod_{i + 1}_{side}_cross_joint"] = first
            found[f"rod_{i + 1}_{side}_joint"] = second
    return found


def _third(rotation: Array) -> Array:
    return rotation[:, 2]


def bodies_with_rods(position: Jet) -> list[Body]:
    found = bodies(position)
    for i in range(3):
        for sign in SIDES.values():
            elbow, rotation, _, _ = rod_frame(i, sign, position)
            y, z = arm_frame(i, arm(i, position)[0])[1].map(lambda R: R[:, 1]), rotation.map(_third)
            cross = jets.frame(jets.cross(y, z), y, z)
            found.append(body(CROSS_MASS, [0, 0, 0], CROSS_INERTIA, elbow, cross))
            found.append(body(ROD_MASS, ROD_COM, ROD_INERTIA, elbow, rotation))
    return found


def torques(
    p: Array, v: Array, a: Array, *, rods: bool = False, gravity: Array = virtual_power.EARTH
) -> Array:
    """Arm torques: the forces in P, through angle' = G P', tau = G^-T f."""
    moving = bodies_with_rods if rods else bodies
    return virtual_power.drive_forces(moving, angles, p, v, a, gravity)


@cache
def equations() -> Lagrange:
    """In P and the three angles, rods massless; driven: 3, 4, 5.

    The loops are (|rim - elbow|^2 - L^2) / 2 L of the three pairs, so that a multiplier is minus
    the tension of both rods together.
    """
    position = sp.Matrix(sp.symbols("x y z"))
    arms = sp.symbols("arm:3")
    moving = [Moving(PLATFORM_MASS, 0.0, position, sp.Integer(0))]
    loops = []
    for i, t in enumerate(arms):
        turn = sp.Matrix(TURNS[i])
        c, s = sp.cos(t), sp.sin(t)
        pitch = sp.Matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        shoulder = turn * sp.Matrix([BASE, 0, 0])
        com = shoulder + turn * pitch * sp.Matrix(ARM_COM)
        moving.append(Moving(ARM_MASS, ARM_INERTIA[1], com, t))
        elbow = shoulder + turn * pitch * sp.Matrix([ARM, 0, 0])
        rod = position + turn * sp.Matrix([PLATFORM, 0, 0]) - elbow
        loops.append((rod.dot(rod) - ROD**2) / (2 * ROD))
    return Lagrange([*position, *arms], moving, loops)
