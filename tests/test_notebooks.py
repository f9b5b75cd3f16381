"""The notebooks run from start to end; they are kept with small outputs, in print's resolution."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook
from PIL import Image

from rps_pin import InputError, RPSRobot
from rps_pin.trajectories import circle
from rps_pin.viewer import NotebookView

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))

#: Smaller sizes of long notebooks, as pairs of texts of their cells. `-m slow` runs what is kept.
SMALLER = {
    "06_control_at_1_khz": [
        ("height=0.223, duration=1.0", "height=0.223, duration=0.5"),
        ("settle=0.5", "settle=0.1"),
        ("begin=0.5", "begin=0.1"),
        ("range(2000)", "range(200)"),
    ],
    "08_parallel_robots": [
        # Others are in tests/task: what the notebook calls, of all of them.
        ("robots = {", "poses = {name: poses[name] for name in FEW}\nrobots = {"),
        ("poses = {\n", 'FEW = "stewart", "delta", "planar_rrr", "ankle"\nposes = {\n'),
        ("duration=0.32", "duration=0.1"),
    ],
    "09_compiled_engine": [
        ("number=20, times=15", "number=2, times=3"),
        ("size = 100_000", "size = 2_000"),
        ("(1000, 2)", "(100, 2)"),
    ],
    "10_task_of_your_own_mechanism": [
        ("line, 250.0", "line, 60.0"),
        ("quick, 2000.0", "quick, 500.0"),
        ("settle=0.2, duration=0.7", "settle=0.05, duration=0.2"),
    ],
    "11_choose_the_dimensions": [
        ("candidates=600", 'compiler="tcc", candidates=300'),
        ("0.15, 26)", "0.15, 14)"),
        ("undecided=1e-4", "undecided=1e-3"),
    ],
    "12_from_the_drawing_to_the_machine": [
        # Runs along the circle end early; the one that excites is whole.
        ("settle=SETTLE)", "settle=SETTLE, duration=TIME.get(path.duration))"),
        ("SETTLE = 0.15  # s", "SETTLE = 0.15  # s\nTIME = {1.2: 0.4}"),
        ("np.linspace(0.0, 1.2, 7)", "np.linspace(0.0, 1.19, 7)"),
        ("(60, 3))", "(20, 3))"),
        ("((20, 1e-6), (80, 10e-6))", "((20, 1e-6),)"),
    ],
}


def test_there_are_notebooks() -> None:
    assert NOTEBOOKS


@pytest.fixture(scope="module")
def client() -> Iterator[NotebookClient]:
    """A kernel for all notebooks: its imports are most of a short notebook's time."""
    runner = NotebookClient(new_notebook(), timeout=600, kernel_name="python3")
    with runner.setup_kernel():
        yield runner


def smaller(cells: list[Any], stem: str) -> None:
    """Replace sizes in the cells of a notebook; each must be there."""
    for size, other in SMALLER[stem]:
        assert any(size in cell.source for cell in cells), f"{stem} has no {size}"
        for cell in cells:
            cell.source = cell.source.replace(size, other)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of Jupyter's own machinery
@pytest.mark.parametrize(
    ("path", "whole"),
    [
        *(pytest.param(path, path.stem not in SMALLER, id=path.stem) for path in NOTEBOOKS),
        *(
            pytest.param(path, True, id=f"{path.stem}-whole", marks=pytest.mark.slow)
            for path in NOTEBOOKS
            if path.stem in SMALLER
        ),
    ],
)
def test_the_notebook_runs(path: Path, whole: bool, client: NotebookClient) -> None:
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_code_cell("%reset -f"))  # nothing stays of the one before
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    if not whole:
        smaller(cells, path.stem)
    client.nb = notebook
    client.reset_execution_trackers()
    for index, cell in enumerate(notebook.cells):
        client.execute_cell(cell, index)
    assert all(cell.execution_count for cell in cells)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_is_shown_with_its_outputs_and_is_small(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    assert any(cell.get("outputs") for cell in notebook.cells)
    assert path.stat().st_size < 500_000


def pictures(path: Path) -> list[tuple[str, Image.Image]]:
    """Return what a notebook shows: its words for programs without pictures, and the picture."""
    shown = []
    for cell in nbformat.read(path, as_version=4).cells:
        for data in (output.get("data", {}) for output in cell.get("outputs", [])):
            assert "text/html" not in data  # pages are large, and many programs do not show them
            if "image/png" in data:
                png = io.BytesIO(base64.b64decode(data["image/png"]))
                shown.append((data["text/plain"], Image.open(png)))
    return shown


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_its_figures_are_fit_for_print(path: Path) -> None:
    shown = [picture for words, picture in pictures(path) if "Figure" in words]
    assert shown
    for picture in shown:
        assert picture.info["dpi"] >= (110, 110)


def test_the_first_shows_the_robot_move_and_the_fifth_its_mechanisms() -> None:
    [(_, moving), *_] = pictures(NOTEBOOKS[0])
    assert moving.n_frames >= 10
    titles = [words for words, _ in pictures(NOTEBOOKS[4]) if "NotebookView" in words]
    assert len(titles) == 3
    for title in ("four_bar", "delta", "left + right + bar"):
        assert any(title in one for one in titles)


def test_a_view_in_a_notebook_is_a_page_in_a_frame_that_needs_nothing_else() -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = circle(height=0.4, tilt=0.2, duration=1.0)
    view = NotebookView(robot, path, layers=["forces"], title='"<b>', height=300, frame_rate=5.0)
    html = view._repr_html_()
    attributes = dict(re.findall(r' ([\w-]+)="([^"]*)"', html))
    assert html.startswith("<iframe ") and html.endswith("></iframe>")
    assert set(attributes) >= {"title", "width", "height", "sandbox", "srcdoc"}
    assert attributes["height"] == "300"
    assert attributes["sandbox"] == "allow-scripts"  # the page does not reach the notebook
    assert "src" not in attributes
    assert unescape(attributes["srcdoc"]) == view.page
    assert unescape(attributes["title"]) == '"<b>'
    assert "default-src 'none'" in unescape(view.page)
    assert float(attributes["data-duration"]) == view.duration == 1.0
    assert repr(view) == """NotebookView('"<b>', 1 s)"""
    with pytest.raises(InputError, match="height"):
        NotebookView(robot, path, height=0)
    with pytest.raises(InputError, match="layer"):
        NotebookView(robot, path, layers=["nothing"])
