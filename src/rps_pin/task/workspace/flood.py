"""A grid filled in fronts from one of its points: each new point is continued from a neighbour.

The neighbours of a point are those one step along one axis. A front are the points that were
reached at once; each of their neighbours that is not reached yet is tried, along one axis after the
other, all of a front as one batch. So an assembly mode is followed over the grid and never jumped;
what no reached neighbour leads to is beyond its end. Only a front's configurations are kept.

Where a mode's configurations differ with the way to a point (a region that goes round a
singularity), those of the first way count.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.task.task import Task
from rps_pin.task.workspace.continuation import continued
from rps_pin.task.workspace.grids import TaskGrid


class Front(NamedTuple):
    """Points of a grid that were reached at once."""

    at: Indices
    """Flat indices, shape (n,)."""
    x: Array
    """Task coordinates, shape (n, m)."""
    q: Array
    """Configurations, shape (n, nq)."""


def fronts(task: Task, grid: TaskGrid, first: int, q: Array) -> Iterator[Front]:
    """Give the points of a grid that are reached from one, in fronts.

    Parameters
    ----------
    task
        The task.
    grid
        The grid, with all coordinates decided.
    first
        Flat index of the point to begin at.
    q
        Closed configuration there, shape (nq,).
    """
    index = np.array([first], dtype=np.intp)
    x = grid.points(index)
    reached = np.zeros(grid.size, dtype=bool)
    reached[first] = True
    front = Front(index, x, q[None])
    steps = [int(np.prod(grid.shape[axis + 1 :], dtype=np.intp)) for axis in range(len(grid.shape))]
    while True:
        yield front
        parts: list[tuple[Indices, Array, Array]] = []
        place = np.unravel_index(front.at, grid.shape)
        for axis, step in enumerate(steps):
            for way in (-1, 1):
                there = place[axis] + way
                tried = np.flatnonzero((there >= 0) & (there < grid.shape[axis]))
                tried = tried[~reached[front.at[tried] + way * step]]
                if not tried.size:
                    continue
                index = front.at[tried] + way * step
                x = grid.points(index)
                found, ok = continued(task, front.q[tried], front.x[tried], x)
                reached[index[ok]] = True
                parts.append((index[ok], x[ok], found[ok]))
        if not any(len(index) for index, *_ in parts):
            return
        front = Front(*(np.concatenate(part) for part in zip(*parts, strict=True)))
