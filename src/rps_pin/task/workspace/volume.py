"""How large a workspace is, by the points of its grid; with an estimate of the error, and bounds.

The volume is the sum of the shares of the points inside (the trapezoidal rule). Between a point
inside and its neighbour outside the boundary may lie anywhere: with equal chances, the deviation of
its place is the step over sqrt(12). Boundaries between the same two layers of points are taken to
err alike, as the face of a box does; those between others, independently. So the error is on the
safe side, the more so the less of the boundary lies along the axes.

Cells of the grid give bounds: those with all corners inside, and those with any. The bounds hold
for workspaces without parts or holes smaller than a step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.grids import shares
from rps_pin.task.workspace.result import Region


class TaskVolume(NamedTuple):
    """How large a workspace is, in the product of its axes' units."""

    value: float
    error: float
    """An estimate of the standard deviation of `value`."""
    least: float
    """Of the cells of the grid that have all their corners inside."""
    most: float
    """Of the cells that have any corner inside."""
    unit: str
    """m^2 rad, as an example."""
    cut: tuple[str, ...]
    """Ends of the grid that points inside lie on, ``"x below"`` as an example: the workspace may
    go on beyond them."""

    def __str__(self) -> str:
        return (
            f"{self.value:.6g} +- {self.error:.2g} {self.unit} (between {self.least:.6g} and "
            f"{self.most:.6g})"
        )


@refuses_other_kinds
def volume(workspace: Region) -> TaskVolume:
    """Return the volume of a workspace within its grid (an area, of two axes).

    Raises
    ------
    InputError
        If an axis has a single value.
    """
    grid, inside = workspace.grid, workspace.inside
    refuse_slices(grid.shape)
    value = _sum(inside, [shares(axis) for axis in grid.axes])
    cell = [np.diff(axis) for axis in grid.axes]
    least, most = _sum(cells(inside), cell), _sum(~cells(~inside), cell)
    return TaskVolume(
        value, _error(inside, grid.axes), least, most, _unit(grid.units), _cut(workspace)
    )


def cells(inside: Bools) -> Bools:
    """Return which cells of a grid have all corners inside, one fewer along each axis."""
    found = inside
    for axis in range(inside.ndim):
        layer = np.moveaxis(found, axis, 0)
        found = np.moveaxis(layer[:-1] & layer[1:], 0, axis)
    return found


def refuse_slices(shape: tuple[int, ...]) -> None:
    """Raise `InputError` if an axis has a single value."""
    if min(shape) < 2:
        raise InputError(f"the grid has shape {shape}: a volume needs 2 points along each axis")


def _sum(inside: Bools, sizes: list[Array]) -> float:
    """Return the sum over points or cells inside of the products of their sizes along each axis."""
    found = inside.astype(np.float64)
    for size in reversed(sizes):
        found = found @ size
    return float(found)


def _error(inside: Bools, axes: tuple[Array, ...]) -> float:
    variance = 0.0
    for k, axis in enumerate(axes):
        layers = np.moveaxis(inside, k, 0)
        others = [shares(one) for i, one in enumerate(axes) if i != k]
        for first, second in ((layers[:-1], layers[1:]), (layers[1:], layers[:-1])):
            faces = first & ~second
            areas = np.array([_sum(layer, others) for layer in faces])
            variance += float(((np.diff(axis) * areas) ** 2).sum()) / 12
    return float(np.sqrt(variance))


def _unit(units: tuple[str, ...]) -> str:
    parts = []
    for unit in ("m", "rad"):
        power = units.count(unit)
        if power:
            parts.append(unit if power == 1 else f"{unit}^{power}")
    return " ".join(parts)


def _cut(workspace: Region) -> tuple[str, ...]:
    found = []
    for k, name in enumerate(workspace.grid.over):
        layer = np.moveaxis(workspace.inside, k, 0)
        found += [
            f"{name} {side}" for side, end in (("below", 0), ("above", -1)) if layer[end].any()
        ]
    return tuple(found)
