"""Closures of any tree as a family of equations, with frame b of each closure anywhere.

The parameters of a closure are a displacement of frame b in its own axes: a position, in units, and
angles a, b, c of Rx(a) Ry(b) Rz(c) where a rotation matters; those of a coupling are a shift of its
offset. At zero they are the mechanism. Over the complex numbers the pairs of configurations and
parameters are one irreducible set: the joints' configurations are one (turns, slides and rotations
are), and the displacements that close all loops are one of the same kind for each of them. So loops
in the parameters connect all solutions (`monodromy`). A solution of the mechanism that is isolated
is the end of a path from generic parameters, where there are as many equations as unknowns.

Balls whose spin nothing sees have one number too many: a linear equation in their quaternion, which
holds for one rotation of each spin, takes it away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, ComplexArray
from rps_pin.closed_loop.assembly.every.general.equations import (
    Loop,
    Numbers,
    Placed,
    Tree,
    cross,
    joined,
    loop_rows,
    moved,
    stacked,
    swapped,
    times,
)
from rps_pin.closed_loop.assembly.every.general.factors import (
    Ball,
    Factor,
    JointFactors,
    Slide,
    Turn,
)
from rps_pin.closed_loop.constraints.closures import LoopClosure

#: Imaginary parts of angles, and sizes of displacements, of generic numbers.
_IMAGINARY, _SIZE = 0.5, 1.0


class Linear(NamedTuple):
    """A linear row, weights . x = constant: of a coupling, an idle spin, or what nothing sees."""

    weights: Array
    constant: float


class GeneralFamily:
    """The equations of a mechanism; see `Family`.

    Parameters
    ----------
    joints
        All joints, the world first.
    size
        Number of unknowns.
    loops
        Closures of frames.
    linear
        Rows of couplings.
    unit
        Unit of length, m.
    """

    def __init__(
        self,
        joints: list[JointFactors],
        size: int,
        loops: list[Loop],
        linear: list[Linear],
        unit: float,
    ) -> None:
        self.tree, self.loops, self.linear, self.unit = Tree(joints, size), loops, linear, unit
        self.factors = [factor for joint in joints for factor in joint.factors]
        self.balls = [one.at for one in self.factors if isinstance(one, Ball)]
        self.spins: list[Linear] = []
        self.size = size

    @property
    def parameters(self) -> int:
        """How many there are: six of each closure, one of each coupling."""
        return 6 * len(self.loops) + len(self.linear)

    def evaluated(
        self, x: ComplexArray, parameters: ComplexArray, rates: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Family`."""
        links, k = self.tree.links(x), len(x)
        values, slopes, changes = [], [], []
        for i, loop in enumerate(self.loops):
            own = slice(6 * i, 6 * i + 6)
            b, angular, linear = displaced(
                self.frame(loop, links.placed), parameters[:, own], rates[:, own]
            )
            value, slope, rate = loop_rows(loop, links, b, self.unit)
            values.append(value)
            slopes.append(slope)
            changes.append(rate(angular[:, None], linear[:, None])[..., 0])
        value, slope = self._others(x)
        count, first = len(self.linear), 6 * len(self.loops)
        value[:, :count] -= parameters[:, first:]
        change = np.zeros_like(value)
        change[:, :count] = -rates[:, first:]
        return (
            joined([*values, value]),
            joined([*slopes, np.broadcast_to(slope, (k, *slope.shape[1:]))]),
            joined([*changes, change]),
        )

    def at_zero(self, x: Numbers) -> tuple[Numbers, Numbers]:
        """Return the mechanism's own values (k, n) and derivatives, intervals of such."""
        links = self.tree.links(x)
        found = [
            loop_rows(loop, links, self.frame(loop, links.placed), self.unit)[:2]
            for loop in self.loops
        ]
        value, slope = self._others(x)
        return joined([*(one[0] for one in found), value]), joined(
            [*(one[1] for one in found), slope]
        )

    def frame(self, loop: Loop, placed: list[Placed]) -> Placed:
        """Return where frame b of a closure is."""
        place = loop.frames.b.placement
        link = placed[loop.frames.b.joint]
        return moved(link, np.asarray(place.rotation), np.asarray(place.translation) / self.unit)

    def _others(self, x: Numbers) -> tuple[Numbers, Numbers]:
        """Return values and derivatives of the couplings, the spins, and e.e = 1."""
        rows = [*self.linear, *self.spins]
        values, slopes = [0.0 * x[:, :0]], [0.0 * x[:, :0, None] * np.zeros(self.size)]
        for one in rows:
            value = -one.constant + 0.0 * x[:, 0]
            for j in np.flatnonzero(one.weights):
                value = value + float(one.weights[j]) * x[:, j]
            values.append(value[:, None])
            slopes.append(0.0 * x[:, :1, None] + one.weights)
        for first in self.balls:
            columns = [0.0 * x[:, 0]] * self.size
            value = -1.0 + 0.0 * x[:, 0]
            for i in range(first, first + 4):
                value, columns[i] = value + x[:, i] * x[:, i], 2.0 * x[:, i]
            values.append(value[:, None])
            slopes.append(stacked(columns, 1)[:, None])
        return joined(values), joined(slopes)

    # Generic numbers ------------------------------------------------------------------------------

    def seeds(self, rng: np.random.Generator, count: int) -> tuple[ComplexArray, ComplexArray]:
        """Return random unknowns, and the parameters that close all loops there."""
        x = _random(rng, (count, self.size), _SIZE)
        for one in self.factors:
            if isinstance(one, Turn):
                turned = rng.uniform(-np.pi, np.pi, count)
                x[:, one.at] = turned + 1j * _IMAGINARY * x[:, one.at].imag
        for spin in self.spins:
            largest = int(np.argmax(np.abs(spin.weights)))
            x[:, largest] += (spin.constant - x @ spin.weights) / spin.weights[largest]
        for first in self.balls:
            e = x[:, first : first + 4]
            x[:, first : first + 4] = e / np.sqrt((e * e).sum(axis=1))[:, None]
        links = self.tree.links(x)
        parameters = [
            displacement(loop, links.placed, self.frame(loop, links.placed), self.unit)
            for loop in self.loops
        ]
        shifts = [(x @ one.weights - one.constant)[:, None] for one in self.linear]
        return x, joined([np.zeros((count, 0)), *parameters, *shifts])

    def drawn(self, rng: np.random.Generator, count: int) -> ComplexArray:
        """Return random parameters."""
        found = _random(rng, (count, self.parameters), _SIZE)
        for i, loop in enumerate(self.loops):
            if not loop.turned:
                found[:, 6 * i + 3 : 6 * i + 6] = 0.0
        return found

    def alike(self, rng: np.random.Generator, parameters: ComplexArray) -> ComplexArray:
        """Return parameters of angles that differ by whole turns."""
        found = parameters.copy()
        turns = 2 * np.pi * rng.integers(-1, 2, found.shape)
        for i, loop in enumerate(self.loops):
            if loop.turned:
                own = slice(6 * i + 3, 6 * i + 6)
                found[:, own] += turns[:, own]
        return found

    def places(self, x: ComplexArray) -> ComplexArray:
        """Return cosines and sines, displacements, and products of quaternions' numbers."""
        found: list[ComplexArray] = [np.ones((len(x), 1), np.complex128)]
        for one in self.factors:
            if isinstance(one, Slide):
                found.append(x[:, one.at, None])
            elif isinstance(one, Turn):
                found += [np.cos(x[:, one.at, None]), np.sin(x[:, one.at, None])]
            else:
                e = x[:, one.at : one.at + 4]
                found.append((e[:, :, None] * e[:, None]).reshape(len(x), 16))
        return np.concatenate(found, axis=1)


def _random(rng: np.random.Generator, shape: tuple[int, ...], size: float) -> ComplexArray:
    return np.asarray(size * (rng.normal(size=shape) + 1j * rng.normal(size=shape)))


# Displacements ------------------------------------------------------------------------------------


def _turns(angles: ComplexArray) -> list[ComplexArray]:
    """Return Rx(a), Ry(b), Rz(c), each (k, 3, 3)."""
    found = []
    for i in range(3):
        axis = np.asarray(pin.skew(np.eye(3)[i]))
        cosine, sine = np.cos(angles[:, i]), np.sin(angles[:, i])
        turn = np.eye(3) + axis @ axis + sine[:, None, None] * axis
        found.append(turn - cosine[:, None, None] * (axis @ axis))
    return found


def displaced(
    b: Placed, by: ComplexArray, rate: ComplexArray
) -> tuple[Placed, ComplexArray, ComplexArray]:
    """Return frame b displaced by parameters (k, 6), and its velocities, (k, 3) each."""
    one, two, three = _turns(by[:, 3:])
    # x' e_x + Rx (y' e_y + Ry z' e_z)
    spin = np.eye(3)[0] * rate[:, 3, None] + times(
        one, np.eye(3)[1] * rate[:, 4, None] + times(two, np.eye(3)[2] * rate[:, 5, None])
    )
    place = moved(b, one @ two @ three, by[:, :3])
    return place, times(b.turn, spin), times(b.turn, rate[:, :3])


def displacement(loop: Loop, placed: list[Placed], b: Placed, unit: float) -> ComplexArray:
    """Return parameters (k, 6) that bring frame b to where the closure is closed."""
    place = loop.frames.a.placement
    a = moved(
        placed[loop.frames.a.joint],
        np.asarray(place.rotation),
        np.asarray(place.translation) / unit,
    )
    turn, at = closed_placement(loop.frames.closure, unit)
    back = swapped(b.turn)
    by = np.zeros((len(b.turn), 6), dtype=np.complex128)
    by[:, :3] = times(back, a.at + times(a.turn, at) - b.at)
    if loop.turned:
        by[:, 3:] = _angles(back @ a.turn @ turn)
    return by


def closed_placement(closure: LoopClosure, unit: float) -> tuple[Array, Array]:
    """Return a placement of frame b in a where a closure is closed."""
    at = np.zeros(3)
    if closure.kind == "distance":
        assert closure.distance is not None
        at[0] = closure.distance / unit
    if closure.axis is None or closure.axis_b is None:
        return np.eye(3), at
    one, two = np.array(closure.axis, np.float64), np.array(closure.axis_b, np.float64)
    if closure.kind == "universal":
        one = cross(one, np.roll(one, 1) + np.eye(3)[int(np.argmin(np.abs(one)))])
    return np.array(pin.Quaternion.FromTwoVectors(two, one).toRotationMatrix()), at


def _angles(turn: ComplexArray) -> ComplexArray:
    """Return a, b, c of Rx(a) Ry(b) Rz(c), shape (k, 3), of complex rotations."""
    sine = turn[:, 0, 2]
    cosine = np.sqrt(1 - sine * sine)
    pairs = [
        (turn[:, 2, 2] / cosine, -turn[:, 1, 2] / cosine),
        (cosine, sine),
        (turn[:, 0, 0] / cosine, -turn[:, 0, 1] / cosine),
    ]
    return np.stack([-1j * np.log(c + 1j * s) for c, s in pairs], axis=1)


def on_its_own(factor: Factor) -> range:
    """Return the unknowns of a factor."""
    return range(factor.at, factor.at + factor.size)
