"""Robots of the example-robot-data wheel, which holds files only."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path


def path_of(name: str) -> Path:
    """A file of the wheel by the end of its path, such as ``panda_description/urdf/panda.urdf``."""
    files = metadata.files("example-robot-data") or []
    found = [file for file in files if str(file).endswith(f"/{name}")]
    assert len(found) == 1, f"{len(found)} files end in {name}"
    return Path(str(found[0].locate()))
