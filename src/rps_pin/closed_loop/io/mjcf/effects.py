"""What acts at the joints of an MJCF: rotors, damping, dry friction, springs, limits.

``stiffness``, ``damping``, ``frictionloss``, ``armature``, ``range`` and ``actuatorfrcrange`` are
those of joints, and of tendons that are joints here; armature and damping of actuators are added.
Forces that are not linear, springs that yield or are slack, and what a medium (density, viscosity),
plugins and flexible bodies exert, are refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.mjcf.actuators import Actuator, force_range
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from rps_pin.closed_loop.io.mjcf.tendons import Tendons
from rps_pin.closed_loop.io.mjcf.tree import BALL, HINGE, SLIDE, MjcfTree, pose_of
from rps_pin.closed_loop.io.parts import EFFECTS
from rps_pin.errors import MechanismError

#: By MuJoCo's name of a force: our name of it, and the flags that switch it off.
_FORCES = {
    "damping": ("damping", ("damper",)),
    "frictionloss": ("friction", ("frictionloss", "constraint")),
    "stiffness": ("stiffness", ("spring",)),
}


def refuse_other_forces(source: MjcfSource) -> None:
    """Refuse what exerts forces on bodies and is not read."""
    m = source.model
    for name in ("density", "viscosity"):
        if getattr(m.opt, name) and not source.without_passive_forces:
            raise MechanismError(
                f"{source.setting('option', attribute=name)} has {name} = "
                f"{getattr(m.opt, name):g}: forces of a medium are not read; a mechanism in vacuum "
                "has 0"
            )
    if m.nflex and not m.flex_rigid.all():
        raise MechanismError(f"{source.setting('flexcomp', 'flex')} is flexible, which is not read")
    for body in np.flatnonzero(m.body_plugin >= 0):
        source.refuse("bodies", int(body), "has forces of a plugin, which are not read")
    for body in np.flatnonzero(m.body_mocapid >= 0):
        source.tell("bodies", int(body), "moved by motion capture in MuJoCo, here it stays there")


def joint_effects(
    tree: MjcfTree, tendons: Tendons, actuators: Sequence[Actuator]
) -> dict[str, dict[str, Any]]:
    """Return damping, friction, stiffness and rest by joint, as `MechanismParts` has them.

    Armature and limits are put into the tree's model.

    Raises
    ------
    MechanismError
        If a joint or tendon has a force that is not read; with its line.
    """
    source, m = tree.source, tree.source.model
    effects: dict[str, dict[str, Any]] = {name: {} for name in EFFECTS}
    holders = [("joints", number, names) for number, names in enumerate(tree.parts)]
    holders += [("tendons", number, [name]) for number, name in tendons.names.items()]
    for kind, number, names in holders:
        acting = [one for one in actuators if (one.kind, one.target) == (kind, number)]
        for force, (effect, flags) in _FORCES.items():
            value = _linear(source, kind, number, force, acting)
            if value and not any(map(source.disabled, flags)):
                effects[effect] |= dict.fromkeys(names, value)
                if force == "stiffness":
                    effects["rest"] |= zip(
                        names, _rests(source, kind, number, len(names)), strict=True
                    )
        armature = _linear(source, kind, number, "armature", acting)
        for name in names:
            place = tree.model.joints[tree.model.getJointId(name)]
            tree.model.armature[place.idx_v : place.idx_v + place.nv] = armature
            if place.nq == 1:
                _add_limits(tree, kind, number, place)
        _add_forces(tree, kind, number, names, acting)
        limited = getattr(m, f"{_prefix(kind)}_limited")[number] and not source.disabled("limit")
        if limited and kind == "joints" and m.jnt_type[number] not in (HINGE, SLIDE):
            source.tell(kind, number, "a range of several coordinates is not read")
    return effects


def _linear(
    source: MjcfSource, kind: str, number: int, force: str, actuators: Sequence[Actuator]
) -> float:
    """Return the coefficient of a force, with what actuators add to it."""
    owner, index = _prefix(kind), number
    if kind == "joints" and force != "stiffness":
        owner, index = "dof", int(source.model.jnt_dofadr[number])
    value = float(source.read(f"{owner}_{force}", index))
    curved = np.any(source.read(f"{owner}_{force}poly", index))
    if force in ("armature", "damping"):
        for one in actuators:
            value += one.gear**2 * float(source.read(f"actuator_{force}", one.number))
            curved |= np.any(source.read(f"actuator_{force}poly", one.number))
    if curved:
        source.refuse(kind, number, f"has a {force} that is not linear, which is not read")
    if value < 0:
        source.refuse(kind, number, f"has a negative {force}")
    return value


def _rests(source: MjcfSource, kind: str, number: int, parts: int) -> list[Any]:
    """Return where a spring is at rest, as `JointEffects` has it, for each part of a joint."""
    m = source.model
    if source.read(f"{_prefix(kind)}_springyield", number):
        source.refuse(kind, number, "has a spring that yields, which is not read")
    if kind == "tendons":
        low, high = m.tendon_lengthspring[number]
        if low != high:
            source.refuse(kind, number, f"is slack from {low:g} to {high:g}, which is not read")
        return [float(low)]
    rest = m.qpos_spring[m.jnt_qposadr[number] :]
    if m.jnt_type[number] in (HINGE, SLIDE):
        return [float(rest[0])]
    if m.jnt_type[number] == BALL:
        return [_rotation_vector(rest[:4])]
    position, turn = rest[:3].tolist(), _rotation_vector(rest[3:7])
    return [position, turn] if parts == 2 else [[*position, *turn]]


def _rotation_vector(quaternion: Array) -> list[float]:
    """Return the rotation vector of a quaternion (w, x, y, z), rad."""
    found: list[float] = pin.log3(pose_of(np.zeros(3), quaternion).rotation).tolist()
    return found


def _add_limits(tree: MjcfTree, kind: str, number: int, place: Any) -> None:
    """Put the limits of a coordinate into the model."""
    m, model, owner = tree.source.model, tree.model, _prefix(kind)
    if getattr(m, f"{owner}_limited")[number] and not (
        tree.source.disabled("limit") or tree.source.disabled("constraint")
    ):
        limits = getattr(m, f"{owner}_range")[number]
        model.lowerPositionLimit[place.idx_q], model.upperPositionLimit[place.idx_q] = limits


def _add_forces(
    tree: MjcfTree, kind: str, number: int, names: Sequence[str], actuators: Sequence[Actuator]
) -> None:
    """Put the limits of the forces that actuators make at a joint into the model."""
    source, model, owner = tree.source, tree.model, _prefix(kind)
    places = [model.joints[model.getJointId(name)] for name in names]
    velocities = [place.idx_v + k for place in places for k in range(place.nv)]
    for k, velocity in enumerate(velocities):
        low, high = force_range(source, [one for one in actuators if one.place == k])
        if source.read(f"{owner}_actfrclimited", number):
            own = getattr(source.model, f"{owner}_actfrcrange")[number]
            low, high = max(low, own[0]), min(high, own[1])
        model.lowerEffortLimit[velocity], model.upperEffortLimit[velocity] = low, high


def _prefix(kind: str) -> str:
    return "jnt" if kind == "joints" else "tendon"
