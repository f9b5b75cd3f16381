"""Mechanisms from YAML files: a URDF or MJCF, closures, actuated joints, effects at joints.

    urdf: slider_crank.urdf            # or mjcf: a file; relative to this one
    closures:
      - {frame_a: knee, frame_b: tip, kind: revolute, axis: [0, 1, 0]}
    actuated: [crank]
    home: {crank: 0.5}

The keys are the fields of `Description`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import close, closed_gap
from rps_pin.closed_loop.column_names import named_velocities
from rps_pin.closed_loop.constraints.closures import (
    Closure,
    JointCoupling,
    LoopClosure,
    frame_id,
    joint_id,
)
from rps_pin.closed_loop.constraints.frame_coordinates import check_coordinates
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.editing.merge import (
    JointMerge,
    merged,
    merged_configuration,
    placeholder_notes,
)
from rps_pin.closed_loop.editing.present_pose import closure_at
from rps_pin.closed_loop.editing.replace import replace_joints, replaced_configuration
from rps_pin.closed_loop.interference.pairs import check_links
from rps_pin.closed_loop.interference.shapes import CollisionShapes
from rps_pin.closed_loop.io.gepetto import is_gepetto, parts_from_gepetto
from rps_pin.closed_loop.io.mechanism_schema import (
    ClosureEntry,
    CouplingEntry,
    Description,
    PlacementEntry,
)
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import EFFECTS, MechanismParts, without_position_limits
from rps_pin.closed_loop.io.urdf import parts_from_urdf
from rps_pin.config import Faults, YamlFile, read_yaml
from rps_pin.errors import InputError, MechanismError, shown
from rps_pin.files import is_folder

#: How far a joint's given coordinates may be from a rotation's (norm of a quaternion, of a cosine
#: and sine).
_NORMED = 1e-3


def parts_from_yaml(
    path: str | os.PathLike[str], within_limits: bool | None = None
) -> MechanismParts:
    """Read a mechanism from its description, a YAML file.

    Descriptions of Gepetto's example-parallel-robots, and their folders, are read too.

    Parameters
    ----------
    path
        The file.
    within_limits
        Whether position limits count; None: as the file says.

    Raises
    ------
    InputError
        If the file cannot be read, is not YAML, or a value is not of its key's type.
    MechanismError
        If what it describes does not hold together (unknown frame, joint or kind; a bad URDF or
        MJCF).
    """
    if is_folder(path):
        return parts_from_gepetto(path, within_limits=within_limits is not False)
    file = read_yaml(path, "mechanism file")
    if is_gepetto(file):
        return parts_from_gepetto(path, within_limits=within_limits is not False)
    description = file.validated(Description, "a mechanism")
    tree = _tree(file, description, Path(path))
    if not (description.within_limits if within_limits is None else within_limits):
        tree = without_position_limits(tree)
    if description.joint_types:
        tree = _of_other_joints(file, description, tree)
    merges = []
    for i, entry in enumerate(description.merge):
        with file.at("merge", i):
            merges.append(JointMerge(**entry.model_dump()))
    parts = _merged(file, description, tree, merges) if merges else tree
    actuated = parts.actuated if description.actuated is None else tuple(description.actuated)
    _check_names(file, description, tree, parts.model, actuated)
    parts = _with_effects(file, description, parts)
    given = _closures(file, description, parts.model, Faults(file.origin))
    own = [one for one in parts.closures if one not in given]
    home = _home(file, description, tree, parts, merges)
    added, home = _standing(file, parts.model, own, given, home)
    return replace(
        parts,
        closures=(*own, *added),
        actuated=actuated,
        home=home,
        name=description.name or parts.name or Path(path).stem,
        friction_speed=description.friction_speed,
        characteristic_length=description.characteristic_length,
        max_condition=description.max_condition,
        accuracy=description.accuracy,
        task=_task(file, description, parts.model),
        collision=_collision(file, description, parts),
    )


def _check_names(
    file: YamlFile,
    description: Description,
    tree: MechanismParts,
    model: pin.Model,
    actuated: Sequence[str],
) -> None:
    """Refuse all names that there are not, and closures and tasks that are none, at once."""
    faults = Faults(file.origin)
    for effect in (*EFFECTS, "armature"):
        for name in getattr(description, effect):
            with faults:
                _check_joint(file, (effect, name), name, model)
    for index, name in enumerate(actuated):
        with faults:
            if named_velocities(model, name) is None:
                _check_joint(file, ("actuated", index), name, model)
    _closures(file, description, model, faults)
    for name in description.home:
        with faults:
            if name not in list(tree.model.names)[1:]:
                _check_joint(file, ("home", name), name, model)
    with faults:
        _task(file, description, model)
    faults.tell()


# The tree -----------------------------------------------------------------------------------------


def _tree(file: YamlFile, description: Description, path: Path) -> MechanismParts:
    """Return the parts in the URDF or MJCF, before merging."""
    if (description.urdf is None) == (description.mjcf is None):
        both = description.urdf is not None
        where = file.place(("mjcf",)) if both else file.origin
        what = "both were given" if both else "neither was given"
        raise MechanismError(f"{where}: a mechanism has one of urdf and mjcf; {what}")
    source = description.urdf or description.mjcf or ""
    key = "urdf" if description.urdf else "mjcf"
    if source.lstrip("\ufeff \t\r\n").startswith("<"):
        raise InputError(f"{file.place((key,))}: {key} must be the name of a file, not its text")
    if description.mjcf and description.root:
        raise MechanismError(
            f"{file.place(('root',))}: root belongs to urdf; an MJCF has its own free joints"
        )
    target = path.parent / Path(source).expanduser()
    with file.at(key):
        if description.mjcf:
            return parts_from_mjcf(target, actuated=description.actuated)
        return parts_from_urdf(target, description.root or "fixed")


def _of_other_joints(
    file: YamlFile, description: Description, tree: MechanismParts
) -> MechanismParts:
    """Replace joints by others, and leave out what they cannot keep, if the file says so."""
    kinds, model = description.joint_types, tree.model
    for name in kinds:
        _check_joint(file, ("joint_types", name), name, model)
    new = model
    for name, kind in kinds.items():
        with file.at("joint_types", name):
            replace_joints(model, {name: kind})  # whose fault it is
    new = replace_joints(model, kinds)
    home = None if tree.home is None else replaced_configuration(model, kinds, tree.home)
    changes: dict[str, Any] = {"model": new, "home": home}
    for effect in EFFECTS:
        values = dict(getattr(tree, effect))
        lost = [name for name in kinds if values.pop(name, None) and new.existJointName(name)]
        for name in lost:
            if name not in getattr(description, effect):
                raise MechanismError(
                    f"{file.place(('joint_types', name))}: joint {name!r} has {effect} in its "
                    f"file; say what it has as a {kinds[name]} joint, in {effect}"
                )
        changes[effect] = values
    for closure in tree.closures:
        if isinstance(closure, JointCoupling):
            with file.at("joint_types"):
                closure.joint_ids(new)
    return replace(tree, **changes)


def _merged(
    file: YamlFile, description: Description, tree: MechanismParts, merges: Sequence[JointMerge]
) -> MechanismParts:
    """Merge joints, and leave out the effects at those that are merged."""
    with file.at("merge"):
        model = merged(tree.model, merges)
        notes = placeholder_notes(tree.model, merges)
    changes: dict[str, Any] = {"model": model, "notes": (*tree.notes, *notes)}
    for effect in EFFECTS:
        values = getattr(tree, effect)
        for merge in merges:
            lost = [name for name in merge.joints if values.get(name)]
            if lost and merge.name not in getattr(description, effect):
                raise MechanismError(
                    f"{file.place(('merge',))}: joint {lost[0]!r} has {effect} and is merged; say "
                    f"what {merge.name!r} has, in {effect}"
                )
        changes[effect] = {
            name: value for name, value in values.items() if model.existJointName(name)
        }
    with file.at("merge"):
        for closure in tree.closures:
            needed = closure.joint_ids if isinstance(closure, JointCoupling) else closure.frame_ids
            needed(model)
    return replace(tree, **changes)


# Effects at joints -------------------------------------------------------------------------------


def _with_effects(
    file: YamlFile, description: Description, parts: MechanismParts
) -> MechanismParts:
    """Replace effects of the tree's file by the description's, on a copy of its model."""
    model = pin.Model(parts.model)
    if description.gravity is not None:
        model.gravity.linear = np.array(description.gravity)
    armature = model.armature.copy()
    for name, value in description.armature.items():
        joint = model.joints[model.getJointId(name)]
        armature[joint.idx_v : joint.idx_v + joint.nv] = value
    model.armature = armature
    effects: Any = {
        name: {**getattr(parts, name), **getattr(description, name)} for name in EFFECTS
    }
    return replace(parts, model=model, **effects)


def _home(
    file: YamlFile,
    description: Description,
    tree: MechanismParts,
    parts: MechanismParts,
    merges: Sequence[JointMerge],
) -> Array | None:
    """Return the home of the tree's file, with the coordinates that the description gives."""
    if tree.home is None and not description.home:
        return None
    before = pin.neutral(tree.model) if tree.home is None else tree.home.copy()
    _set_joints(file, description.home, tree, before)
    q = merged_configuration(tree.model, merges, before) if merges else before
    new = {k: v for k, v in description.home.items() if not tree.model.existJointName(k)}
    _set_joints(file, new, parts, q)
    return q


def _set_joints(
    file: YamlFile, values: Mapping[str, float | Sequence[float]], parts: MechanismParts, q: Array
) -> None:
    model = parts.model
    for name, value in values.items():
        if not model.existJointName(name):
            continue
        given = np.atleast_1d(np.asarray(value, dtype=np.float64))
        joint = model.joints[model.getJointId(name)]
        where = file.place(("home", name))
        if name in parts.continuous and given.size == 2:
            q[joint.idx_q] = _angle(where, name, given)
            continue
        if given.size != joint.nq:
            raise InputError(
                f"{where}: home of {name!r} ({joint.shortname()}) has {given.size} numbers; "
                f"it must have {joint.nq}"
            )
        own, here = q.copy(), slice(joint.idx_q, joint.idx_q + joint.nq)
        own[here] = given
        whole = pin.normalize(model, own)
        normed = whole[here]
        near = np.abs(normed - given).max() <= _NORMED
        if not (near and pin.isNormalized(model, whole, _NORMED)):  # zeros stay zeros
            raise InputError(
                f"{where}: home of {name!r} ({joint.shortname()}) = {shown(value)} is not a "
                "rotation; a quaternion (x, y, z, w), or a cosine and a sine, has length 1"
            )
        q[here] = normed


def _angle(where: str, name: str, given: Array) -> float:
    """Return the angle of a cosine and a sine, as Pinocchio has an unbounded turn."""
    if abs(np.hypot(*given) - 1.0) > _NORMED:
        raise InputError(
            f"{where}: home of {name!r} = {shown(given.tolist())} is neither an angle nor a cosine "
            "and a sine, whose length is 1"
        )
    return float(np.arctan2(given[1], given[0]))


# Task ---------------------------------------------------------------------------------------------


def _task(file: YamlFile, description: Description, model: pin.Model) -> dict[str, Any] | None:
    """Return the arguments of a task whose frames, joints and coordinates there are."""
    entry = description.task
    if entry is None:
        return None
    if (entry.frame is None) != (entry.coordinates is None) or (
        (entry.frame is None) == (entry.joints is None)
    ):
        raise MechanismError(
            f"{file.place(('task',))}: a task has a frame and its coordinates, or joints"
        )
    if entry.joints is not None and (entry.placement or entry.reference != "universe"):
        key = "placement" if entry.placement else "reference"
        raise MechanismError(f"{file.place(('task', key))}: {key} belongs to a frame's task")
    for i, name in enumerate(entry.coordinates or ()):
        with file.at("task", "coordinates", i):
            check_coordinates([name])
    for key in ("frame", "reference"):
        if getattr(entry, key) is not None:
            with file.at("task", key):
                frame_id(model, getattr(entry, key), "task")
    for i, name in enumerate(entry.joints or ()):
        with file.at("task", "joints", i):
            joint_id(model, name, "task")
    return entry.model_dump() | {"placement": _placed(entry.placement)}


# Interference -------------------------------------------------------------------------------------


def _collision(file: YamlFile, description: Description, parts: MechanismParts) -> CollisionShapes:
    """Return the shapes of the tree's file, without the pairs that the description leaves out."""
    shapes, entry = parts.collision, description.interference
    for i, pair in enumerate(entry.ignore if entry else ()):
        with file.at("interference", "ignore", i):
            shapes = shapes.ignoring([pair])
            check_links(parts.model, [pair])
    return shapes


# Closures -----------------------------------------------------------------------------------------


class _AtHome(NamedTuple):
    """A closure of frames as they stand at home, once this is known."""

    number: int
    """Index in the file's closures."""
    fields: dict[str, Any]


def _closures(
    file: YamlFile, description: Description, model: pin.Model, faults: Faults
) -> list[Closure | _AtHome]:
    """Return the closures and couplings that are possible; tell the others."""
    found: list[Closure | _AtHome] = []
    for i, entry in enumerate(description.closures):
        for end in ("frame_a", "frame_b"):
            with faults, file.at("closures", i, end):
                frame_id(model, getattr(entry, end), "closures")
        fields = _fields(entry)
        with faults, file.at("closures", i):
            found.append(_AtHome(i, fields) if entry.at_home else LoopClosure(**fields))
    for i, coupled in enumerate(description.couplings):
        with faults, file.at("couplings", i):
            found.append(_coupling(coupled, model))
    return found


def _fields(entry: ClosureEntry) -> dict[str, Any]:
    """Return the fields of a closure."""
    fields = entry.model_dump(exclude={"at_home"})
    return fields | {end: _placed(getattr(entry, end)) for end in ("placement_a", "placement_b")}


def _placed(offset: PlacementEntry | None) -> Array | None:
    """Return the matrix of an offset, R = R_z(yaw) R_y(pitch) R_x(roll)."""
    if offset is None:
        return None
    turn = pin.rpy.rpyToMatrix(*offset.rpy)
    return np.asarray(pin.SE3(turn, np.array(offset.xyz)).homogeneous)


def _standing(
    file: YamlFile,
    model: pin.Model,
    own: Sequence[Closure],
    given: Sequence[Closure | _AtHome],
    home: Array | None,
) -> tuple[list[Closure], Array | None]:
    """Return the closures given, and the home, at which all others are closed if some stand there.

    Parameters
    ----------
    own
        The closures of the tree's file.
    """
    fixed = [one for one in given if not isinstance(one, _AtHome)]
    if len(fixed) == len(given):
        return fixed, home
    system = ConstraintSystem(model, [*own, *fixed], ())
    q = system.normalised(pin.neutral(model) if home is None else home, "home")
    if system.equations.largest_gap(system.equations.gaps(q)) > closed_gap(system, q):
        q = close(system, q)
    closures: list[Closure] = []
    for one in given:
        if isinstance(one, _AtHome):
            with file.at("closures", one.number):
                closures.append(closure_at(model, q, **one.fields))
        else:
            closures.append(one)
    return closures, q


def _coupling(entry: CouplingEntry, model: pin.Model) -> JointCoupling:
    """Return a coupling of joints that the model has."""
    if (entry.other is None) == (entry.others is None):
        both = "both were given" if entry.other else "neither was given"
        raise MechanismError(
            f"a coupling has one of other (a joint) and others (ratios by joints' names); {both}"
        )
    given = entry.model_dump(exclude={"others"})
    coupling = JointCoupling(**given | {"other": entry.other or entry.others})
    coupling.joint_ids(model)
    return coupling


def _check_joint(file: YamlFile, path: tuple[str | int, ...], name: str, model: pin.Model) -> None:
    """Refuse a name that no joint has."""
    joints = list(model.names)[1:]
    if name not in joints:
        raise MechanismError(
            f"{file.place(path)}: {path[0]}: no joint {name!r}; there are: {', '.join(joints)}"
        )
