"""Style of all figures: colours and lines that all readers can tell apart, sizes, axes, files.

Figures are made at the size of print: `COLUMN` or `PAGE` wide, with letters of `POINTS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rps_pin.errors import InputError
from rps_pin.files import whole_file

P = ParamSpec("P")

#: Okabe and Ito's colours, told apart by colour-blind readers.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, YELLOW, BLACK = "#E69F00", "#56B4E9", "#F0E442", "#000000"
GREY = "#999999"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
#: Of legs 1, 2, 3; or of x, y, z. Line styles tell them apart in print without colour.
LEG_COLOURS = (BLUE, VERMILION, GREEN)
LEG_STYLES = ("-", "--", "-.")
#: From dark to light, in print without colour too; the viewer's.
COLOUR_MAP = "viridis"
#: Widths of a journal's column and of its page, inches; size of all letters, points.
COLUMN, PAGE, POINTS = 85 / 25.4, 175 / 25.4, 8.0

#: Points of an area that an SVG writes one by one, about 20 bytes each; and dots an inch of PNGs
#: and of the pictures of those with more.
MOST_POINTS, PICTURE_DPI = 5000, 300

#: Of all figures. Pictures in files have `PICTURE_DPI` by `save_figure`.
STYLE: Any = {
    "font.size": POINTS,
    **dict.fromkeys(
        ("axes.titlesize", "axes.labelsize", "xtick.labelsize", "ytick.labelsize"), POINTS
    ),
    **dict.fromkeys(("legend.fontsize", "figure.titlesize", "figure.labelsize"), POINTS),
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelpad": 3.0,
    "axes.titlepad": 4.0,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
    **dict.fromkeys(("xtick.major.width", "ytick.major.width", "hatch.linewidth"), 0.6),
    **dict.fromkeys(("xtick.major.size", "ytick.major.size"), 2.5),
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.3,
    "legend.labelspacing": 0.3,
    "figure.dpi": 200,
    "svg.hashsalt": "rps_pin",  # the same run writes the same SVG
}


def styled(plot: Callable[P, Figure]) -> Callable[P, Figure]:
    """Let a function draw in `STYLE`, and leave Matplotlib's settings as they were."""

    @wraps(plot)
    def drawn(*args: P.args, **options: P.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            figure = plot(*args, **options)
            for axes in figure.axes:  # ticks are made when first asked for: in this style
                for name in axes._axis_names:  # type: ignore[attr-defined]
                    getattr(axes, f"{name}axis").get_major_ticks(1)
        return figure

    return drawn


def figure_of(axes: Axes) -> Figure:
    """Return the figure of axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None  # axes of a figure have one
    return figure


class PrintFigure(Figure):
    """A new figure in a column, whose height grows by the legends' rows."""

    def __init__(self, height: float) -> None:
        """Make one of a height in inches."""
        super().__init__(figsize=(COLUMN, height), layout="constrained")

    def grow(self, rows: int) -> None:
        """Add room for rows of a legend."""
        self.set_figheight(self.get_figheight() + rows * 1.35 * POINTS / 72)


def new_axes(axes: Axes | None, height: float) -> Axes:
    """Return the axes given, or those of a new figure in a column, of a height in inches."""
    return axes or PrintFigure(height).add_subplot()


def three_axes(axes: Sequence[Axes] | None, height: float) -> Sequence[Axes]:
    """Return the three axes given, or those of a new figure in a column, of a height in inches."""
    if axes is None:
        return panels(None, 3, height)
    if len(axes) != 3:
        raise InputError(f"axes: {len(axes)} given; three are needed")
    return axes


def panels(figure: Figure | None, count: int, height: float) -> list[Axes]:
    """Return axes below each other over one abscissa, of a height in inches on a new figure."""
    figure = figure or PrintFigure(height)
    found = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    figure.align_ylabels(found)
    return found


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG, each whole or not at all; return the two paths.

    In the SVG, areas of more than `MOST_POINTS` points, and as many markers, are pictures. (Lines
    are simplified by Matplotlib, areas and markers are not.)
    """
    written = []
    svg: Any = {"metadata": {"Date": None}, "dpi": PICTURE_DPI}
    for suffix, options in ((".png", {"dpi": PICTURE_DPI}), (".svg", svg)):
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
