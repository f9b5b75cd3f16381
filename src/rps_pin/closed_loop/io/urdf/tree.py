"""Open trees from URDF files, with the closures and joint forces that the files state.

Joints of type ``continuous`` are revolute joints of one coordinate without limits, as in MuJoCo and
Drake (Pinocchio's own parser gives them cosine and sine). A ``limit`` without lower and upper, or
none at all, bounds no position; where there are lower and upper, they do. ``planar`` joints move
across their axis, ``floating`` ones are free-flyers. ``mimic`` elements are couplings.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.editing.rebuild import JointRow, NewJoint, rebuilt
from rps_pin.closed_loop.io.foreign import refuse_other_formats
from rps_pin.closed_loop.io.parts import MechanismParts
from rps_pin.closed_loop.io.unit_doubts import unit_doubts
from rps_pin.closed_loop.io.urdf.check import check_tree
from rps_pin.closed_loop.io.urdf.collisions import collisions_of
from rps_pin.closed_loop.io.urdf.elements import SIMPLE, UrdfFile, UrdfJoint, read_elements
from rps_pin.closed_loop.io.urdf.extensions import armature_of, look_into_extensions
from rps_pin.closed_loop.io.urdf.inertials import read_inertials
from rps_pin.closed_loop.io.urdf.loops import closures_of
from rps_pin.closed_loop.io.urdf.mimics import couplings_of
from rps_pin.closed_loop.io.urdf.normal_form import normal_form
from rps_pin.closed_loop.io.xml_file import xml_root, xml_text
from rps_pin.errors import MechanismError
from rps_pin.validation import choice

#: Whether the root link of a tree is fixed in the world.
ROOTS = ("fixed", "free")
_ROOT_JOINT = "root_joint"


def urdf_file(path_or_xml: str | os.PathLike[str]) -> UrdfFile:
    """Return the contents of a URDF, checked.

    Raises
    ------
    InputError, MechanismError
        As `model_from_urdf`.
    """
    text, origin = xml_text(path_or_xml, "URDF")
    refuse_other_formats(text, origin, "URDF")
    file = read_elements(xml_root(text, origin, "URDF"), origin)
    read_inertials(file)
    check_tree(file)
    look_into_extensions(file)
    return file


def model_from_urdf(path_or_xml: str | os.PathLike[str], root: str = "fixed") -> pin.Model:
    """Return the open tree alone of a URDF: a file's path, or its text (which begins with ``<``).

    Parameters
    ----------
    path_or_xml
        The file, or its text.
    root
        ``"fixed"``: the root link is fixed in the world. ``"free"``: it is on a free-flyer joint
        called ``"root_joint"``.

    Raises
    ------
    InputError
        If the file cannot be read, or the root is neither of the two.
    MechanismError
        If it is not a valid URDF; with the line.
    """
    return parts_from_urdf(path_or_xml, root).model


def parts_from_urdf(path_or_xml: str | os.PathLike[str], root: str = "fixed") -> MechanismParts:
    """Return the open tree of a URDF, its closures, and the damping and friction of its joints.

    Parameters and errors are those of `model_from_urdf`.
    """
    choice(root, "root", ROOTS)
    file = urdf_file(path_or_xml)
    if root == "free" and _ROOT_JOINT in file.joints:
        element = file.joints[_ROOT_JOINT].element
        file.refuse(element, f"a free root's joint is called {_ROOT_JOINT!r}; rename this one")
    model = _built(file, root)
    closures = (*couplings_of(file), *closures_of(file))
    for frame in file.frames:
        body = model.frames[model.getFrameId(frame.link, pin.FrameType.BODY)]
        placement = body.placement * frame.placement
        if model.existFrame(frame.name):
            raise MechanismError(f"{file.origin}: two frames are called {frame.name!r}")
        model.addFrame(
            pin.Frame(frame.name, body.parentJoint, placement, pin.FrameType.OP_FRAME), False
        )
    moving = [joint for joint in file.joints.values() if joint.kind != "fixed"]
    return MechanismParts(
        model,
        closures=closures,
        name=model.name,
        damping={one.name: _one_or_all(one.damping) for one in moving if any(one.damping)},
        friction={one.name: one.friction for one in moving if one.friction},
        continuous=frozenset(one.name for one in moving if one.kind == "continuous"),
        notes=(*file.all_notes(), *unit_doubts(model)),
        collision=collisions_of(file),
    )


def _one_or_all(values: tuple[float, ...]) -> Any:
    return values[0] if len(values) == 1 else values


def _built(file: UrdfFile, root: str) -> pin.Model:
    """Return the model with the file's joint types, limits and losses."""
    text = normal_form(file)
    try:
        if root == "free":
            model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
        else:
            model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise MechanismError(f"{file.origin} is not a valid URDF: {error}") from None
    model = _with_other_joints(file, model)
    armature = armature_of(file)
    for joint in file.joints.values():
        if joint.kind != "fixed":
            _set_properties(file, model, joint, armature.get(joint.name, 0.0))
    return model


def _with_other_joints(file: UrdfFile, model: pin.Model) -> pin.Model:
    """Put Drake's joint types in the place of their stand-ins, and turn planar joints."""
    rows: dict[int, JointRow] = {}
    for joint in file.joints.values():
        if joint.kind in ("ball", "universal", "screw"):
            index = model.getJointId(joint.name)
            new = NewJoint(joint.name, _joint_model(joint), model.jointPlacements[index])
            rows[index] = JointRow([new], [])
    if rows:
        model = rebuilt(model, rows)
    for joint in file.joints.values():
        if joint.kind == "planar":
            _turn(model, model.getJointId(joint.name), joint.axis)
    return model


def _joint_model(joint: UrdfJoint) -> Any:
    if joint.kind == "ball":
        return pin.JointModelSpherical()
    if joint.kind == "universal":  # Drake's: about x, then about y
        return pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    return pin.JointModelHelicalUnaligned(joint.axis, joint.pitch / (2.0 * np.pi))


def _turn(model: pin.Model, index: int, normal: Array) -> None:
    """Turn a planar joint, which moves across z, so that it moves across `normal`.

    All that the joint carries stays where it is.
    """
    up = np.array([0.0, 0.0, 1.0])
    turn = pin.SE3(pin.Quaternion.FromTwoVectors(up, normal).matrix(), np.zeros(3))
    back = turn.inverse()
    model.jointPlacements[index] = model.jointPlacements[index] * turn
    model.inertias[index] = back.act(model.inertias[index])
    for other in range(1, model.njoints):
        if model.parents[other] == index:
            model.jointPlacements[other] = back * model.jointPlacements[other]
    for frame in model.frames:
        if frame.parentJoint == index:
            frame.placement = back * frame.placement


def _set_properties(file: UrdfFile, model: pin.Model, joint: UrdfJoint, armature: float) -> None:
    """Write limits, losses and armature of a joint into the model."""
    place = model.joints[model.getJointId(joint.name)]
    velocities = slice(place.idx_v, place.idx_v + place.nv)
    if joint.kind in SIMPLE:
        model.lowerPositionLimit[place.idx_q] = joint.lower
        model.upperPositionLimit[place.idx_q] = joint.upper
    elif place.nq == place.nv:
        model.lowerPositionLimit[place.idx_q : place.idx_q + place.nq] = -np.inf
        model.upperPositionLimit[place.idx_q : place.idx_q + place.nq] = np.inf
    for name, value in (
        ("EffortLimit", joint.effort),
        ("VelocityLimit", joint.velocity),
        ("DryFrictionLimit", joint.friction),
    ):
        getattr(model, f"upper{name}")[velocities] = value
        getattr(model, f"lower{name}")[velocities] = -value
    model.damping[velocities] = joint.damping if len(joint.damping) > 1 else joint.damping[0]
    model.armature[velocities] = armature
