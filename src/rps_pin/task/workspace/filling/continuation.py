"""Configurations continued from others in batches, in their assembly mode.

A way is the straight line of the task's coordinates from those of a closed configuration to others.
The Pinocchio engine follows it in steps of its own (`ClosedLoopModel.complete`). Generated code
divides it into up to 64 parts, in each of which the assembly mode is kept
(`CompiledMechanism.continued`). Where it fails, 31/32 of the rest of the way are tried, and then
what is left; the way is given up where these 31/32 fail. So a goal just before a singularity is
reached, down to 1e-7 of the way, and one beyond it costs two failures, some 40 us. A way that
passes a singularity within about a hundredth of its length can be given up too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.task.task import Task

#: What is left of the rest of a way in the next try; and the least rest of a way.
_LEFT, _LEAST = 1 / 32, 1e-7


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
    whole, engine = task.joined(q, start), task.engines[0]
    found, reached = engine.continued(goal, whole)
    if task.compiled and not reached.all():
        left = np.flatnonzero(~reached)
        found[left], reached[left] = _in_pieces(engine, whole[left], start[left], goal[left])
    return found[:, : q.shape[1]], reached


def _in_pieces(engine: Any, q: Array, start: Array, goal: Array) -> tuple[Array, Bools]:
    """Return configurations of the extended mechanism at goals, and which are reached."""
    rest = np.ones(len(q))
    active = np.arange(len(q))
    while active.size:
        way = goal[active] - start[active]
        most = goal[active] - (_LEFT * rest[active])[:, None] * way
        moved, ok = engine.continued(most, q[active])
        active = active[ok]
        q[active] = moved[ok]
        rest[active] *= _LEFT
        moved, ok = engine.continued(goal[active], q[active])
        q[active[ok]] = moved[ok]
        rest[active[ok]] = 0.0
        active = active[~ok & (rest[active] > _LEAST)]
    return q, rest == 0
