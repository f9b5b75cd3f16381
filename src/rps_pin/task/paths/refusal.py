"""Errors of paths that a task cannot follow: raised before any force is computed, say where."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from rps_pin.errors import SingularityError, UnreachableError
from rps_pin.task.path_check import check_path
from rps_pin.task.paths.events import PathCheck, SingularityEvent
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory


def require_clear(
    task: Task, trajectory: Trajectory, near: ArrayLike | None = None, least_steps: int = 250
) -> PathCheck:
    """Return what `check_path` found of a trajectory that the task can follow.

    One that only grazes a singularity passes: it has forces, however large. So does one that is
    too fast or needs too large a force: that is what sizing is to tell.

    Raises
    ------
    UnreachableError
        If it leaves a limit of a joint's position: says when, and which.
    SingularityError
        If it crosses a singularity or stays in one, or the assembly mode ends: says when and where.
        The error is that of what comes first.
    """
    found = check_path(
        task,
        trajectory,
        near=near,
        least_steps=least_steps,
        actuators=False,
        interference=False,
    )
    outside = [event for event in found.limits if event.kind != "returns"]
    singular = [event for event in found.singularities if event.kind != "grazes"]
    if outside and not (singular and singular[0].time < outside[0].time):
        more = f"; limits are left {len(outside)} times in all" if outside[1:] else ""
        raise UnreachableError(f"the trajectory cannot be followed: at {outside[0]}{more}")
    if singular:
        again = ", ".join(f"{event.time:.6g} s" for event in singular[1:])
        raise SingularityError(
            f"the trajectory cannot be followed: at {singular[0]}{_reason(singular[0])}"
            f"{f'; again at {again}' if again else ''}",
            math.inf,
            task.mechanism.max_condition,
        )
    return found


def _reason(event: SingularityEvent) -> str:
    return "" if event.kind == "ends" else "; no actuator forces carry the mechanism through it"
