"""Identity of a mechanism: a digest of all that its generated code depends on.

Two mechanisms of the same digest have the same generated code: that of one serves the other, also
in another process and at another time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.editing.split import split


def digest(system: ConstraintSystem, options: Sequence[object]) -> str:
    """Return the SHA-256 of a mechanism, of options, and of the code that generates code."""
    found = hashlib.sha256()
    for part in (_generator(), *_contents(system), *options):
        found.update(_bytes(part))
        found.update(b"\0")
    return found.hexdigest()


def _contents(system: ConstraintSystem) -> Iterator[object]:
    model, effects = split(system.model), system.effects  # of joints without parts
    for joint in list(model.joints)[1:]:
        yield joint.shortname()
        inner = joint.extract()
        yield from (getattr(inner, name) for name in ("axis", "pitch") if hasattr(inner, name))
    yield list(model.names)
    yield list(model.parents)
    for placement in list(model.jointPlacements)[1:]:
        yield placement.homogeneous
    for inertia in list(model.inertias)[1:]:
        yield inertia.toDynamicParameters()
    yield from (model.armature, model.gravity.vector, system.actuated, system.max_condition)
    for frame in model.frames:
        yield from (frame.name, frame.parentJoint, frame.placement.homogeneous)
    yield from system.equations.closures
    yield from (system.equations.length, system.rule)
    if effects is not None:
        yield from (effects.damping, effects.friction, effects.stiffness, effects.rest)
        yield effects.friction_speed


def _bytes(part: object) -> bytes:
    if isinstance(part, np.ndarray):
        return np.ascontiguousarray(part, dtype=np.float64).tobytes()
    return repr(part).encode()


@cache
def _generator() -> str:
    """Return a digest of the modules that write the code, and of CasADi's version."""
    found = hashlib.sha256(metadata.version("casadi").encode())
    for folder in (Path(__file__).parents[1], Path(__file__).parents[2] / "closed_loop"):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".h", ".c"):
                found.update(path.read_bytes())
    return found.hexdigest()
