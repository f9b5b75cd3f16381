"""What a mechanism looks like: the shapes of the URDF that its description names."""

from __future__ import annotations

import os
from pathlib import Path

import pinocchio as pin

from rps_pin.closed_loop.description_schema import validated
from rps_pin.errors import MechanismError
from rps_pin.yaml_files import read_yaml


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
    description = validated(read_yaml(path, "mechanism file"))
    if description.urdf is None:
        return None
    urdf = Path(path).parent / Path(description.urdf).expanduser()
    try:
        return pin.buildGeomFromUrdf(
            model, str(urdf), pin.GeometryType.VISUAL, package_dirs=[str(urdf.parent)]
        )
    except ValueError as error:
        raise MechanismError(f"{urdf}: its shapes cannot be read: {error}") from None
