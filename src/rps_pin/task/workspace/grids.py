"""Regular grids in some coordinates of a task, the others held."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.bounds import POINTS, check_size
from rps_pin.closed_loop.constraints.rotation_vector import MOST_TURN
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.validation import finite_number, real_array

#: Axes of a grid.
FEWEST_AXES, MOST_AXES = 2, 6


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class TaskGrid:
    """Every combination of the values of some coordinates of a task; see `task_grid`."""

    coordinates: tuple[str, ...]
    """All coordinates of the task."""
    angular: tuple[bool, ...]
    """Which of them are angles."""
    over: tuple[str, ...]
    """The coordinates that vary: the axes of the grid, in its own order."""
    axes: tuple[Array, ...]
    """Their values, increasing, m or rad, shape (n,) each."""
    at: Array
    """Values of the others, m or rad, shape (m,), in the task's order; NaN where they are not
    decided yet, and where a coordinate varies."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(len(axis) for axis in self.axes)

    @property
    def size(self) -> int:
        """Points in all."""
        return math.prod(self.shape)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the axes, m or rad."""
        return tuple("rad" if self.angular[i] else "m" for i in self.columns)

    @property
    def columns(self) -> tuple[int, ...]:
        """Where the axes are among the task's coordinates."""
        return tuple(self.coordinates.index(name) for name in self.over)

    @property
    def held(self) -> dict[str, float]:
        """Values of the coordinates that are held, as far as they are decided, m or rad."""
        named = zip(self.coordinates, self.at, strict=True)
        return {name: float(value) for name, value in named if np.isfinite(value)}

    def holding(self, x: Array) -> TaskGrid:
        """Return the grid with undecided coordinates held at those of x, shape (m,)."""
        at = np.where(np.isfinite(self.at), self.at, x)
        at[list(self.columns)] = np.nan
        return replace(self, at=at)

    def points(self, index: ArrayLike | None = None) -> Array:
        """Return task coordinates of the grid's points.

        Parameters
        ----------
        index
            Flat indices of points, shape (n,); of all points if left out.

        Returns
        -------
        array
            Shape (n, m), or (n_1, n_2, ..., m) of all points.
        """
        flat = np.arange(self.size) if index is None else np.asarray(index, dtype=np.intp)
        found = np.empty((*flat.shape, len(self.coordinates)))
        found[:] = self.at
        parts = np.unravel_index(flat, self.shape)
        for column, axis, part in zip(self.columns, self.axes, parts, strict=True):
            found[..., column] = axis[part]
        return found if index is not None else found.reshape(*self.shape, -1)

    def axis(self, name: str) -> int:
        """Return the number of an axis.

        Raises
        ------
        InputError
            If the coordinate is not one of the axes.
        """
        if name not in self.over:
            raise InputError(f"no axis {shown(name)}; the grid's are: {', '.join(self.over)}")
        return self.over.index(name)

    def without(self, name: str, number: int) -> TaskGrid:
        """Return the slice in which an axis is held at one of its values, by that one's number."""
        k, at = self.axis(name), self.at.copy()
        at[self.columns[k]] = self.axes[k][number]
        over, axes = (*self.over[:k], *self.over[k + 1 :]), (*self.axes[:k], *self.axes[k + 1 :])
        return replace(self, over=over, axes=axes, at=at)

    def nearest(self, name: str, value: float) -> int:
        """Return the number of the value of an axis that is nearest to one, m or rad.

        Raises
        ------
        InputError
            If there is no such axis, or the value lies beyond its ends.
        """
        k = self.axis(name)
        return nearest_value(self.axes[k], value, f"axis {name}")


@refuses_other_kinds
def task_grid(
    task: Task,
    over: Mapping[str, ArrayLike],
    held: Mapping[str, float] | None = None,
) -> TaskGrid:
    """Return a grid in two to six coordinates of a task.

    Parameters
    ----------
    task
        The task.
    over
        Values of the coordinates that vary, by name: ``{"x": np.linspace(-0.2, 0.2, 41), ...}``;
        m or rad, shape (n,) each, increasing. Their order is that of the grid's axes.
    held
        Values of others, m or rad. Those that are named in neither are held where the start of the
        workspace has them, which is home unless another start is given.

    Raises
    ------
    InputError
        If a coordinate is unknown or named in both; if there are fewer than two axes or more than
        six; if an axis is empty, too long, not finite or not increasing; if rotation vectors would
        be a whole turn long.
    """
    names = task.coordinates
    held = {} if held is None else held
    for name in (*over, *held):
        if name not in names:
            raise InputError(f"no coordinate {shown(name)}; the task has: {', '.join(names)}")
    if both := set(over) & set(held):
        raise InputError(f"coordinate {sorted(both)[0]} is both varied and held")
    if not FEWEST_AXES <= len(over) <= MOST_AXES:
        raise InputError(
            f"a grid over {len(over)} coordinates; it takes {FEWEST_AXES} to {MOST_AXES} of the "
            f"task's: {', '.join(names)}"
        )
    axes = tuple(checked_axis(values, name) for name, values in over.items())
    for name, axis in zip(over, axes, strict=True):
        check_size(len(axis), POINTS, f"{len(axis)} points of axis {name}")
    at = np.full(len(names), np.nan)
    for name, value in held.items():
        at[names.index(name)] = finite_number(value, f"held {name}")
    grid = TaskGrid(names, task.angular, tuple(over), axes, at)
    farthest = np.where(np.isfinite(at), np.abs(at), 0.0)
    farthest[list(grid.columns)] = [max(abs(axis[0]), abs(axis[-1])) for axis in axes]
    turn = float(np.linalg.norm(farthest[list(task.angular)]))
    if task.frame is not None and turn > MOST_TURN:
        raise InputError(
            f"the grid holds rotation vectors of {turn:.4g} rad; at most {MOST_TURN:.4g} is "
            "possible: a rotation vector of a whole turn has no rates"
        )
    return grid


def checked_axis(values: ArrayLike, name: str) -> Array:
    """Return the values of an axis, shape (n,); a single number makes an axis of one.

    Raises
    ------
    InputError
        If it is empty, not finite or not increasing.
    """
    axis = np.atleast_1d(real_array(values, name))
    if axis.ndim != 1 or not len(axis):
        raise InputError(f"{name} has shape {axis.shape}; it must be (n,) with n at least 1")
    if not (np.diff(axis) > 0).all():
        raise InputError(f"{name} must increase from value to value")
    return axis


def nearest_value(values: Array, value: float, name: str) -> int:
    """Return the number of the value nearest to one that lies between the ends.

    Raises
    ------
    InputError
        If it lies beyond the ends.
    """
    if not values[0] <= value <= values[-1]:
        raise InputError(
            f"{name} has values from {values[0]:.6g} to {values[-1]:.6g}, not {value:.6g}"
        )
    return int(np.argmin(np.abs(values - value)))


def shares(axis: Array) -> Array:
    """Return how much of an axis belongs to each of its values, shape (n,): the trapezoidal rule's.

    Half the way to each neighbour.
    """
    return np.asarray((np.diff(axis, prepend=axis[0]) + np.diff(axis, append=axis[-1])) / 2)
