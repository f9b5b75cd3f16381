"""The five-bar of urdf/five_bar.urdf: circles that intersect, d'Alembert, and Lagrange by SymPy.

In the x-z plane; the two base joints' angles from the x axis are the independent coordinates.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from tests.closed_loop.mechanisms import Bar
from tests.reference import jets
from tests.reference.lagrange import Lagrange, bar_body
from tests.reference.newton_euler import Jet
from tests.reference.virtual_power import Body, plane_body

Array = NDArray[np.float64]

GROUND = 0.4
LEFT = Bar(0.3, 1.0, 0.14, 0.01, 0.02)
LEFT_ARM = Bar(0.42, 0.8, 0.2, -0.02, 0.025)
RIGHT = Bar(0.28, 1.1, 0.12, 0.02, 0.03)
RIGHT_ARM = Bar(0.45, 0.7, 0.21, 0.015, 0.015)


def elbows(q: Jet) -> tuple[Jet, Jet, Jet, Jet]:
    """Of the two driven bars: their directions, and where they end."""
    left, right = (jets.direction(q.map(lambda x, i=i: x[i])) for i in (0, 1))
    return (
        left,
        right,
        left.map(lambda u: LEFT.length * u),
        right.map(lambda u: RIGHT.length * u).shift([GROUND, 0]),
    )


def tip(q: Jet) -> Jet:
    """Where the arms meet: the upper intersection of the circles about the two elbows.

    With D from the left elbow to the right: tip = left + t D + s D_turned,
    t = (D^2 + l^2 - r^2) / 2 D^2 and s = sqrt(l^2 / D^2 - t^2).
    """
    _, _, left, right = elbows(q)
    gap = jets.minus(right, left)
    per_square = jets.over(jets.constant(1.0), jets.dot(gap, gap))
    across = LEFT_ARM.length**2 - RIGHT_ARM.length**2
    t = per_square.map(lambda x: across * x / 2).shift(0.5)
    radius = per_square.map(lambda x: LEFT_ARM.length**2 * x)
    s = jets.root(jets.minus(radius, jets.dot(t, t)))
    return left + jets.scaled(t, gap) + jets.scaled(s, jets.turned(gap))


def bodies(q: Jet) -> list[Body]:
    u_left, u_right, left, right = elbows(q)
    end = tip(q)
    u_left_arm = jets.minus(end, left).map(lambda x: x / LEFT_ARM.length)
    u_right_arm = jets.minus(end, right).map(lambda x: x / RIGHT_ARM.length)
    return [
        plane_body(LEFT, jets.constant([0, 0]), u_left),
        plane_body(LEFT_ARM, left, u_left_arm),
        plane_body(RIGHT, jets.constant([GROUND, 0]), u_right),
        plane_body(RIGHT_ARM, right, u_right_arm),
    ]


def joints(q: Jet) -> dict[str, Jet]:
    """Every joint's value, rate and acceleration."""
    _, _, left, right = elbows(q)
    end = tip(q)
    left_arm = jets.angle_of(jets.minus(end, left).map(lambda x: x / LEFT_ARM.length))
    right_arm = jets.angle_of(jets.minus(end, right).map(lambda x: x / RIGHT_ARM.length))
    q_left, q_right = (q.map(lambda x, i=i: x[i]) for i in (0, 1))
    return {
        "left_joint": q_left,
        "left_arm_joint": jets.minus(left_arm, q_left),
        "right_joint": q_right,
        "right_arm_joint": jets.minus(right_arm, q_right),
    }


@cache
def equations() -> Lagrange:
    """In the angles of left, left arm, right and right arm from the x axis; driven: 0 and 2.

    The multipliers are the force of the right arm on the left arm.
    """
    left, left_arm, right, right_arm = q = sp.symbols("left left_arm right right_arm")
    foot = sp.Matrix([GROUND, 0])
    elbow, other = LEFT.length * _direction(left), foot + RIGHT.length * _direction(right)
    loop = elbow + LEFT_ARM.length * _direction(left_arm)
    loop -= other + RIGHT_ARM.length * _direction(right_arm)
    moving = [
        bar_body(LEFT, sp.zeros(2, 1), left),
        bar_body(LEFT_ARM, elbow, left_arm),
        bar_body(RIGHT, foot, right),
        bar_body(RIGHT_ARM, other, right_arm),
    ]
    return Lagrange(q, moving, list(loop))


def _direction(angle: sp.Symbol) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])
