"""Regular grids of leg lengths and of poses, on which workspaces are computed."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.bounds import POINTS, check_size
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.task.workspace.grids import checked_axis
from rps_pin.validation import positive_number, real, whole_number

GridKind = Literal["leg lengths", "poses"]

#: Slices of a grid's first and second axes; the third is whole.
Block = tuple[slice, slice]
WHOLE: Block = (slice(None), slice(None))

#: Meaning and unit of each axis.
AXES = {
    "leg lengths": tuple((f"length of leg {leg}", "m") for leg in (1, 2, 3)),
    "poses": (("z", "m"), ("tilt_x", "rad"), ("tilt_y", "rad")),
}


class Grid(NamedTuple):
    """Every combination of three increasing axes."""

    kind: GridKind
    axes: tuple[Array, Array, Array]
    """Leg lengths 1, 2, 3 (m), or z (m), tilt_x and tilt_y (rad); each of shape (n,)."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Points along each axis."""
        first, second, third = self.axes
        return len(first), len(second), len(third)

    @property
    def size(self) -> int:
        """Points in all."""
        return math.prod(self.shape)

    @refuses_other_kinds
    def points(self, block: Block = WHOLE) -> Array:
        """Return the points of a block of the grid, shape (n_1, n_2, n_3, 3)."""
        first, second, third = self.axes
        planes, rows = block
        return np.stack(np.meshgrid(first[planes], second[rows], third, indexing="ij"), axis=-1)

    @refuses_other_kinds
    def blocks(self, points: int) -> list[Block]:
        """Cut the grid into blocks of at most `points` points (or one row), in storage order."""
        planes, rows, columns = self.shape
        thick, wide = max(1, points // (rows * columns)), min(rows, max(1, points // columns))
        return [
            (slice(i, min(i + thick, planes)), slice(j, min(j + wide, rows)))
            for i in range(0, planes, thick)
            for j in range(0, rows, wide)
        ]


@refuses_other_kinds
def leg_grid(
    parameters: RPSParameters,
    points: int | tuple[int, int, int] = 51,
    *,
    step: float | None = None,
    limits: tuple[float, float] | None = None,
) -> Grid:
    """Return the grid of leg lengths of the paper's Section 3.

    Parameters
    ----------
    parameters
        The robot, for the limits of its leg lengths.
    points
        Points per leg, both ends of the stroke among them: 51 are the paper's 1 mm steps over
        50 mm.
    step
        Step instead of `points`, m; it is shrunk, if need be, to divide the stroke into equal
        steps.
    limits
        Shortest and longest leg, m; the robot's own limits if None.

    Raises
    ------
    InputError
        If the grid would be empty, or a limit is infinite, not positive or out of order.
    """
    ends = parameters.leg_length_limits if limits is None else limits
    if np.shape(ends) != (2,):
        raise InputError(f"limits = {ends!r}; they must be two numbers")
    shortest, longest = map(real, ends)
    if not (0 < shortest < longest < math.inf):
        raise InputError(
            f"leg lengths from {shortest:.6g} to {longest:.6g} m make no grid: both ends must be "
            "positive, finite and in order; set leg_length_limits, or give limits"
        )
    if step is not None:
        points = math.ceil((longest - shortest) / positive_number(step, "step", "m") - 1e-9) + 1
    counts = points if isinstance(points, tuple) else (points,) * 3
    if len(counts) != 3:
        raise InputError(f"points = {points!r}; it must be a whole number, or three")
    for count in counts:
        check_size(whole_number(count, "points", least=2), POINTS, f"{count} points of an axis")
    first, second, third = (np.linspace(shortest, longest, count) for count in counts)
    return Grid("leg lengths", (first, second, third))


@refuses_other_kinds
def pose_grid(z: ArrayLike, tilt_x: ArrayLike, tilt_y: ArrayLike | None = None) -> Grid:
    """Return a grid of poses (z, tilt_x, tilt_y).

    Parameters
    ----------
    z
        Heights, m, shape (n,), increasing; a single number makes a slice.
    tilt_x, tilt_y
        Tilts, rad, shape (n,) each, increasing; a single number makes a slice. `tilt_y` is
        `tilt_x` if None.

    Raises
    ------
    InputError
        If an axis is empty, not finite or not increasing.
    """
    first, second = checked_axis(z, "z"), checked_axis(tilt_x, "tilt_x")
    third = second.copy() if tilt_y is None else checked_axis(tilt_y, "tilt_y")
    return Grid("poses", (first, second, third))


def checked_grid(grid: object) -> Grid:
    """Return a grid whose axes are finite and increasing, lengths positive, or refuse it.

    Raises
    ------
    InputError
        If it is no grid, or one of its axes is not such.
    """
    if not isinstance(grid, Grid):
        raise InputError("grid must be a Grid; leg_grid(...) and pose_grid(...) make one")
    if grid.kind not in AXES:
        raise InputError(f"grid.kind = {grid.kind!r}; it must be 'leg lengths' or 'poses'")
    if len(grid.axes) != 3:
        raise InputError(f"a grid has three axes, not {len(grid.axes)}")
    named = zip(grid.axes, AXES[grid.kind], strict=True)
    first, second, third = (checked_axis(axis, name) for axis, (name, _) in named)
    for axis, (name, _) in zip((first, second, third), AXES[grid.kind], strict=True):
        if grid.kind == "leg lengths" and axis[0] <= 0:
            raise InputError(f"{name} begins at {axis[0]:.6g} m; it must be positive")
    return Grid(grid.kind, (first, second, third))
