"""Files of a mechanism: a URDF with its description, or a MuJoCo file."""

from __future__ import annotations

import os
from pathlib import Path

import pinocchio as pin

from rps_pin.closed_loop.io.write.description import description_text
from rps_pin.closed_loop.io.write.mjcf import mjcf_text
from rps_pin.closed_loop.io.write.mjcf_inertia import Mending
from rps_pin.closed_loop.io.write.source import Source, kind_of, without_rows
from rps_pin.closed_loop.io.write.urdf import is_whole, urdf_text
from rps_pin.errors import InputError
from rps_pin.files import write_text
from rps_pin.validation import non_negative_number


def write_urdf(
    source: Source, path: str | os.PathLike[str], shapes: pin.GeometryModel | None = None
) -> Path:
    """Write the URDF of a mechanism and, beside it, its description; see `ClosedLoopModel`."""
    target = _target(path, ".urdf")
    plain = without_rows(source, is_whole)
    text, merges = urdf_text(plain, shapes)
    described = description_text(plain, target.name, merges)
    write_text(target, text)
    description = target.with_suffix(".yaml")
    write_text(description, described)
    return description


def write_mjcf(
    source: Source,
    path: str | os.PathLike[str],
    least_mass: float,
    least_inertia: float,
    mend_inertia: bool,
) -> Path:
    """Write a mechanism as a MuJoCo file; see `ClosedLoopModel.to_mjcf`."""
    target = _target(path, ".xml")
    mending = Mending(
        non_negative_number(least_mass, "least_mass", "kg"),
        non_negative_number(least_inertia, "least_inertia", "kg m^2"),
        mend_inertia,
    )
    plain = without_rows(source, lambda joint: kind_of(joint) == "ball")
    write_text(target, mjcf_text(plain, mending))
    return target


def _target(path: str | os.PathLike[str], suffix: str) -> Path:
    target = Path(path)
    if target.suffix.lower() != suffix:
        raise InputError(f"{target}: the file's name must end in {suffix}")
    return target
