"""The notebooks run from start to end; they are kept with small outputs, in print's resolution."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook
from PIL import Image

from rps_pin import InputError, RPSRobot
from rps_pin.trajectories import circle
from rps_pin.viewer import NotebookView

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks() -> None:
    assert NOTEBOOKS


@pytest.fixture(scope="module")
def client() -> Iterator[NotebookClient]:
    """A kernel for all notebooks: its imports are most of a short notebook's time."""
    runner = NotebookClient(new_notebook(), timeout=120, kernel_name="python3")
    with runner.setup_kernel():
        yield runner


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of Jupyter's own machinery
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs(path: Path, client: NotebookClient) -> None:
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, new_code_cell("%reset -f"))  # nothing stays of the one before
    client.nb = notebook
    client.reset_execution_trackers()
    for index, cell in enumerate(notebook.cells):
        client.execute_cell(cell, index)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
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
