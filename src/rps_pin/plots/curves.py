"""Curves over one abscissa: equal ones drawn once, jumps as jumps, limits, a legend that fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.textpath import TextPath

from rps_pin.arrays import Array
from rps_pin.plain_text import for_figure
from rps_pin.plots.style import COLOURS, LEG_STYLES, POINTS, STYLE, PrintFigure, figure_of

#: Line styles of further curves, where the colours come round again.
_STYLES = (*LEG_STYLES, ":")
#: Curves closer than this share of what all span are one to the eye.
_SAME = 1e-3
#: A step this many times as large as the steps beside it is a jump, if it is this share of the
#: span or more.
_JUMP, _SEEN = 8.0, 0.01
#: Limits are drawn if the curves come as close to them as this many times their own span.
_NEAR = 1.5
#: Letters of a name.
_LONGEST = 26
#: Shares of a figure's width: more than that of one panel of two, and of a lone one at least.
_ALONE, _LAID_OUT = 0.6, 0.84
#: Of an entry of a legend, beside its label.
_PARTS = ("handlelength", "handletextpad", "columnspacing")


def plot_curves(axes: Axes, x: Array, y: Array, labels: Sequence[str], **look: Any) -> None:
    """Draw curves y of shape (n, m) over x of shape (n,) or (n, m), equal ones once.

    Labels are shown as they are: names of a user's are passed through `for_figure` first.
    """
    over = np.broadcast_to(x.T, y.T.shape)
    for place, group in enumerate(_equal(over, y.T)):
        own: Any = {
            "color": COLOURS[place % len(COLOURS)],
            "linestyle": _STYLES[(place // len(COLOURS) + place) % len(_STYLES)],
            "label": _together([labels[k] for k in group], len(labels)),
        }
        axes.plot(over[group[0]], y[:, group[0]], **own | look)


def names_for_figure(names: Sequence[str]) -> list[str]:
    """Return names of a user's as labels; those too long for a column without their middle."""
    half = _LONGEST // 2
    short = (n if len(n) <= _LONGEST else f"{n[:half]}...{n[-half:]}" for n in names)
    return [for_figure(name) for name in short]


def with_jumps(time: Array, *values: Array) -> tuple[Array, ...]:
    """Return times and values (n, ...), each jump drawn upright, half-way between two samples.

    A jump is a step that is much larger than the steps beside it, in any column of the first.
    """
    y = values[0].reshape(len(time), -1)
    steps = np.abs(np.diff(y, axis=0))
    padded = np.pad(steps, ((1, 1), (0, 0)))
    beside = np.maximum(padded[:-2], padded[2:])
    span = np.ptp(y, axis=0)
    jumps = (steps > _JUMP * beside) & (steps > _SEEN * span) & (span > 1e-9 * np.abs(y).max())
    before = np.flatnonzero(jumps.any(axis=1)) if len(time) > 3 else np.empty(0, np.intp)
    at = np.repeat(before + 1, 2)
    held = np.stack([before, before + 1], axis=1).ravel()
    middle = np.repeat((time[before] + time[before + 1]) / 2, 2) if len(before) else time[:0]
    return (
        np.insert(time, at, middle),
        *(np.insert(one, at, one[held], axis=0) for one in values),
    )


def draw_limits(axes: Axes, values: Array, low: float, high: float, unit: str) -> None:
    """Draw the finite limits of values as dotted lines; those far away are told in the legend."""
    least, greatest = float(values.min()), float(values.max())
    reach = _NEAR * (greatest - least)
    limits = [one for one in (low, high) if np.isfinite(one)]
    near = [one for one in limits if least - reach <= one <= greatest + reach]
    for k, one in enumerate(near):
        label = ("limits" if len(near) > 1 else "limit") if k == 0 else None
        axes.axhline(one, color="black", linewidth=0.8, linestyle=":", label=label)
    if limits and not near:
        axes.plot([], [], " ", label=f"limits: {_range(low, high)} {unit}")


def legend_above(axes: Axes) -> None:
    """Put the legend in rows above the axes, as many entries in a row as fit its width."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    figure = figure_of(axes)
    share = axes.get_position().width  # before the layout, which gives a lone panel more
    if share > _ALONE and figure.get_layout_engine() is not None:
        share = max(share, _LAID_OUT)
    width = 72 * share * figure.get_figwidth()
    look: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    columns = legend_columns(labels, width)
    axes.legend(handles, labels, ncols=columns, **look)
    if isinstance(figure, PrintFigure):
        figure.grow(-(-len(labels) // columns) - 1)


def legend_columns(labels: Sequence[str], width: float) -> int:
    """Return how many columns of a legend fit a width in points, in rows of even length."""
    drawn = [TextPath((0.0, 0.0), label or " ", size=POINTS).get_extents() for label in labels]
    beside = sum(STYLE[f"legend.{name}"] for name in _PARTS)
    widths = [box.width + POINTS * beside for box in drawn]
    for columns in range(len(widths), 1, -1):
        rows = -(-len(widths) // columns)
        if sum(max(widths[k : k + rows]) for k in range(0, len(widths), rows)) <= width:
            return -(-len(widths) // rows)
    return 1


def _equal(x: Array, y: Array) -> list[list[int]]:
    """Return the rows in groups of equal curves."""
    tolerance = _SAME * float(np.ptp(y)) + 1e-9 * float(np.abs(y).max(initial=0.0))
    wide = _SAME * float(np.ptp(x))
    groups: list[list[int]] = []
    for k in range(len(y)):
        for group in groups:
            first = group[0]
            same = np.abs(y[k] - y[first]).max(initial=0.0) <= tolerance
            if same and np.abs(x[k] - x[first]).max(initial=0.0) <= wide:
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _together(labels: Sequence[str], of: int) -> str:
    """Return the label of curves that are equal."""
    if len(labels) == 1 or not any(labels):
        return labels[0]
    if len(labels) == of > 2:
        return f"all {of} are equal"
    return f"{' = '.join(labels)}" if len(labels) < 4 else f"{labels[0]} = ... = {labels[-1]}"


def _range(low: float, high: float) -> str:
    if low == -high:
        return f"±{high:.4g}"
    if not np.isfinite(low):
        found = f"at most {high:.4g}"
    else:
        found = f"{low:.4g} to {high:.4g}" if np.isfinite(high) else f"at least {low:.4g}"
    return found.replace("-", "\N{MINUS SIGN}")
