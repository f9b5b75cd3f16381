"""Poses at which tolerances are looked at: arrays, motions, grids and workspaces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError, UnreachableError
from rps_pin.plain_text import short
from rps_pin.task.task import Task
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.validation import numbers

#: Poses of a motion.
SAMPLES = 101
#: Poses up to which building code takes longer than the Pinocchio engine does.
_FEW = 300


class Poses(NamedTuple):
    """Task coordinates and configurations of poses."""

    x: Array
    """Shape (n, m), m or rad."""
    q: Array
    """Shape (n, nq)."""
    grid: TaskGrid | None
    """The grid whose points they are, if they are some."""
    points: Indices
    """Of a grid: flat indices of its points, shape (n,)."""


def poses_of(task: Task, given: Any) -> Poses:
    """Return the poses of what is given, each in the assembly mode of home.

    Parameters
    ----------
    task
        The task.
    given
        Task coordinates (n, m) or (m,); a `Trajectory`, of which `SAMPLES` poses evenly spaced in
        time are taken; a `TaskGrid`, all points of it; a `TaskWorkspace`, its points inside. None:
        the mechanism's home.

    Raises
    ------
    InputError
        If there is no pose, or coordinates have another shape.
    UnreachableError
        If a pose is not reached from home; of grids and workspaces, if none is.
    """
    grid, points = None, np.zeros(0, dtype=np.intp)
    if given is None:
        x = task.home[None]
    elif hasattr(given, "sample"):
        x = np.asarray(given.sample(np.linspace(0.0, given.duration, SAMPLES)).pose)
    elif isinstance(given, (TaskGrid, TaskWorkspace)):
        inside = given.inside if isinstance(given, TaskWorkspace) else None
        grid = (given if isinstance(given, TaskGrid) else given.grid).holding(task.home)
        if grid.coordinates != task.coordinates:
            raise InputError(
                f"the grid is of {', '.join(grid.coordinates)}, the task has "
                f"{', '.join(task.coordinates)}"
            )
        points = np.arange(grid.size) if inside is None else np.flatnonzero(inside)
        x = grid.points(points)
    else:
        x = np.atleast_2d(numbers(given, "poses", f"numbers of shape (n, {task.size})"))
        if x.ndim != 2 or x.shape[1] != task.size:
            raise InputError(f"poses have shape {np.shape(given)}; expected (n, {task.size})")
    if not len(x):
        raise InputError("there are no poses")
    if len(x) > _FEW and not task.compiled:
        task = Task(task.mechanism, **task.options).compile()
    q, reached = _configurations(task, x)
    if grid is None and not reached.all():
        k = int(np.argmin(reached))
        raise UnreachableError(
            f"pose {k} ({', '.join(map(short, x[k]))}) is not reached from home, and "
            f"{np.count_nonzero(~reached) - 1} others are not"
        )
    if not reached.any():
        raise UnreachableError("no point of the grid is reached from home")
    return Poses(x[reached], q[reached], grid, points[reached] if grid is not None else points)


def _configurations(task: Task, x: Array) -> tuple[Array, Bools]:
    """Return configurations straight from home, or else from the nearest pose that is reached."""
    options: Any = {"within_limits": False, "errors": "mask"}
    q = np.asarray(task.configuration(x, **options))
    reached: Bools = np.asarray(np.isfinite(q).all(axis=-1))
    left = np.flatnonzero(~reached)
    scale = task.scale
    while left.size and reached.any():
        done = np.flatnonzero(reached)
        away = np.linalg.norm((x[left, None] - x[None, done]) * scale, axis=-1)
        near = done[np.argmin(away, axis=1)]
        found = np.asarray(task.configuration(x[left], q[near], **options))
        good = np.isfinite(found).all(axis=1)
        if not good.any():
            break
        q[left[good]], reached[left[good]] = found[good], True
        left = left[~good]
    return q, reached
