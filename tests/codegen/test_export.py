"""Exported C: its texts, and that compilers take it and its self-test passes, or fails when it must.

`test_cortex_m` runs it on another processor.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, JointEffects, LoopClosure
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.names import identifier, quoted
from rps_pin.codegen.export.package import Package, conditions
from rps_pin.codegen.export.vectors import vectors
from rps_pin.errors import InputError, MechanismError
from tests.programs import output_of, program
from tests.worst import worst

URDF = Path(__file__).resolve().parents[2] / "urdf"
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
LINE = r"^ok +(\w+) +(\d+) states, at most ([\d.]+) of the accepted difference"


def exported(folder: Path, name: str, **options: object) -> Package:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    package = mechanism_package(mechanism, name=name, **options)
    write_c_files(c_files(package), folder)
    return package


def tested(folder: Path, name: str, compiler: str, *flags: str) -> str:
    """Compile a self-test and run it; return what it prints."""
    sources = f"{name}.c", f"{name}_test.c"
    output_of(program(compiler), *STRICT, *flags, *sources, "-o", "self_test", "-lm", folder=folder)
    return output_of("./self_test", folder=folder)


def shares(printed: str) -> dict[str, float]:
    """Return the share of the accepted difference by function."""
    return {name: float(share) for name, _, share in re.findall(LINE, printed, re.MULTILINE)}


@pytest.fixture(scope="module", params=["double", "float"])
def five_bar(request, tmp_path_factory) -> tuple[Package, Path]:
    """Has parameters, wrenches and a frame."""
    folder = tmp_path_factory.mktemp("five_bar")
    package = exported(
        folder,
        "five_bar",
        real=request.param,
        functions=[*USUAL, "inverse_dynamics_derivatives", "forward_dynamics_derivatives"],
        frames=["right_rod_tip"],
        parameters=["gravity", "mass:left_rod_joint"],
        wrench_frames=["left_rod_tip"],
    )
    return package, folder
