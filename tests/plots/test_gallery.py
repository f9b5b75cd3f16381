"""Every figure of the gallery: drawn, its axes labelled with units, its picture small."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import matplotlib
import pytest
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin import plots

DOCS = Path(__file__).resolve().parents[2] / "docs"
NAMES = [name for name in plots.__all__ if name.startswith("plot_")]
#: Axes that count, or name things.
WITHOUT_UNIT = {"status"}


@pytest.fixture(scope="module")
def figures() -> dict:
    spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
    assert spec is not None
    assert spec.loader is not None
    gallery = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(gallery)
    return gallery.figures()


def test_all_are_shown(figures: dict) -> None:
    assert sorted(figures) == sorted(NAMES)
    page = (DOCS / "gallery.md").read_text("utf-8")
    for name, (shows, _) in figures.items():
        picture = f"images/gallery/{name}.png"
        assert f"![{shows}]({picture})" in page
        assert 5_000 < (DOCS / picture).stat().st_size < 80_000


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_units_and_matplotlib_is_left_as_it_was(figures: dict, name: str) -> None:
    before = dict(matplotlib.rcParams)
    figure = figures[name][1]()
    assert dict(matplotlib.rcParams) == before
    figure.draw_without_rendering()
    unit = re.compile(r"\((mm|m|N|s|rad|rad, m|µm|µrad|mm/s|m/s|J|1|°|degrees)\)|\(0 singular")
    for axes in figure.axes:
        labels = [axes.get_ylabel()]
        shared = axes.get_shared_x_axes().get_siblings(axes)
        lowest = min(shared, key=lambda one: one.get_position().y0)
        labels.append((lowest if len(shared) > 1 else axes).get_xlabel())
        if isinstance(axes, Axes3D):
            labels.append(axes.get_zlabel())
        if axes.get_label() == "<colorbar>":
            labels = [axes.get_ylabel()]
        for label in labels:
            assert label in WITHOUT_UNIT or unit.search(label), (label, axes)
