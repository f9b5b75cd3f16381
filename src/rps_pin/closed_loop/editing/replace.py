"""Joints of other types in the place of some: a hinge that stands for a ball, a lock.

Files say ``revolute`` where their format has no ball or Cardan joint. The new joint stands where
the old one did, its axes are those of the old joint's frame, and what it carries is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import joint_id
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.editing.rebuild import (
    LIMITS,
    JointRow,
    NewJoint,
    copy_joint_properties,
    rebuilt,
)
from rps_pin.errors import MechanismError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import real_vector

#: A kind by name, or any of Pinocchio's joint models.
JointKind = Any

_AXES = dict(zip("xyz", np.eye(3), strict=True))
_OF_ONE_AXIS: dict[str, Any] = {
    "revolute": pin.JointModelRevoluteUnaligned,
    "prismatic": pin.JointModelPrismaticUnaligned,
}
_KINDS: dict[str, Any] = {
    "spherical": pin.JointModelSpherical(),
    "free": pin.JointModelFreeFlyer(),
    "planar": pin.JointModelPlanar(),
    "translation": pin.JointModelTranslation(),
    **{
        f"{kind}_{name}": made(axis)
        for kind, made in _OF_ONE_AXIS.items()
        for name, axis in _AXES.items()
    },
    **{
        f"universal_{one}{two}": pin.JointModelUniversal(_AXES[one], _AXES[two])
        for one, two in permutations(_AXES, 2)
    },
}
FIXED = "fixed"
#: Names of the kinds.
JOINT_KINDS = (FIXED, *_OF_ONE_AXIS, *_KINDS)
#: What only a joint of the same velocities can keep.
_ROTOR = ("armature", "rotorInertia")


@refuses_other_kinds
def replace_joints(model: pin.Model, kinds: Mapping[str, JointKind]) -> pin.Model:
    """Return a model in which some joints are of another type.

    Placements, names, masses, frames and gravity are kept. The new joint has no limits, damping or
    rotor, except one that turns about the same axis as the old one, by an angle in place of cosine
    and sine, for example. Reference configurations follow as `replaced_configuration` says.

    Parameters
    ----------
    model
        The open tree; it is not changed.
    kinds
        By the name of the joint: ``"spherical"``, ``"free"``, ``"planar"`` (across z),
        ``"translation"``, ``"universal_xy"`` (about the joint frame's x, then y; likewise for all
        pairs), ``"revolute_x"`` and ``"prismatic_x"`` (likewise y, z), ``"revolute"`` and
        ``"prismatic"`` (the axis of the old joint), ``"fixed"`` (at its neutral coordinates), or a
        Pinocchio joint model.

    Raises
    ------
    MechanismError
        If there is no such joint or kind (lists those there are), the old joint has no axis to
        keep, or has a rotor, which the new one cannot have.
    """
    rows, fixed = {}, []
    for name, kind in kinds.items():
        index = joint_id(model, name, "joints to replace")
        if isinstance(kind, str) and kind == FIXED:
            fixed.append(index)
            continue
        new = _joint_model(model, index, kind)
        if not _same_turn(model.joints[index], new):
            _refuse_rotor(model, index)
        rows[index] = JointRow([NewJoint(name, new, model.jointPlacements[index])], [])
    result = _rebuilt(model, rows) if rows else model
    if fixed:
        result = _locked(result, fixed)
    for entry in model.referenceConfigurations:
        q = replaced_configuration(model, kinds, entry.data())
        result.referenceConfigurations[entry.key()] = q
    return result


def replaced_configuration(model: pin.Model, kinds: Mapping[str, JointKind], q: ArrayLike) -> Array:
    """Return the configuration of the new model for one of the old model.

    Joints that are kept keep their coordinates; a new joint takes over the rotation of the old one
    where it can (``spherical``, ``free``, and angles in place of cosine and sine), or else is
    neutral.

    Parameters
    ----------
    model
        The old model.
    kinds
        As for `replace_joints`.
    q
        Configuration of the old model, shape (nq,).
    """
    q_ = real_vector(q, model.nq, "q")
    data = model.createData()
    pin.forwardKinematics(model, data, q_)
    values = []
    for index in range(1, model.njoints):
        old, kind = model.joints[index], kinds.get(model.names[index])
        own = q_[old.idx_q : old.idx_q + old.nq]
        if kind is None:
            values.append(own)
        elif not (isinstance(kind, str) and kind == FIXED):
            moved = model.jointPlacements[index].actInv(data.liMi[index])
            values.append(_taken_over(_joint_model(model, index, kind), old, own, moved))
    return np.concatenate(values) if values else np.empty(0)


def replaced_effects(
    model: pin.Model, new: pin.Model, kinds: Mapping[str, JointKind], effects: JointEffects
) -> JointEffects:
    """Return the effects of the joints that both models have.

    Raises
    ------
    MechanismError
        If a joint that is replaced by one of other velocities has damping, friction or a spring.
    """
    arrays: dict[str, Any] = {
        what: np.zeros(new.nv) for what in ("damping", "friction", "stiffness", "rest")
    }
    for index in range(1, model.njoints):
        name, old = model.names[index], model.joints[index]
        here = slice(old.idx_v, old.idx_v + old.nv)
        kept = new.existJointName(name)
        same = kept and (name not in kinds or _same_turn(old, new.joints[new.getJointId(name)]))
        for what, array in arrays.items():
            value = getattr(effects, what)[here]
            if same:
                joint = new.joints[new.getJointId(name)]
                array[joint.idx_v : joint.idx_v + joint.nv] = value
            elif kept and what != "rest" and value.any():
                raise MechanismError(
                    f"joint {name!r} is replaced and has {what} {shown(value.tolist())}, which "
                    "the new joint cannot have; give effects without it"
                )
    return replace(effects, **arrays)


def _rebuilt(model: pin.Model, rows: Mapping[int, JointRow]) -> pin.Model:
    """Return the model with new joints, which are not bounded unless they turn as the old ones."""
    result = rebuilt(model, rows)
    for index in rows:
        old, joint = model.joints[index], result.joints[index]
        here = slice(joint.idx_q, joint.idx_q + joint.nq)
        if joint.nq == joint.nv:
            result.lowerPositionLimit[here], result.upperPositionLimit[here] = -np.inf, np.inf
        if _same_turn(old, joint):
            copy_joint_properties(model, [index], result, index, limits=old.nq == joint.nq)
    return result


def _locked(model: pin.Model, joints: Sequence[int]) -> pin.Model:
    """Return the model with joints fixed at their neutral coordinates."""
    free = model.copy()  # without limits, of which Pinocchio accepts only some
    for name in LIMITS:
        getattr(free, name).fill(-np.inf if name.startswith("lower") else np.inf)
    result = pin.buildReducedModel(free, list(joints), pin.neutral(model))
    for index in range(1, result.njoints):
        source = model.getJointId(result.names[index])
        copy_joint_properties(model, [source], result, index)
    return result


def _joint_model(model: pin.Model, index: int, kind: JointKind) -> Any:
    """Return Pinocchio's joint of a kind in the place of a joint."""
    if not isinstance(kind, str):
        if isinstance(kind, type) and kind.__name__.startswith("JointModel"):
            raise MechanismError(
                f"joint {model.names[index]!r} cannot be replaced by the class "
                f"{kind.__name__}: give a joint, {kind.__name__}(...)"
            )
        if not _is_joint_model(kind):
            raise MechanismError(
                f"joint {model.names[index]!r} cannot be replaced by "
                f"{' '.join(shown(kind).split())}: give one of {', '.join(JOINT_KINDS)}, or a "
                "Pinocchio joint model"
            )
        return kind
    if kind in _OF_ONE_AXIS:
        return _OF_ONE_AXIS[kind](_axis(model, index, kind))
    if kind not in _KINDS:
        raise MechanismError(
            f"joint {model.names[index]!r} cannot be {kind!r}; there are: {', '.join(JOINT_KINDS)}"
        )
    return _KINDS[kind]


def _is_joint_model(kind: Any) -> bool:
    """Return whether it is a joint of its own: not a mimic, and no composite without parts."""
    name = type(kind).__name__
    return name.startswith("JointModel") and name != "JointModelMimic" and kind.nv > 0


def _axis(model: pin.Model, index: int, kind: str) -> Array:
    """Return the axis about or along which a joint moves, shape (3,)."""
    joint = model.joints[index]
    if joint.nv == 1:
        for part in _subspace(joint).reshape(2, 3)[::-1]:  # of a screw, its axis
            if part.any():
                return np.asarray(part / np.linalg.norm(part))
    raise MechanismError(
        f"joint {model.names[index]!r} ({joint.shortname()}) has no axis that a {kind} joint could "
        f"keep; say which: {kind}_x, {kind}_y or {kind}_z"
    )


def _subspace(joint: Any) -> Array:
    """Return (linear, angular) of a joint of one velocity at its neutral coordinates, (6,)."""
    alone = pin.Model()
    alone.addJoint(0, joint, pin.SE3.Identity(), "joint")
    data = alone.joints[1].createData()
    alone.joints[1].calc(data, pin.neutral(alone))
    return np.asarray(data.S, dtype=np.float64).reshape(6)


def _same_turn(old: Any, new: Any) -> bool:
    """Return whether both turn about one axis, by an angle or by cosine and sine."""
    if not old.nv == new.nv == 1:
        return False
    one, other = _subspace(old), _subspace(new)
    same: bool = np.allclose(one, other, rtol=0, atol=1e-12)
    return same and not one[:3].any()


def _refuse_rotor(model: pin.Model, index: int) -> None:
    joint = model.joints[index]
    for name in _ROTOR:
        values = getattr(model, name)[joint.idx_v : joint.idx_v + joint.nv]
        if values.any():
            raise MechanismError(
                f"joint {model.names[index]!r} has {name} = {shown(values.tolist())}, which its "
                "new type cannot keep; set it to 0 first"
            )


def _taken_over(new: Any, old: Any, own: Array, moved: pin.SE3) -> Array:
    """Return the coordinates of a new joint that turn as the old one did, or neutral ones."""
    alone = pin.Model()
    alone.addJoint(0, new, pin.SE3.Identity(), "joint")
    neutral: Array = pin.neutral(alone)
    if new.shortname() in ("JointModelSpherical", "JointModelFreeFlyer"):
        neutral[-4:] = pin.Quaternion(moved.rotation).coeffs()
    elif _same_turn(old, new):
        angle = own[0] if old.nq == 1 else np.arctan2(own[1], own[0])
        return np.array([angle] if new.nq == 1 else [np.cos(angle), np.sin(angle)])
    return neutral
