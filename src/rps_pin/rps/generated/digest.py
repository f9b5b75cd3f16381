"""Digest of the modules that generated code depends on: it tells what the cache holds apart."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from rps_pin import codegen

#: What generated code of the 3-RPS is made from, and compared with, beside the compiler.
SOURCES = (
    *("numerics", "codegen", "rps/kernels", "rps/generated", "rps/kinematics", "rps/dynamics"),
    "closed_loop/dynamics/passive_joint_forces.py",
)


@cache
def digest_of(*sources: str) -> str:
    """Return the SHA-256 of modules and of what folders hold, all named from the package's."""
    package = Path(codegen.__file__).parent.parent
    found = hashlib.sha256()
    for source in sources:
        place = package / source
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.suffix in (".py", ".h", ".c"):
                found.update(path.read_bytes())
    return found.hexdigest()
