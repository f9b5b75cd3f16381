"""SVGs of long motions: areas and markers of many points are pictures, small figures stay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin.plots import save_figure


def figure_of(samples: int) -> Figure:
    figure = Figure()
    axes = figure.add_subplot()
    time = np.linspace(0.0, 1.0, samples)
    axes.fill_between(time, 0.0, np.random.default_rng(0).normal(size=samples))
    axes.plot(time, np.sin(time))
    return figure


@pytest.mark.parametrize(("samples", "pictures"), [(1000, 0), (100_000, 1)])
def test_areas_of_many_points_are_pictures(tmp_path: Path, samples: int, pictures: int) -> None:
    figure = figure_of(samples)
    _, svg = save_figure(figure, tmp_path, "areas")
    text = svg.read_text("utf-8")
    assert text.count("<image") == pictures
    assert len(text) < 500_000
    assert not any(one.get_rasterized() for one in figure.axes[0].collections)


@pytest.mark.parametrize(("samples", "pictures"), [(1000, 0), (100_000, 1)])
def test_many_markers_are_a_picture(tmp_path: Path, samples: int, pictures: int) -> None:
    figure = Figure()
    axes = figure.add_subplot()
    axes.plot(np.random.default_rng(0).normal(size=samples), ".")
    _, svg = save_figure(figure, tmp_path, "markers")
    text = svg.read_text("utf-8")
    assert text.count("<image") == pictures
    assert len(text) < 500_000
    assert not axes.lines[0].get_rasterized()
