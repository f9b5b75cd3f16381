"""Errors of the pose by tolerances: which number makes them, and where they are large."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from rps_pin.errors import InputError
from rps_pin.plain_text import for_figure
from rps_pin.plots.style import BLUE, COLOUR_MAP, COLUMN, PrintFigure, figure_of, new_axes, styled

if TYPE_CHECKING:
    from rps_pin.task.tolerances import ToleranceAnalysis

#: Bars, at most.
_MOST = 12
#: Largest over smallest error from which a map's colours are logarithmic.
_WIDE = 5.0
#: Of a label beside a bar: the line of all numbers does not cross it; and room to the right for it.
_OVER_LINE = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
_ROOM = 1.25
_UNITS = {"position": "mm", "angle": "mrad"}


@styled
def plot_tolerance_shares(
    analysis: ToleranceAnalysis, part: str | None = None, axes: Axes | None = None
) -> Figure:
    """Draw the error that each number makes alone, the largest first, with its share.

    Bars are three root mean squares over the poses, the line that of all numbers together; the
    share of the variance stands beside the bar. At most twelve bars, then one of all others.

    Parameters
    ----------
    analysis
        Of `rps_pin.task.tolerances.tolerance`.
    part
        ``"position"`` or ``"angle"``; the first there is if left out.
    axes
        To draw on; default: those of a new figure.

    Raises
    ------
    InputError
        If the output has no such part.
    """
    name = analysis.parts[0].name if part is None else part
    sizes, shares = 3e3 * analysis.own(name), 100 * analysis.shares(name)
    order = np.argsort(-shares, kind="stable")
    labels = [for_figure(analysis.labels[k]) for k in order[:_MOST]]
    bars, told = list(sizes[order[:_MOST]]), list(shares[order[:_MOST]])
    if rest := len(order) - _MOST if len(order) > _MOST else 0:
        labels.append(f"{rest} others")
        bars.append(float(np.linalg.norm(sizes[order[_MOST:]])))
        told.append(float(shares[order[_MOST:]].sum()))
    axes = new_axes(axes, 0.8 + 0.17 * len(bars))
    places = np.arange(len(bars))
    axes.barh(places, bars, color=BLUE, height=0.7)
    whole = 3e3 * analysis.rms(name)
    axes.axvline(whole, color="black", ls="--", lw=0.8)
    for place, bar, share in zip(places, bars, told, strict=True):
        axes.annotate(
            f"{share:.2g} %" if share < 99.5 else "100 %",
            (bar, place),
            (3, 0),
            textcoords="offset points",
            va="center",
            bbox=_OVER_LINE,
        )
    label = f"{name}, 3 sigma ({_UNITS[name]})\ndashed: all together"
    axes.set(xlim=(0, _ROOM * max(whole, *bars)), xlabel=label)
    axes.set_yticks(places, labels)
    axes.set_ylabel("number")
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    return figure_of(axes)


@styled
def plot_tolerance_map(
    analysis: ToleranceAnalysis, part: str | None = None, axes: Axes | None = None
) -> Figure:
    """Draw the error of the pose over a workspace: three root mean squares at each point.

    Parameters
    ----------
    analysis
        Of `rps_pin.task.tolerances.tolerance`, at the points of a grid or workspace over two axes.
    part, axes
        As for `plot_tolerance_shares`.

    Raises
    ------
    InputError
        If its poses are not those of a grid over two axes of at least two values each.
    """
    grid = analysis.poses.grid
    if grid is None or len(grid.over) != 2 or min(grid.shape) < 2:
        raise InputError(
            "a map needs the poses of a grid, or workspace, over two axes of two values or more"
        )
    name = analysis.parts[0].name if part is None else part
    values = np.full(grid.size, np.nan)
    values[analysis.poses.points] = 3e3 * analysis.size(name)
    shown = np.ma.masked_invalid(values.reshape(grid.shape).T)
    scales = [(math.degrees(1), "°") if unit == "rad" else (1e3, "mm") for unit in grid.units]
    x, y = (scale * axis for (scale, _), axis in zip(scales, grid.axes, strict=True))
    same = len(set(grid.units)) == 1
    height = COLUMN * 2 / 3 * np.ptp(y) / np.ptp(x) + 0.6 if same else 3.2
    axes = axes or PrintFigure(float(np.clip(height, 1.7, 3.2))).add_subplot()
    wide = shown.max() > _WIDE * shown.min() > 0
    norm = LogNorm() if wide else Normalize()
    drawn = axes.pcolormesh(x, y, shown, cmap=COLOUR_MAP, norm=norm, shading="nearest")
    axes.grid(visible=False)
    axes.set(**{
        f"{side}label": f"{coordinate} ({unit})"
        for side, coordinate, (_, unit) in zip("xy", grid.over, scales, strict=True)
    })  # fmt: skip
    if same:
        axes.set_aspect("equal", adjustable="box")
    figure = figure_of(axes)
    figure.colorbar(drawn, ax=axes, label=f"{name}, 3 sigma ({_UNITS[name]})", shrink=0.9)
    return figure
