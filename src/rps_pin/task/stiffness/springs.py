"""A mechanism's tree with springs in it: every spring is one more joint of one coordinate.

A bearing is a row of such joints before the joint (or closed frame) that it holds, a segment of a
beam a row of six in the link (see `beams`); the link's inertia, joints and frames are shared out
among the nodes of its beams. All coordinates of springs at zero is the rigid mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop import ClosedLoopModel, JointEffects, LoopClosure
from rps_pin.closed_loop.constraints.closures import Closure, frame_id, joint_id
from rps_pin.closed_loop.editing.rebuild import copy_joint_properties
from rps_pin.errors import MechanismError
from rps_pin.task.stiffness.beam_nodes import Node, inertias_of, nodes_of
from rps_pin.task.stiffness.compliances import DIRECTIONS, Compliances

_KINDS = (
    *(pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    *(pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
)
#: Share of a unit motion below which a joint does not move in a direction.
_MOVES = 1e-9


class ElasticTree(NamedTuple):
    """The tree with its springs."""

    model: pin.Model
    closures: tuple[Closure, ...]
    effects: JointEffects | None
    idx_q: Indices
    """Where the coordinates of the rigid mechanism are in q, (nq,)."""
    idx_v: Indices
    """The same of its velocities, (nv,)."""
    names: tuple[str, ...]
    """Of the springs: ``joint.x``, ``closure.rx``, ``beam[1].ry``; not those of actuators."""
    spring_v: Indices
    """Their velocities."""
    stiffness: Array
    """Theirs, shape (ns,), N/m and N m/rad."""
    output: str | None
    """Name of the output frame."""


@dataclass
class _Part:
    """A joint of the new tree, with what comes after it."""

    name: str
    kind: Any
    placement: pin.SE3
    old: int | None = None
    """Index of the joint that it is in the rigid mechanism; None: a spring."""
    stiffness: float = 0.0
    inertia: pin.Inertia = field(default_factory=pin.Inertia.Zero)
    after: list[_Part] = field(default_factory=list)
    index: int = 0
    """In the new model, once it is there."""


class _Point(NamedTuple):
    """Where something is fixed in the new tree."""

    part: _Part
    placement: pin.SE3
    """In the part's frame."""


class ElasticBuilder:
    """Builds the tree of a mechanism with springs.

    Parameters
    ----------
    mechanism
        The rigid mechanism.
    compliances
        Its springs.
    output
        Name and placement of the output frame, or None.

    Raises
    ------
    MechanismError
        If something is named that there is not, or a bearing gives way where its joint is free.
    """

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        compliances: Compliances,
        output: tuple[str, pin.SE3] | None,
    ) -> None:
        self._mechanism, self._compliances = mechanism, compliances
        self._model = model = mechanism.model
        self._refuse_unknown()
        self._parts = {
            old: _Part(
                model.names[old], model.joints[old] if old else None, pin.SE3.Identity(), old
            )
            for old in range(model.njoints)
        }
        self._nodes: dict[int, list[tuple[Node, _Part]]] = {}
        for old in range(model.njoints):
            self._add_link(old)
        for old in range(1, model.njoints):
            self._add_joint(old)
        self._frames: list[tuple[str, _Point]] = []
        closures = tuple(self._closure(one) for one in mechanism.closures)
        name = None if output is None else self._output(*output)
        self.tree = self._emitted(closures, name)

    # Links, joints and closures -------------------------------------------------------------------

    def _add_link(self, old: int) -> None:
        """Hang the springs of a link's beams behind its joint."""
        root = self._parts[old]
        beams = {
            name: beam
            for name, beam in self._compliances.beams.items()
            if self._link(beam.link, name) == old
        }
        nodes = nodes_of(self._mechanism, old, beams)
        placed: list[tuple[Node, _Part]] = []
        for node in nodes:
            part = root
            if node.compliances is not None:
                before, carrier = placed[node.before]
                at = before.placement.actInv(node.placement)
                springs = [
                    (direction, 1 / value)
                    for direction, value in zip(DIRECTIONS, node.compliances, strict=True)
                ]
                part = _hung(carrier, at, node.name, springs)
            placed.append((node, part))
        self._nodes[old] = placed
        if not placed:
            root.inertia = self._model.inertias[old]
            return
        shares = inertias_of(self._model.inertias[old], nodes)
        for (_, part), share in zip(placed, shares, strict=True):
            part.inertia = share

    def _add_joint(self, old: int) -> None:
        """Hang a joint, behind its bearing's springs, on the link that carries it."""
        model = self._model
        carrier, at = self._point(model.parents[old], model.jointPlacements[old])
        name = model.names[old]
        bearing = self._compliances.joints.get(name, {})
        self._refuse_free(old, bearing)
        part = self._parts[old]
        if bearing:
            carrier, at = _hung(carrier, at, name, _ordered(bearing)), pin.SE3.Identity()
        part.placement = at
        carrier.after.append(part)

    def _closure(self, closure: Closure) -> Closure:
        """Return a closure of frames of its own, on the nodes that carry the closed frames."""
        if not isinstance(closure, LoopClosure):
            return closure
        bearing = self._compliances.closures.get(closure.name, {})
        names = []
        for side, frame in zip("ab", closure.closed_frames(self._model), strict=True):
            point = self._point(frame.joint, frame.placement)
            if side == "b" and bearing:
                last = _hung(point.part, point.placement, closure.name, _ordered(bearing))
                point = _Point(last, pin.SE3.Identity())
            names.append(self._frame(f"{closure.name}:{side}", point))
        return replace(
            closure, frame_a=names[0], frame_b=names[1], placement_a=None, placement_b=None
        )

    def _output(self, frame: str, offset: pin.SE3) -> str:
        of = self._model.frames[frame_id(self._model, frame, "output")]
        return self._frame("output", self._point(of.parentJoint, of.placement * offset))

    def _frame(self, name: str, point: _Point) -> str:
        """Keep a frame of a new name for later, and return its name."""
        while self._model.existFrame(name) or any(name == other for other, _ in self._frames):
            name += "'"
        self._frames.append((name, point))
        return name

    def _point(self, link: int, placement: pin.SE3) -> _Point:
        """Return where something of a link is fixed: at the nearest node of its beams."""
        placed = self._nodes[link]
        if not placed:
            return _Point(self._parts[link], placement)
        away = [float(np.linalg.norm(node.at - placement.translation)) for node, _ in placed]
        node, part = placed[int(np.argmin(np.round(away, 12)))]
        return _Point(part, node.placement.actInv(placement))

    # Refusals -------------------------------------------------------------------------------------

    def _link(self, name: str, beam: str) -> int:
        """Return the joint that carries the link of a beam."""
        if self._model.existJointName(name):
            return joint_id(self._model, name, f"beam {beam!r}")
        return int(self._model.frames[frame_id(self._model, name, f"beam {beam!r}")].parentJoint)

    def _refuse_unknown(self) -> None:
        given, mechanism = self._compliances, self._mechanism
        known = {
            "actuator": (given.actuators, mechanism.actuated),
            "joint": (given.joints, list(self._model.names)[1:]),
            "closure": (
                given.closures,
                [one.name for one in mechanism.closures if isinstance(one, LoopClosure)],
            ),
        }
        for kind, (names, there) in known.items():
            for name in names:
                if name not in there:
                    raise MechanismError(
                        f"compliances: no {kind} {name!r}; there are: {', '.join(there) or 'none'}"
                    )

    def _refuse_free(self, old: int, bearing: Any) -> None:
        """Refuse springs in directions in which the joint moves: no force would load them."""
        joint = self._model.joints[old]
        data = joint.createData()
        joint.calc(data, pin.neutral(self._model))
        subspace = np.array(data.S).reshape(6, joint.nv)
        for direction in bearing:
            axis = np.eye(6)[DIRECTIONS.index(direction)]
            part, *_ = np.linalg.lstsq(subspace, axis, rcond=None)
            if np.linalg.norm(subspace @ part - axis) < _MOVES:
                raise MechanismError(
                    f"joint {self._model.names[old]!r} moves freely in direction {direction}: a "
                    "bearing cannot give way there; a spring of the joint itself belongs to the "
                    "mechanism (stiffness), that of a drive to 'actuators'"
                )

    # The model ------------------------------------------------------------------------------------

    def _emitted(self, closures: tuple[Closure, ...], output: str | None) -> ElasticTree:
        """Return the tree as Pinocchio's, each branch to its end before the next."""
        old_model, model = self._model, pin.Model()
        model.name, model.gravity = old_model.name, old_model.gravity
        root = self._parts[0]
        model.inertias[0] = root.inertia
        springs: list[_Part] = []
        for parent, part in _from(root):
            part.index = int(
                model.addJoint(parent.index, part.kind, part.placement, _free(model, part.name))
            )
            model.inertias[part.index] = part.inertia
            if part.old is None:
                springs.append(part)
                joint = model.joints[part.index]
                model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q] = (
                    -np.inf,
                    np.inf,
                )
            else:
                copy_joint_properties(old_model, [part.old], model, part.index)
        self._add_frames(model)
        places = [(old_model.joints[i], model.joints[self._parts[i].index]) for i in
                  range(1, old_model.njoints)]  # fmt: skip
        idx_q, idx_v = np.empty(old_model.nq, np.intp), np.empty(old_model.nv, np.intp)
        for before, now in places:
            idx_q[before.idx_q : before.idx_q + before.nq] = now.idx_q + np.arange(now.nq)
            idx_v[before.idx_v : before.idx_v + before.nv] = now.idx_v + np.arange(now.nv)
        return ElasticTree(
            model,
            closures,
            _effects(self._mechanism.effects, idx_v, model.nv),
            idx_q,
            idx_v,
            tuple(part.name for part in springs),
            np.array([model.joints[part.index].idx_v for part in springs], dtype=np.intp),
            np.array([part.stiffness for part in springs]),
            output,
        )

    def _add_frames(self, model: pin.Model) -> None:
        """Add the frames of the rigid mechanism, and those of closures and output."""
        old_model = self._model
        for old in list(old_model.frames)[1:]:
            is_joint = old.type == pin.FrameType.JOINT
            part, at = (
                _Point(self._parts[old.parentJoint], old.placement)
                if is_joint
                else self._point(old.parentJoint, old.placement)
            )
            model.addFrame(pin.Frame(old.name, part.index, 0, at, old.type), False)
        for name, (part, at) in self._frames:
            model.addFrame(pin.Frame(name, part.index, 0, at, pin.FrameType.OP_FRAME), False)


def _ordered(bearing: Any) -> list[tuple[str, float]]:
    return [(one, bearing[one]) for one in DIRECTIONS if one in bearing]


def _hung(carrier: _Part, at: pin.SE3, name: str, springs: list[tuple[str, float]]) -> _Part:
    """Hang springs, one after the other, on a part; return the last."""
    for direction, stiffness in springs:
        kind = _KINDS[DIRECTIONS.index(direction)]()
        part = _Part(f"{name}.{direction}", kind, at, stiffness=stiffness)
        carrier.after.append(part)
        carrier, at = part, pin.SE3.Identity()
    return carrier


def _from(root: _Part) -> Iterator[tuple[_Part, _Part]]:
    """Yield each part after another with the one before it, branch by branch."""
    waiting = [(root, part) for part in reversed(root.after)]
    while waiting:
        before, part = waiting.pop()
        yield before, part
        waiting += [(part, one) for one in reversed(part.after)]


def _free(model: pin.Model, name: str) -> str:
    while model.existJointName(name):
        name += "'"
    return name


def _effects(effects: JointEffects | None, idx_v: Indices, nv: int) -> JointEffects | None:
    """Return the effects of the rigid mechanism's joints in the new tree."""
    if effects is None:
        return None
    arrays = {}
    for name in ("damping", "friction", "stiffness", "rest"):
        arrays[name] = np.zeros(nv)
        arrays[name][idx_v] = getattr(effects, name)
    return JointEffects(**arrays, friction_speed=effects.friction_speed)
