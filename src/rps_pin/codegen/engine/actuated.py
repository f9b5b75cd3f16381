"""Where the actuated joints are in a configuration, if generated code can continue by them."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Indices
from rps_pin.codegen.engine.generated import GeneratedCode


def actuated_coordinates(code: GeneratedCode) -> Indices | None:
    """Return indices into q; None if an actuated joint has not one coordinate of its own."""
    mechanism = code.mechanism
    model = mechanism.model
    if not all(map(model.existJointName, mechanism.actuated)):
        return None
    joints = [model.joints[model.getJointId(name)] for name in mechanism.actuated]
    if any(joint.nq != 1 for joint in joints):
        return None
    return np.array([joint.idx_q for joint in joints], dtype=np.intp)


def continued_coordinates(code: GeneratedCode) -> Indices | None:
    """Return the same if these are the independent joints, whose values ``completed`` takes."""
    at = actuated_coordinates(code)
    if at is None or code.mechanism.system.actuated.size != at.size:
        return None
    return at if code.partition.is_actuated else None
