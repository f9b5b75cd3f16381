"""Maps of a task's workspace: conditioning inside, and outside what puts a point out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError
from rps_pin.plots.style import COLOUR_MAP, COLUMN, PAGE, PrintFigure, figure_of, styled
from rps_pin.task.workspace.boundary import refuse_not_three
from rps_pin.task.workspace.reasons import INTERFERENCE, SINGULAR, UNREACHABLE
from rps_pin.task.workspace.result import TaskWorkspace

#: Slices of a workspace over three axes.
_SLICES = 3
#: Heights of a map's figure, inches.
_LOW, _HIGH = 1.7, 3.2


class _Family(NamedTuple):
    """Reasons that a map shows alike."""

    name: str
    colour: str
    hatch: str


#: From what is told first to what is told last, where a point has several reasons.
_FAMILIES = (
    _Family("end of the mode", "#e8e8e8", ""),
    _Family("singular", "#b9b9b9", "xxxx"),
    _Family("actuator below limit", "#f6dfb0", "...."),
    _Family("actuator above limit", "#f3c6a5", "////"),
    _Family("other joint or cone", "#e3c8dc", "\\\\\\\\"),
    _Family("links interfere", "#f2a9a0", "++++"),
    _Family("actuator's force", "#c5d9ee", "----"),
    _Family("actuator's speed", "#cfe5cf", "||||"),
)
#: Families of the reasons that limits of actuators are, by words in them.
_OF_ACTUATORS = {" force beyond ": 7, " speed beyond ": 8, " below ": 3, " above ": 4}


@styled
def plot_map(workspace: TaskWorkspace, axes: Axes | None = None) -> Figure:
    """Draw a workspace over two axes: its conditioning, and why other points are out.

    Parameters
    ----------
    workspace
        Over two axes: one of them, or a slice (`TaskWorkspace.plane`).
    axes
        To draw on; default: those of a new figure.

    Raises
    ------
    InputError
        If it has another number of axes, or one of them has a single value.
    """
    _refuse_no_map(workspace)
    axes = axes or PrintFigure(_height(workspace)).add_subplot()
    drawn = _draw(axes, workspace, _largest([workspace]))
    figure = figure_of(axes)
    figure.colorbar(drawn, ax=axes, label="conditioning (0 singular, 1 best)", shrink=0.9)
    _legend(figure, [workspace], 2)
    return figure


@styled
def plot_slices(
    workspace: TaskWorkspace, along: str | None = None, figure: Figure | None = None
) -> Figure:
    """Draw three slices of a workspace over three axes.

    They are at the middles of three equal parts of what is inside along one of the axes.

    Parameters
    ----------
    workspace
        Over three axes.
    along
        Name of the axis; the last if left out.
    figure
        To draw on; default: a new one.

    Raises
    ------
    InputError
        If it has another number of axes or no point inside, or there is no such axis.
    """
    refuse_not_three(workspace.grid.over)
    name = workspace.grid.over[-1] if along is None else along
    k = workspace.grid.axis(name)
    if not workspace.inside.any():
        raise InputError("no point of the grid is inside the workspace")
    low, high = workspace.extents()[name]
    places = low + (high - low) * (np.arange(_SLICES) + 0.5) / _SLICES
    planes = [workspace.plane(name, float(place)) for place in places]
    _refuse_no_map(planes[0])
    figure = figure or Figure(figsize=(PAGE, 2.6), layout="constrained")
    panels = figure.subplots(1, _SLICES, sharey=True)
    for panel, plane in zip(panels, planes, strict=True):
        drawn = _draw(panel, plane, _largest(planes))
        scale, unit = _scale(workspace.grid.units[k])
        panel.set_title(f"{name} = {scale * plane.grid.held[name]:.4g} {unit}")
    figure.colorbar(drawn, ax=list(panels), label="conditioning (0 singular)", shrink=0.9)
    _legend(figure, planes, 3)
    return figure


def _draw(axes: Axes, workspace: TaskWorkspace, most: float) -> Any:
    """Draw a map, and return its coloured part."""
    first, second = workspace.grid.axes
    scales = [_scale(unit) for unit in workspace.grid.units]
    x, y = (scale * axis for (scale, _), axis in zip(scales, (first, second), strict=True))
    family, edges = _families(workspace).T, (_edges(x), _edges(y))
    picture = np.zeros((*family.shape, 4))
    for number, one in enumerate(_FAMILIES, start=1):
        picture[family == number] = to_rgba(one.colour)
    axes.pcolormesh(*edges, picture)
    inside = np.ma.masked_where(~workspace.inside.T, workspace.conditioning.T)
    drawn = axes.pcolormesh(*edges, inside, cmap=COLOUR_MAP, vmin=0.0, vmax=most)
    for number in np.unique(family[family > 0]):
        if _FAMILIES[number - 1].hatch:
            _hatch(axes, (x, y), family == number, _FAMILIES[number - 1].hatch)
    axes.grid(visible=False)
    labels = [
        f"{name} ({unit})" for name, (_, unit) in zip(workspace.grid.over, scales, strict=True)
    ]
    axes.set(xlabel=labels[0], ylabel=labels[1])
    if len(set(workspace.grid.units)) == 1:
        axes.set_aspect("equal", adjustable="box")
    return drawn


def _hatch(axes: Axes, at: tuple[Array, Array], where: Array, hatch: str) -> None:
    if min(where.shape) < 2:
        return
    look: Any = {"levels": [0.5, 1.5], "colors": "none", "hatches": [hatch]}
    filled = axes.contourf(*at, where.astype(np.float64), **look)
    filled.set_edgecolor("#00000055")
    filled.set_linewidth(0.0)


def _families(workspace: TaskWorkspace) -> Indices:
    """Return the number of the family of each point's first reason, 0 inside."""
    actuators = tuple(f"{name} " for name in workspace.actuated)
    found = np.zeros(workspace.reason.shape, dtype=np.intp)
    numbers = {UNREACHABLE: 1, SINGULAR: 2, INTERFERENCE: 6}
    of_reason = []
    for name in workspace.reasons:
        number = numbers.get(name, 5)
        if number == 5 and name.startswith((*actuators, "leg ")):
            number = next(family for word, family in _OF_ACTUATORS.items() if word in name)
        of_reason.append((number, name))
    for number, name in sorted(of_reason, reverse=True):
        found[workspace.mask(name)] = number
    return found


def _legend(figure: Figure, drawn: Sequence[TaskWorkspace], columns: int) -> None:
    there = np.unique(np.concatenate([_families(one).ravel() for one in drawn]))
    entries = [
        Patch(facecolor=one.colour, hatch=one.hatch, edgecolor="#00000055", lw=0, label=one.name)
        for number, one in enumerate(_FAMILIES, start=1)
        if number in there
    ]
    if not entries:
        return
    if isinstance(figure, PrintFigure):
        figure.grow(-(-len(entries) // columns))
    figure.legend(handles=entries, loc="outside upper center", ncols=columns)


def _largest(drawn: Sequence[TaskWorkspace]) -> float:
    """Return the largest conditioning inside, and at least something."""
    return (
        max([float(one.conditioning[one.inside].max(initial=0.0)) for one in drawn], default=0.0)
        or 1.0
    )


def _height(workspace: TaskWorkspace) -> float:
    """Return the height of a figure of a map, inches; the map is two thirds of a column wide."""
    if len(set(workspace.grid.units)) > 1:
        return _HIGH
    wide, high = (axis[-1] - axis[0] for axis in workspace.grid.axes)
    return float(np.clip(COLUMN * 2 / 3 * high / wide + 0.6, _LOW, _HIGH))


def _scale(unit: str) -> tuple[float, str]:
    return (180 / np.pi, "°") if unit == "rad" else (1e3, "mm")


def _edges(values: Array) -> Array:
    """Return the ends of the cells around values, (n + 1,)."""
    middles = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])


def _refuse_no_map(workspace: TaskWorkspace) -> None:
    if len(workspace.grid.over) != 2 or min(workspace.grid.shape) < 2:
        told = ", ".join(workspace.grid.over)
        raise InputError(
            f"a map needs a workspace over two axes of at least 2 values each; this one is over "
            f"{told}, of shape {workspace.grid.shape}: take slices (`plane`)"
        )
