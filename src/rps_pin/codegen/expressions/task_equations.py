"""Closure equations of a mechanism with a task, F(x, y) = 0: y local unknowns, x the task's.

Given the task's coordinates x, the other coordinates follow from the closures. They are written
about a configuration, by charts without a singularity below half a turn: angles and lengths move by
y, a ball from the rotation R_0 to R_0 C(y / 2), with Cayley's C(a) = (1 + a^)(1 - a^)^-1, which is
the quaternion (a, 1) scaled to unit length. y has no unit: lengths count in characteristic lengths.

Loops are cut at the output frame, so that legs do not meet in one equation: its origin stands where
x says, its rotation where the rotation vector r of x says; what x leaves open is unknown. The chain
that carries the frame has to arrive there, which is further equations, unless it is one free joint.
Angles are closed by their sines, u of

    skew(u) = (M - M') / 2,    M = R_a' R_b,

with the cosine (tr(M) - 1) / 2 positive. With the Stumpff functions c_n of r . r,

    exp(r^) = 1 + c_1 r^ + c_2 r^ r^,      dc_n/d(r . r) = (n c_(n+2) - c_(n+1)) / 2,

c_1, c_2 and their first and second slopes are inputs, so that they can be bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.couplings import coupling_row
from rps_pin.closed_loop.constraints.frame_coordinates import ANGULAR, LINEAR
from rps_pin.closed_loop.constraints.rows import across
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.codegen.expressions.joints import Expression, Placement, clean, rotation_of, sparse
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.tree import Tree
from rps_pin.errors import MechanismError

Kind = Literal["number", "turn", "pair", "quaternion"]
#: Gaps that no coordinate moves count as closed below this, in characteristic lengths.
_CLOSED = 1e-9


class Unknown(NamedTuple):
    """Coordinates that are moved together."""

    kind: Kind
    z: slice
    """In the state: q, and what the output frame has that x does not say."""
    y: slice
    unit: float
    """Of y: 1 rad, or the characteristic length, m."""


class TaskEquations:
    """F(x, y), its Jacobians, and further functions, of a task's mechanism.

    Parameters
    ----------
    system
        The mechanism.
    coordinates
        Names of the task's coordinates: of a frame, or joints.
    frame
        Index of the output frame in the model, and the placement of the task's frame in it; None
        for a task of joints.

    Attributes
    ----------
    unknowns : list of Unknown
    state : SX, (nz,)
        q, then the coordinates of the output frame that are unknown, `open_linear` and
        `open_angular`, in axes of the world.
    x, y, stumpff : SX, (m,), (n,) and (6,)
    gaps : SX, (n,)
    cosines : SX, (k,)
        Positive where angles are closed, not half a turn away.
    turn : SX, (3, 1) or None
        r, where the task's rotation vector is needed as a whole.

    Raises
    ------
    MechanismError
        If equations and unknowns are not as many: redundant closures, or idle freedoms.
    """

    def __init__(
        self,
        system: ConstraintSystem,
        coordinates: Sequence[str],
        frame: tuple[int, pin.SE3] | None,
    ) -> None:
        self.system, self._coordinates = system, tuple(coordinates)
        parameters = Parameters(system)
        self.tree = Tree(parameters.model, parameters)
        self._length = system.equations.length
        self.x, self.stumpff = ca.SX.sym("x", len(self._coordinates)), ca.SX.sym("c", 6)
        self.open_linear: tuple[int, ...] = ()
        self.open_angular: tuple[int, ...] = ()
        self.turn: Expression | None = None
        self.unknowns: list[Unknown] = []
        self._q = ca.SX(self.tree.q)
        self._rows: list[Expression] = []
        self._cosines: list[Expression] = []
        self._world: dict[int, Placement] = {0: (ca.SX.eye(3), ca.SX(3, 1))}
        self._y: list[Expression] = []
        self._extra: list[Expression] = []
        free = self._of_joints() if frame is None else self._of_frame(*frame)
        #: Number of unknowns of the output frame, which legs share: the first ones.
        self.shared = sum(one.numel() for one in self._y)
        self._charts(free)
        for closure in system.equations.closures:
            self._close(closure)
        self.y = ca.vertcat(ca.SX(0, 1), *self._y)
        extra = [ca.SX(0, 1), *self._extra]
        self.state = ca.vertcat(self.tree.q, *extra)
        self.gaps, self.cosines = self._square()

    # Unknowns -------------------------------------------------------------------------------------

    def _unknown(self, kind: Kind, z: slice, count: int, unit: float) -> Expression:
        start = sum(one.numel() for one in self._y)
        self._y.append(ca.SX.sym(f"y{len(self._y)}", count))
        self.unknowns.append(Unknown(kind, z, slice(start, start + count), unit))
        return self._y[-1]

    def _open(self, name: str, unit: float) -> Expression:
        """Return a coordinate of the output frame that x does not say."""
        at = self.tree.model.nq + len(self._extra)
        self._extra.append(ca.SX.sym(name))
        return self._extra[-1] + unit * self._unknown("number", slice(at, at + 1), 1, unit)

    def _of_joints(self) -> list[int]:
        """Put x into joints, and return the others."""
        model, held = self.tree.model, set()
        for k, name in enumerate(self._coordinates):
            joint = model.getJointId(name)
            held.add(joint)
            self._q[model.joints[joint].idx_q] = self.x[k]
        return [i for i in range(1, model.njoints) if i not in held]

    def _of_frame(self, index: int, placement: pin.SE3) -> list[int]:
        """Place the output frame, and return the joints whose coordinates are unknown."""
        model, tree = self.tree.model, self.tree
        frame = model.frames[index]
        joint, in_joint = int(frame.parentJoint), frame.placement * placement
        turn, shift = sparse(clean(in_joint.rotation)), sparse(clean(in_joint.translation))
        is_free = str(model.joints[joint].shortname()) == "JointModelFreeFlyer" and (
            not tree.parents[joint]
        )
        joints = [i for i in range(1, model.njoints) if not (is_free and i == joint)]
        names, length = self._coordinates, self._length
        linear = {name: self.x[k] for k, name in enumerate(names) if name in LINEAR}
        angular = {name: self.x[k] for k, name in enumerate(names) if name in ANGULAR}
        chain = None if is_free else self._chain(joint)
        axis = self._plane(chain, angular) if chain else None
        if angular and axis is None:
            r = [angular.get(name) for name in ANGULAR]
            self.open_angular = tuple(k for k, one in enumerate(r) if one is None)
        if is_free:
            self.open_linear = tuple(k for k, name in enumerate(LINEAR) if name not in linear)
            for k in self.open_linear:
                linear[LINEAR[k]] = self._open(LINEAR[k], length)
        if angular and axis is None:
            for k in self.open_angular:
                r[k] = self._open(ANGULAR[k], 1.0)
            self.turn = ca.vertcat(*r)
            rotation = _exponential(self.turn, self.stumpff) @ turn.T
        elif axis is not None:
            rotation = _about(axis, *angular.values()) @ turn.T
        elif is_free:
            idx = model.joints[joint].idx_q + 3
            quaternion = self._unknown("quaternion", slice(idx, idx + 4), 3, 1.0)
            rotation = rotation_of(_turned(tree.q[idx : idx + 4], quaternion))
        else:
            assert chain is not None
            rotation = chain[0]
        if chain is None:
            point = ca.vertcat(*(linear[name] for name in LINEAR))
        else:
            at = chain[1] + chain[0] @ shift
            point = ca.vertcat(*(linear.get(name, at[k]) for k, name in enumerate(LINEAR)))
            self._rows.append(at - point)
            if angular:
                self._parallel_frames(chain[0], rotation)
        self._world[joint] = rotation, point - rotation @ shift
        return joints

    def _chain(self, joint: int) -> Placement:
        """Return a joint's placement by the joints that carry it."""
        rotation, origin = ca.SX.eye(3), ca.SX(3, 1)
        above = []
        while joint:
            above.append(joint)
            joint = self.tree.parents[joint]
        for i in reversed(above):
            turn, shift = self.tree.placement[i]
            rotation, origin = rotation @ turn, origin + rotation @ shift
        return rotation, origin

    @staticmethod
    def _plane(chain: Placement, angular: dict[str, Expression]) -> int | None:
        """Return the world's axis about which alone a chain turns, if x is the angle about it."""
        if len(angular) != 1:
            return None
        axis = ANGULAR.index(next(iter(angular)))
        rest = ca.SX(chain[0])
        wanted = np.zeros(3)
        wanted[axis] = 1.0
        for line in (rest[axis, :].T, rest[:, axis]):
            if not line.is_constant() or not np.allclose(ca.DM(line).full().ravel(), wanted):
                return None
        return axis

    def _charts(self, joints: Sequence[int]) -> None:
        """Move the coordinates of joints by y."""
        model, q0 = self.tree.model, self.tree.q
        angular = self.system.equations.angular_velocities
        coupled = self._held_joints()
        for i in joints:
            joint = model.joints[i]
            kind = str(joint.shortname()).removeprefix("JointModel")
            q, v = joint.idx_q, joint.idx_v
            if joint.nq == joint.nv:
                for k in range(joint.nq):
                    unit = 1.0 if angular[v + k] else self._length
                    turns = angular[v + k] and q + k not in coupled
                    at = slice(q + k, q + k + 1)
                    y = self._unknown("turn" if turns else "number", at, 1, unit)
                    self._q[q + k] = q0[q + k] + unit * y
                continue
            if kind in ("FreeFlyer", "Planar"):
                for k in range(joint.nq - (4 if kind == "FreeFlyer" else 2)):
                    y = self._unknown("number", slice(q + k, q + k + 1), 1, self._length)
                    self._q[q + k] = q0[q + k] + self._length * y
                q += joint.nq - (4 if kind == "FreeFlyer" else 2)
            if kind in ("FreeFlyer", "Spherical"):
                y = self._unknown("quaternion", slice(q, q + 4), 3, 1.0)
                self._q[q : q + 4] = _turned(q0[q : q + 4], y)
            else:
                y = self._unknown("pair", slice(q, q + 2), 1, 1.0)
                self._q[q : q + 2] = _moved_pair(q0[q : q + 2], y)

    def _held_joints(self) -> set[int]:
        """Return coordinates that couplings and springs hold: a whole turn is not the same."""
        held = set()
        for coupling in self.system.equations.couplings:
            held |= {coupling.idx_q, *(term.idx_q for term in coupling.terms)}
        if self.system.springs is not None:
            held |= {at for i, at in self.system.springs.single if self.system.springs.stiffness[i]}
        return held

    # Equations ------------------------------------------------------------------------------------

    def world(self, joint: int) -> Placement:
        """Return a joint's placement in the world, the output frame's where x says."""
        if joint not in self._world:
            rotation, origin = self.world(self.tree.parents[joint])
            turn, shift = self.tree.placement[joint]
            self._world[joint] = rotation @ turn, origin + rotation @ shift
        return self._world[joint]

    def _close(self, closure: Any) -> None:
        """Append the equations of a closure."""
        if isinstance(closure, JointCoupling):
            row = coupling_row(closure, self.tree.model, 0)
            gap = self.tree.q[row.idx_q] - row.constant
            for term in row.terms:
                gap -= term.derivatives(self.tree.q[term.idx_q])[0]
            self._rows.append(gap)
            return
        assert isinstance(closure, LoopClosure)
        ends = []
        for frame in closure.closed_frames(self.tree.model):
            rotation, origin = self.world(frame.joint)
            at = sparse(clean(frame.placement.translation))
            turn = sparse(clean(frame.placement.rotation))
            ends.append((rotation @ turn, origin + rotation @ at))
        (a, p), (b, s) = ends
        kind, apart = closure.kind, s - p
        if kind == "distance":
            assert closure.distance is not None
            self._rows.append((ca.sumsqr(apart) - closure.distance**2) / (2 * closure.distance))
            return
        if kind in ("spherical", "rigid", "revolute", "universal"):
            self._rows.append(apart)
        else:
            axis = np.array(closure.axis)
            planes = axis[None] if kind in ("planar", "point_on_plane") else across(axis)
            self._rows.append(sparse(planes) @ (a.T @ apart))
        if kind in ("rigid", "prismatic"):
            self._parallel_frames(a, b)
        elif kind in ("revolute", "cylindrical", "planar"):
            axis, n = np.array(closure.axis), a.T @ b @ sparse(np.array(closure.axis_b))
            self._rows.append(sparse(across(axis)) @ n)
            self._cosines.append(sparse(axis).T @ n)
        elif kind == "universal":
            n = a.T @ b @ sparse(np.array(closure.axis_b))
            self._rows.append(sparse(np.array(closure.axis)).T @ n)

    def _parallel_frames(self, a: Expression, b: Expression) -> None:
        """Append the sines of the rotation from one to another, and its cosine."""
        m = a.T @ b
        self._rows.append(ca.vertcat(m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]) / 2)
        self._cosines.append((ca.trace(m) - 1) / 2)

    def moved(self, expression: Expression) -> Expression:
        """Return an expression of the tree's q with these moved by y."""
        return ca.substitute(ca.SX(expression), self.tree.q, self._q)

    def _square(self) -> tuple[Expression, Expression]:
        """Return the equations that depend on something, as many as unknowns, and the cosines."""
        rows, both = [], ca.vertcat(self.x, self.y, self.stumpff)
        for row in ca.vertsplit(ca.vertcat(ca.SX(0, 1), *self._rows)):
            one = ca.simplify(self.moved(row))
            if ca.jacobian(one, both).nnz():
                rows.append(one)
            elif not (one.is_constant() and abs(float(ca.DM(one))) < _CLOSED * self._length):
                raise MechanismError(
                    "boxes cannot be certified: a closure has a row that nothing moves, and that "
                    "is not closed"
                )
        if len(rows) != self.y.numel():
            raise MechanismError(
                f"boxes cannot be certified: given the task's coordinates there are {len(rows)} "
                f"equations for {self.y.numel()} unknowns; closures that are redundant at some "
                "configurations only, and idle freedoms, are not possible"
            )
        return ca.vertcat(*rows), ca.vertcat(ca.SX(0, 1), *(self.moved(c) for c in self._cosines))

    # Functions ------------------------------------------------------------------------------------

    def by_unknowns(self, expression: Expression) -> Expression:
        """Return the Jacobian by y, shape (k, n)."""
        return self._total(expression, self.y)

    def by_task(self, expression: Expression) -> Expression:
        """Return the Jacobian by x, shape (k, m)."""
        return self._total(expression, self.x)

    def _total(self, expression: Expression, by: Expression) -> Expression:
        """Return the Jacobian, through the Stumpff functions too."""
        found = ca.jacobian(expression, by)
        if self.turn is not None:
            slope = 2 * self.turn.T @ ca.jacobian(self.turn, by)
            found += ca.jacobian(expression, self.stumpff[:4]) @ (self.stumpff[2:] @ slope)
        return ca.sparsify(ca.simplify(found))

    def second(self, expression: Expression) -> tuple[Expression, list[tuple[int, int, int]]]:
        """Return second derivatives by (x, y), the nonzero ones, and (row, column, column) of each.

        Of the pairs of columns, those with the first not beyond the second.
        """
        w = ca.vertcat(self.x, self.y)
        first = self._total(expression, w)
        rows, columns = first.sparsity().get_triplet()
        second = self._total(ca.vertcat(ca.SX(0, 1), *first.nonzeros()), w)
        entries, others = second.sparsity().get_triplet()
        of = [(rows[e], columns[e], k) for e, k in zip(entries, others, strict=True)]
        kept = [
            (value, at) for value, at in zip(second.nonzeros(), of, strict=True) if at[1] <= at[2]
        ]
        return ca.vertcat(ca.SX(0, 1), *(value for value, _ in kept)), [at for _, at in kept]

    @property
    def inputs(self) -> list[Expression]:
        """Symbols that functions take: state, x, y, and the Stumpff functions with their slopes."""
        return [self.state, self.x, self.y, self.stumpff]

    def unknown_of(self, coordinate: int) -> int | None:
        """Return which unknown a single coordinate of q is; None if it is one of x, or held."""
        for one in self.unknowns:
            if one.kind in ("number", "turn") and one.z.start == coordinate:
                return int(one.y.start)
        return None


def _turned(q0: Expression, y: Expression) -> Expression:
    """Return the quaternion q0 (y / 2, 1), scaled to unit length."""
    a, u, w = y / 2, q0[:3], q0[3]
    found = ca.vertcat(w * a + u + ca.cross(u, a), w - ca.dot(u, a))
    return found / ca.sqrt(ca.sumsqr(found))


def _moved_pair(q0: Expression, y: Expression) -> Expression:
    """Return (cos, sin) turned by y, scaled to unit length."""
    c, s = ca.cos(y), ca.sin(y)
    found = ca.vertcat(c * q0[0] - s * q0[1], s * q0[0] + c * q0[1])
    return found / ca.sqrt(ca.sumsqr(q0))


def _exponential(r: Expression, c: Expression) -> Expression:
    """Return exp(r^) with c_1 and c_2 given."""
    turn = ca.skew(r)
    return ca.SX.eye(3) + c[0] * turn + c[1] * (r @ r.T - ca.sumsqr(r) * ca.SX.eye(3))


def _about(axis: int, angle: Expression) -> Expression:
    """Return the rotation about an axis of the world."""
    c, s = ca.cos(angle), ca.sin(angle)
    found = ca.SX.eye(3)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found[one, one] = found[two, two] = c
    found[one, two], found[two, one] = -s, s
    return found
