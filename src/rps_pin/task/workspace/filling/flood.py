"""A block of a grid filled in fronts from its seeds: each new point is continued from a neighbour.

The neighbours of a point are those one step along one axis. A front are the points that were
reached at once; each of their neighbours that is not reached yet is tried, along one axis after the
other, all of a front as one batch. So an assembly mode is followed over the grid and never jumped;
what no reached neighbour leads to is beyond its end. Points of the blocks beside it that are
reached from this one are their seeds.

Where a mode's configurations differ with the way to a point (a region that goes round a
singularity), those of the first way count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.task.task import Task
from rps_pin.task.workspace.filling.continuation import continued
from rps_pin.task.workspace.filling.division import Bits, Division, flags_of
from rps_pin.task.workspace.grids import TaskGrid


class Seeds(NamedTuple):
    """Points of a block that are reached, and from which others may be."""

    at: NDArray[np.int32]
    """Flat indices in the block, shape (n,)."""
    q: Array
    """Closed configurations, shape (n, nq)."""


class Work(NamedTuple):
    """What a block is filled from."""

    block: int
    seeds: Seeds
    reached: Bits
    """Which points of the block are reached already, the seeds among them."""
    beside: tuple[Bits | None, ...]
    """Which points next to each face are reached already; none at the end of the grid."""


class Filled(NamedTuple):
    """The points of a block that were reached, its seeds among them."""

    at: NDArray[np.int32]
    """Flat indices in the block, shape (n,)."""
    x: Array
    """Task coordinates, shape (n, m)."""
    q: Array
    """Configurations, shape (n, nq)."""
    beside: tuple[Seeds, ...]
    """Points beyond each face; `at` counts those of the layer there, see `Division.in_layer`."""


def filled(task: Task, grid: TaskGrid, division: Division, work: Work) -> Filled:
    """Return the points of a block that are reached from its seeds.

    Parameters
    ----------
    task
        The task.
    grid
        The grid, with all coordinates decided.
    division
        Its blocks.
    work
        The block, and what is known of it.
    """
    frame = _Frame(grid, division, work)
    at = frame.framed(work.seeds.at)
    front = at, frame.coordinates(at), work.seeds.q
    inside, outside = [front], []
    while len(front[0]):
        found = _next(task, frame, *front)
        own = frame.own[found[0]]
        front = found[0][own], found[1][own], found[2][own]
        inside.append(front)
        outside.append((found[0][~own], found[2][~own]))
    at, x, q = (np.concatenate(part) for part in zip(*inside, strict=True))
    there, others = (np.concatenate(part) for part in zip(*outside, strict=True))
    return Filled(frame.local(at), x, q, frame.beyond(there, others))


def _next(
    task: Task, frame: _Frame, at: Indices, x: Array, q: Array
) -> tuple[Indices, Array, Array]:
    """Return the points that are reached from a front: indices in the frame, x and q."""
    parts: list[tuple[Indices, Array, Array]] = [(at[:0], x[:0], q[:0])]
    for axis, step in enumerate(frame.steps):
        for way in (-step, step):
            tried = np.flatnonzero(~frame.reached[at + way])
            if not tried.size:
                continue
            there, start = at[tried] + way, x[tried]
            goal = frame.moved(start, there, axis)
            found, ok = continued(task, q[tried], start, goal)
            frame.reached[there[ok]] = True
            parts.append((there[ok], goal[ok], found[ok]))
    first, second, third = (np.concatenate(part) for part in zip(*parts, strict=True))
    return first, second, third


class _Frame:
    """A block with one more layer of points around it, which are not tried where there is none."""

    def __init__(self, grid: TaskGrid, division: Division, work: Work) -> None:
        slices = division.slices(work.block)
        self._shape, self._faces = division.shape(work.block), division.faces
        self._wide = tuple(n + 2 for n in self._shape)
        sizes = [int(np.prod(self._wide[k + 1 :], dtype=np.intp)) for k in range(len(slices))]
        #: Steps of the flat index along each axis.
        self.steps = tuple(sizes)
        self._columns, self._at = grid.columns, grid.at
        self._axes = [
            np.pad(axis, 1, mode="edge")[one.start : one.stop + 2]
            for axis, one in zip(grid.axes, slices, strict=True)
        ]
        core = tuple(slice(1, -1) for _ in slices)
        reached, own = np.ones(self._wide, dtype=bool), np.zeros(self._wide, dtype=bool)
        reached[core], own[core] = flags_of(work.reached, self._shape), True
        for (axis, way), bits in zip(self._faces, work.beside, strict=True):
            if bits is not None:
                layer = (*core[:axis], 0 if way < 0 else -1, *core[axis + 1 :])
                reached[layer] = flags_of(bits, reached[layer].shape)
        #: Whether points are reached, or not there; and whether they are the block's, flat.
        self.reached: Bools = reached.reshape(-1)
        self.own: Bools = own.reshape(-1)

    def framed(self, at: NDArray[np.int32]) -> Indices:
        """Return indices in the frame of points of the block."""
        place = np.unravel_index(at.astype(np.intp), self._shape)
        return np.ravel_multi_index(tuple(k + 1 for k in place), self._wide)

    def local(self, at: Indices) -> NDArray[np.int32]:
        """Return indices in the block of its points in the frame."""
        place = np.unravel_index(at, self._wide)
        found = np.ravel_multi_index(tuple(k - 1 for k in place), self._shape)
        return found.astype(np.int32)

    def coordinates(self, at: Indices) -> Array:
        """Return task coordinates (n, m) of points in the frame."""
        x = np.empty((len(at), len(self._at)))
        x[:] = self._at
        for axis in range(len(self._axes)):
            x = self.moved(x, at, axis)
        return x

    def moved(self, x: Array, at: Indices, axis: int) -> Array:
        """Return task coordinates with that of one axis at points in the frame."""
        found = x.copy()
        place = at // self.steps[axis] % self._wide[axis]
        found[:, self._columns[axis]] = self._axes[axis][place]
        return found

    def beyond(self, at: Indices, q: Array) -> tuple[Seeds, ...]:
        """Return the points beyond each face."""
        place = np.stack(np.unravel_index(at, self._wide), axis=-1) - 1
        found = []
        for axis, way in self._faces:
            here = np.flatnonzero(place[:, axis] == (-1 if way < 0 else self._shape[axis]))
            across = np.delete(place[here], axis, axis=1)
            sizes = tuple(np.delete(self._shape, axis))
            flat = np.ravel_multi_index(tuple(across.T), sizes)
            found.append(Seeds(flat.astype(np.int32), q[here]))
        return tuple(found)
