"""What a figure's readers stumble over: texts on texts, on curves, beyond the edge, or too small.

A figure is drawn with Agg, and each text that is drawn is a rectangle, turned as it is.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple
from unittest import mock

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Points at which letters are smaller than those of print, with some rounding; and how far boxes
#: may reach into each other, which have room above and below their letters.
LEAST_POINTS, TOLERANCE = 7.9, 0.08


class Drawn(NamedTuple):
    """A text that was drawn."""

    words: str
    points: float
    corners: Array
    """Of its rectangle, shape (4, 2), pixels."""


def drawn_texts(figure: Figure) -> list[Drawn]:
    """Draw a figure, and return its texts."""
    seen: dict[int, Drawn] = {}
    draw = Text.draw

    def kept(text: Text, renderer: RendererAgg, *args: object, **options: object) -> None:
        if text.get_visible() and text.get_text().strip():
            seen[id(text)] = Drawn(text.get_text(), text.get_fontsize(), corners(text, renderer))
        draw(text, renderer, *args, **options)

    # While it is drawn: texts in space have their place on paper then only.
    with mock.patch.object(Text, "draw", kept):
        FigureCanvasAgg(figure).draw()
    return list(seen.values())


def corners(text: Text, renderer: RendererAgg) -> Array:
    """Return the corners of a text's rectangle, shape (4, 2), pixels."""
    around = text.get_window_extent(renderer)
    angle = text.get_rotation()
    text.set_rotation(0.0)
    flat = text.get_window_extent(renderer)
    text.set_rotation(angle)
    way = np.radians(angle)
    turn = np.array([[np.cos(way), -np.sin(way)], [np.sin(way), np.cos(way)]])
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [flat.width / 2, flat.height / 2]
    middle = np.array([around.x0 + around.x1, around.y0 + around.y1]) / 2
    found: Array = middle + half @ turn.T
    return found


def depth(a: Array, b: Array) -> float:
    """Return how far two rectangles reach into each other, pixels; negative if they do not."""
    edges = [one[k + 1] - one[k] for one in (a, b) for k in (0, 1)]
    least = np.inf
    for edge in edges:
        axis = edge / np.linalg.norm(edge)
        p, q = a @ axis, b @ axis
        least = min(least, min(p.max(), q.max()) - max(p.min(), q.min()))
    return float(least)


def faults(figure: Figure) -> list[str]:
    """Return all that is wrong with a figure's texts, in words; none if all is well."""
    texts = drawn_texts(figure)
    assert texts  # a figure without words says nothing
    assert all(np.isfinite(one.corners).all() for one in texts), "a text lies nowhere"
    letter = figure.get_dpi() / 72
    found = [f"{one.words!r} has {one.points:.3g} pt" for one in texts if one.points < LEAST_POINTS]
    width, height = figure.bbox.width, figure.bbox.height
    for one in texts:
        low, high = one.corners.min(axis=0), one.corners.max(axis=0)
        if low.min() < -1 or high[0] > width + 1 or high[1] > height + 1:
            found.append(f"{one.words!r} is cut off")
    for a, b in itertools.combinations(texts, 2):
        allowed = TOLERANCE * letter * min(a.points, b.points)
        if depth(a.corners, b.corners) > allowed:
            found.append(f"{a.words!r} lies on {b.words!r}")
    return found + list(_on_curves(figure))


def _on_curves(figure: Figure) -> list[str]:
    """Return the legends that hide curves."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    found = []
    for legend in figure.findobj(Legend):
        box: Bbox = legend.get_window_extent(renderer)
        for axes in figure.axes:
            for line in axes.get_lines():
                if line.axes is None or not len(line.get_xdata()) or hasattr(line, "get_data_3d"):
                    continue
                path = line.get_path().transformed(line.get_transform())
                if len(path.vertices) and path.intersects_bbox(box, filled=False):
                    found.append(f"the legend lies on {line.get_label()!r}")
    return found
