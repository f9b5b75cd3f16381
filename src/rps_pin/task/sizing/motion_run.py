"""Motion of a task: the motion of all joints, forces and reactions, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, SingularityError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.maps import TaskState
from rps_pin.task.paths.events import PathCheck
from rps_pin.task.paths.refusal import require_clear
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import real

Progress = Callable[[Iterable[int]], Iterable[int]]

_MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class TaskMotion:
    """Everything computed along a motion of a task; n samples, SI units."""

    time: Array
    """Shape (n,), s."""
    pose: Array
    """The task's coordinates, shape (n, m), m and rad."""
    rate: Array
    """Their first time derivatives, shape (n, m)."""
    acceleration: Array
    """Their second time derivatives, shape (n, m)."""
    state: TaskState
    """The motion of all joints, q (n, nq), v and a (n, nv)."""
    position: Array
    """Of the actuators, shape (n, na), m or rad."""
    speed: Array
    """Of the actuators, shape (n, na), m/s or rad/s."""
    force: Array
    """Of the actuators, shape (n, na), N or N m."""
    joint_wrenches: dict[str, Array]
    """That each joint of the tree carries, (force, moment), shape (n, 6), N and N m, in the axes of
    the joint's frame, at its origin; see `ClosedLoopModel.joint_wrenches`."""
    closure_wrenches: dict[str, Array]
    """That frame b's side of each closure exerts on frame a's, shape (n, 6), in world axes; see
    `ClosedLoopModel.closure_wrenches`."""
    path_check: PathCheck | None
    """Of the trajectory; none of samples."""

    @property
    def power(self) -> Array:
        """Mechanical power of the actuators, shape (n, na), W."""
        return self.force * self.speed


@refuses_other_kinds
def run_motion(
    task: Task,
    trajectory: Trajectory,
    sample_rate: float = 1000.0,
    *,
    near: ArrayLike | None = None,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    progress: Progress = iter,
) -> TaskMotion:
    """Compute the inverse dynamics of a task's mechanism along a trajectory.

    Parameters
    ----------
    task
        The task; a compiled one is followed in a fraction of the time.
    trajectory
        The task's coordinates and their exact derivatives over time.
    sample_rate
        Samples a second, Hz; the end of the trajectory is always the last sample.
    near
        Closed configuration whose assembly mode the motion begins in, shape (nq,); home if left
        out.
    payload, wrench
        Fixed to, and exerted on, the output frame: see `Loads`.
    progress
        Wraps the loop over the samples, for a progress bar.

    Raises
    ------
    InputError
        If the sample rate is not a positive number, or gives over ten million samples; or a load
        does not fit.
    UnreachableError, SingularityError
        If a joint leaves its limits, or the path meets a singularity: says when, before any force
        is computed.
    """
    loads = Loads(task, payload, wrench)
    time = sample_times(trajectory.duration, sample_rate)
    loads.refuse_other_count(len(time))
    check = require_clear(task, trajectory, near)
    motion = trajectory.sample(time)
    q = task.follow(motion.pose, near, within_limits=False)
    state = task.motion(q, motion.rate, motion.acceleration, x=motion.pose)
    return solved(task, time, (motion.pose, motion.rate, motion.acceleration), state, loads, check,
                  progress)  # fmt: skip


def solved(
    task: Task,
    time: Array,
    motion: tuple[Array, Array, Array],
    state: TaskState,
    loads: Loads,
    check: PathCheck | None,
    progress: Progress = iter,
) -> TaskMotion:
    """Return a motion with its forces and reactions.

    Raises
    ------
    SingularityError
        If a sample is singular, or a singularity of type II is crossed between two; says when.
    """
    mechanism, count = loads.mechanism, len(time)
    names = list(mechanism.model.names)[1:]
    force = np.empty((count, task.mechanism.actuated_indices.size))
    joints = {name: np.empty((count, 6)) for name in names}
    closures: dict[str, Array] = {}
    side = 0
    for i in progress(range(count)):
        q, v, a = (part[i] for part in state)
        wrenches = loads.wrenches(q, i)
        try:
            result = mechanism.inverse_dynamics(q, v, a, wrenches=wrenches)
        except SingularityError as error:
            text = f"at t = {time[i]:.6g} s the motion meets a singularity: {error}"
            raise SingularityError(text, error.condition, error.limit) from None
        before, side = side, result.orientation
        if before * side < 0:
            raise SingularityError(
                f"between t = {time[i - 1]:.6g} s and {time[i]:.6g} s the motion crosses a "
                "singularity: no actuator forces carry the mechanism through it",
                math.inf,
                mechanism.max_condition,
            )
        force[i], multipliers = result.tau, result.constraint_forces
        for name, one in mechanism.closure_wrenches(q, multipliers).items():
            closures.setdefault(name, np.empty((count, 6)))[i] = one
        carried = mechanism.joint_wrenches(q, v, a, multipliers, wrenches=wrenches)
        for name, one in carried.items():
            joints[name][i] = one
    speed = state.v[:, task.mechanism.actuated_indices]
    position = state.q[:, task.of_actuators]
    return TaskMotion(time, *motion, state, position, speed, force, joints, closures, check)


def sample_times(duration: float, sample_rate: float) -> Array:
    """Return times from 0 at a rate (Hz), and the duration itself as the last one, s."""
    if not 0 < real(sample_rate) < math.inf:
        raise InputError(f"sample rate = {shown(sample_rate)}: it must be a positive number of Hz")
    if duration * sample_rate > _MOST_SAMPLES:
        raise InputError(
            f"{sample_rate:g} Hz for {duration:g} s would be {duration * sample_rate:.3g} samples; "
            f"at most {_MOST_SAMPLES} are possible"
        )
    count = math.ceil(duration * sample_rate - 1e-9)
    return np.append(np.arange(count) / sample_rate, duration)
