"""The start of what follows an assembly mode: where it is, and in which configuration."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError, shown
from rps_pin.task.engine import PinocchioEngine
from rps_pin.task.task import Task
from rps_pin.validation import numbers


def started(task: Task, start: ArrayLike) -> tuple[Array, Array]:
    """Return a start's task coordinates (m,) and closed configuration (nq,).

    Parameters
    ----------
    task
        The task.
    start
        Task coordinates (m,), followed straight from home, or a closed configuration (nq,).

    Raises
    ------
    InputError
        If it is neither.
    ClosureError, UnreachableError
        If it cannot be reached from home, or its loops are open.
    """
    m, nq = task.size, task.mechanism.model.nq
    given = numbers(start, "start", f"{m} task coordinates, or a configuration of {nq} numbers")
    if given.shape not in ((m,), (nq,)) or not np.isfinite(given).all():
        raise InputError(
            f"start = {shown(start)}: it must be {m} finite task coordinates "
            f"({', '.join(task.coordinates)}), or a configuration of {nq} numbers"
        )
    try:
        if given.shape == (m,):
            return given, task.configuration(given, within_limits=False)
        q = PinocchioEngine(task.mechanism).closed(given)
        return task.at(q), q
    except RPSPinError as error:
        error.args = (f"the start: {error}", *error.args[1:])
        raise
