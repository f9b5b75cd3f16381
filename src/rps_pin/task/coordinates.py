"""What a task's coordinates are, and the mechanism that has them as joints.

The *extended mechanism* has one more joint without mass for each coordinate of the output frame,
and the rows that tie it to the frame (see `frame_coordinates`); its actuated joints are the task's
coordinates. A task of joints needs neither: it is the mechanism with these joints actuated. So the
maps of a task are those of actuated joints, computed by whatever computes these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop import ClosedLoopModel, JointEffects
from rps_pin.closed_loop.constraints.closures import frame_id, joint_id
from rps_pin.closed_loop.constraints.equations import (
    ClosureEquations,
    names_of,
    refuse_twice,
)
from rps_pin.closed_loop.constraints.frame_coordinates import (
    ANGULAR,
    LINEAR,
    FrameCoordinates,
    check_coordinates,
)
from rps_pin.errors import MechanismError

#: Joints that hold coordinates are called ``task:x``.
_PREFIX = "task"


class Extended(NamedTuple):
    """A mechanism whose actuated joints are a task's coordinates."""

    mechanism: ClosedLoopModel
    names: tuple[str, ...]
    """Of the coordinates, in the task's order."""
    angular: tuple[bool, ...]
    """Which of them are angles."""
    added: int
    """Number of joints that were added, whose coordinates are the last of q."""
    idx_q: Indices
    """Where the coordinates are in q, in the task's order."""
    rows: Indices
    """Their rows in J, in the task's order; empty for a task of joints."""
    frame: str | None
    reference: str
    placement: pin.SE3
    """Of the output frame in the frame named."""


def of_joints(mechanism: ClosedLoopModel, joints: Sequence[str]) -> Extended:
    """Return a mechanism whose coordinates are those of joints.

    Raises
    ------
    MechanismError
        If a joint is unknown, named twice, or has not exactly one coordinate.
    """
    names = names_of(joints, "joint of the task")
    refuse_twice("joint of the task", names)
    model = mechanism.model
    found = [model.joints[joint_id(model, name, "task")] for name in names]
    for name, joint in zip(names, found, strict=True):
        if joint.nq != 1:
            raise MechanismError(
                f"task: joint {name!r} ({joint.shortname()}) has {joint.nq} coordinates; a task "
                "takes joints of one, or the coordinates of a frame"
            )
    other = mechanism.with_actuated(names)
    angular = [bool(other.system.equations.angular_velocities[joint.idx_v]) for joint in found]
    idx_q = np.array([joint.idx_q for joint in found], dtype=np.intp)
    none = np.empty(0, dtype=np.intp)
    nowhere = pin.SE3.Identity()
    return Extended(other, names, tuple(angular), 0, idx_q, none, None, "universe", nowhere)


def of_frame(
    mechanism: ClosedLoopModel,
    frame: str,
    coordinates: Sequence[str],
    reference: str,
    placement: Any,
) -> Extended:
    """Return a mechanism with joints that hold the coordinates of a frame.

    Raises
    ------
    MechanismError
        If a frame or coordinate is unknown, or named twice.
    """
    names = names_of(coordinates, "coordinate of the task")
    check_coordinates(names)
    for one in (frame, reference):
        frame_id(mechanism.model, one, "task")
    ordered = tuple(name for name in (*LINEAR, *ANGULAR) if name in names)
    model = pin.Model(mechanism.model)
    joints = tuple(_hold(model, name) for name in ordered)
    closure = FrameCoordinates(
        reference, frame, name=_free(mechanism, frame), placement_b=placement, coordinates=ordered,
        joints=joints,
    )  # fmt: skip
    extended = ClosedLoopModel(
        model,
        (*mechanism.closures, closure),
        [joints[ordered.index(name)] for name in names],
        home=_home(model, closure, mechanism.home),
        effects=_with_more(mechanism.effects, len(joints)),
        name=mechanism.name,
        characteristic_length=mechanism.characteristic_length,
        max_condition=mechanism.max_condition,
        accuracy=mechanism.accuracy,
    )
    first, start = mechanism.model.nq, extended.rows(closure.name).start
    order = np.array([ordered.index(name) for name in names], dtype=np.intp)
    return Extended(
        extended,
        names,
        tuple(name in ANGULAR for name in names),
        len(names),
        first + order,
        start + order,
        frame,
        reference,
        closure.offsets()[1],
    )


def _free(mechanism: ClosedLoopModel, frame: str) -> str:
    """Return a name that no closure has."""
    names = {closure.name for closure in mechanism.closures}
    name = f"coordinates of {frame}"
    while name in names:
        name += "_"
    return name


def _hold(model: pin.Model, coordinate: str) -> str:
    """Add a joint that holds a coordinate, and return its name."""
    axis = (*LINEAR, *ANGULAR).index(coordinate)
    kinds = (
        *(pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
        *(pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
    )
    name = f"{_PREFIX}:{coordinate}"
    while model.existJointName(name):
        name += "_"
    free = np.full(1, np.inf)
    model.addJoint(0, kinds[axis](), pin.SE3.Identity(), name, free, free, -free, free)
    return name


def _with_more(effects: JointEffects | None, count: int) -> JointEffects | None:
    """Return the effects of a model with further joints, which have none."""
    if effects is None:
        return None
    more = np.zeros(count)
    parts = (effects.damping, effects.friction, effects.stiffness, effects.rest)
    damping, friction, stiffness, rest = (np.concatenate([part, more]) for part in parts)
    return JointEffects(damping, friction, stiffness, rest, friction_speed=effects.friction_speed)


def _home(model: pin.Model, closure: FrameCoordinates, home: Array) -> Array:
    """Return a configuration with the coordinates of the frame there."""
    equations = ClosureEquations(model, [closure])
    held = equations.held[0]
    q = np.concatenate([home, np.zeros(closure.size)])
    q[held.idx_q] = -equations.gaps(q)[held.rows]
    return q
