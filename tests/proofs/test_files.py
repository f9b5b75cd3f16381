"""The files in urdf/: where they come from, what is in them, and that the package carries them."""

from __future__ import annotations

import subprocess
import sys
from importlib import resources

import numpy as np
import pinocchio as pin
import pytest
from ruamel.yaml import YAML

from tests.proofs import common

GENERATED = sorted(path.stem for path in common.URDF.glob("*.urdf") if "rps" not in path.stem)
GENERATOR = common.URDF.parent / "tools" / "make_urdfs.py"


def test_the_generator_writes_what_is_there() -> None:
    run = subprocess.run(
        [sys.executable, str(GENERATOR), "--check"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("name", GENERATED)
def test_every_body_with_mass_has_a_shape(name: str) -> None:
    """So that any viewer shows the whole mechanism."""
    path = str(common.URDF / f"{name}.urdf")
    model = pin.buildModelFromUrdf(path)
    shapes = pin.buildGeomFromUrdf(model, path, pin.GeometryType.VISUAL)
    shown = {shape.parentJoint for shape in shapes.geometryObjects}
    heavy = {i for i, inertia in enumerate(model.inertias) if i and inertia.mass > 0}
    assert heavy
    assert heavy <= shown


@pytest.mark.parametrize("name", GENERATED)
def test_masses_are_those_of_rigid_bodies(name: str) -> None:
    """No principal moment exceeds the sum of the others."""
    model = pin.buildModelFromUrdf(str(common.URDF / f"{name}.urdf"))
    for inertia in list(model.inertias)[1:]:
        smallest, middle, largest = np.linalg.eigvalsh(inertia.inertia)
        assert smallest >= 0
        assert largest <= (smallest + middle) * (1 + 1e-12)


@pytest.mark.parametrize("name", sorted(path.stem for path in common.URDF.glob("*.yaml")))
def test_comes_with_the_package(name: str) -> None:
    packaged = resources.files("rps_pin") / "urdf" / f"{name}.yaml"
    description = YAML(typ="safe", pure=True).load(packaged.read_text("utf-8"))
    assert (resources.files("rps_pin") / "urdf" / description["urdf"]).is_file()
