"""The path check: where and when a path of a task meets a singularity or leaves a limit.

Everything that can go wrong is a *signal*, a function of time that is zero where it happens; see
`rps_pin.task.paths.signals` for the signals and `rps_pin.task.paths.findings` for how they are
searched. What the check relies on: **between two samples, no signal turns more than once.**
Neighbouring samples are apart by at most ``duration / least_steps`` in time, and by `max_step`
characteristic lengths in any coordinate, angles counted as lengths, as far as the rates at both
ends tell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.paths.events import PathCheck
from rps_pin.task.paths.findings import GRAZE, check_signals, sample_times
from rps_pin.task.paths.interference import path_interference
from rps_pin.task.paths.limits import Cone
from rps_pin.task.paths.signals import TaskSignals
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import non_negative_number, positive_number, whole_number


@refuses_other_kinds
def check_path(
    task: Task,
    trajectory: Trajectory,
    *,
    near: ArrayLike | None = None,
    cones: Sequence[Cone] = (),
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    tolerance: float | None = None,
    threshold: float = GRAZE,
    actuators: bool = True,
    interference: bool | None = None,
    clearance: float = 0.0,
    ignore: Sequence[tuple[str, str]] = (),
    least_steps: int = 250,
    max_step: float = 0.02,
) -> PathCheck:
    """Return where and when a path of a task meets a singularity, grazes one, or leaves a limit.

    Limits are those of the mechanism's model: the joints' positions, and the actuators' speeds and
    forces (limits of 1e6 or more are none). The forces are those of the motion, by inverse
    dynamics; at a type II singularity they grow without bound. Where the assembly mode ends on the
    path, in a type I or a constraint singularity, an event ``"ends"`` says when; the rest of the
    path is not checked.

    Parameters
    ----------
    task
        The task; a compiled one (`Task.compile`) is checked in a fraction of the time.
    trajectory
        The path, of the task's coordinates; rates and accelerations must be the derivatives.
    near
        Closed configuration whose assembly mode the path begins in, shape (nq,); home if left out.
    cones
        Limits of balls and universal joints.
    payload, wrench
        Fixed to, and exerted on, the output frame: see `Loads`; the wrench is constant, shape (6,).
    tolerance
        Widest bracket of an event, s; 1e-10 of the path's duration if left out. Two crossings less
        than this apart count as a graze.
    threshold
        A smallest distance below this is a graze. Distances are those of `SingularityMeasures`.
    actuators
        Whether speeds and forces of the actuators are checked.
    interference
        Whether pairs of links are checked for interference; left out, where the mechanism has
        collision shapes and all can be read. See `ClosedLoopModel.interference`.
    clearance
        Least distance of two links, m.
    ignore
        Pairs of links, by name, that may overlap: ``[("arm", "cover")]``; those of the description
        need not be named.
    least_steps, max_step
        How dense the path is sampled: at least so many steps, each of at most so much of every
        coordinate over the characteristic length. See the module's text for what that guarantees.

    Returns
    -------
    PathCheck
        Its events have the task's coordinates as poses.

    Raises
    ------
    InputError
        If a number is out of its range, or the trajectory's samples are not finite and of the
        task's coordinates; if interference is asked for, and there are no collision shapes, or one
        cannot be read.
    ClosureError, SingularityError
        If the first pose cannot be reached.
    MechanismError
        If a cone's frame or a link is unknown, or a task of joints is to carry a load.
    """
    threshold = positive_number(threshold, "threshold")
    least = non_negative_number(clearance, "clearance", "m")
    loads = Loads(task, payload, wrench)
    if loads.wrench is not None and loads.wrench.ndim != 1:
        raise InputError(f"wrench has shape {loads.wrench.shape}; along a path it must be (6,)")
    path = TaskSignals(task, trajectory, tolerance, cones=cones, loads=loads, actuators=actuators)
    steps = whole_number(least_steps, "least_steps")
    times = sample_times(path, steps, positive_number(max_step, "max_step"))
    times = path.follow(times, near)
    links = path_interference(path, interference, least, ignore)
    found = with_end(check_signals(path, times, threshold), path)
    return found._replace(interference=links)


def with_end(found: PathCheck, path: TaskSignals) -> PathCheck:
    """Return a check with the event of where the assembly mode ends, if it does."""
    end = path.end
    if end is None:
        return found
    last = end.time - end.width

    def same(kind: str, time: float) -> bool:
        return kind == end.singularity and time >= last

    kept = [e for e in found.singularities if not same(e.singularity, e.time)]
    nearest = found.minimum_distance, found.minimum_singularity, found.minimum_time
    pose = found.minimum_pose
    if end.distance <= nearest[0] or same(nearest[1], nearest[2]):
        nearest, pose = (end.distance, end.singularity, end.time), end.pose
    distance, kind, time = nearest
    return found._replace(
        singularities=(*kept, end),
        minimum_distance=float(np.abs(distance)),
        minimum_singularity=kind,
        minimum_time=time,
        minimum_pose=pose,
    )
