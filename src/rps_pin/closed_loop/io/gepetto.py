"""Mechanisms of Gepetto's `example-parallel-robots`: a folder with a URDF and ``robot.yaml``.

    closed_loop: [[loop_A, loop_B]]     # pairs of frames of the URDF
    type: ["6d"]                        # 3d: their origins coincide; 6d: the frames do
    name_mot: [motor_1]                 # the actuated joints
    joint_name: [ball, hook]            # joints of another type than the URDF's
    joint_type: [SPHERICAL, UJOINT_XY]  # or FIXED; for each of them

``UJOINT_XY`` (likewise all pairs) is a universal joint about the x axis of the joint's frame, then
the y axis behind it; ``name_mot`` may name one of its axes as there, ``NAME_X``. ``FIXED`` joints
stay at zero. Whether the root floats is not in these files. Three massless revolute joints that
meet in a point stay three joints: there they become one ball joint, which has the same motions.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pinocchio as pin
from pydantic import Field

from rps_pin.closed_loop.column_names import joint_coordinates
from rps_pin.closed_loop.constraints.closures import Kind, LoopClosure, frame_id
from rps_pin.closed_loop.editing.replace import replace_joints
from rps_pin.closed_loop.io.parts import EFFECTS, MechanismParts, without_position_limits
from rps_pin.closed_loop.io.urdf import parts_from_urdf
from rps_pin.config import Entry, Text, YamlFile, read_yaml
from rps_pin.errors import InputError, MechanismError, did_you_mean
from rps_pin.files import is_file, is_folder, is_there

#: The file in such a folder.
FILE = "robot.yaml"
_KINDS: dict[str, Kind] = {"3d": "spherical", "6d": "rigid"}
_TWO_TURNS = re.compile(r"UJOINT_([XYZ])(?!\1)([XYZ])")


class GepettoFile(Entry):
    """The keys of such a file."""

    closed_loop: list[list[Text]] = Field(default_factory=list)
    type: list[Text] = Field(default_factory=list)
    name_mot: list[Text] = Field(default_factory=list)
    joint_name: list[Text] = Field(default_factory=list)
    joint_type: list[Text] = Field(default_factory=list)


def is_gepetto(file: YamlFile) -> bool:
    """Return whether a YAML file is one of these."""
    return bool({"closed_loop", "name_mot"} & file.values.keys())


def gepetto_urdf(path: Path) -> Path:
    """Return the URDF beside such a file: of its name, or the only one.

    Raises
    ------
    InputError
        If there is none, or several of other names.
    """
    same = path.with_suffix(".urdf")
    if is_file(same):
        return same
    found = sorted(path.parent.glob("*.urdf"))
    if len(found) != 1:
        there = ", ".join(one.name for one in found) or "none"
        raise InputError(
            f"{path}: a description of example-parallel-robots has a URDF beside it, {same.name} "
            f"or the only one; there is: {there}"
        )
    return found[0]


def parts_from_gepetto(
    path: str | os.PathLike[str], root: str = "fixed", within_limits: bool = True
) -> MechanismParts:
    """Read a mechanism from such a file, or from its folder.

    Parameters
    ----------
    path
        The YAML file, or the folder of ``robot.yaml``.
    root
        ``"fixed"`` or ``"free"``, as for a URDF.
    within_limits
        Whether the URDF's position limits count.

    Raises
    ------
    InputError
        If a file cannot be read, or a key or a value is not of this format.
    MechanismError
        If a frame, a joint, or a type is unknown; with the line.
    """
    source = Path(path)
    if is_folder(source):
        source /= FILE
        if not is_there(source):
            raise InputError(f"{path} is a folder without {FILE}, so it holds no mechanism")
    file = read_yaml(source, "description of example-parallel-robots")
    description = file.validated(GepettoFile, "a description of example-parallel-robots")
    for one, other in (("closed_loop", "type"), ("joint_name", "joint_type")):
        counts = [len(getattr(description, key)) for key in (one, other)]
        if counts[0] != counts[1]:
            raise MechanismError(
                f"{file.place((other,))}: {counts[1]} entries of {other} stand beside {counts[0]} "
                f"of {one}; there is one for each"
            )
    parts = parts_from_urdf(gepetto_urdf(source), root)
    if not within_limits:
        parts = without_position_limits(parts)
    kinds = _joint_kinds(file, description, parts.model)
    parts = _with_other_joints(parts, kinds)
    actuated = tuple(
        _actuated(file, parts.model, kinds, index, name)
        for index, name in enumerate(description.name_mot)
    )
    folder = source.resolve().parent.name
    return replace(
        parts,
        closures=(*parts.closures, *_closures(file, description, parts.model)),
        actuated=actuated,
        name=folder if source.stem == Path(FILE).stem else source.stem,
    )


def _joint(file: YamlFile, model: pin.Model, key: str, index: int, name: str) -> int:
    """Return a joint's index, or refuse a name that no joint has."""
    names = list(model.names)[1:]
    if name not in names:
        raise MechanismError(
            f"{file.place((key, index))}: {key}: no joint {name!r}{did_you_mean(name, names)}; "
            f"there are: {', '.join(names)}"
        )
    return int(model.getJointId(name))


def _closures(file: YamlFile, description: GepettoFile, model: pin.Model) -> list[LoopClosure]:
    closures = []
    pairs = zip(description.closed_loop, description.type, strict=True)
    for i, (frames, given) in enumerate(pairs):
        if len(frames) != 2:
            raise MechanismError(
                f"{file.place(('closed_loop', i))}: a loop is closed at two frames, not "
                f"{len(frames)}"
            )
        if given.lower() not in _KINDS:
            raise MechanismError(
                f"{file.place(('type', i))}: no type {given!r} of a closure; there are: 3d, 6d"
            )
        for j, name in enumerate(frames):
            with file.at("closed_loop", i, j):
                frame_id(model, name, "closed_loop")
        with file.at("closed_loop", i):
            closures.append(LoopClosure(frames[0], frames[1], _KINDS[given.lower()]))
    return closures


def _joint_kinds(file: YamlFile, description: GepettoFile, model: pin.Model) -> dict[str, str]:
    """Return the kinds of joints that are of another type than the URDF's, by name."""
    kinds = {}
    pairs = zip(description.joint_name, description.joint_type, strict=True)
    for i, (name, kind) in enumerate(pairs):
        _joint(file, model, "joint_name", i, name)
        two_turns = _TWO_TURNS.fullmatch(kind)
        if two_turns:
            kinds[name] = f"universal_{''.join(two_turns.groups()).lower()}"
        elif kind in ("SPHERICAL", "FIXED"):
            kinds[name] = kind.lower()
        else:
            raise MechanismError(
                f"{file.place(('joint_type', i))}: no type {kind!r} of a joint; there are: "
                "SPHERICAL, FIXED, UJOINT_XY (or two others of X, Y, Z)"
            )
    return kinds


def _with_other_joints(parts: MechanismParts, kinds: Mapping[str, str]) -> MechanismParts:
    """Return the parts with joints of other types, which have no damping, friction or spring."""
    if not kinds:
        return parts
    changes: dict[str, Any] = {"model": replace_joints(parts.model, kinds)}
    lost = set()
    for effect in EFFECTS:
        values = getattr(parts, effect)
        changes[effect] = {name: value for name, value in values.items() if name not in kinds}
        lost |= {name for name, value in values.items() if name in kinds and value}
    if lost:
        names = ", ".join(name for name in kinds if name in lost)
        said = f"damping and friction of joints that joint_type replaces are left out: {names}"
        changes["notes"] = (*parts.notes, said)
    return replace(parts, **changes)


def _actuated(
    file: YamlFile, model: pin.Model, kinds: Mapping[str, str], index: int, name: str
) -> str:
    """Return the joint that a motor drives, or the coordinate of a universal joint."""
    owner, _, axis = name.rpartition("_")
    kind = kinds.get(owner, "")
    if kind.startswith("universal") and axis.lower() in kind[-2:]:
        return joint_coordinates(model, owner)[kind[-2:].index(axis.lower())]
    _joint(file, model, "name_mot", index, name)
    return name
