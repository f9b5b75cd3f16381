"""What the parts of a control loop take as a robot: an `RPSRobot`, a `Task`, or a mechanism."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.task import Task
from rps_pin.validation import numbers

#: Anything with a task.
Robot: TypeAlias = RPSRobot | Task | ClosedLoopModel


def task_of(robot: Robot) -> Task:
    """Return the task of a robot.

    Raises
    ------
    InputError
        If it is none of these.
    MechanismError
        If the mechanism has no task.
    """
    if isinstance(robot, Task):
        return robot
    if isinstance(robot, RPSRobot | ClosedLoopModel):
        task: Task = robot.task
        return task
    raise InputError(
        f"robot is a {type(robot).__name__}; it must be an RPSRobot, a Task, or a ClosedLoopModel "
        "that has one"
    )


def force_limits(robot: Robot, given: ArrayLike | None) -> Array:
    """Return the force limit of each actuator, shape (na,), N or N m; infinite for none.

    Parameters
    ----------
    robot
        The robot, whose limits are taken if none are given.
    given
        One number or na.

    Raises
    ------
    InputError
        If a limit is not positive, or there are not as many.
    """
    mechanism = task_of(robot).mechanism
    count = len(mechanism.actuated_indices)
    if given is None and isinstance(robot, RPSRobot):
        given = robot.parameters.actuator_force_limit
    elif given is None:
        given = mechanism.model.effortLimit[mechanism.actuated_indices]
    words = {3: "three"}.get(count, str(count))
    limit = numbers(given, "force_limit", f"positive, one number or {words}")
    if limit.shape not in ((), (count,)) or not (limit > 0).all():
        raise InputError(f"force_limit = {limit.tolist()}: it must be positive, one or {words}")
    return np.broadcast_to(limit, count).copy()
