"""The parallel ankle of urdf/ankle.urdf, 2-RSU, in closed form: cranks of pitch and roll.

A crank of length a, at zero pointing back, turns about y by t; with d from its axis to the rod's
joint at the foot, d_x cos t' + d_z sin t' = (d^2 + a^2 - L^2) / 2 a for its direction t' in the x-z
plane.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.reference import jets
from tests.reference.newton_euler import Jet
from tests.reference.parallel.legs import on_universal, part
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

CRANK = 0.04
SIDES = {"left": (0.035, 0.13, 0.12), "right": (-0.035, 0.21, 0.2)}
"""Of each leg: y, height of the crank's axis, length of the rod."""
ARMATURE = 0.01
CROSS_BODY = (0.05, (0, 0, 0), (5e-06, 4e-06, 6e-06))
FOOT_BODY = (0.9, (0.03, 0.002, -0.04), (0.0006, 0.0035, 0.0037))
CRANK_BODY = (0.08, (-0.02, 0, 0.0025), (4e-06, 1.2667e-05, 1.2667e-05))
ROD_CROSS_BODY = (0.01, (0, 0, 0), (1e-06, 8e-07, 9e-07))
ROD_BODIES = {
    "left": (0.06, (0, 0, 0.06125), (7.2375e-05, 7.2375e-05, 7.5e-07)),
    "right": (0.06, (0, 0, 0.10125), (0.000200375, 0.000200375, 7.5e-07)),
}


def cross(x: Jet) -> Jet:
    """Rotation of the cross: about y by the pitch."""
    u = jets.direction(part(x, 0))
    return jets.frame(
        u.map(lambda v: np.array([v[0], 0.0, -v[1]])),
        jets.constant([0.0, 1.0, 0.0]),
        u.map(lambda v: np.array([v[1], 0.0, v[0]])),
    )


def foot(x: Jet) -> Jet:
    """Rotation of the foot: the cross's, then about its x by the roll."""
    first, y, z = (cross(x).map(lambda R, k=k: R[:, k]) for k in range(3))
    c, s = (jets.direction(part(x, 1)).map(lambda v, k=k: v[k]) for k in (0, 1))
    return jets.frame(
        first,
        jets.scaled(c, y) + jets.scaled(s, z),
        jets.minus(jets.scaled(c, z), jets.scaled(s, y)),
    )


def leg(side: str, x: Jet) -> tuple[Jet, Jet, Jet]:
    """Of a leg: rod's joint at the foot, crank's direction (x, z), unit vector along the rod."""
    y, height, length = SIDES[side]
    joint = jets.applied(foot(x), [-0.045, y, 0.005])
    d = joint.shift([0.0, -y, -height])
    half = jets.dot(d, d).shift(CRANK**2 - length**2).map(lambda v: v / (2 * CRANK))
    u = jets.meeting(part(d, 0, 2), half, -1)
    arm = u.map(lambda v: CRANK * np.array([v[0], 0.0, v[1]]))
    return joint, u, jets.minus(arm, d).map(lambda v: v / length)


def _angle(u: Jet) -> Jet:
    """About y, from pointing back."""
    return jets.angle_of(u.map(lambda v: np.array([-v[0], v[1]])))


def drives(x: Jet) -> Jet:
    """Inverse kinematics: the cranks' angles."""
    return jets.stacked(*(_angle(leg(side, x)[1]) for side in SIDES))


def joints(x: Jet) -> dict[str, Jet]:
    found = {"cross_joint": part(x, 0), "foot_joint": part(x, 1)}
    for side in SIDES:
        _, u, s = leg(side, x)
        _, _, first, second = on_universal(foot(x), s)
        found[f"{side}_crank_joint"] = _angle(u)
        found[f"{side}_rod_cross_joint"], found[f"{side}_rod_joint"] = first, second
    return found


def bodies(x: Jet) -> list[Body]:
    origin, y = jets.constant(np.zeros(3)), jets.constant([0.0, 1.0, 0.0])
    found = [body(*CROSS_BODY, origin, cross(x)), body(*FOOT_BODY, origin, foot(x))]
    for side, (place, height, _) in SIDES.items():
        joint, u, s = leg(side, x)
        forward = u.map(lambda v: np.array([-v[0], 0.0, -v[1]]))
        turn = jets.frame(forward, y, jets.cross(forward, y))
        found.append(body(*CRANK_BODY, jets.constant([0.0, place, height]), turn))
        rod_cross, rod, _, _ = on_universal(foot(x), s)
        found.append(body(*ROD_CROSS_BODY, joint, rod_cross))
        found.append(body(*ROD_BODIES[side], joint, rod))
    return found
