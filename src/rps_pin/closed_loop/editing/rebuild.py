"""Models with other joints in the place of some, everything else being kept."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import pinocchio as pin

#: Vectors of a model with an entry for each coordinate of a configuration.
_OF_POSITION = ("lowerPositionLimit", "upperPositionLimit", "positionLimitMargin")
#: Vectors of a model with an entry for each coordinate of a velocity.
_OF_VELOCITY = (
    "lowerVelocityLimit",
    "upperVelocityLimit",
    "lowerEffortLimit",
    "upperEffortLimit",
    "lowerDryFrictionLimit",
    "upperDryFrictionLimit",
    "damping",
    "armature",
    "rotorInertia",
    "rotorGearRatio",
)
#: The bounds among them.
LIMITS = tuple(name for name in _OF_POSITION + _OF_VELOCITY if name.endswith("Limit"))


class NewJoint(NamedTuple):
    """A joint of the new model."""

    name: str
    kind: Any
    """A Pinocchio joint model."""
    placement: pin.SE3
    """In its parent: the joint before it in the row, or that of the whole row."""


class JointRow(NamedTuple):
    """Joints one after the other that replace one joint; the last carries what that one carried."""

    joints: Sequence[NewJoint]
    sources: Sequence[int]
    """Indices of the joints of the old model whose limits, friction, rotors, ... they have."""


def rebuilt(
    model: pin.Model, rows: Mapping[int, JointRow], dropped: Collection[int] = ()
) -> pin.Model:
    """Return a model in which rows of joints replace some joints.

    Names, inertias, limits, friction, rotors, frames and gravity are kept, reference configurations
    are not. The frame of a replaced joint has the name of the last joint of its row.

    Parameters
    ----------
    model
        The old model.
    rows
        The new joints, by the index of the joint that they replace.
    dropped
        Indices of joints that are left out, with the frames on their bodies. A joint after them
        follows the joint before them.
    """
    result = pin.Model()
    result.name = model.name
    new_ids = {0: 0}
    for old in range(1, model.njoints):
        if old in dropped:
            continue
        same = NewJoint(model.names[old], model.joints[old], model.jointPlacements[old])
        row = rows.get(old, JointRow([same], [old]))
        parent = model.parents[old]
        while parent in dropped:
            parent = model.parents[parent]
        new, first = new_ids[parent], result.njoints
        for joint in row.joints:
            new = int(result.addJoint(new, joint.kind, joint.placement, joint.name))
        copy_joint_properties(model, row.sources, result, first)
        new_ids[old] = new
    for old, new in new_ids.items():
        result.inertias[new] = model.inertias[old]
    _add_frames(model, result, new_ids)
    result.gravity = model.gravity
    return result


def _add_frames(model: pin.Model, result: pin.Model, new_ids: Mapping[int, int]) -> None:
    """Copy the frames of the joints that are kept, each below the nearest frame that is."""
    new_frames = {0: 0}
    for index in range(1, model.nframes):
        old = model.frames[index]
        if old.parentJoint not in new_ids:
            continue
        parent = old.parentFrame
        while parent not in new_frames:
            parent = model.frames[parent].parentFrame
        frame = pin.Frame(old)
        frame.parentJoint = new_ids[old.parentJoint]
        frame.parentFrame = new_frames[parent]
        if old.type == pin.FrameType.JOINT:
            frame.name = result.names[frame.parentJoint]
        new_frames[index] = result.addFrame(frame, False)


def copy_joint_properties(
    source: pin.Model, joints: Sequence[int], target: pin.Model, joint: int, limits: bool = True
) -> None:
    """Copy limits, friction, damping, armature and rotors of joints of `source` to `target`.

    The coordinates of `joints`, one after the other, are those of `target` from `joint` on.
    Without `limits`, those of positions are left out, whose coordinates may differ then.
    """
    of_position = _OF_POSITION if limits else ()
    place = target.joints[joint]
    idx_q, idx_v = place.idx_q, place.idx_v
    for one in (source.joints[i] for i in joints):
        for names, size, start, index in (
            (of_position, one.nq, idx_q, one.idx_q),
            (_OF_VELOCITY, one.nv, idx_v, one.idx_v),
        ):
            for name in names:
                getattr(target, name)[start : start + size] = getattr(source, name)[
                    index : index + size
                ]
        idx_q, idx_v = idx_q + one.nq, idx_v + one.nv
