"""The largest box, ball and cylinder inside a workspace over three axes.

All lie within the cells of the grid whose eight corners are inside: what `boundary` encloses. So
they hold as far as the grid tells, and a finer grid finds larger ones. A point of the grid is free
if all cells around it are inside. A ball about a free point lies within such cells if it is no
larger than the distance to the nearest point that is not free: the point of a cell that is nearest
to a grid point is one of its corners.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.boundary import refuse_not_three
from rps_pin.task.workspace.result import Region
from rps_pin.task.workspace.volume import cells, refuse_slices

#: By how much the steps of an axis may differ, relative to them, and count as equal.
_EQUAL = 1e-6


class InscribedBox(NamedTuple):
    """A box along the axes."""

    lower: Array
    """Least values of the axes, m and rad, shape (3,)."""
    upper: Array
    """Greatest."""
    volume: float
    """In the product of the axes' units."""


class InscribedBall(NamedTuple):
    """A ball."""

    centre: Array
    """Shape (3,), m or rad."""
    radius: float
    volume: float


class InscribedCylinder(NamedTuple):
    """A cylinder along one of the axes."""

    axis: str
    """Name of that axis."""
    centre: Array
    """Of the two others, in the grid's order, shape (2,), m or rad."""
    radius: float
    lower: float
    """Where it begins along its axis, m or rad."""
    upper: float
    volume: float


@refuses_other_kinds
def largest_box(workspace: Region) -> InscribedBox:
    """Return the box along the axes of the largest volume.

    It takes the product of the number of points and of those of a layer: seconds for 60 an axis.

    Raises
    ------
    InputError
        If the grid has not three axes, or no cell is inside.
    """
    cell = _cells(workspace)
    first, second, third = workspace.grid.axes
    best, ends = 0.0, ((0, 0), (0, 0), (0, 0))
    for i in range(cell.shape[0]):
        slabs = np.logical_and.accumulate(cell[i:], axis=0)  # from layer i to each
        heights = first[i + 1 :] - first[i]
        for j in range(cell.shape[1]):
            if (heights[-1] * (second[-1] - second[j])) * (third[-1] - third[0]) <= best:
                break
            rows = np.logical_and.accumulate(slabs[:, j:], axis=1)
            run = _run_lengths(rows, third)
            volumes = run.max(axis=-1) * heights[:, None] * (second[j + 1 :] - second[j])
            k, m = np.unravel_index(int(np.argmax(volumes)), volumes.shape)
            if volumes[k, m] > best:
                best, last = float(volumes[k, m]), int(np.argmax(run[k, m]))
                start = int(np.searchsorted(third, third[last + 1] - run[k, m, last] * (1 + 1e-12)))
                ends = (i, i + int(k) + 1), (j, j + int(m) + 1), (start, last + 1)
    lower, upper = (
        np.array([axis[end[side]] for axis, end in zip(workspace.grid.axes, ends, strict=True)])
        for side in (0, 1)
    )
    return InscribedBox(lower, upper, best)


@refuses_other_kinds
def largest_ball(workspace: Region) -> InscribedBall:
    """Return the largest ball about a point of the grid.

    Raises
    ------
    InputError
        If the grid has not three axes of one unit and equal steps each, or no point has all cells
        around it inside.
    """
    grid = workspace.grid
    cell = _cells(workspace)
    _refuse_units(grid.units, grid.over)
    distance = _depths(cell, [_step(axis, n) for axis, n in zip(grid.axes, grid.over, strict=True)])
    at = np.unravel_index(int(np.argmax(distance)), distance.shape)
    radius = float(distance[at])
    _refuse_none(radius)
    centre = np.array([axis[i] for axis, i in zip(grid.axes, at, strict=True)])
    return InscribedBall(centre, radius, 4 / 3 * math.pi * radius**3)


@refuses_other_kinds
def largest_cylinder(workspace: Region, axis: str | None = None) -> InscribedCylinder:
    """Return the cylinder along one axis of the largest volume, about a line of the grid.

    Parameters
    ----------
    workspace
        Over three axes.
    axis
        Name of the cylinder's axis; the grid's last if left out.

    Raises
    ------
    InputError
        If there is no such axis, the two others have not one unit and equal steps each, or no point
        has all cells around it inside.
    """
    grid = workspace.grid
    cell = _cells(workspace)
    along = grid.axis(grid.over[-1] if axis is None else axis)
    others = [k for k in range(3) if k != along]
    _refuse_units([grid.units[k] for k in others], [grid.over[k] for k in others])
    steps = [_step(grid.axes[k], grid.over[k]) for k in others]
    layers, heights = np.moveaxis(cell, along, 0), grid.axes[along]
    best = InscribedCylinder(grid.over[along], np.zeros(2), 0.0, 0.0, 0.0, 0.0)
    for i in range(len(layers)):
        for k, layer in enumerate(np.logical_and.accumulate(layers[i:], axis=0), start=i + 1):
            if not layer.any():
                break
            depth = _depths(layer, steps)
            radius, height = float(depth.max()), float(heights[k] - heights[i])
            volume = math.pi * radius**2 * height
            if volume > best.volume:
                at = np.unravel_index(int(np.argmax(depth)), depth.shape)
                centre = np.array([grid.axes[n][p] for n, p in zip(others, at, strict=True)])
                ends = float(heights[i]), float(heights[k])
                best = InscribedCylinder(grid.over[along], centre, radius, *ends, volume)
    _refuse_none(best.radius)
    return best


# Parts --------------------------------------------------------------------------------------------


def _cells(workspace: Region) -> Bools:
    """Return which cells have all corners inside; at least one."""
    refuse_not_three(workspace.grid.over)
    refuse_slices(workspace.grid.shape)
    found = cells(workspace.inside)
    if not found.any():
        raise InputError("no cell of the grid is inside the workspace: nothing fits into it")
    return found


def _run_lengths(inside: Bools, axis: Array) -> Array:
    """Return for each cell of the last axis how long the run of cells inside is that ends there."""
    number = np.arange(inside.shape[-1])
    outside = np.maximum.accumulate(np.where(inside, -1, number), axis=-1)
    return np.where(inside, axis[1:] - axis[outside + 1], 0.0)


def _depths(cell: Bools, steps: list[float]) -> Array:
    """Return the distance of each grid point to the nearest that is not free, zero at these."""
    return np.asarray(distance_transform_edt(cells(np.pad(cell, 1)), sampling=steps))


def _step(axis: Array, name: str) -> float:
    steps = np.diff(axis)
    if steps.max() - steps.min() > _EQUAL * steps.max():
        raise InputError(
            f"the steps of axis {name} are from {steps.min():.6g} to {steps.max():.6g}; they must "
            "be equal"
        )
    return float(steps.min())


def _refuse_units(units: list[str] | tuple[str, ...], names: list[str] | tuple[str, ...]) -> None:
    if len(set(units)) > 1:
        named = ", ".join(f"{name} in {unit}" for name, unit in zip(names, units, strict=True))
        raise InputError(f"a radius needs axes of one unit; there are {named}")


def _refuse_none(radius: float) -> None:
    if not radius > 0:
        raise InputError("no point of the grid has all cells around it inside: take a finer grid")
