"""Parts that legs of several robots have: two bars in a plane, and a rod on a universal joint."""

from __future__ import annotations

import numpy as np

from tests.reference import jets
from tests.reference.newton_euler import Jet


def part(x: Jet, *where: int) -> Jet:
    """One entry of a vector, or several."""
    return x.map(lambda value: value[where[0]] if len(where) == 1 else value[list(where)])


def two_bars(to: Jet, first: float, second: float, side: float) -> tuple[Jet, Jet]:
    """Directions of two bars that lead from the origin of a plane to a point.

    |to - first u|^2 = second^2; the first bar is ahead of the point (side 1) or behind it (-1).
    """
    half = jets.dot(to, to).shift(first**2 - second**2).map(lambda x: x / (2 * first))
    u = jets.meeting(to, half, side)
    return u, jets.minus(to, u.map(lambda x: first * x)).map(lambda x: x / second)


def on_universal(parent: Jet, s: Jet) -> tuple[Jet, Jet, Jet, Jet]:
    """Of a rod along its z, on a joint about the parent's y, then its own x; s along the rod.

    Rotations of the cross and the rod, and the two angles.
    """
    x_parent, y, z_parent = (parent.map(lambda R, k=k: R[:, k]) for k in range(3))
    x = jets.unit(jets.cross(y, s))
    z = jets.cross(x, y)
    first = jets.stacked(jets.dot(x, x_parent), jets.dot(x, z_parent).map(np.negative))
    second = jets.stacked(jets.dot(s, z), jets.dot(s, y).map(np.negative))
    return (
        jets.frame(x, y, z),
        jets.frame(x, jets.cross(s, x), s),
        jets.angle_of(first),
        jets.angle_of(second),
    )
