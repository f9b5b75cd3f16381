"""Closure equations of a tree: gaps, Jacobian and constraint bias.

With e(q) the gaps of all closures, stacked, J v is their rate (in the rows that `rows` describes)
and J a + J' v their acceleration, J' being the derivative of J. J' v is the constraint bias.

Rows of spherical and rigid closures are in *world* axes at frame a's origin, those of the other
kinds in *frame a's* axes at its origin; forces come before moments.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.constraints.closures import (
    ClosedFrame,
    Closure,
    JointCoupling,
    LoopClosure,
    joint_id,
)
from rps_pin.closed_loop.constraints.couplings import CouplingRow, coupling_row
from rps_pin.closed_loop.constraints.frame_coordinates import FrameCoordinates
from rps_pin.closed_loop.constraints.rows import Floats, RotationVectorRows, Rows, Stack, rows_of
from rps_pin.errors import InputError, MechanismError, shown
from rps_pin.validation import positive_number

_WORLD_AXES = ("spherical", "rigid")
_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_THREE, _NINE = Struct("3d").unpack_from, Struct("9d").unpack_from
_distance, _ORIGIN = math.dist, (0.0, 0.0, 0.0)  # names of the module: fast

_Reader = Callable[[], Floats]
_OpenTest = tuple[_Reader, _Reader, Callable[[Floats, Floats], float]]

#: A configuration counts as open beyond this gap, in characteristic lengths. Forces at a smaller
#: gap have a relative error of about its size, and steps of finite differences stay below it.
OPEN = 1e-4


class LoopErrors(NamedTuple):
    """Gaps of the loops, their rates and accelerations; rows as the closures' in order."""

    position: Array
    """Gaps, shape (nc,), m; for angular rows the rotation vector between the frames, rad."""
    velocity: Array
    """Their rates, shape (nc,), m/s and rad/s."""
    acceleration: Array
    """Their second derivatives, shape (nc,), m/s^2 and rad/s^2; for angular rows the difference of
    the frames' angular accelerations, which is that where their angular velocities agree."""


class ClosedFrames(NamedTuple):
    """A closure of two frames, its rows and Pinocchio's data."""

    closure: LoopClosure
    rows: slice
    """Its rows in J."""
    a: ClosedFrame
    b: ClosedFrame
    selected: Rows
    """The selected rows, in frame a's axes."""
    in_world: bool
    """Whether its rows in J are turned to world axes."""
    constraint_data: Any
    """Pinocchio's; holds ``oMc1`` and ``c1Mc2`` once J or the gaps are computed."""


class HeldCoordinates(NamedTuple):
    """Coordinates of a frame that joints hold."""

    rows: Indices
    """In J."""
    idx_q: Indices
    idx_v: Indices
    turns: RotationVectorRows
    """The rows of the rotation vector, which are the last."""


class _Together:
    """Gaps of all spherical closures in one step, from Pinocchio's own memory."""

    def __init__(self, points: Sequence[ClosedFrames]) -> None:
        at = [range(frames.rows.start, frames.rows.stop) for frames in points]
        self.rows = np.array(at, dtype=np.intp).ravel()
        self._apart = [frames.constraint_data.c1Mc2.translation for frames in points]
        self._turns = [frames.constraint_data.oMc1.rotation for frames in points]

    def gaps(self) -> Array:
        """Return -R p of each, in world axes, (3 n,)."""
        apart = np.concatenate(self._apart).reshape(-1, 3, 1)
        turns = np.concatenate(self._turns).reshape(-1, 3, 3)
        return np.asarray(-(turns @ apart).ravel())


class ClosureEquations:
    """The closure equations of one model, with the scratch memory to evaluate them.

    Parameters
    ----------
    model
        The open tree.
    closures
        Its loop closures.
    characteristic_length
        See `ClosedLoopModel`.

    Attributes
    ----------
    size : int
        Number of rows, nc.
    length : float
        The characteristic length, m.
    reach : float
        Longest way along the links from the world to a closed frame, joints at zero, and at least
        the length, m: of its size are the numbers whose rounding errors gaps have.
    speed : float
        Characteristic speed, of a fall by half the length, m/s; 0 without gravity.
    row_scale, column_scale : (nc,) and (nv,) arrays
        ``row_scale[:, None] * J * column_scale`` has entries of one unit: angular rows count with
        the length as their lever, angular velocities are those of a point at that lever.
    angular_rows, angular_velocities : (nc,) and (nv,) bool arrays
        Which they are.
    data, calls, constraints, constraint_data
        For calling Pinocchio: `getConstraintsJacobian` reads what each of the `calls` refreshes.
    plain : bool
        Whether what it returns is J already; otherwise `select_rows` makes J of it.
    closed_frames, couplings : lists of ClosedFrames and CouplingRow
        The closures of frames, and those of joints.

    Raises
    ------
    MechanismError
        If a frame or joint is unknown, or two closures have one name.
    InputError
        If the characteristic length is not positive.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        characteristic_length: float | None = None,
    ) -> None:
        _refuse_other_orders(model)
        self.model = model
        self.closures = tuple(closures)
        for closure in self.closures:
            if not isinstance(closure, (LoopClosure, JointCoupling)):
                raise InputError(
                    f"closures are LoopClosure or JointCoupling objects, not {shown(closure)}"
                )
        refuse_twice("closure", [closure.name for closure in self.closures])
        self.size = sum(closure.size for closure in self.closures)
        self.data = model.createData()
        self._still = np.zeros(model.nv)
        self.constraints = pin.StdVec_RigidConstraintModel()
        self.constraint_data = pin.StdVec_RigidConstraintData()
        self.closed_frames: list[ClosedFrames] = []
        of_frames = [closure for closure in self.closures if isinstance(closure, LoopClosure)]
        for closure in of_frames:
            constraint = closure.constraint_model(model)
            self.constraints.append(constraint)
            self.constraint_data.append(constraint.createData())
        # Iterating a StdVec makes new Python objects each time: ten times as slow as a list.
        self.calls = [
            (constraint.calc, data)
            for constraint, data in zip(self.constraints, self.constraint_data, strict=True)
        ]
        for closure, (_, data) in zip(of_frames, self.calls, strict=True):
            rows, in_world = self.rows(closure.name), closure.kind in _WORLD_AXES
            a, b = closure.closed_frames(model)
            self.closed_frames.append(
                ClosedFrames(closure, rows, a, b, rows_of(closure), in_world, data)
            )
        self._points = [f for f in self.closed_frames if f.closure.kind == "spherical"]
        self._frames = [f for f in self.closed_frames if f.closure.kind != "spherical"]
        self.plain = 0 < len(of_frames) == len(self.closures)
        self.plain = self.plain and all(frames.in_world for frames in self.closed_frames)
        self.length = self._length(characteristic_length)
        self.reach = self._reach()
        self.speed = math.sqrt(float(np.linalg.norm(model.gravity.linear)) * self.length)
        self.angular_velocities = angular = self._is_angular()
        #: Coordinates that are displacements: of slides, and of free-flyers.
        self.displacements = self._displacements()
        self.column_scale = np.where(angular, 1 / self.length, 1.0)
        self.angular_rows = np.zeros(self.size, dtype=bool)
        for frames in self.closed_frames:
            self.angular_rows[frames.rows] = frames.selected.angular
        self.couplings: list[CouplingRow] = []
        #: Their rows of J, as far as these do not depend on q.
        self._coupling_rows = np.zeros((self.size, model.nv))
        for closure in self.closures:
            if isinstance(closure, JointCoupling):
                coupling = coupling_row(closure, model, self.rows(closure.name).start)
                self.couplings.append(coupling)
                self._coupling_rows[coupling.row, coupling.idx_v] = 1.0
                for term in coupling.terms:
                    self._coupling_rows[coupling.row, term.idx_v] = -term.coefficients[0]
                self.angular_rows[coupling.row] = angular[coupling.idx_v]
        #: Coordinates of frames, which joints hold.
        self.held = [self._held(f) for f in self.closed_frames if _has_joints(f)]
        for held in self.held:
            self._coupling_rows[held.rows, held.idx_v] = 1.0
        #: Those whose rows of J depend on q.
        self.curved = [coupling for coupling in self.couplings if not coupling.is_linear]
        self.row_scale = np.where(self.angular_rows, self.length, 1.0)
        self._groups = self._row_groups()
        #: Gap beyond which a configuration counts as open, m.
        self.open_limit = OPEN * self.length
        self._open_points, self._open_frames = self._open_tests()
        self._only_spherical = len(self._open_points) == len(self.closures)
        self._together = _Together(self._points)

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies scratch memory of their own."""
        given = self.model, self.closures, self.length
        return type(self), given, {"open_limit": self.open_limit}

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure by its name, or say which there are."""
        start = 0
        for candidate in self.closures:
            if candidate.name == closure:
                return slice(start, start + candidate.size)
            start += candidate.size
        names = ", ".join(candidate.name for candidate in self.closures)
        raise MechanismError(f"no closure {closure!r}; there are: {names}")

    def jacobian(self, q: Array) -> Array:
        """Return J at a configuration, shape (nc, nv)."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        for calc, constraint_data in self.calls:
            calc(model, data, constraint_data)
        return self.select_rows(
            pin.getConstraintsJacobian(model, data, self.constraints, self.constraint_data), q
        )

    def select_rows(self, jacobian: Array, q: Array) -> Array:
        """Return J (nc, nv) at q from what Pinocchio's `getConstraintsJacobian` returned there."""
        if self.plain:
            return jacobian.reshape(self.size, self.model.nv)  # a single row or column comes flat
        self.look_at(q)
        rows = self._rows_of_couplings(q)
        all_rows = jacobian.reshape(-1, self.model.nv)
        start = 0
        for frames in self.closed_frames:
            stop = start + (3 if frames.closure.kind == "spherical" else 6)
            block = all_rows[start:stop]
            rows[frames.rows] += (
                block
                if frames.in_world
                else frames.selected.wrenches(frames.constraint_data.c1Mc2) @ block
            )
            start = stop
        return rows

    def look_at(self, q: Array) -> None:
        """Take the rotation vectors of frames that are nearest to what their joints hold at q."""
        for held in self.held:
            held.turns.near[held.turns.axes] = q[
                held.idx_q[held.idx_q.size - len(held.turns.axes) :]
            ]

    def _held(self, frames: ClosedFrames) -> HeldCoordinates:
        """Return where joints hold the coordinates of a frame."""
        closure, model = frames.closure, self.model
        assert isinstance(closure, FrameCoordinates)
        assert isinstance(frames.selected, Stack)
        turns = frames.selected.parts[1]
        assert isinstance(turns, RotationVectorRows)
        joints = [model.joints[joint_id(model, name, closure.name)] for name in closure.joints]
        return HeldCoordinates(
            np.arange(frames.rows.start, frames.rows.stop),
            np.array([joint.idx_q for joint in joints], dtype=np.intp),
            np.array([joint.idx_v for joint in joints], dtype=np.intp),
            turns,
        )

    def _rows_of_couplings(self, q: Array) -> Array:
        """Return the rows of J of joints' coordinates, and zeros for others, shape (nc, nv)."""
        rows = self._coupling_rows.copy()
        for coupling in self.curved:
            for k, (_, first, _, _) in coupling.slopes(q):
                rows[coupling.row, k] = -first
        return rows

    def _curvature(self, q: Array, v: Array) -> Array:
        """Return J' v of the couplings, -p'' v^2, and zeros for the others, shape (nc,)."""
        bias = np.zeros(self.size)
        for coupling in self.curved:
            for k, (_, _, second, _) in coupling.slopes(q):
                bias[coupling.row] -= second * v[k] ** 2
        return bias

    # Gaps -----------------------------------------------------------------------------------------

    def gaps(self, q: Array) -> Array:
        """Return e(q), shape (nc,), m and rad."""
        pin.forwardKinematics(self.model, self.data, q)
        for calc, constraint_data in self.calls:
            calc(self.model, self.data, constraint_data)
        return self.current_gaps(q)

    def current_gaps(self, q: Array) -> Array:
        """Return e(q), from the placements that `jacobian` or `gaps` has computed at q."""
        gaps = np.empty(self.size)
        self.look_at(q)
        if self._points:
            gaps[self._together.rows] = self._together.gaps()
        for frames in self._frames:
            gap = frames.selected.gap(frames.constraint_data.c1Mc2)
            if frames.in_world:
                gap = (gap.reshape(-1, 3) @ frames.constraint_data.oMc1.rotation.T).ravel()
            gaps[frames.rows] = gap
        for coupling in self.couplings:
            gaps[coupling.row] = coupling.gap(q)
        for held in self.held:
            gaps[held.rows] += q[held.idx_q]
        return gaps

    def largest_gap(self, gaps: Array) -> float:
        """Return the largest gap of a closure, m; angles with the length as lever."""
        return float(self.largest_gaps(gaps))

    def largest_gaps(self, gaps: Array) -> Array:
        """Return `largest_gap` of many, (..., nc), shape (...)."""
        if not self.size:
            return np.zeros(gaps.shape[:-1])
        scaled = self.row_scale * gaps
        squares = np.add.reduceat(scaled * scaled, self._groups, axis=-1)
        return np.asarray(np.sqrt(squares.max(axis=-1)))

    def is_open(self, q: Array) -> bool:
        """Return whether a gap exceeds `OPEN`, after `jacobian` at q: fast, for control loops."""
        reach = self.open_limit
        for point in self._open_points:
            if not _distance(point(), _ORIGIN) <= reach:
                return True
        if self._only_spherical:
            return False
        limit = reach * reach
        for point, rotation, squared_gap in self._open_frames:
            if not squared_gap(point(), rotation()) <= limit:
                return True
        for coupling in self.couplings:
            gap = self.row_scale[coupling.row] * coupling.gap(q)
            if not gap * gap <= limit:
                return True
        return bool(self.held) and not self.largest_gap(self.current_gaps(q)) <= reach

    def accept(self, gap: float) -> None:
        """Count configurations with this gap (m) as closed: a rounded file leaves it."""
        self.open_limit = max(self.open_limit, gap)

    def open_closure(self, gaps: Array) -> str:
        """Return the closure of the largest gap, and the gap, in words."""
        scaled = self.row_scale * gaps
        largest = [np.linalg.norm(part) for part in np.split(scaled, self._groups[1:])]
        row = int(self._groups[int(np.argmax(largest))])
        name = next(c.name for c in self.closures if row < self.rows(c.name).stop)
        found, angular = gaps[self.rows(name)], self.angular_rows[self.rows(name)]
        turn, apart = float(np.linalg.norm(found[angular])), float(np.linalg.norm(found[~angular]))
        parts = ""
        if turn * self.length > 0.01 * apart:
            parts = f" ({apart:.3g} m between its points, {turn:.3g} rad between its axes)"
        return f"closure {name!r} stays open by {max(largest):.6g} m{parts}"

    def _row_groups(self) -> Indices:
        """Return the first row of each closure's linear and angular part."""
        starts = {self.rows(closure.name).start for closure in self.closures}
        starts |= set((np.flatnonzero(np.diff(self.angular_rows.astype(int))) + 1).tolist())
        return np.array(sorted(starts), dtype=np.intp)

    def _open_tests(self) -> tuple[list[_Reader], list[_OpenTest]]:
        """Return readers of c1Mc2 of spherical closures; and of the others, with their gaps."""
        points: list[_Reader] = []
        others: list[_OpenTest] = []
        for frames in self.closed_frames:
            placement = frames.constraint_data.c1Mc2  # refers to Pinocchio's own memory
            point = partial(_THREE, memoryview(placement.translation))
            if frames.closure.kind == "spherical":
                points.append(point)
                continue
            if isinstance(frames.closure, FrameCoordinates):
                continue  # tested by their gaps
            rotation = partial(_NINE, memoryview(placement.rotation.T))
            squared_gap = partial(frames.selected.squared_gap, self.length)
            others.append((point, rotation, squared_gap))
        return points, others

    def errors(self, q: Array, v: Array, a: Array) -> LoopErrors:
        """Return gaps, their rates and their accelerations."""
        gaps = self.gaps(q)
        pin.forwardKinematics(self.model, self.data, q, v, a)
        rows = self._rows_of_couplings(q)
        rates, accelerations = rows @ v, rows @ a + self._curvature(q, v)
        for frames in self.closed_frames:
            rate, acceleration = (
                self._world_motion(frames) if frames.in_world else self._selected_motion(frames)
            )
            rates[frames.rows] += rate
            accelerations[frames.rows] += acceleration
        return LoopErrors(gaps, rates, accelerations)

    def bias(self, q: Array, v: Array) -> Array:
        """Return the constraint bias J' v, shape (nc,): J a = -J' v keeps the loops closed.

        J' is the derivative of J itself, also where the loops are open.
        """
        model, data, acceleration = self.model, self.data, pin.getFrameClassicalAcceleration
        pin.forwardKinematics(model, data, q, v, self._still)
        bias = self._curvature(q, v)
        self.look_at(q)
        for frames in self._points:
            bias[frames.rows] = (
                acceleration(model, data, frames.a.joint, frames.a.placement, _WORLD).linear
                - acceleration(model, data, frames.b.joint, frames.b.placement, _WORLD).linear
            )
        for frames in self._frames:
            bias[frames.rows] = self._selected_motion(frames)[1]
        return bias

    def _world_motion(self, frames: ClosedFrames) -> tuple[Array, Array]:
        """Return velocity and acceleration of a less those of b, each frame's at its own origin."""
        size = frames.closure.size
        rates, accelerations = (
            [
                of(self.model, self.data, frame.joint, frame.placement, _WORLD)
                for frame in (frames.a, frames.b)
            ]
            for of in (pin.getFrameVelocity, pin.getFrameClassicalAcceleration)
        )
        return (
            (rates[0] - rates[1]).vector[:size],
            (accelerations[0] - accelerations[1]).vector[:size],
        )

    def _selected_motion(self, frames: ClosedFrames) -> tuple[Array, Array]:
        """Return J v = W X and its derivative W A + W' X, X the twist of a relative to b, A = X'.

        In world axes, with R and w of frame a: R W X, and R (W X)' + R (w x W X). After a
        `forwardKinematics` with velocities and accelerations.
        """
        model, data = self.model, self.data
        local = pin.ReferenceFrame.LOCAL
        of_a, of_b = (
            (model, data, one.joint, one.placement, local) for one in (frames.a, frames.b)
        )
        placement_a = frames.a.at(data)
        placement = placement_a.actInv(frames.b.at(data))
        twist_a = pin.getFrameVelocity(*of_a)
        twist_b = placement.act(pin.getFrameVelocity(*of_b))
        twist = twist_a - twist_b
        a = pin.getFrameAcceleration(*of_a)
        b = placement.act(pin.getFrameAcceleration(*of_b))
        # d/dt (Ad_M nu_b) = Ad_M nu_b' + xi x (Ad_M nu_b), xi = -X; and X x nu_b = X x nu_a.
        acceleration = a - b + twist.cross(twist_a)
        wrenches = frames.selected.wrenches(placement)
        rate = wrenches @ twist.vector
        change = wrenches @ acceleration.vector + frames.selected.bias(placement, twist.vector)
        if not frames.in_world:
            return rate, change
        turn = placement_a.rotation
        rate, change = rate.reshape(-1, 3), change.reshape(-1, 3)
        change = change + np.cross(twist_a.angular, rate)
        return (rate @ turn.T).ravel(), (change @ turn.T).ravel()

    def _length(self, given: float | None) -> float:
        """Return the given length, or the longest lever of a closure or, without one, of a link.

        A link's levers are the way to its centre of mass, and to the joints that it carries. 1 m
        if there is none either.
        """
        if given is not None:
            return positive_number(given, "characteristic_length", "m")
        levers = [
            float(np.linalg.norm(frame.placement.translation))
            for frames in self.closed_frames
            for frame in (frames.a, frames.b)
            if frame.joint != 0  # the world is no lever
        ]
        if not any(levers):
            levers = [float(np.linalg.norm(at.translation)) for at in self.model.jointPlacements]
            levers += [float(np.linalg.norm(inertia.lever)) for inertia in self.model.inertias]
        return max(levers, default=0.0) or 1.0

    def _reach(self) -> float:
        """Return the longest way from the world to a closed frame, at least the length, m."""
        model, ways = self.model, [0.0]
        for index in range(1, model.njoints):
            step = float(np.linalg.norm(model.jointPlacements[index].translation))
            ways.append(ways[model.parents[index]] + step)
        ends = [
            ways[frame.joint] + float(np.linalg.norm(frame.placement.translation))
            for frames in self.closed_frames
            for frame in (frames.a, frames.b)
        ]
        return max([self.length, *ends])

    def _is_angular(self) -> Bools:
        """Return which velocity components are angular: they move joint frames by turning them."""
        neutral = pin.neutral(self.model)
        pin.computeJointJacobians(self.model, self.data, neutral)
        angular = np.zeros(self.model.nv, dtype=bool)
        for index in range(1, self.model.njoints):
            joint = self.model.joints[index]
            columns = slice(joint.idx_v, joint.idx_v + joint.nv)
            local = pin.getJointJacobian(self.model, self.data, index, pin.ReferenceFrame.LOCAL)
            subspace = local.reshape(6, self.model.nv)[:, columns]
            angular[columns] = np.abs(subspace[3:]).max(axis=0) > 1e-12
        return angular

    def _displacements(self) -> Indices:
        found: list[int] = []
        for joint in list(self.model.joints)[1:]:
            of_joint = self.angular_velocities[joint.idx_v : joint.idx_v + joint.nv]
            if joint.nq == joint.nv or not of_joint.all():  # the shifts come first
                found += (joint.idx_q + np.flatnonzero(~of_joint)).tolist()
        return np.array(found, dtype=np.intp)


def _has_joints(frames: ClosedFrames) -> bool:
    return isinstance(frames.closure, FrameCoordinates)


def _refuse_other_orders(model: pin.Model) -> None:
    """Raise `MechanismError` unless the joints after any joint's are those that it carries."""
    for index in range(2, model.njoints):
        parent, before = model.parents[index], index - 1
        while before not in (0, parent):
            before = model.parents[before]
        if before != parent:
            raise MechanismError(
                f"joint {model.names[index]!r} was added after another branch than its own: "
                "Pinocchio's mass matrix is wrong in such a tree; add each branch to its end "
                "before the next"
            )


def names_of(given: object, what: str) -> tuple[str, ...]:
    """Return one name, or several, as a tuple; `what` they are names of is told otherwise."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, Iterable):
        raise MechanismError(f"{what}: {shown(given)} is no list of names")
    listed = tuple(names)
    for name in listed:
        if not isinstance(name, str):
            raise MechanismError(f"{what}: {shown(name)} is not a name")
    return listed


def refuse_twice(what: str, names: Sequence[str]) -> None:
    """Raise `MechanismError` if a name comes twice."""
    twice = {name for name in names if list(names).count(name) > 1}
    if twice:
        raise MechanismError(f"{what} {min(twice)!r} is named twice")
