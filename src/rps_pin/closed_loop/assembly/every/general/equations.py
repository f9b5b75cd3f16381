"""Closures of any tree as equations over complex numbers, or over intervals.

Unknowns are the angles of turns, displacements of slides in a unit of length, and quaternions e
(x, y, z, w) of balls, R = M(e) / e.e with e.e = 1: cos, sin and R are all that the equations hold,
so they are polynomial. A joint that moves is a product of such factors (`factors`). The rows of a
closure are those of `rows`, as polynomials of frame b's placement (R, p) in frame a:

- points: u . p = 0;  directions: m . R n = 0;  rods: p . p = L^2;
- frames that stay parallel: vee(R - R') = 0. That holds for half turns too, which no path leads to.

The same lines evaluate them over arrays of complex numbers and over `Interval`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.every.general.factors import (
    Ball,
    Factor,
    JointFactors,
    Slide,
    Turn,
)
from rps_pin.closed_loop.constraints.equations import ClosedFrames
from rps_pin.closed_loop.constraints.rows import (
    AxisRows,
    DistanceRows,
    FrameRows,
    PointRows,
    Rows,
    Stack,
)
from rps_pin.numerics import interval_functions
from rps_pin.numerics.intervals import Interval

#: Arrays of complex numbers, or intervals.
Numbers = Any


class Loop(NamedTuple):
    """A closure of two frames."""

    frames: ClosedFrames
    rows: list[Rows]
    sides: Array
    """Of each unknown: 1 if it moves frame b alone, -1 frame a alone, 0 both or none."""

    @property
    def turned(self) -> bool:
        """Whether a rotation of frame b matters."""
        return any(isinstance(one, AxisRows | FrameRows) for one in self.rows)


class Placed(NamedTuple):
    """Rotations (k, 3, 3) and positions (k, 3)."""

    turn: Numbers
    at: Numbers


class Links(NamedTuple):
    """Where all links are, and the twist of each unknown, by the world's origin and axes."""

    placed: list[Placed]
    angular: Numbers
    """Shape (k, n, 3)."""
    linear: Numbers


def parts(rows: Rows) -> list[Rows]:
    """Return the rows that a stack is made of."""
    if isinstance(rows, Stack):
        return [one for part in rows.parts for one in parts(part)]
    return [rows]


class Tree:
    """Placements of all links by the unknowns.

    Parameters
    ----------
    joints
        All joints, the world first.
    size
        Number of unknowns.
    """

    def __init__(self, joints: list[JointFactors], size: int) -> None:
        self.joints, self.size = joints, size

    def links(self, x: Numbers) -> Links:
        """Return where the links are, of unknowns (k, n)."""
        k = x.lower.shape[0] if isinstance(x, Interval) else len(x)
        placed = [Placed(np.broadcast_to(np.eye(3), (k, 3, 3)), np.zeros((k, 3)))]
        angular: list[Numbers] = [None] * self.size
        linear: list[Numbers] = [None] * self.size
        for joint in self.joints[1:]:
            here = placed[joint.parent]
            here = moved(here, joint.turn, joint.at)
            for factor in joint.factors:
                here = _through(factor, x, here, angular, linear)
            placed.append(here)
        return Links(placed, stacked(angular), stacked(linear))


def _through(
    factor: Factor, x: Numbers, here: Placed, angular: list[Numbers], linear: list[Numbers]
) -> Placed:
    """Return what a factor moves, and add the twists of its unknowns."""
    i = factor.at
    if isinstance(factor, Slide):
        axis = times(here.turn, factor.axis)
        angular[i], linear[i] = 0.0 * axis, axis
        return Placed(here.turn, here.at + axis * x[:, i][:, None])
    if isinstance(factor, Turn):
        angular[i] = times(here.turn, factor.axis)
        linear[i] = cross(here.at, angular[i])
        cosine, sine = cos_sin(x[:, i])
        k0, k1, k2 = factor.parts
        turn = k0 + k1 * sine[:, None, None] + k2 * cosine[:, None, None]
        return Placed(product(here.turn, turn), here.at)
    assert isinstance(factor, Ball)
    e = [x[:, i + j] for j in range(4)]
    back, size = quaternion(e)
    for j, column in enumerate(spins(e, size)):
        angular[i + j] = times(here.turn, column)
        linear[i + j] = cross(here.at, angular[i + j])
    return Placed(product(here.turn, back), here.at)


def quaternion(e: list[Numbers]) -> tuple[Numbers, Numbers]:
    """Return R = M(e) / e.e, shape (k, 3, 3), and e.e."""
    a, b, c, w = e
    aa, bb, cc, ww = a * a, b * b, c * c, w * w
    size = aa + bb + cc + ww
    two = 2.0 / size
    rows = [
        [1.0 - two * (bb + cc), two * (a * b - w * c), two * (a * c + w * b)],
        [two * (a * b + w * c), 1.0 - two * (aa + cc), two * (b * c - w * a)],
        [two * (a * c - w * b), two * (b * c + w * a), 1.0 - two * (aa + bb)],
    ]
    return stacked([stacked(row, 1) for row in rows]), size


def spins(e: list[Numbers], size: Numbers) -> list[Numbers]:
    """Return the angular velocities, (k, 3), of rates of the four numbers: 2 vec(e' e*) / e.e."""
    a, b, c, w = (2.0 * one / size for one in e)
    return [stacked(one, 1) for one in ([w, c, -b], [-c, w, a], [b, -a, w], [-a, -b, -c])]


def loop_rows(loop: Loop, links: Links, b: Placed, unit: float) -> tuple[Numbers, Numbers, Any]:
    """Return the values (k, r) and derivatives (k, r, n) of a closure's rows.

    And the function of (angular, linear) rates of frame b, (k, m, 3) in the world's axes at its
    origin, that gives the rates (k, r, m) of the rows.
    """
    a = links.placed[loop.frames.a.joint]
    place = loop.frames.a.placement
    a = moved(a, np.asarray(place.rotation), np.asarray(place.translation) / unit)
    back = swapped(a.turn)
    p, turn = times(back, b.at - a.at), product(back, b.turn)
    values = joined([_values(one, p, turn, unit) for one in loop.rows])

    def rates(angular: Numbers, linear: Numbers) -> Numbers:
        spin, speed = product(angular, a.turn), product(linear, a.turn)
        return joined([_rates(one, p, turn, spin, speed) for one in loop.rows])

    sides = loop.sides[:, None]
    angular = links.angular * sides
    linear = links.linear * sides + cross(angular, b.at[:, None])
    return values, rates(angular, linear), rates


def _values(rows: Rows, p: Numbers, turn: Numbers, unit: float) -> Numbers:
    if isinstance(rows, PointRows):
        return times(rows.directions, p)
    if isinstance(rows, AxisRows):
        directions = product(rows.in_b[None], swapped(turn))
        return total(rows.in_a * directions)
    if isinstance(rows, DistanceRows):
        length = Interval(rows.distance / unit) if isinstance(p, Interval) else rows.distance / unit
        return stacked([total(p * p) - length * length], 1)
    assert isinstance(rows, FrameRows)
    return stacked([turn[:, i - 1, i - 2] - turn[:, i - 2, i - 1] for i in range(3)], 1)


def _rates(rows: Rows, p: Numbers, turn: Numbers, spin: Numbers, speed: Numbers) -> Numbers:
    """Return rates (k, r, m) with b's, in a's axes, (k, m, 3)."""
    if isinstance(rows, PointRows):
        return product(rows.directions[None], swapped(speed))
    if isinstance(rows, AxisRows):  # m . (w x n) = (n x m) . w
        directions = product(rows.in_b[None], swapped(turn))
        return product(cross(directions, rows.in_a), swapped(spin))
    if isinstance(rows, DistanceRows):
        return product(2.0 * p[:, None], swapped(speed))
    trace = turn[:, 0, 0] + turn[:, 1, 1] + turn[:, 2, 2]  # (tr R - R) w
    return product(np.eye(3) * trace[:, None, None] - turn, swapped(spin))


# Numbers of both kinds ----------------------------------------------------------------------------


def moved(one: Placed, turn: Numbers, at: Numbers) -> Placed:
    """Return the placement behind another one."""
    return Placed(product(one.turn, turn), one.at + times(one.turn, at))


def product(a: Numbers, b: Numbers) -> Numbers:
    """Return the products of matrices."""
    if not isinstance(a, Interval) and not isinstance(b, Interval):
        return a @ b
    count = (a.lower if isinstance(a, Interval) else a).shape[-1]
    found = a[..., :, 0, None] * b[..., None, 0, :]
    for j in range(1, count):
        found = found + a[..., :, j, None] * b[..., None, j, :]
    return found


def times(a: Numbers, v: Numbers) -> Numbers:
    """Return the products of matrices and vectors."""
    return product(a, v[..., None])[..., 0]


def swapped(a: Numbers) -> Numbers:
    """Return the transposed matrices."""
    if isinstance(a, Interval):
        return Interval(a.lower.swapaxes(-1, -2), a.upper.swapaxes(-1, -2))
    return a.swapaxes(-1, -2)


def cross(a: Numbers, b: Numbers) -> Numbers:
    """Return the vector products along the last axis."""
    found = [a[..., i - 2] * b[..., i - 1] - a[..., i - 1] * b[..., i - 2] for i in range(3)]
    return stacked(found, -1)


def total(a: Numbers) -> Numbers:
    """Return the sums of three along the last axis."""
    return a[..., 0] + a[..., 1] + a[..., 2]


def stacked(a: list[Numbers], axis: int = 1) -> Numbers:
    """Return arrays, or intervals, side by side along a new axis."""
    if any(isinstance(one, Interval) for one in a):
        every = [one if isinstance(one, Interval) else Interval(one) for one in a]
        ends = [[one.lower for one in every], [one.upper for one in every]]
        return Interval(*(np.stack(np.broadcast_arrays(*one), axis) for one in ends))
    return np.stack(a, axis)


def joined(a: list[Numbers], axis: int = 1) -> Numbers:
    """Return arrays, or intervals, one behind another along an axis."""
    if any(isinstance(one, Interval) for one in a):
        every = [one if isinstance(one, Interval) else Interval(one) for one in a]
        return Interval(
            np.concatenate([one.lower for one in every], axis),
            np.concatenate([one.upper for one in every], axis),
        )
    return np.concatenate(a, axis)


def cos_sin(angle: Numbers) -> tuple[Numbers, Numbers]:
    """Return the cosines and sines."""
    if isinstance(angle, Interval):
        return interval_functions.cos(angle), interval_functions.sin(angle)
    return np.cos(angle), np.sin(angle)
