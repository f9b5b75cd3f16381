"""Composition of several open trees in one world: two arms, and the object they hold.

The joints and frames of a part called ``left`` are called ``left/...`` in the whole. Loop closures
between frames of the parts make a mechanism of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.closed_loop.constraints.closures import frame_id
from rps_pin.closed_loop.editing.rebuild import copy_joint_properties
from rps_pin.errors import InputError, MechanismError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import fixed_array, inertia_fault, positive_number, real_vector

#: Between a part's name and its own names.
SEPARATOR = "/"
#: Name of the free-flyer joint of a `body`.
FREE_JOINT = "root_joint"


@refuses_other_kinds
@dataclass(frozen=True)
class Part:
    """An open tree, and the placement of its world in the whole.

    Attributes
    ----------
    model
        The tree; it is copied, not changed.
    placement
        Of the tree's world in the parent frame.
    parent
        Name of a frame of the whole: ``"universe"``, or one of an earlier part
        (``"left/tool0"``), to which the tree is fixed.
    """

    model: pin.Model
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    parent: str = "universe"


@refuses_other_kinds
def compose(parts: Mapping[str, Part], *, name: str = "") -> pin.Model:
    """Return one model of several trees.

    Joint and frame names are the part's name, ``/``, and the name in the part. Limits, armature,
    rotors, friction and damping are kept. A reference configuration is that of all parts that have
    one of its name, the others being neutral.

    Parameters
    ----------
    parts
        The trees by name, in the order in which they come in q and v. (A tree fixed to an earlier
        part comes directly after the joint that carries it.)
    name
        Of the whole; ``"left + right"`` if left out.

    Raises
    ------
    MechanismError
        If there are no parts, a name cannot be used, a parent frame is unknown (lists those there
        are), or the parts are not in the same gravity.
    """
    _check(parts)
    whole = pin.Model()
    for key, part in parts.items():
        parent = frame_id(whole, part.parent, f"parent of part {key!r}")
        own = _prefixed(part.model, key)
        before = whole
        try:
            whole = pin.appendModel(before, own, parent, part.placement)
        except ValueError as error:  # limits in the wrong order
            raise MechanismError(f"part {key!r}: {error}") from None
        # appendModel does not copy armature, and some of the limits.
        for source in (before, own):
            for joint in range(1, source.njoints):
                new = int(whole.getJointId(source.names[joint]))
                copy_joint_properties(source, [joint], whole, new)
    whole.name = name or " + ".join(parts)
    whole.gravity = next(iter(parts.values())).model.gravity
    _set_references(whole, parts)
    return whole


@refuses_other_kinds
def body(
    name: str,
    mass: float,
    inertia: ArrayLike,
    com: ArrayLike = (0.0, 0.0, 0.0),
    frames: Mapping[str, pin.SE3] | None = None,
) -> pin.Model:
    """Return a model of one rigid body on a free-flyer joint called ``"root_joint"``.

    Parameters
    ----------
    name
        Of the body's frame, which is that of the free-flyer.
    mass
        kg, positive.
    inertia
        About the centre of mass, in the body's axes, kg m^2, shape (3, 3).
    com
        Centre of mass in the body's frame, m, shape (3,).
    frames
        Further frames fixed in the body, by name.

    Raises
    ------
    InputError
        If the mass or the inertia is not that of a rigid body.
    """
    moments = fixed_array(inertia, f"inertia of body {name!r}", (3, 3))
    if fault := inertia_fault(moments):
        raise InputError(f"inertia of body {name!r}: {fault}")
    own = pin.Inertia(
        positive_number(mass, f"mass of body {name!r}", "kg"), real_vector(com, 3, "com"), moments
    )
    model = pin.Model()
    model.name = name
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), FREE_JOINT)
    joint_frame = model.addJointFrame(joint)
    model.appendBodyToJoint(joint, own, pin.SE3.Identity())
    taken = {"universe", FREE_JOINT}
    base = joint_frame
    for label, placement in {name: pin.SE3.Identity(), **(frames or {})}.items():
        if not label or label in taken:
            raise InputError(f"body {name!r}: a frame cannot be called {label!r}")
        taken.add(label)
        kind = pin.FrameType.BODY if label == name else pin.FrameType.OP_FRAME
        added = model.addFrame(pin.Frame(label, joint, base, placement, kind))
        base = added if label == name else base
    return model


def _check(parts: Mapping[str, Part]) -> None:
    if not parts:
        raise MechanismError("nothing to compose: no part was given")
    for key, part in parts.items():
        if not isinstance(key, str) or not key or SEPARATOR in key:
            raise MechanismError(f"a part cannot be called {key!r}: text without {SEPARATOR!r}")
        if not isinstance(part, Part):
            raise MechanismError(f"part {key!r} must be a Part, not a {type(part).__name__}")
    first, *others = parts
    gravity = parts[first].model.gravity.linear
    for key in others:
        other = parts[key].model.gravity.linear
        if not np.array_equal(gravity, other):
            raise MechanismError(
                f"parts in one world are in one gravity: that of {first!r} is {gravity} m/s^2, "
                f"that of {key!r} is {other} m/s^2"
            )


def _prefixed(model: pin.Model, key: str) -> pin.Model:
    """Return a copy of a model with the part's name before all names."""
    copy = pin.Model(model)
    for joint in range(1, copy.njoints):
        copy.names[joint] = f"{key}{SEPARATOR}{copy.names[joint]}"
    for frame in copy.frames:
        frame.name = f"{key}{SEPARATOR}{frame.name}"
    return copy


def _set_references(whole: pin.Model, parts: Mapping[str, Part]) -> None:
    own = {
        key: {entry.key(): entry.data().copy() for entry in part.model.referenceConfigurations}
        for key, part in parts.items()
    }
    for name in {name for configurations in own.values() for name in configurations}:
        q = pin.neutral(whole)
        for key, part in parts.items():
            if name not in own[key]:
                continue
            for joint in range(1, part.model.njoints):
                there = whole.getJointId(f"{key}{SEPARATOR}{part.model.names[joint]}")
                size, start = whole.nqs[there], whole.idx_qs[there]
                source = part.model.idx_qs[joint]
                q[start : start + size] = own[key][name][source : source + size]
        whole.referenceConfigurations[name] = q
