"""The panel in a notebook and in a page: sliders are moved, readings and pictures follow."""

from __future__ import annotations

import io
import os
import socket
import time
import warnings
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from rps_pin import RPSPinError, RPSRobot
from rps_pin.panel import BrowserPanel, NotebookPanel, RPSPanel
from rps_pin.viewer.files.browser import ARGUMENTS

MICRO = RPSRobot.from_preset("micro")
BROWSER = os.environ.get("RPS_PIN_CHROMIUM", "chromium")
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # of websockets, and Jupyter's
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def test_widgets_move_the_robot_and_each_other() -> None:
    panel = RPSPanel(MICRO)
    with NotebookPanel(panel) as face:
        assert face.url.startswith("http://127.0.0.1:")
        height, tilt_x, _ = face._sliders["pose"]
        height.value = 230.0
        tilt_x.value = 4.0
        np.testing.assert_allclose(panel.pose, [0.23, np.radians(4.0), 0.0], atol=1e-12)
        length = MICRO.inverse_kinematics(panel.pose).length
        shown = [handle.value for handle in face._sliders["lengths"]]
        np.testing.assert_allclose(shown, 1e3 * length, atol=1e-6)
        assert "230.000 mm" in face.text.value
        assert "within all limits" in face.text.value
        face._sliders["lengths"][0].value = 255.0
        assert "its limits are 0.2 to 0.25 m" in face.text.value
        assert panel.length[0] == pytest.approx(0.255)
        assert face._sliders["pose"][0].value == pytest.approx(1e3 * panel.pose[0])


def test_a_move_of_a_slider_sends_the_moving_links_once() -> None:
    """So little that a picture follows at its own rate; see benchmarks/bench_panel.py."""
    panel = RPSPanel(MICRO)
    with NotebookPanel(panel) as face:
        sent: list[object] = []
        send = face._viewer.window.send
        face._viewer.window.send = lambda command: (sent.append(command), send(command))  # type: ignore[assignment,method-assign]
        for k in range(20):
            face._sliders["pose"][0].value = 220.0 + k
        moving = sum(link.moves for link in face._scene._links)
        assert len(sent) == 20 * moving


@pytest.fixture
def served() -> Iterator[BrowserPanel]:
    with warnings.catch_warnings(), BrowserPanel(RPSPanel(MICRO), title="micro") as page:
        yield page


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
        page = browser.new_page(viewport={"width": 900, "height": 600})
        page.on("console", lambda one: said.append(one.text) if one.type == "error" else None)
        page.goto(served.url)
        page.get_by_text("within all limits").wait_for(timeout=60_000)
        time.sleep(2.0)
        before = _picture(page)
        # The first number box is the height's: as someone at the keyboard would.
        box = page.locator("input[type=text], input[type=number]").first
        box.fill("255")
        box.press("Enter")
        page.get_by_text("255.000 mm").first.wait_for(timeout=30_000)
        page.get_by_text("its limits are 0.2 to 0.25 m").first.wait_for(timeout=30_000)
        time.sleep(2.0)
        after = _picture(page)
        browser.close()
    assert served._panel.pose[0] == pytest.approx(0.255)  # type: ignore[attr-defined]
    robot = (slice(None), slice(0, 550))  # left of the sliders
    assert np.abs(after[robot] - before[robot]).mean() > 0.5
    assert said == []


def test_without_the_packages_it_says_how_to_get_them(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(RPSPinError, match=r"pip install 'rps-pin\[panel\]'"):
        BrowserPanel(RPSPanel(MICRO))
    with pytest.raises(RPSPinError, match=r"pip install 'rps-pin\[jupyter\]'"):
        NotebookPanel(RPSPanel(MICRO))


def _path() -> str:
    import shutil

    path = shutil.which(BROWSER)
    if path is None:
        pytest.skip("there is no browser")
    return path


def _picture(page: object) -> np.ndarray:
    image = Image.open(io.BytesIO(page.screenshot()))  # type: ignore[attr-defined]
    return np.asarray(image.convert("L"), dtype=float)
