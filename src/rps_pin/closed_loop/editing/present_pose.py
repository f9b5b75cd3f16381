"""Closures of frames as they stand: a foot on the ground, a trunk that is held, a grip.

Both closed frames of such a closure coincide at a configuration: they stand at frame a, with its
axes; or, if the world carries frame a, at frame b's origin with frame a's axes.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Kind, LoopClosure
from rps_pin.errors import MechanismError

#: What follows from the configuration, of a rod and of other closures.
_FOLLOWING = ("distance", "placement_b")
_OPTIONS = tuple(
    field.name for field in fields(LoopClosure) if field.name not in ("frame_a", "frame_b", "kind")
)


def closure_at(
    model: pin.Model, q: Array, frame_a: str, frame_b: str, kind: Kind, **options: Any
) -> LoopClosure:
    """Return a closure that is closed at q; see `ClosedLoopModel.closure_at`."""
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        raise MechanismError(
            f"closure of {frame_a!r} as it stands: no option {unknown[0]!r}; there are: "
            f"{', '.join(name for name in _OPTIONS if name not in _FOLLOWING)}"
        )
    is_rod = kind == "distance"
    fixed = "distance" if is_rod else "placement_b"
    if options.get(fixed) is not None:
        raise MechanismError(
            f"closure of {frame_a!r} as it stands: {fixed} follows from q; leave it out"
        )
    if is_rod:  # of any length, to measure
        options["distance"] = 1.0
    closure = LoopClosure(frame_a, frame_b, kind, **options)
    a, b = closure.closed_frames(model)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    if is_rod:
        apart = a.at(data).translation - b.at(data).translation
        return replace(closure, distance=float(np.linalg.norm(apart)))
    if a.joint == 0 and closure.placement_a is None:
        at = a.placement.actInv(b.at(data).translation)
        closure = replace(closure, placement_a=pin.SE3(np.eye(3), at))
        a = closure.closed_frames(model)[0]
    return replace(closure, placement_b=b.at(data).actInv(a.at(data)))
