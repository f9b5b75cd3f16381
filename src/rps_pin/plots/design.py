"""Fronts of designs: the candidates that meet all requirements, and the best of them."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.errors import InputError
from rps_pin.plots.style import BLUE, COLOURS, GREY, PrintFigure, styled

if TYPE_CHECKING:
    from rps_pin.task.design import DesignResult, Objective

_UNITS = {
    "conditioning": "1",
    "size": "m",
    "mass": "kg",
    "force": "N, N m",
    "speed": "m/s, rad/s",
    "stiffness": "N/m",
}


@styled
def plot_front(result: DesignResult, figure: Figure | None = None) -> Figure:
    """Draw the front of a design: each pair of objectives, with the robots that are chosen.

    Parameters
    ----------
    result
        Of `rps_pin.task.design.design`, with two or three objectives.
    figure
        To draw on; default: a new one.

    Raises
    ------
    InputError
        If there is only one objective.
    """
    count = len(result.objectives)
    if count < 2:
        raise InputError("a front of one objective is one point: there is nothing to draw")
    pairs = list(itertools.combinations(range(count), 2))
    figure = figure or PrintFigure(0.5 + 2.1 * len(pairs))
    for axes, (k, other) in zip(
        figure.subplots(len(pairs), 1, squeeze=False)[:, 0], pairs, strict=True
    ):
        _draw(axes, result, k, other)
    axes = figure.axes[0]
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _draw(axes: Axes, result: DesignResult, k: int, other: int) -> None:
    scores = result.scores
    met, front = scores[result.feasible], scores[result.front]
    axes.plot(met[:, k], met[:, other], ".", color=GREY, ms=2, alpha=0.5, label="meets all")
    axes.plot(front[:, k], front[:, other], ".", color=BLUE, ms=4, label="front")
    for colour, one in zip(itertools.cycle(COLOURS[1:]), result.chosen(), strict=False):
        name = one.name.replace("_", " ")
        axes.plot(*front[one.row, [k, other]], "D", color=colour, ms=5, label=name)
    axes.set(xlabel=_label(result.objectives[k]), ylabel=_label(result.objectives[other]))
    for part, limits in ((k, axes.set_xlim), (other, axes.set_ylim)):
        low, high = front[:, part].min(), front[:, part].max()
        room = 0.15 * (high - low) or 0.1 * abs(high) or 1.0
        limits(low - room, high + room)


def _label(objective: Objective) -> str:
    unit = _UNITS.get(objective.name, "")
    return f"{objective.name}{f' ({unit})' if unit else ''}"
