"""Exported C for tests: written, compiled, and its self-test run."""

from __future__ import annotations

import re
from pathlib import Path

from rps_pin import ClosedLoopModel
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.package import Package
from tests.programs import output_of, program

URDF = Path(__file__).resolve().parents[2] / "urdf"
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
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
