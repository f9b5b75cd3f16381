"""Merging of revolute joints that meet in a point into one spherical or universal joint.

Files describe a ball joint as three revolute joints with massless links between, or a Cardan joint
as two. The merged spherical joint has no gimbal lock, and a quaternion as its coordinates.

The placement of the merged joint is that of the last joint of the row at zero angles; so zero
angles are the neutral configuration, and what the last joint carries is not moved. With P_i the
placements of the joints and a_i their axes,

    spherical:  placement P_1 P_2 P_3,  R = (R_1 R_2 R_3)' R_1 exp(a_1 q_1) R_2 exp(a_2 q_2) ...
    universal:  placement P_1 P_2,      R = exp(R_2' a_1 q_1) exp(a_2 q_2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Literal, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import joint_id
from rps_pin.closed_loop.editing.rebuild import JointRow, NewJoint, rebuilt
from rps_pin.errors import MechanismError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import real_vector

MergedKind = Literal["spherical", "universal"]

_JOINTS_OF = {"spherical": 3, "universal": 2}
#: Origins count as coincident below this distance, over the longest offset in the tree.
_COINCIDENT = 1e-9
#: Links between joints may have this share of the mass, and of the moments of inertia about the
#: joint, of what the last one carries: many files give them 1e-9 kg for want of 0.
PLACEHOLDER = 1e-5
#: Axes count as perpendicular below this cosine, and as parallel below this sine.
_PERPENDICULAR = 1e-6
_PARALLEL = 1e-3


@refuses_other_kinds
@dataclass(frozen=True)
class JointMerge:
    """Revolute joints in a row, named from the base outwards, and the joint they become.

    Parameters
    ----------
    joints
        Three joints for a spherical joint, two for a universal one.
    into
        ``"spherical"`` or ``"universal"``.
    name
        Name of the merged joint.

    Raises
    ------
    MechanismError
        If the kind is unknown, or the number of joints is not that of the kind.
    """

    joints: Sequence[str]
    into: MergedKind
    name: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(self.joints))
        if self.into not in _JOINTS_OF:
            kinds = ", ".join(get_args(MergedKind))
            raise MechanismError(f"joints cannot be merged into {self.into!r}; there are: {kinds}")
        wanted = _JOINTS_OF[self.into]
        if len(self.joints) != wanted or len(set(self.joints)) != wanted:
            raise MechanismError(
                f"merge {self.name!r}: a {self.into} joint is made of {wanted} different joints, "
                f"not of {', '.join(self.joints) or 'none'}"
            )
        if not self.name or self.name == "universe":
            raise MechanismError(f"a merged joint cannot be called {self.name!r}")


@refuses_other_kinds
def merged(model: pin.Model, merges: Sequence[JointMerge]) -> pin.Model:
    """Return a model in which rows of revolute joints are single joints.

    Everything else is kept: limits, armature, friction, damping, rotors, frames, gravity,
    reference configurations. A universal joint has the coordinates, limits, ... of its two joints.
    A spherical joint has no limits, since those of three angles are not limits of a rotation.
    Frames on the links between are left out; the frame of the last joint has the merged joint's
    name. The links between must be massless but for a `PLACEHOLDER`, which is added, as it is at
    zero angles, to the link that the last joint carries.

    Raises
    ------
    MechanismError
        If a joint is unknown, not revolute, or in two merges; the joints are not in a row; their
        origins or axes do not fit; or a link between has mass or carries another joint.
    """
    rows = [_row(model, merge) for merge in merges]
    _refuse_shared(model, merges, rows)
    joints = {
        row[-1]: _merged_joint(model, merge, row) for merge, row in zip(merges, rows, strict=True)
    }
    result = rebuilt(model, joints, {joint for row in rows for joint in row[:-1]})
    for merge, row in zip(merges, rows, strict=True):
        result.inertias[result.getJointId(merge.name)] += _between(model, row)
    for entry in model.referenceConfigurations:
        result.referenceConfigurations[entry.key()] = merged_configuration(
            model, merges, entry.data()
        )
    return result


def merged_configuration(model: pin.Model, merges: Sequence[JointMerge], q: ArrayLike) -> Array:
    """Return the configuration of the merged model for one of the model before merging.

    Parameters
    ----------
    model
        The model before merging.
    merges
        What `merged` was given.
    q
        Configuration of `model`, shape (nq,).

    Raises
    ------
    InputError
        If q has the wrong shape or is not finite.
    MechanismError
        As for `merged`.
    """
    q = real_vector(q, model.nq, "q")
    rows = {row[-1]: row for row in (_row(model, merge) for merge in merges)}
    dropped = {joint for row in rows.values() for joint in row[:-1]}
    values = []
    for joint in range(1, model.njoints):
        row = rows.get(joint, [joint])
        if joint in dropped:
            continue
        if len(row) == 3:
            values.append(pin.Quaternion(_turned(model, row, q)).coeffs())
        else:
            values += [q[model.idx_qs[i] : model.idx_qs[i] + model.nqs[i]] for i in row]
    return np.concatenate(values) if values else np.empty(0)


def placeholder_notes(model: pin.Model, merges: Sequence[JointMerge]) -> list[str]:
    """Return a sentence for each merge whose links between have a mass."""
    masses = [(merge, _between(model, _row(model, merge)).mass) for merge in merges]
    return [
        f"merge {merge.name!r}: {mass:.6g} kg of the links between is added to the link it carries"
        for merge, mass in masses
        if mass
    ]


def _between(model: pin.Model, row: list[int]) -> pin.Inertia:
    """Return the inertia of the links between, at zero angles, in the frame of the last joint."""
    total, to_last = pin.Inertia.Zero(), pin.SE3.Identity()
    for joint, before in zip(row[:0:-1], row[-2::-1], strict=True):
        to_last = model.jointPlacements[joint] * to_last
        total += to_last.actInv(model.inertias[before])
    return total


def _turned(model: pin.Model, row: list[int], q: Array) -> Array:
    """Return R of a row of three joints, as in the module docstring; shape (3, 3)."""
    straight, turned = np.eye(3), np.eye(3)
    for joint in row:
        placed = model.jointPlacements[joint].rotation
        straight = straight @ placed
        turned = turned @ placed @ pin.exp3(_axis(model, joint) * q[model.idx_qs[joint]])
    return np.asarray(straight.T @ turned)


def _merged_joint(model: pin.Model, merge: JointMerge, row: list[int]) -> JointRow:
    placement = pin.SE3.Identity()
    for joint in row:
        placement = placement * model.jointPlacements[joint]
    if merge.into == "spherical":
        for joint, name in product(row, ("armature", "rotorInertia")):
            value = getattr(model, name)[model.idx_vs[joint]]
            if value != 0:  # of a rotor about an axis that is not constant in the merged joint
                raise MechanismError(
                    f"merge {merge.name!r}: joint {model.names[joint]!r} has {name} = {value:.6g}, "
                    "which a spherical joint cannot have; set it to 0 first"
                )
        return JointRow([NewJoint(merge.name, pin.JointModelSpherical(), placement)], [])
    kind = pin.JointModelUniversal(*_axes(model, row))
    return JointRow([NewJoint(merge.name, kind, placement)], row)


# Checks -------------------------------------------------------------------------------------------


def _row(model: pin.Model, merge: JointMerge) -> list[int]:
    """Return the indices of the joints to merge, which are in a row and meet in a point."""
    what = f"merge {merge.name!r}"
    row = [joint_id(model, name, what) for name in merge.joints]
    for joint in row:
        _axis(model, joint, what)
    for first, second in pairwise(row):
        _check_link(model, what, first, second)
    _check_masses(model, what, row)
    _check_axes(model, what, merge, row)
    return row


def _check_link(model: pin.Model, what: str, first: int, second: int) -> None:
    """Refuse a link between two joints that has other joints, or a length."""
    before, after = model.names[first], model.names[second]
    if model.parents[second] != first:
        raise MechanismError(
            f"{what}: {after!r} does not follow {before!r}; it follows "
            f"{model.names[model.parents[second]]!r}. Name them from the base outwards"
        )
    others = [model.names[i] for i in range(1, model.njoints) if model.parents[i] == first]
    if len(others) > 1:
        others.remove(after)
        raise MechanismError(
            f"{what}: the link between {before!r} and {after!r} also carries {', '.join(others)}"
        )
    offset = float(np.linalg.norm(model.jointPlacements[second].translation))
    if offset > _COINCIDENT * _longest(model):
        raise MechanismError(
            f"{what}: the origins of {before!r} and {after!r} are {offset:.6g} m apart; "
            "joints are merged where they meet in a point"
        )


def _longest(model: pin.Model) -> float:
    """Return the longest offset of a joint, a frame or a centre of mass from its joint, m."""
    offsets = [one.translation for one in model.jointPlacements]
    offsets += [frame.placement.translation for frame in model.frames]
    offsets += [inertia.lever for inertia in model.inertias]
    return max(float(np.linalg.norm(offset)) for offset in offsets)


def _check_masses(model: pin.Model, what: str, row: list[int]) -> None:
    """Refuse links between that weigh more than a `PLACEHOLDER` of what the last joint carries."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    last, carried = row[-1], pin.Inertia.Zero()
    for joint in model.subtrees[last]:
        carried += data.oMi[last].actInv(data.oMi[joint]).act(model.inertias[joint])
    for first, second in pairwise(row):
        inertia = model.inertias[first]
        shares = (inertia.mass, carried.mass), (_moments(inertia), _moments(carried))
        if all(part <= PLACEHOLDER * whole for part, whole in shares):
            continue
        raise MechanismError(
            f"{what}: the link between {model.names[first]!r} and {model.names[second]!r} has a "
            f"mass of {inertia.mass:.6g} kg and a moment of inertia of "
            f"{np.abs(inertia.inertia).max():.6g} kg m^2; only links can be left out that are "
            f"massless, or have at most {PLACEHOLDER:g} of what they carry ({carried.mass:.6g} kg)"
        )


def _moments(inertia: pin.Inertia) -> float:
    """Return the sum of the moments of inertia about the joint's point, kg m^2."""
    return float(np.trace(inertia.matrix()[3:, 3:]))


def _check_axes(model: pin.Model, what: str, merge: JointMerge, row: list[int]) -> None:
    """Refuse axes that do not make a universal joint, or do not reach every rotation."""
    for (before, first), (after, second) in pairwise(
        zip(merge.joints, _axes(model, row), strict=True)
    ):
        cosine = abs(float(first @ second))
        if merge.into == "universal" and cosine > _PERPENDICULAR:
            raise MechanismError(
                f"{what}: the axes of {before!r} and {after!r} are at "
                f"{np.degrees(np.arccos(min(cosine, 1.0))):.6g} degrees; those of a universal "
                "joint are perpendicular"
            )
        if merge.into == "spherical" and np.linalg.norm(np.cross(first, second)) < _PARALLEL:
            raise MechanismError(
                f"{what}: neighbouring axes are parallel, so the joints are not a ball joint"
            )


def _refuse_shared(model: pin.Model, merges: Sequence[JointMerge], rows: list[list[int]]) -> None:
    merging = [joint for row in rows for joint in row]
    for joint in merging:
        if merging.count(joint) > 1:
            raise MechanismError(f"joint {model.names[joint]!r} is merged twice")
    if len(model.mimicking_joints) > 0:
        raise MechanismError(
            "a model with mimic joints cannot be merged; couple the joints instead"
        )
    kept = {model.names[i] for i in range(model.njoints) if i not in merging}
    kept |= {
        frame.name
        for frame in model.frames
        if frame.parentJoint not in {joint for row in rows for joint in row[:-1]}
        and not (frame.type == pin.FrameType.JOINT and frame.parentJoint in merging)
    }
    for merge in merges:
        if merge.name in kept:
            raise MechanismError(
                f"a merged joint cannot be called {merge.name!r}: that name is taken"
            )
        kept.add(merge.name)


def _axes(model: pin.Model, row: list[int]) -> list[Array]:
    """Return the axes of a row of joints at zero angles, in the last one's frame."""
    axes = []
    turn = np.eye(3)
    for joint in reversed(row):
        axes.append(turn.T @ _axis(model, joint))
        turn = model.jointPlacements[joint].rotation @ turn
    return axes[::-1]


def _axis(model: pin.Model, joint: int, what: str = "merge") -> Array:
    """Return the axis of a revolute joint, in its frame; shape (3,)."""
    one = model.joints[joint]
    if one.nq == one.nv == 1:
        data = one.createData()
        one.calc(data, np.zeros(model.nq))
        subspace = np.asarray(data.S).reshape(6)
        if not subspace[:3].any() and abs(np.linalg.norm(subspace[3:]) - 1) < _PERPENDICULAR:
            return np.asarray(subspace[3:])
    raise MechanismError(
        f"{what}: joint {model.names[joint]!r} ({one.shortname()}) is not revolute with one angle"
    )
