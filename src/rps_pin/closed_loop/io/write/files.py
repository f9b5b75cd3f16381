"""Files of a mechanism: a URDF with its description, or a MuJoCo file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pinocchio as pin

from rps_pin.closed_loop.io.write.description import description_text
from rps_pin.closed_loop.io.write.mjcf import mjcf_text
from rps_pin.closed_loop.io.write.mjcf_inertia import Mending
from rps_pin.closed_loop.io.write.source import Source, kind_of, without_rows
from rps_pin.closed_loop.io.write.urdf import is_whole, urdf_text
from rps_pin.errors import InputError, warn_caller
from rps_pin.files import write_text
from rps_pin.validation import non_negative_number


def write_urdf(
    source: Source,
    path: str | os.PathLike[str],
    shapes: pin.GeometryModel | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the URDF of a mechanism and, beside it, its description; see `ClosedLoopModel`."""
    target = urdf_path(path)
    return write_texts(target, urdf_texts(source, target, shapes), overwrite)


def urdf_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of a URDF.

    Raises
    ------
    InputError
        If it does not end in ``.urdf``.
    """
    return _target(path, ".urdf")


class UrdfTexts(NamedTuple):
    """A URDF and its description, to be written."""

    urdf: str
    description: str
    told: list[str]
    """What the format does not have."""


def urdf_texts(source: Source, target: Path, shapes: pin.GeometryModel | None = None) -> UrdfTexts:
    """Return the URDF that `target` will be, and its description."""
    told: list[str] = []
    plain = without_rows(source, is_whole)
    text, merges, ignored = urdf_text(plain, shapes, told)
    return UrdfTexts(text, description_text(plain, target.name, merges, ignored), told)


def write_texts(target: Path, texts: UrdfTexts, overwrite: bool) -> Path:
    """Write a URDF and, beside it, its description; return the path of the latter."""
    description = target.with_suffix(".yaml")
    _write({target: texts.urdf, description: texts.description}, overwrite)
    _tell(target, texts.told)
    return description


def write_mjcf(
    source: Source, path: str | os.PathLike[str], mending: Mending, overwrite: bool = False
) -> Path:
    """Write a mechanism as a MuJoCo file; see `ClosedLoopModel.to_mjcf`."""
    target = _target(path, ".xml")
    mending = mending._replace(
        least_mass=non_negative_number(mending.least_mass, "least_mass", "kg"),
        least_inertia=non_negative_number(mending.least_inertia, "least_inertia", "kg m^2"),
    )
    told: list[str] = []
    plain = without_rows(source, lambda joint: kind_of(joint) == "ball")
    _write({target: mjcf_text(plain, mending, told)}, overwrite)
    _tell(target, told)
    return target


def _target(path: str | os.PathLike[str], suffix: str) -> Path:
    target = Path(path)
    if target.suffix.lower() != suffix:
        raise InputError(f"{target}: the file's name must end in {suffix}")
    return target


def _write(texts: Mapping[Path, str], overwrite: bool) -> None:
    """Write files, or none if one of them exists already and must not be replaced."""
    there = [str(path) for path in texts if not overwrite and (path.exists() or path.is_symlink())]
    if there:
        which = "it" if len(there) == 1 else "them"
        verb = "exists" if len(there) == 1 else "exist"
        raise InputError(f"{', '.join(there)} {verb}; overwrite=True replaces {which}")
    for path, text in texts.items():
        write_text(path, text)


def _tell(target: Path, told: Sequence[str]) -> None:
    """Warn of what the format does not have."""
    if told:
        warn_caller(f"{target}: {'; '.join(told)}")
