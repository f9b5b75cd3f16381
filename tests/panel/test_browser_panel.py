"""The panel in a page and in a notebook: sliders are moved, readings and pictures follow."""

from __future__ import annotations

import io
import os
import socket
import time
import warnings
from collections.abc import Callable, Iterator
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image

from rps_pin import InputError, RPSPinError, RPSRobot
from rps_pin.panel import BrowserPanel, NotebookPanel, RPSPanel
from rps_pin.viewer.files.browser import ARGUMENTS

MICRO = RPSRobot.from_preset("micro")
BROWSER = os.environ.get("RPS_PIN_CHROMIUM", "chromium")
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # of websockets, and Jupyter's
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture
def served() -> Iterator[BrowserPanel]:
    with warnings.catch_warnings(), BrowserPanel(RPSPanel(MICRO), title="micro") as page:
        yield page


def test_sliders_move_the_robot_and_each_other(served: BrowserPanel) -> None:
    panel = served._panel
    served.move("pose", [230.0, 4.0, 0.0])
    assert moved(lambda: np.allclose(panel.pose, [0.23, np.radians(4.0), 0.0], atol=1e-12))
    length = MICRO.inverse_kinematics(panel.pose).length
    assert moved(lambda: np.allclose(served.shown("lengths"), 1e3 * length, atol=1e-6))
    assert f"{1e3 * length[0]:.3f} mm" in served.text
    assert "within all limits" in served.text
    served.move("lengths", [255.0, *served.shown("lengths")[1:]])
    assert moved(lambda: "its limits are 200 to 250 mm" in served.text)
    assert panel.length[0] == pytest.approx(0.255)
    assert moved(lambda: np.isclose(served.shown("pose")[0], 1e3 * panel.pose[0]))


def test_a_move_of_a_slider_places_the_moving_links_once(served: BrowserPanel) -> None:
    """So little that a picture follows at its own rate; see benchmarks/bench_panel.py."""
    placed: list[str] = []
    scene = served.view.scene
    place = scene.writer.place
    scene.writer.place = lambda path, matrix: (placed.append(path), place(path, matrix))
    for k in range(20):
        served.move("pose", [220.5 + k, 0.0, 0.0])
        assert moved(lambda k=k: len(placed) == 7 * (k + 1))  # three cylinders and rods, platform
    assert {path.rpartition("/")[2] for path in placed} == set(scene.paths) - {"base"}


def test_layers_follow_the_sliders_and_have_switches() -> None:
    panel = RPSPanel(MICRO)
    with BrowserPanel(panel, layers=["forces"], hidden=["limits", "ghosts"]) as face:
        scene = face._server.scene
        shaft = scene.get_handle_by_name("/world/layers/forces/leg_2_prismatic/shaft")
        length, force = shaft.scale[2], panel.force[1]
        face.move("pose", [225.0, 40.0, 0.0])
        assert moved(lambda: np.isclose(panel.pose[1], np.radians(40.0)))
        assert abs(panel.force[1] / force - 1.0) > 1e-3
        assert moved(lambda: np.isclose(shaft.scale[2] / length, panel.force[1] / force, rtol=1e-9))
        assert not scene.get_handle_by_name("/world/layers/limits").visible
        face.view.set_visible("limits", True)
        assert scene.get_handle_by_name("/world/layers/limits").visible
    with pytest.raises(InputError, match="no layer 'nonsense'"):
        BrowserPanel(panel, layers=["nonsense"])


def test_in_a_notebook_it_is_the_page_in_a_frame() -> None:
    with NotebookPanel(RPSPanel(MICRO), title="micro") as panel:
        assert f'<iframe src="{panel.url}"' in panel._repr_html_()
        assert panel.widget.src == panel.url
        with urlopen(panel.url, timeout=10) as answer:
            assert b"<html" in answer.read()
    with pytest.raises(OSError):
        urlopen(panel.url, timeout=1)


def test_the_page_is_for_this_machine_only(served: BrowserPanel) -> None:
    assert served.url.startswith("http://127.0.0.1:")
    with socket.socket() as other:
        other.settimeout(5)
        # 127.0.0.2 is this machine too (Linux), but not the address that is listened on.
        with pytest.raises(OSError):
            other.connect(("127.0.0.2", served._server.get_port()))
    assert served._server.request_share_url() is None  # viser's tunnel to its makers' site


def test_sliders_in_the_page(served: BrowserPanel) -> None:
    if not BROWSER:
        pytest.skip("there is no browser")
    playwright = pytest.importorskip("playwright.sync_api")
    said = []
    with playwright.sync_playwright() as engine:
        browser = engine.chromium.launch(executable_path=_path(), args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 900, "height": 400})
        page.on("console", lambda one: said.append(one.text) if one.type == "error" else None)
        page.goto(served.url)
        page.get_by_text("within all limits").wait_for(timeout=60_000)
        before = _settled(page)
        # The first number box is the height's: as someone at the keyboard would.
        box = page.locator("input[type=text], input[type=number]").first
        box.fill("255")
        box.press("Enter")
        page.get_by_text("255.000 mm").first.wait_for(timeout=30_000)
        page.get_by_text("its limits are 200 to 250 mm").first.wait_for(timeout=30_000)
        after = _settled(page)
        browser.close()
    assert served._panel.pose[0] == pytest.approx(0.255)  # type: ignore[attr-defined]
    robot = (slice(None), slice(0, 550))  # left of the sliders
    assert np.abs(after[robot] - before[robot]).mean() > 0.5
    assert said == []


def test_without_the_packages_it_says_how_to_get_them(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    for kind in (BrowserPanel, NotebookPanel):
        with pytest.raises(RPSPinError, match=r"pip install 'rps-pin\[panel\]'"):
            kind(RPSPanel(MICRO))


def moved(condition: Callable[[], bool]) -> bool:
    """Return whether a condition comes true: viser calls back in threads of its own."""
    deadline = time.monotonic() + 20.0
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def _path() -> str:
    import shutil

    path = shutil.which(BROWSER)
    if path is None:
        pytest.skip("there is no browser")
    return path


def _settled(page: object) -> np.ndarray:
    """Return the picture when it no longer changes."""
    last = _picture(page)
    while True:
        time.sleep(0.3)
        now = _picture(page)
        if np.array_equal(now, last):
            return now
        last = now


def _picture(page: object) -> np.ndarray:
    image = Image.open(io.BytesIO(page.screenshot()))  # type: ignore[attr-defined]
    return np.asarray(image.convert("L"), dtype=float)
