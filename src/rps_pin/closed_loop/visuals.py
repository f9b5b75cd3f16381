"""Shapes of a mechanism: those of the URDF in its description, or a skeleton."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.closed_loop.io.mechanism_schema import Description
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.config import read_config
from rps_pin.errors import MechanismError


def visual_model(path: str | os.PathLike[str], model: pin.Model) -> pin.GeometryModel | None:
    """Return the shapes of the mechanism in a description, to show `model` with.

    Parameters
    ----------
    path
        The description, a YAML file.
    model
        What `ClosedLoopModel.load` made of it.

    Returns
    -------
    pin.GeometryModel or None
        None where the description names a MuJoCo file, whose shapes are not read.

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If a mesh that the URDF names cannot be.
    """
    _, description = read_config(path, "mechanism", Description)
    if description.urdf is None:
        return None
    urdf = Path(path).parent / Path(description.urdf).expanduser()
    try:
        return pin.buildGeomFromUrdf(
            model, str(urdf), pin.GeometryType.VISUAL, package_dirs=[str(urdf.parent)]
        )
    except ValueError as error:
        raise MechanismError(f"{urdf}: its shapes cannot be read: {error}") from None


_JOINT = np.array([0.83, 0.62, 0.22, 1.0])
_BAR = np.array([0.16, 0.39, 0.68, 1.0])
_BASE = np.array([0.45, 0.48, 0.52, 1.0])


def skeleton(mechanism: ClosedLoopModel) -> pin.GeometryModel:
    """Return bars for a mechanism that has no shapes of its own.

    A ball at every joint, and a bar on each body from its joint to the joints that it carries and
    to its closed frames. The thickness is a fiftieth of the longest bar, or 1 cm if all are short
    of any length.
    """
    model = mechanism.model
    ends = [
        (int(model.parents[joint]), np.array(model.jointPlacements[joint].translation))
        for joint in range(1, model.njoints)
    ]
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure):
            for frame in (model.frames[index] for index in closure.frame_ids(model)):
                ends.append((int(frame.parentJoint), np.array(frame.placement.translation)))
    longest = max((float(np.linalg.norm(end)) for _, end in ends), default=0.0)
    radius = longest / 50.0 or 0.01
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
