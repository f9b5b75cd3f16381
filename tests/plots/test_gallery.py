"""Every figure of the gallery: drawn, its axes labelled with units, its picture small."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib
import pytest
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin import plots
from tests.plots.overlaps import faults

DOCS = Path(__file__).resolve().parents[2] / "docs"
NAMES = [name for name in plots.__all__ if name.startswith("plot_")]
#: Those of the page: all of these, and more of some.
PAGE = (DOCS / "gallery.md").read_text("utf-8")
SHOWN = re.findall(r"images/gallery/(\w+)\.png", PAGE)
#: What the page begins with, and the code of each.
BEGIN, *BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
CODES = dict(zip(SHOWN, BLOCKS, strict=True))
#: Axes that count, or name things.
WITHOUT_UNIT = {"number", "status"}


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
    assert spec is not None
    assert spec.loader is not None
    gallery = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(gallery)
    return gallery


@pytest.fixture(scope="module")
def begun() -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(BEGIN, names)
    return names


def test_all_are_shown_with_the_code_that_draws_them(gallery: ModuleType) -> None:
    assert set(NAMES) <= set(gallery.FIGURES)
    assert gallery.page() == PAGE
    for name in gallery.FIGURES:
        assert 5_000 < (gallery.IMAGES / f"{name}.png").stat().st_size < 200_000
    assert {one.stem for one in gallery.IMAGES.iterdir()} == set(gallery.FIGURES)


@pytest.mark.parametrize("name", SHOWN)
def test_axes_have_units_no_text_collides_and_matplotlib_is_left_as_it_was(
    begun: dict[str, Any], name: str
) -> None:
    """Of the figure that the page's code draws."""
    before, names = dict(matplotlib.rcParams), dict(begun)
    exec(CODES[name], names)
    figure = names["figure"]
    assert dict(matplotlib.rcParams) == before
    assert figure.get_figwidth() in (plots.COLUMN, plots.PAGE)
    assert not faults(figure)
    unit = re.compile(
        r"\((mm|m|N|s|rad|rad, m|µm|µrad|N m|rad/s|mm/s|m/s|J|N/µm|Hz|1|°|degrees)\)|\(0 singular"
    )
    for axes in figure.axes:
        if name == "plot_assembly_modes":  # of one scale, without axes
            assert "120 mm" in figure.get_supxlabel()
            continue
        labels = [axes.get_ylabel()]
        shared = axes.get_shared_x_axes().get_siblings(axes)
        lowest = min(shared, key=lambda one: one.get_position().y0)
        labels.append((lowest if len(shared) > 1 else axes).get_xlabel().split("\n")[0])
        if isinstance(axes, Axes3D):
            labels.append(axes.get_zlabel())
        if axes.get_label() == "<colorbar>":
            labels = [axes.get_ylabel()]
        for label in labels:
            assert label in WITHOUT_UNIT or unit.search(label), (label, axes)
