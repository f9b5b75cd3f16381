"""Positions at which all, or any, of a set of orientations are in the workspace.

An orientation is a set of values of coordinates that the grid holds. For each, the workspace of the
grid is computed with these held, from the same start, in its assembly mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError, RPSPinError, UnreachableError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.task.workspace.compute import workspace
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.task.workspace.result import Region
from rps_pin.validation import choice, real_array

Rule = Literal["all", "any"]


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class OrientationWorkspace(Region):
    """How many of a set of orientations are inside at each point of a grid of positions."""

    grid: TaskGrid
    """The positions; the coordinates of the orientations are not decided in it."""
    orientations: dict[str, Array]
    """Values of each coordinate of the k orientations, rad (or m), shape (k,)."""
    rule: Rule
    """Whether all orientations must be inside, or any."""
    count: Indices
    """How many orientations are inside, of the grid's shape."""

    @property
    def inside(self) -> Bools:
        """Whether all, or any, of the orientations are inside."""
        number = len(next(iter(self.orientations.values())))
        return np.asarray(self.count == number if self.rule == "all" else self.count > 0)


@refuses_other_kinds
def orientation_workspace(
    task: Task,
    grid: TaskGrid,
    orientations: Mapping[str, ArrayLike],
    rule: Rule = "all",
    **options: Any,
) -> OrientationWorkspace:
    """Return the positions at which all, or any, of a set of orientations are inside.

    An orientation in which the grid's point nearest to the start is not reached is inside nowhere.

    Parameters
    ----------
    task
        The task.
    grid
        The positions.
    orientations
        Values of coordinates that the grid neither varies nor holds, by name, shape (k,) each: one
        of each is an orientation: ``{"rx": [0, 0.1, -0.1], "ry": [0, 0, 0]}``.
    rule
        ``"all"``: the positions with every orientation; ``"any"``: those with at least one.
    **options
        Those of `workspace`.

    Raises
    ------
    InputError
        If a coordinate is unknown or not free, there are no orientations, or not as many of each;
        and as `workspace`.
    """
    choice(rule, "rule", ("all", "any"))
    if not orientations:
        raise InputError("orientations is empty; an example: {'rx': [0.0, 0.1]}")
    values = {name: np.atleast_1d(real_array(one, name)) for name, one in orientations.items()}
    for name, one in values.items():
        if name not in task.coordinates or name in grid.over or name in grid.held:
            free = [n for n in task.coordinates if n not in grid.over and n not in grid.held]
            raise InputError(
                f"orientations: no free coordinate {shown(name)}; there are: {', '.join(free)}"
            )
        if one.ndim != 1 or not len(one):
            raise InputError(f"{name} has shape {one.shape}; it must be (k,) with k at least 1")
    if len({len(one) for one in values.values()}) > 1:
        sizes = ", ".join(f"{len(one)} of {name}" for name, one in values.items())
        raise InputError(f"as many values of each coordinate are needed, not {sizes}")
    count = np.zeros(grid.shape, dtype=np.intp)
    for orientation in zip(*values.values(), strict=True):
        x = np.full(len(task.coordinates), np.nan)
        for name, value in zip(values, orientation, strict=True):
            x[task.coordinates.index(name)] = value
        try:
            found = workspace(task, grid.holding(x), **options)
        except UnreachableError:
            continue
        except RPSPinError as error:
            named = zip(values, orientation, strict=True)
            told = ", ".join(f"{name} = {value:.6g}" for name, value in named)
            error.args = (f"orientation {told}: {error}", *error.args[1:])
            raise
        count += found.inside
    return OrientationWorkspace(grid, values, rule, count)
