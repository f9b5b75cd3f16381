"""Collisions planted in a figure are found, and a figure without any has none."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin.plots import COLUMN, styled
from tests.plots.overlaps import depth, faults


@styled
def well(title: str = "", size: float | None = None) -> Figure:
    figure = Figure(figsize=(COLUMN, 2.2), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [-1.0, 1.0], label="a curve")
    axes.set_title(title)
    axes.set_xlabel("time (s)", fontsize=size)
    return figure


def test_a_figure_without_collisions_has_none() -> None:
    assert not faults(well())
    assert not faults(well("a title"))


def test_a_legend_on_a_title_is_found() -> None:
    figure = well("a title")
    figure.axes[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    assert faults(figure) == ["'a title' lies on 'a curve'"]


def test_a_legend_on_a_curve_is_found() -> None:
    figure = well()
    figure.axes[0].legend(loc="center")
    assert faults(figure) == ["the legend lies on 'a curve'"]


def test_a_minus_sign_on_a_label_is_found() -> None:
    figure = well()
    figure.draw_without_rendering()
    axes = figure.axes[0]
    tick = axes.yaxis.get_ticklabels()[1]
    assert tick.get_text().startswith("\N{MINUS SIGN}")
    left = tick.get_window_extent().x0 + 4.0
    x, y = axes.transData.inverted().transform((left, tick.get_window_extent().y0))
    axes.text(x, y, "I", ha="right")
    (words,) = faults(figure)
    assert tick.get_text() in words


def test_texts_beyond_the_edge_are_found() -> None:
    figure = well()
    figure.text(0.99, 0.5, "beyond")
    assert faults(figure) == ["'beyond' is cut off"]


def test_letters_too_small_for_print_are_found() -> None:
    assert faults(well(size=6.0)) == ["'time (s)' has 6 pt"]


@pytest.mark.parametrize("angle", np.linspace(0.0, 170.0, 7))
def test_turned_rectangles_collide_where_a_point_of_one_is_in_the_other(angle: float) -> None:
    """Against points sampled in the turned one; the other is along the axes."""
    random = np.random.default_rng(round(angle))
    way = np.radians(angle)
    turn = np.array([[np.cos(way), -np.sin(way)], [np.sin(way), np.cos(way)]])
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    still = square * [4.0, 1.0]
    inside = random.uniform(-1.0, 1.0, (4000, 2)) * [3.0, 0.7]
    together = 0
    for middle in random.uniform(-7.0, 7.0, (100, 2)):
        turned = middle + (square * [3.0, 0.7]) @ turn.T
        reach = depth(still, turned)
        sampled = (np.abs(middle + inside @ turn.T) < [4.0, 1.0]).all(axis=1).any()
        if abs(reach) > 0.2:  # thinner overlaps may fall between the points
            assert sampled == (reach > 0)
        together += reach > 0
    assert 0 < together < 100


def test_positions_that_are_no_numbers_are_no_collision_but_an_error() -> None:
    figure = well()
    figure.text(np.nan, 0.5, "nowhere")
    with pytest.raises((AssertionError, ValueError)):
        faults(figure)
