"""Axes in space: labels, ticks, a frame without margins, and scales that are equal or said."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array, Bools
from rps_pin.plots.curves import legend_columns
from rps_pin.plots.style import COLUMN, POINTS, figure_of

POSITION = ("$p_x$ (mm)", "$p_y$ (mm)", "$p_z$ (mm)")
#: Sides of a box differ by this factor at most. Up to `_EQUAL`, short ones get room; beyond, they
#: are magnified, but not if nothing happens along them, to `_NOTHING` of the longest.
_SLENDER, _EQUAL, _NOTHING = 3.0, 10.0, 1e-3
#: Sides of the base shorter than this share have a tick in their middle only.
_NARROW = 0.5
#: Room of labels left of, right of and below the box, and largest height of the box, inches.
_LEFT, _RIGHT, _BELOW, _HIGHEST = 0.4, 0.7, 0.5, 2.5
#: Height of a line of text, inches.
_LINE = 1.6 * POINTS / 72


def axes_in_space(
    figure: Figure | None, width: float = COLUMN, place: tuple[int, int, int] = (1, 1, 1)
) -> Axes3D:
    """Return new three-dimensional axes on a figure, or on a new one of a width in inches."""
    figure = figure or Figure(figsize=(width, width))
    axes = figure.add_subplot(*place, projection="3d")
    assert isinstance(axes, Axes3D)  # what the projection "3d" makes
    return axes


def frame_space(
    axes: Axes3D,
    low: Array,
    high: Array,
    labels: Sequence[str] = POSITION,
    ticks: int = 4,
    least: float = 0.0,
) -> str:
    """Set limits, labels and sides of a box from `low` to `high`, shape (3,).

    Its longest side is `least` or more.

    Returns
    -------
    str
        Which scales differ, by how much; empty if all are equal.
    """
    span, factor, wide = _sides(high - low, least)
    middle = (low + high) / 2
    ends = np.stack([middle - span / 2, middle + span / 2], axis=1).tolist()
    axes.set(xlim=ends[0], ylim=ends[1], zlim=ends[2])
    sides = np.where(wide, factor * span, span)
    axes.set_box_aspect(tuple(sides))
    for axis, label, side in zip(
        (axes.xaxis, axes.yaxis, axes.zaxis), labels, sides / sides.max(), strict=True
    ):
        axis.set_label_text(label)
        steps = [1, 2, 2.5, 5, 10]
        upright = axis is axes.zaxis
        if upright or side > _NARROW:
            axis.set_major_locator(MaxNLocator(max(1, round(ticks * side)), steps=steps))
        else:  # at the ends, x and y would meet
            locator = MaxNLocator(2, steps=steps, prune="both", min_n_ticks=1)
            axis.set_major_locator(locator)
        axis.set_tick_params(pad=2 if upright else -1)
        axis.labelpad = 4 if upright else -1
        axis.pane.set_facecolor("white")
        axis.pane.set_edgecolor("0.8")
        info: Any = axis._axinfo  # there is no public way
        info["grid"] |= {"color": "0.85", "linewidth": 0.5}
    names = [[n for n, one in zip("xyz", wide, strict=True) if one == which] for which in (1, 0)]
    words = [" and ".join(one) for one in names]
    return f"{words[0]} drawn {factor:g} times as large as {words[1]}" if factor > 1 else ""


def fill_figure(axes: Axes3D, note: str = "", right: float = 0.0) -> None:
    """Let a frame fill its figure's width, legend above and a note below, and set its height.

    Parameters
    ----------
    axes
        The only ones of a figure.
    note
        Below them.
    right
        Room for more beside them, inches.
    """
    figure = figure_of(axes)
    width = float(figure.get_figwidth())
    handles, names = axes.get_legend_handles_labels()
    rows = 0
    if handles:
        columns = legend_columns(names, 72 * width)
        rows = -(-len(names) // columns)
    figure.set_figheight(width)
    axes.set_position((0.0, 0.0, 1.0, 1.0))
    x, y = _corners(axes) / (width * figure.dpi)  # of the box, as shares of the square
    scale = (width - _LEFT - _RIGHT - right) / float(np.ptp(x)) / width
    scale = min(scale, _HIGHEST / float(np.ptp(y)) / width)
    box = np.array([np.ptp(x), np.ptp(y)]) * scale * width
    below = _BELOW + _LINE * bool(note)
    height = below + box[1] + _LINE * rows + 0.15
    figure.set_figheight(height)
    room = width - right - box[0] - _LEFT - _RIGHT  # a high box is narrow: it stands in the middle
    left = _LEFT + room / 2 - x.min() * scale * width
    place = left / width, (below - y.min() * scale * width) / height
    axes.set_position((*place, scale, scale * width / height))
    if handles:
        figure.legend(handles, names, loc="upper center", ncols=columns)
    if note:
        figure.text(0.5, 0.5 * _LINE / height, note, ha="center", va="center")


def finish_space(axes: Axes3D, given: Figure | None, note: str = "", right: float = 0.0) -> Figure:
    """Return the figure of axes; one that was not given is filled, else there is but a legend."""
    figure = figure_of(axes)
    if given is None:
        fill_figure(axes, note, right)
    else:
        axes.set_title(note)
        if given.get_layout_engine() is None:  # room for labels, which are no part of axes in space
            box = axes.get_position()
            axes.set_position(box.shrunk(0.75, 0.75).anchored("C", box))
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left")
    return figure


def _sides(span: Array, least: float) -> tuple[Array, float, Bools]:
    """Return spans, a factor, and to which it applies: 1 if equal scales make a fair box."""
    longest = max(float(span.max()), least)
    short: Bools = (span < longest / _EQUAL) & (span > _NOTHING * longest)
    if not short.any():
        return np.maximum(span, longest / _SLENDER), 1.0, short
    factor = 0.9 * longest / float(span[short].max())
    ten = 10.0 ** np.floor(np.log10(factor))
    factor = float(np.floor(factor / ten) * ten)
    room = longest / _SLENDER / np.where(short, factor, 1.0)
    return np.maximum(span, room), factor, short


def _corners(axes: Axes3D) -> Array:
    """Return the frame's corners on the figure, shape (2, 8), pixels."""
    axes.apply_aspect()
    corners = np.array([*itertools.product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())])
    x, y, _ = proj3d.proj_transform(*corners.T, axes.get_proj())
    found: Array = axes.transData.transform(np.stack([x, y], axis=1)).T
    return found
