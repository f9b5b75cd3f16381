"""Motion of one frame relative to another along the joints between them, as expressions.

The path from frame a to frame b goes up a's branch to the nearest common ancestor and down b's.
Joint i on it moves what follows by the constant twist (S_l, S_a) v, in its own frame's axes; where
the path goes up, by the opposite of the joint's. In frame a's axes, with R_i the rotation of these
axes, r_i the vector from the joint's origin to b's, and joints from a's end to b's,

    b's origin       x   = sum of the vectors between successive origins
    its velocity     x'  = sum of c_i v_i,       c_i = R_i (S_l + S_a x R_i' r_i)
    b's spin         w   = sum of w_i,           w_i = R_i S_a v_i
    accelerations at constant v (those that differentiation of the Jacobians would give):
                     x'' = sum of w_i x (u_i + u_i+1),   u_i  = c_i v_i + u_i+1
                     w'  = sum of w_i x W_i+1,           W_i  = w_i + W_i+1

Nothing outside the path occurs, so columns of the common ancestors are structurally zero, and so
are those of joints on whose axis b's origin lies.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.expressions.joints import ROUNDING, Expression
from rps_pin.codegen.expressions.tree import Tree


class End(NamedTuple):
    """A frame fixed in a body: its joint, and its rotation (3, 3) and origin (3, 1) there."""

    joint: int
    rotation: Expression
    origin: Expression


class _Step(NamedTuple):
    """A joint on a path: its twist by v, in the axes of the path's first frame."""

    columns: range
    sign: int
    """-1 where the path goes up, 1 where it goes down."""
    rotation: Expression
    """R_i (3, 3)."""
    own_linear: Array
    own_angular: Array
    """S_l and S_a (3, k), in the joint's axes."""
    linear: Expression
    angular: Expression
    """R_i S_l and R_i S_a."""
    slide: Expression
    spin: Expression
    """R_i S_l v and R_i S_a v, times the sign."""


class Motion(NamedTuple):
    """Motion of frame b relative to frame a, in a's axes; all SX, sparse."""

    sign: int
    """+1 or -1: the factor s of the derivatives of x."""
    rotation: Expression
    """R (3, 3): coordinates in b turned to a's axes."""
    origin: Expression
    """x (3, 1), m."""
    jacobian: Expression
    """Of s x, (3, nv)."""
    velocity: Expression
    """s x' (3, 1), m/s."""
    acceleration: Expression
    """s x'' at constant v, (3, 1), m/s^2."""
    spin_jacobian: Expression
    """Of the angular velocity w, (3, nv)."""
    spin: Expression
    """w (3, 1), rad/s."""
    spin_rate: Expression
    """w' at constant v, (3, 1), rad/s^2."""
    levers: list[tuple[_Step, Expression]]
    """Each joint on the path, and b's origin in the joint's own axes."""

    def along(self, direction: Expression) -> Expression:
        """Return direction (3, 1) . jacobian, shape (1, nv).

        For joints of several coordinates by turning the direction into their axes:
        S_l . R' u + S_a . (r x R' u).
        """
        row = ca.SX(1, self.jacobian.size2())
        for step, own in self.levers:
            of_step = slice(step.columns.start, step.columns.stop)
            if len(step.columns) == 1:
                row[0, of_step] = direction.T @ self.jacobian[:, of_step]
                continue
            turned = step.rotation.T @ (self.sign * step.sign * direction)
            moment = cross(own, turned)
            linear, angular = constant(step.own_linear), constant(step.own_angular)
            row[0, of_step] = turned.T @ linear + moment.T @ angular
        return tidy(row)


class Chains:
    """Paths between frames of a tree; motions from one ancestor are shared between paths.

    Parameters
    ----------
    tree
        The open tree.
    """

    def __init__(self, tree: Tree) -> None:
        self.tree, self._nv = tree, tree.v.numel()
        self._down: dict[tuple[int, int], tuple[_Step, Expression]] = {}

    def ancestor(self, first: int, second: int) -> int:
        """Return the nearest joint that carries both, or is one of them; 0 is the world."""
        above = {first}
        while first:
            first = self.tree.parents[first]
            above.add(first)
        while second not in above:
            second = self.tree.parents[second]
        return second

    def from_joint(self, root: int, end: End, sign: int = 1) -> Motion:
        """Return the motion of a frame relative to a joint's frame on the way to the world."""
        path = self._path(root, end.joint)
        steps, segments = [], []
        for joint in path:
            step, segment = self._down_to(root, joint)
            steps.append(step)
            segments.append(segment)
        rotation = steps[-1].rotation if steps else ca.SX.eye(3)
        segments.append(tidy(rotation @ end.origin))
        own, _ = self._points_down(path, end.origin)
        motion = self._motion(sign, steps, segments, own, tidy(rotation @ end.rotation))
        return self._cheaper(path, motion)

    def between(self, a: End, b: End, sign: int = 1) -> Motion:
        """Return the motion of frame b relative to frame a."""
        root = self.ancestor(a.joint, b.joint)
        up, down = self._path(root, a.joint)[::-1], self._path(root, b.joint)
        placement = self.tree.placement
        # From a up to the common ancestor: its frame's rotation and a point of it so far reached.
        rotation, reached = a.rotation.T, a.origin
        steps, segments = [], []
        for joint in up:
            segments.append(tidy(-rotation @ reached))
            steps.append(self._step(joint, rotation, -1))
            turn, reached = placement[joint]
            rotation = tidy(rotation @ turn.T)
        for joint in down:
            turn, origin = placement[joint]
            segments.append(tidy(rotation @ tidy(origin - reached)))
            rotation, reached = tidy(rotation @ turn), ca.SX(3, 1)
            steps.append(self._step(joint, rotation, 1))
        segments.append(tidy(rotation @ tidy(b.origin - reached)))
        own, point = self._points_down(down, b.origin)
        own_up = []
        for joint in reversed(up):
            turn, origin = placement[joint]
            point = tidy(turn.T @ tidy(point - origin))
            own_up.append(point)
        own = own_up[::-1] + own
        return self._motion(sign, steps, segments, own, tidy(rotation @ b.rotation))

    def _cheaper(self, path: list[int], motion: Motion) -> Motion:
        """Return a motion, its velocity and acceleration in the form of fewer operations.

        The other form has the same sums in each joint's own axes, where S_a v has few entries, and
        turns them from joint to joint. Joints of several coordinates are cheaper in the first form
        as soon as two paths share them.
        """
        if any(len(step.columns) > 1 for step, _ in motion.levers):
            return motion
        velocity, acceleration = ca.SX(3, 1), ca.SX(3, 1)
        for joint, (step, own) in zip(path[::-1], motion.levers[::-1], strict=True):
            v = self.tree.v[step.columns.start]
            axis = constant(step.own_angular)
            faster = velocity + (constant(step.own_linear) + cross(axis, own)) * (motion.sign * v)
            acceleration = acceleration + cross(axis * v, velocity + faster)
            turn, _ = self.tree.placement[joint]
            velocity, acceleration = tidy(turn @ tidy(faster)), tidy(turn @ tidy(acceleration))
        other = motion._replace(velocity=velocity, acceleration=acceleration)
        return min(motion, other, key=_operations)

    def _path(self, root: int, joint: int) -> list[int]:
        """Return the joints below `root` on the way down to `joint`, which is the last."""
        path = []
        while joint != root:
            path.append(joint)
            joint = self.tree.parents[joint]
        return path[::-1]

    def _down_to(self, root: int, joint: int) -> tuple[_Step, Expression]:
        """Return a joint in its ancestor's axes, and the vector to it from the joint before."""
        if (root, joint) not in self._down:
            parent, (turn, origin) = self.tree.parents[joint], self.tree.placement[joint]
            rotation = ca.SX.eye(3)
            if parent != root:
                rotation = self._down_to(root, parent)[0].rotation
            step = self._step(joint, tidy(rotation @ turn), 1)
            self._down[root, joint] = step, tidy(rotation @ origin)
        return self._down[root, joint]

    def _step(self, joint: int, rotation: Expression, sign: int) -> _Step:
        columns = self.tree.columns[joint]
        own_linear, own_angular = self.tree.subspace[joint]
        linear, angular = (tidy(rotation @ constant(s)) for s in (own_linear, own_angular))
        v = sign * self.tree.v[columns.start : columns.stop]
        slide, spin = tidy(linear @ v), tidy(angular @ v)
        return _Step(columns, sign, rotation, own_linear, own_angular, linear, angular, slide, spin)

    def _points_down(
        self, path: list[int], point: Expression
    ) -> tuple[list[Expression], Expression]:
        """Return a point of the last body in each joint's own axes, and in the first's parent's."""
        points = []
        for joint in reversed(path):
            points.append(point)
            turn, origin = self.tree.placement[joint]
            point = tidy(origin + turn @ point)
        return points[::-1], point

    def _motion(
        self,
        sign: int,
        steps: list[_Step],
        segments: list[Expression],
        own_points: list[Expression],
        rotation: Expression,
    ) -> Motion:
        """Go through the joints from b's end to a's.

        `segments` lead from a's origin to each joint's and at last to b's, in a's axes;
        `own_points` are b's origin in each joint's own axes.
        """
        jacobian, spin_jacobian = ca.SX(3, self._nv), ca.SX(3, self._nv)
        levers = list(zip(steps, own_points, strict=True))
        to_tip, velocity, acceleration, spin, spin_rate = (ca.SX(3, 1) for _ in range(5))
        for (step, own), segment in zip(levers[::-1], segments[:0:-1], strict=True):
            to_tip = tidy(to_tip + segment)
            block = _columns(step, sign * step.sign, to_tip, own)
            of_step = slice(step.columns.start, step.columns.stop)
            jacobian[:, of_step], spin_jacobian[:, of_step] = block, step.sign * step.angular
            moved = block @ self.tree.v[of_step]
            if len(step.columns) > 1 and block.nnz():
                moved = sign * step.slide + _signed_cross(sign, step.spin, to_tip)
            faster = velocity + moved
            acceleration = acceleration + cross(step.spin, velocity + faster)
            velocity = faster
            spin_rate = spin_rate + cross(step.spin, spin)
            spin = spin + step.spin
        return Motion(
            sign,
            rotation,
            tidy(to_tip + segments[0]),
            tidy(jacobian),
            tidy(velocity),
            tidy(acceleration),
            tidy(spin_jacobian),
            tidy(spin),
            tidy(spin_rate),
            levers,
        )


def _operations(motion: Motion) -> int:
    """Count the nodes of the graph of what most closures need."""
    needed = ca.vertcat(motion.origin, ca.vec(motion.jacobian), motion.acceleration)
    return int(ca.n_nodes(needed))


def _columns(step: _Step, sign: int, to_tip: Expression, own: Expression) -> Expression:
    """Return +-R (S_l + S_a x r) = +-(R S_l + (R S_a) x R r), each column in the cheaper form."""
    columns = []
    for k in range(len(step.columns)):
        angular = constant(step.own_angular[:, k])
        in_own_axes = constant(step.own_linear[:, k]) + cross(angular, own)
        in_own_axes, axis = tidy(sign * in_own_axes), step.angular[:, k]
        if _products(step.rotation, in_own_axes) <= _products(ca.skew(axis), to_tip):
            columns.append(step.rotation @ in_own_axes)
        else:
            columns.append(sign * step.linear[:, k] + _signed_cross(sign, axis, to_tip))
    return tidy(ca.horzcat(*columns))


def _signed_cross(sign: int, a: Expression, b: Expression) -> Expression:
    """Return sign a x b without a change of sign."""
    return cross(a, b) if sign > 0 else cross(b, a)


def _products(matrix: Expression, vector: Expression) -> int:
    """Count the multiplications of a matrix and a vector."""
    count = 0
    for column, factor in zip(ca.horzsplit(matrix), vector.elements(), strict=True):
        if not (_is(factor, 0) or _is(factor, 1) or _is(factor, -1)):
            entries = column.nonzeros()
            count += sum(not (_is(e, 0) or _is(e, 1) or _is(e, -1)) for e in entries)
    return count


def _is(entry: Expression, number: int) -> bool:
    return bool(entry.is_constant() and float(entry) == number)


def cross(a: Expression, b: Expression) -> Expression:
    """Return a x b, (3, 1), sparse."""
    (a1, a2, a3), (b1, b2, b3) = a.elements(), b.elements()
    return tidy(ca.vertcat(a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1))


def constant(numbers: Array) -> Expression:
    """Return numbers as an expression without zeros; a vector as a column."""
    return tidy(ca.SX(np.asarray(numbers, dtype=np.float64)))


def tidy(x: Expression) -> Expression:
    """Return an expression sparse, with constants within `ROUNDING` of 0 or +-1 set to it."""
    result: Expression = ca.SX(x)
    for index, entry in enumerate(result.nonzeros()):
        if entry.is_constant():
            number = float(entry)
            near = round(number) if abs(number) < 2 else number
            if near != number and abs(number - near) <= ROUNDING:
                result.nz[index] = near
    return ca.sparsify(result)
