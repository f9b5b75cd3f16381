"""Wrenches in the closures, and all wrenches on the tree's bodies.

A wrench is (force, moment), shape (6,), N and N m; at a frame's origin, in world axes unless said
otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.equations import ClosureEquations

#: External wrenches by frame name: (force, moment), shape (6,), N and N m, in world axes.
Wrenches = Mapping[str, ArrayLike]


def closure_wrenches(equations: ClosureEquations, q: Array, multipliers: Array) -> dict[str, Array]:
    """Return, by closure name, the wrench of frame b's side on frame a's, at a, in world axes.

    Couplings have none: theirs is a generalised force of two joints.
    """
    equations.jacobian(q)
    wrenches = {}
    for frames in equations.closed_frames:
        force = multipliers[frames.rows]
        if frames.in_world:
            wrench = np.concatenate([force, np.zeros(6 - force.size)])
        else:
            local = frames.selected.wrenches(frames.constraint_data.c1Mc2).T @ force
            wrench = (local.reshape(2, 3) @ frames.constraint_data.oMc1.rotation.T).ravel()
        wrenches[frames.closure.name] = wrench
    return wrenches


def forces_on_joints(
    equations: ClosureEquations, on_closures: Mapping[str, Array], on_frames: Mapping[int, Array]
) -> pin.StdVec_Force:
    """Return all wrenches on the tree's bodies, in their joints' frames, for Pinocchio's `rnea`.

    After `forwardKinematics` of the equations' data.

    Parameters
    ----------
    equations
        The closures.
    on_closures
        Wrenches in closures, as `closure_wrenches` returns them: on a's side, and opposite on b's.
    on_frames
        External wrenches by frame index.
    """
    model, data = equations.model, equations.data
    forces = pin.StdVec_Force(model.njoints, pin.Force.Zero())

    def add(joint: int, at: Array, wrench: Array) -> None:
        placed = pin.SE3(np.eye(3), at)  # a frame with world axes
        forces[joint] += data.oMi[joint].actInv(placed.act(pin.Force(wrench)))

    for frames in equations.closed_frames:
        wrench = on_closures[frames.closure.name]
        at = frames.a.at(data).translation
        add(frames.a.joint, at, wrench)
        add(frames.b.joint, at, -wrench)
    for frame, wrench in on_frames.items():
        joint = int(model.frames[frame].parentJoint)
        add(joint, data.oMi[joint].act(model.frames[frame].placement.translation), wrench)
    return forces
