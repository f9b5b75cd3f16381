"""Wrenches: those given at frames, those in the closures, and those that the tree's joints carry.

A wrench is (force, moment), shape (6,), N and N m; at a frame's origin, in world axes unless said
otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.loops import Loops
from rps_pin.validation import real_vector

Wrenches = Mapping[str, ArrayLike]

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def generalised_force(
    model: pin.Model, data: pin.Data, frames: Mapping[int, Array], nv: int
) -> Array:
    """Return the sum of J_f' w over frames by index, shape (nv,), after `computeJointJacobians`."""
    force = np.zeros(nv)
    for frame, wrench in frames.items():
        jacobian = pin.getFrameJacobian(model, data, frame, _WORLD).reshape(6, nv)
        force += jacobian.T @ wrench
    return force


def checked_wrench(value: ArrayLike, frame: str) -> Array:
    """Return a wrench as a finite array (6,)."""
    return real_vector(value, 6, f"the wrench at frame {frame!r}")


def closure_wrenches(loops: Loops, q: Array, multipliers: Array) -> dict[str, Array]:
    """Return, by closure name, what frame b's side exerts on frame a's, at a, in world axes.

    Couplings have none: theirs is a generalised force of two joints.
    """
    loops.jacobian(q)
    wrenches = {}
    for frames in loops.closed_frames:
        own = multipliers[frames.rows]
        if frames.in_world:
            wrench = np.concatenate([own, np.zeros(6 - own.size)])
        else:
            local = frames.kept.wrenches(frames.constraint_data.c1Mc2).T @ own
            wrench = (local.reshape(2, 3) @ frames.constraint_data.oMc1.rotation.T).ravel()
        wrenches[frames.closure.name] = wrench
    return wrenches


def forces_on_joints(
    loops: Loops, on_closures: Mapping[str, Array], on_frames: Mapping[int, Array]
) -> pin.StdVec_Force:
    """Return all wrenches on the tree's bodies, in their joints' frames, for Pinocchio's `rnea`.

    After a `framesForwardKinematics` of the loops' data.

    Parameters
    ----------
    loops
        The closures.
    on_closures
        Wrenches in closures, as `closure_wrenches` returns them: on a's side, and opposite on b's.
    on_frames
        External wrenches by frame index.
    """
    model, data = loops.model, loops.data
    forces = pin.StdVec_Force(model.njoints, pin.Force.Zero())

    def add(frame: int, at: Array, wrench: Array) -> None:
        joint = model.frames[frame].parentJoint
        placed = pin.SE3(np.eye(3), at)  # a frame with world axes
        forces[joint] += data.oMi[joint].actInv(placed.act(pin.Force(wrench)))

    for frames in loops.closed_frames:
        wrench = on_closures[frames.closure.name]
        at = data.oMf[frames.frame_a].translation
        add(frames.frame_a, at, wrench)
        add(frames.frame_b, at, -wrench)
    for frame, wrench in on_frames.items():
        add(frame, data.oMf[frame].translation, wrench)
    return forces
