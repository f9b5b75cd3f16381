"""Configurations continued from others in batches, in their assembly mode.

A way is the straight line of the task's coordinates from those of a closed configuration to others.
The Pinocchio engine follows it in steps of its own (`ClosedLoopModel.complete`). Generated code
halves its steps until the assembly mode is kept in each (`CompiledMechanism.continued`), and gives
the way up where a step would be less than 1/64 of what is left of it. So a goal just before a
singularity is reached, down to 1e-7 of the way, and one beyond it costs some microseconds. A way
that passes a singularity within about a hundredth of its length can be given up too.
"""

from __future__ import annotations

from typing import Any

from rps_pin.arrays import Array, Bools
from rps_pin.task.task import Task

#: Ways of a batch that go to the graphics card, if the task has one; fewer are the processor's.
LEAST_ON_CARD = 1024


def continued(task: Task, q: Array, start: Array, goal: Array) -> tuple[Array, Bools]:
    """Return configurations (n, nq) at goals, and which of them are reached in their mode.

    What is returned of the others has no meaning.

    Parameters
    ----------
    task
        The task.
    q, start
        Closed configurations, shape (n, nq), and their task coordinates, (n, m).
    goal
        Task coordinates, shape (n, m).
    """
    engine: Any = task.engines[0]
    if task.card is not None and len(q) >= LEAST_ON_CARD:
        engine = task.card
    found, reached = engine.continued(goal, task.joined(q, start))
    return found[:, : q.shape[1]], reached
