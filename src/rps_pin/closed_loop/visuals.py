"""Shapes of a mechanism: those of the URDF in its description, or a skeleton."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.closed_loop.interference.meshes import mesh_file
from rps_pin.closed_loop.io.gepetto import FILE, gepetto_urdf, is_gepetto
from rps_pin.closed_loop.io.mechanism_schema import Description
from rps_pin.closed_loop.io.urdf.normal_form import Shapes, normal_form
from rps_pin.closed_loop.io.urdf.tree import urdf_file
from rps_pin.closed_loop.io.xml_file import is_text
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.config import read_yaml
from rps_pin.errors import few, warn_caller

PackagePath = Sequence[str | os.PathLike[str]]


def visual_model(
    path: str | os.PathLike[str], model: pin.Model, package_path: PackagePath = ()
) -> pin.GeometryModel | None:
    """Return the shapes of the mechanism in a description, to show `model` with.

    Meshes that are not found or cannot be read are left out, with a warning. They are looked for by
    the rules of ROS; see `packages`.

    Parameters
    ----------
    path
        The description, a YAML file; or a URDF, or its text.
    model
        What `ClosedLoopModel.load` made of it.
    package_path
        Folders that are ROS packages, or hold some.

    Returns
    -------
    pin.GeometryModel or None
        None, for a skeleton, where there is nothing to draw, or the description names a MuJoCo
        file, whose shapes are not read.

    Raises
    ------
    InputError
        If the description or its URDF cannot be read.
    """
    urdf: str | Path | None = _urdf_of(path)
    if urdf is None:
        return None
    shapes, missing = urdf_shapes(urdf, model, package_path)
    if missing:
        where = "the URDF text" if is_text(urdf) else urdf
        warn_caller(f"{where}: not drawn: {few(missing)}")
    return shapes if shapes.ngeoms else None


def own_shapes(mechanism: ClosedLoopModel) -> pin.GeometryModel | None:
    """Return the shapes in the file that a mechanism was read from; None where it has none."""
    if mechanism.file is None or not (is_text(mechanism.file) or Path(mechanism.file).exists()):
        return None
    return visual_model(mechanism.file, mechanism.model)


def _urdf_of(path: str | os.PathLike[str]) -> str | Path | None:
    """Return the URDF, or its text, of a description; None if it names a MuJoCo file."""
    if is_text(path):
        return os.fspath(path)
    found = Path(path)
    if found.is_dir():
        found /= FILE
    if found.suffix.lower() == ".urdf":
        return found
    file = read_yaml(found, "mechanism file")
    if is_gepetto(file):
        return gepetto_urdf(found)
    description = file.validated(Description, "a mechanism")
    if description.urdf is None:
        return None
    return found.parent / Path(description.urdf).expanduser()


def urdf_shapes(
    urdf: str | Path, model: pin.Model, package_path: PackagePath = ()
) -> tuple[pin.GeometryModel, list[str]]:
    """Return the shapes of a URDF, or its text, that can be drawn, and why the others cannot.

    Files that a text names are looked for from the working directory.
    """
    loader = coal.CachedMeshLoader()
    beside = Path("text.urdf") if is_text(urdf) else Path(urdf)

    def mesh(attributes: dict[str, str]) -> str:
        name = attributes.get("filename", "")
        try:
            scale = np.array(attributes.get("scale", "1 1 1").split(), dtype=np.float64)
        except ValueError:
            scale = np.full(3, np.nan)
        return mesh_file(name, beside, package_path, scale, loader)[0]

    missing: list[str] = []
    links = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
    text = normal_form(urdf_file(urdf), Shapes(mesh, missing, links))
    try:
        shapes = pin.buildGeomFromUrdfString(
            model, text, pin.GeometryType.VISUAL, mesh_loader=loader
        )
    except (ValueError, RuntimeError, IndexError) as error:
        return pin.GeometryModel(), [*missing, str(error)]
    return shapes, list(dict.fromkeys(missing))


_JOINT = np.array([0.83, 0.62, 0.22, 1.0])
_BAR = np.array([0.16, 0.39, 0.68, 1.0])
_BASE = np.array([0.45, 0.48, 0.52, 1.0])


def skeleton(mechanism: ClosedLoopModel) -> pin.GeometryModel:
    """Return bars for a mechanism that has no shapes of its own.

    A ball at every joint, and a bar on each body from its joint to the joints that it carries and
    to its closed frames. What no body has as its own, the viewer draws besides: rods of
    ``distance`` closures, and the way from where a prismatic joint stands to where it is.
    """
    model, ends, radius = mechanism.model, _ends(mechanism), bar_radius(mechanism)
    ball, here = coal.Sphere(1.6 * radius), pin.SE3.Identity()
    items = [
        (_JOINT, pin.GeometryObject(f"joint_{joint}", joint, here, ball))
        for joint in range(1, model.njoints)
    ]
    for count, (joint, end) in enumerate(ends):
        length = float(np.linalg.norm(end))
        if length > 2.0 * radius:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length)
            middle = pin.SE3(turn.matrix(), end / 2.0)
            bar = coal.Cylinder(radius, length)
            item = pin.GeometryObject(f"bar_{count + 1}", joint, middle, bar)
            items.append((_BAR if joint else _BASE, item))
    shapes = pin.GeometryModel()
    for colour, item in items:
        item.meshColor = colour
        shapes.addGeometryObject(item)
    return shapes


def bar_radius(mechanism: ClosedLoopModel) -> float:
    """Return the thickness of a skeleton's bars, m: a fiftieth of the longest of bars and rods.

    1 cm if all are short of any length.
    """
    longest = max((float(np.linalg.norm(end)) for _, end in _ends(mechanism)), default=0.0)
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure) and closure.distance is not None:
            longest = max(longest, closure.distance)
    return longest / 50.0 or 0.01


def sliding_joints(mechanism: ClosedLoopModel) -> list[int]:
    """Return the indices of the joints with one coordinate that is a length."""
    joints, angular = mechanism.model.joints, mechanism.angular_velocities
    return [
        joint.id for joint in list(joints)[1:] if joint.nv == 1 and not bool(angular[joint.idx_v])
    ]


def _ends(mechanism: ClosedLoopModel) -> list[tuple[int, Array]]:
    """Return joints and points of their bodies: joints that they carry, and closed frames."""
    model = mechanism.model
    ends = [
        (int(model.parents[joint]), np.array(model.jointPlacements[joint].translation))
        for joint in range(1, model.njoints)
    ]
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure):
            for frame in closure.closed_frames(model):
                ends.append((frame.joint, np.array(frame.placement.translation)))
    return ends
