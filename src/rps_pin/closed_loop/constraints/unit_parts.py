"""Parts of a configuration that have unit length: quaternions, and cosines with sines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import InputError

_PARTS = {
    "JointModelSpherical": slice(0, 4),
    "JointModelFreeFlyer": slice(3, 7),
    "JointModelPlanar": slice(2, 4),
}


def unit_parts(model: pin.Model) -> list[slice]:
    """Return where these parts are in q."""
    return [part for joint in list(model.joints)[1:] for part in _of(joint)]


def normalised(q: Array, parts: list[slice], name: str) -> Array:
    """Return configurations (..., nq) with these parts of unit length.

    Raises
    ------
    InputError
        If a part has no length.
    """
    if not parts:
        return q
    found = q.copy()
    for part in parts:
        size = np.abs(q[..., part]).max(
            axis=-1, keepdims=True
        )  # squares neither over- nor underflow
        if not (size > 0).all():
            raise InputError(f"{name} holds a quaternion of length zero, which is no orientation")
        scaled = q[..., part] / size
        found[..., part] = scaled / np.sqrt((scaled * scaled).sum(axis=-1, keepdims=True))
    return found


def _of(joint: Any) -> list[slice]:
    inner = joint.extract() if hasattr(joint, "extract") else joint
    if hasattr(inner, "joints"):
        return [part for one in list(inner.joints) for part in _of(one)]
    kind = _PARTS.get(joint.shortname())
    if kind is None:
        if joint.nq == joint.nv:
            return []
        kind = slice(0, joint.nq)
    return [slice(joint.idx_q + kind.start, joint.idx_q + kind.stop)]
