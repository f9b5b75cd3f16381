"""Style of all figures: colours and lines that all readers can tell apart, axes, legends, files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.files import whole_file

#: Okabe and Ito's colours, told apart by colour-blind readers.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, YELLOW, BLACK = "#E69F00", "#56B4E9", "#F0E442", "#000000"
GREY = "#999999"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
#: Of legs 1, 2, 3; or of x, y, z. Line styles tell them apart in print without colour.
LEG_COLOURS = (BLUE, VERMILION, GREEN)
LEG_STYLES = ("-", "--", "-.")
#: From dark to light, in print without colour too.
COLOUR_MAP = "cividis"

#: Points of an area that an SVG writes one by one, about 20 bytes each; and dots an inch of the
#: pictures of those with more.
MOST_POINTS, PICTURE_DPI = 5000, 300

#: Of all figures.
STYLE: Any = {
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 150,
    "svg.hashsalt": "rps_pin",  # the same run writes the same SVG
}


def figure_of(axes: Axes) -> Figure:
    """Return the figure of axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None  # axes of a figure have one
    return figure


def new_axes(axes: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axes given, or those of a new figure of a size in inches."""
    return axes or Figure(figsize=size, layout="constrained").add_subplot()


def three_axes(axes: Sequence[Axes] | None, title: str) -> Sequence[Axes]:
    """Return the three axes given, or those of a new figure with a title."""
    if axes is None:
        figure = Figure(figsize=(6.4, 7.2), layout="constrained")
        figure.suptitle(title)
        return list(figure.subplots(3, 1, sharex=True))
    if len(axes) != 3:
        raise InputError(f"axes: {len(axes)} given; three are needed")
    return axes


def axes_in_space(
    figure: Figure | None, size: tuple[float, float], place: tuple[int, int, int] = (1, 1, 1)
) -> Axes3D:
    """Return new three-dimensional axes on a figure, or on a new one of a size in inches."""
    figure = figure or Figure(figsize=size, layout="constrained")
    axes = figure.add_subplot(*place, projection="3d")
    assert isinstance(axes, Axes3D)  # what the projection "3d" makes
    return axes


def plot_legs(axes: Axes, x: Array, y: Array, labels: Sequence[str], **look: Any) -> None:
    """Draw a curve for each leg (or axis): y of shape (n, 3) over x of shape (n,) or (n, 3)."""
    both = np.broadcast_arrays(x.T, y.T)
    for across, up, colour, style, label in zip(
        *both, LEG_COLOURS, LEG_STYLES, labels, strict=True
    ):
        own: Any = {"color": colour, "linestyle": style, "label": label}
        axes.plot(across, up, **own | look)


def legend_above(axes: Axes, columns: int) -> None:
    """Put the legend in a row above the axes."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=columns,
        frameon=False,
        fontsize="small",
        columnspacing=1.0,
        handlelength=1.6,
    )


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG, each whole or not at all; return the two paths.

    In the SVG, areas of more than `MOST_POINTS` points, and as many markers, are pictures. (Lines
    are simplified by Matplotlib, areas and markers are not.)
    """
    written = []
    svg: Any = {"metadata": {"Date": None}, "dpi": PICTURE_DPI}
    for suffix, options in ((".png", {}), (".svg", svg)):
        path = folder / f"{name}{suffix}"
        with matplotlib.rc_context(STYLE), whole_file(path) as scratch, _large_as_pictures(figure):
            figure.savefig(scratch, **options)
        written.append(path)
    return written


@contextmanager
def _large_as_pictures(figure: Figure) -> Iterator[None]:
    """Let vector formats have pictures of areas and markers that have many points."""
    found: list[Any] = [one for one in figure.findobj(Collection) if _points(one) > MOST_POINTS]
    found += [one for one in figure.findobj(Line2D) if _markers(one) > MOST_POINTS]
    before = [one.get_rasterized() for one in found]
    try:
        for one in found:
            one.set_rasterized(True)
        yield
    finally:
        for one, was in zip(found, before, strict=True):
            one.set_rasterized(was)


def _points(areas: Any) -> int:
    return sum(len(path.vertices) for path in areas.get_paths())


def _markers(line: Any) -> int:
    drawn = line.get_marker() not in ("None", "none", "", " ", None)
    return len(line.get_xdata()) if drawn else 0
