"""The 3-RRS of urdf/rrs.urdf in closed form: arms of height and tilt.

The legs' planes hold the platform's three balls, so that its centre moves aside and its rotation
vector stays level, as those of the 3-RPS: with r the radius of the balls, u_i their directions and
n_i the planes' normals, n_i . (P + r R u_i) = 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.reference import jets
from tests.reference.delta import TURNS
from tests.reference.newton_euler import Jet, rotation_of
from tests.reference.parallel.legs import two_bars
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

BASE, ARM, SHANK, PLATFORM = 0.2, 0.15, 0.25, 0.12
PLATFORM_BODY = (1.5, (0.004, -0.003, 0.01), (0.006, 0.0062, 0.011, 0.0001, -0.0002, 0.0001))
ARM_BODY = (0.4, (0.075, 0, 0.00375), (4.5e-05, 0.0007725, 0.0007725))
SHANK_BODY = (0.3, (0.125, 0, 0.0025), (1.5e-05, 0.00157, 0.00157))


def platform(x: Jet) -> tuple[Jet, Jet]:
    """Place and rotation of z, rx, ry."""
    level = x.map(lambda v: np.array([v[1], v[2], 0.0]))
    turn = rotation_of(level)

    def aside(turns: Array) -> Array:
        out = [turns @ turn[:, 0] * PLATFORM for turn in TURNS]
        second, third = (TURNS[i][:, 1] @ out[i] for i in (1, 2))  # n_3 - n_2 = (sqrt 3, 0)
        return np.array([(second - third) / np.sqrt(3), -out[0][1], 0.0])

    return turn.map(aside) + x.map(lambda v: np.array([0.0, 0.0, v[0]])), turn


def legs(x: Jet) -> list[tuple[Jet, Jet]]:
    """Directions of each arm and shank in its plane (outwards, up)."""
    place, rotation = platform(x)
    found = []
    for turn in TURNS:
        ball = place + jets.applied(rotation, turn[:, 0] * PLATFORM)
        plane = ball.map(lambda v, turn=turn: (turn.T @ v)[[0, 2]]).shift([-BASE, 0.0])
        found.append(two_bars(plane, ARM, SHANK, -1))
    return found


def joints(x: Jet) -> dict[str, Jet]:
    """Every joint but the platform's."""
    found = {}
    for i, (arm, shank) in enumerate(legs(x), start=1):
        found[f"arm_{i}_joint"] = jets.angle_of(arm)
        found[f"shank_{i}_joint"] = jets.relative(arm, shank)
    return found


def drives(x: Jet) -> Jet:
    """Inverse kinematics: the arms' angles."""
    return jets.stacked(*(jets.angle_of(arm) for arm, _ in legs(x)))


def bodies(x: Jet) -> list[Body]:
    found = [body(*PLATFORM_BODY, *platform(x))]
    for turn, (arm, shank) in zip(TURNS, legs(x), strict=True):

        def spatial(v: Array, turn: Array = turn) -> Array:
            return np.asarray(turn @ [v[0], 0.0, v[1]])

        y = jets.constant(turn[:, 1])
        shoulder = jets.constant(turn[:, 0] * BASE)
        elbow = shoulder + arm.map(lambda v, spatial=spatial: ARM * spatial(v))
        for numbers, origin, u in ((ARM_BODY, shoulder, arm), (SHANK_BODY, elbow, shank)):
            frame = jets.frame(u.map(spatial), y, jets.turned(u).map(spatial))
            found.append(body(*numbers, origin, frame))
    return found
