"""The panel in a page and in a notebook: sliders are moved, readings and pictures follow."""

from __future__ import annotations

import io
import os
import re
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from PIL import Image

from rps_pin import ClosedLoopModel, InputError, RPSPinError, RPSRobot, helix
from rps_pin.panel import BrowserPanel, MechanismPanel, NotebookPanel, PoseFile, RPSPanel
from rps_pin.panel.page.worker import Worker
from rps_pin.viewer.files.browser import ARGUMENTS

URDF = Path(__file__).resolve().parents[2] / "urdf"
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
    assert f"<td>{1e3 * length[0]:.3f}</td>" in served.text
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
        assert moved(lambda: abs(panel.force[1] / force - 1.0) > 1e-3)
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
        with urlopen(panel.url, timeout=120) as answer:
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


def test_beyond_its_limits_the_robot_is_red_and_within_them_as_before(served: BrowserPanel) -> None:
    scene = served.view.scene
    painted: dict[str, tuple[float, ...]] = {}
    paint = scene.writer.set_colour
    scene.writer.set_colour = lambda path, colour, opacity: (
        painted.__setitem__(path, tuple(colour)),
        paint(path, colour, opacity),
    )
    served.move("lengths", [255.0, 225.0, 225.0])
    assert moved(
        lambda: "leg 1: length would be 255 mm; its limits are 200 to 250 mm" in served.text
    )
    red = {path for path, (r, g, b) in painted.items() if r > 0.8 and max(g, b) < 0.2}
    assert {path.split("/")[-2] for path in red} == {"leg_1_cylinder", "leg_1_rod"}
    served.move("lengths", [245.0, 225.0, 225.0])
    assert moved(lambda: "within all limits" in served.text)
    assert not {path for path, (r, g, b) in painted.items() if r > 0.8 and max(g, b) < 0.2}


def test_meshes_with_colours_of_their_own_turn_red_and_back(tmp_path: Path) -> None:
    mesh = trimesh.creation.box((0.1, 0.02, 0.02))
    mesh.visual.vertex_colors = np.tile(np.array([0, 200, 0, 255], dtype=np.uint8), (8, 1))
    mesh.visual.vertex_colors[0] = [200, 0, 200, 255]
    mesh.export(tmp_path / "m.obj")
    text = (URDF / "four_bar.urdf").read_text("utf-8")
    shape = f'<geometry><mesh filename="{tmp_path}/m.obj"/></geometry>'
    text = re.sub(r"<geometry>.*?</geometry>", shape, text, flags=re.DOTALL)
    text = re.sub(r"<material.*?</material>|<material[^>]*/>", "", text, flags=re.DOTALL)
    (tmp_path / "four_bar.urdf").write_text(text, "utf-8")
    (tmp_path / "four_bar.yaml").write_text((URDF / "four_bar.yaml").read_text("utf-8"))
    with BrowserPanel(MechanismPanel(ClosedLoopModel.load(tmp_path / "four_bar.yaml"))) as face:
        scene, path = face._server.scene, "/world/robot/crank/crank_0"
        own = scene.get_handle_by_name(path)
        assert not hasattr(own, "color")
        face.view.scene.set_joint_colour("crank_joint", (0.8, 0.2, 0.0))
        assert scene.get_handle_by_name(path).color == (204, 51, 0)
        np.testing.assert_allclose(scene.get_handle_by_name(path).position, own.position)
        face.view.scene.set_joint_colour("crank_joint", None)
        assert not hasattr(scene.get_handle_by_name(path), "color")


def test_what_is_beyond_a_slider_is_told_and_the_slider_goes_back(served: BrowserPanel) -> None:
    (slider, handle), *_ = served._sliders["pose"]
    served._refused(handle, 999.0)
    assert moved(lambda: "not followed: height (mm): 999 is beyond its slider" in served.text)
    handle.value = handle.max  # as the page makes of 999 when its box is left
    assert moved(lambda: handle.value == slider.scale * served._panel.pose[0])
    assert "999 is beyond its slider" in served.text
    served._refused(handle, 26.0)
    handle.value = 260.0  # typed digit by digit
    assert moved(lambda: served._panel.pose[0] == 0.26)


def test_a_trajectory_is_played_paused_and_scrubbed() -> None:
    panel = RPSPanel(MICRO)
    recording = panel.load(helix(MICRO, radius=4e-5, pitch=0.01, height=0.225))
    with BrowserPanel(panel) as face:
        assert face.player is not None
        face._worker.submit("play", lambda: face._play(True))
        assert moved(lambda: face._scrub.value > 0.05)
        assert moved(lambda: face.shown("pose")[0] == pytest.approx(1e3 * panel.pose[0]))
        face._worker.submit("pause", lambda: face._play(False))
        assert moved(lambda: not face.player.playing)
        face._scrub.value = 0.5 * recording.duration
        assert moved(lambda: panel.pose[0] == pytest.approx(0.23, abs=1e-6))
        assert moved(lambda: f"t = {0.5 * recording.duration:.2f} s" in face._clock.content)
        assert moved(lambda: "--now: 50.00%" in face._mark.content)
        np.testing.assert_array_equal(face._charts.data[0][0], recording.time)
        face.move("pose", [222.0, 0.0, 0.0])  # by hand: the last seconds
        assert moved(lambda: len(face._charts.data[0][0]) < 50)
        assert "none" in face._mark.content


def test_poses_are_saved_and_gone_to(tmp_path: Path) -> None:
    panel = RPSPanel(MICRO)
    with BrowserPanel(panel, poses=PoseFile(tmp_path / "poses.yaml", panel)) as face:
        face.move("pose", [231.0, 2.0, 0.0])
        assert moved(lambda: panel.pose[0] == pytest.approx(0.231))
        save, go = (partial(face._worker.submit, "pose", job) for job in
                    (face._save_pose, face._go_to_pose))  # fmt: skip
        save()
        assert moved(lambda: "a pose has a name" in face.text)
        face._name.value = "tool change"
        save()
        assert moved(lambda: face._saved.value == "tool change")
        face._worker.submit("home", face._go_home)
        assert moved(lambda: panel.pose[0] == pytest.approx(0.225))
        save()
        assert moved(lambda: "press &#x27;Save as&#x27; again to replace it" in face.text)
        go()
        assert moved(lambda: panel.pose[0] == pytest.approx(0.231))
        assert PoseFile(face._poses.path, panel).poses["tool change"][0] == pytest.approx(0.231)


def test_only_the_last_of_what_is_asked_repeatedly_is_done() -> None:
    begun, go, done = threading.Event(), threading.Event(), []
    worker = Worker(lambda: None)
    worker.submit("first", lambda: (begun.set(), go.wait(10.0)))
    worker.start()
    assert begun.wait(10.0)
    for k in range(100):
        worker.submit("drag", lambda k=k: done.append(k))
    worker.submit("ended", lambda: done.append("ended"))
    go.set()
    assert moved(lambda: done == [99, "ended"])
    worker.end()


@pytest.mark.skipif(not BROWSER, reason="there is no browser")
def test_the_robot_is_moved_in_the_page() -> None:
    """By the mouse at its handle, by numbers, by buttons: in Chromium."""
    playwright = pytest.importorskip("playwright.sync_api")
    said: list[str] = []
    panel = RPSPanel(MICRO)
    panel.load(helix(MICRO, radius=4e-5, pitch=0.01, height=0.225))
    with (
        BrowserPanel(panel, title="micro") as served,
        playwright.sync_playwright() as engine,
    ):
        served._writer.set_shadows(False)  # the processor draws
        browser = engine.chromium.launch(executable_path=_path(), args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 1000, "height": 460})
        page.set_default_timeout(120_000)
        page.on("console", lambda one: said.append(one.text) if one.type == "error" else None)
        page.goto(served.url)
        page.get_by_text("within all limits").wait_for()
        before = _settled(page)
        # The arrow of the height, 10 mm up and then far beyond the slider.
        x, y = _pixel(served, panel.handle.placement(panel.configuration)[:3, 3], page)
        length = _pixel(served, [0.0, 0.0, panel.pose[0] + 0.01], page)[1] - y
        page.mouse.move(x, y + 4.0 * length)
        page.mouse.down()
        page.mouse.move(x, y + 4.5 * length)
        page.mouse.move(x, y + 5.0 * length)
        page.mouse.up()
        assert moved(lambda: panel.pose[0] > 0.23)
        assert panel.pose[0] == pytest.approx(0.235, abs=1e-3)
        np.testing.assert_array_equal(panel.pose[1:], 0.0)
        # A number, as someone at the keyboard would; then one beyond the slider.
        box = page.locator(f"[id='{served._sliders['pose'][0][1]._impl.uuid}']")
        box = box.locator("xpath=..").locator("input[inputmode]").first
        box.fill("255")
        box.press("Enter")
        page.get_by_text("255.000", exact=True).first.wait_for()
        page.get_by_text("its limits are 200 to 250 mm").first.wait_for()
        after = _settled(page)
        box.fill("300")
        box.press("Tab")
        page.get_by_text("height (mm): 300 is beyond its slider").wait_for()
        page.wait_for_function("box => box.value == '255'", arg=box.element_handle())
        assert panel.pose[0] == pytest.approx(0.255)
        # The trajectory.
        page.get_by_role("button", name="Play").click()
        page.wait_for_function("document.body.textContent.match(/t = [1-9]/)")
        page.get_by_role("button", name="Pause").click()
        assert moved(lambda: not served.player.playing)
        elapsed = served.player.time
        page.get_by_text(f"t = {elapsed:.2f} s").wait_for()
        x, *_ = panel._trajectory.sample([elapsed])
        assert panel.pose == pytest.approx(x[0])
        page.get_by_role("button", name="Home").click()
        assert moved(lambda: panel.pose[0] == pytest.approx(0.225))
        browser.close()
    robot = (slice(None), slice(330, 630))  # between the columns
    assert np.abs(after[robot] - before[robot]).mean() > 0.5
    assert said == []


def _pixel(served: BrowserPanel, point: Any, page: Any) -> tuple[float, float]:
    """Return where a point of the world is on the page."""
    canvas = page.locator("canvas[data-engine]").bounding_box()
    (client,) = served._server.get_clients().values()
    camera = client.camera
    w, x, y, z = camera.wxyz
    right, down, ahead = pin.Quaternion(w, x, y, z).matrix().T @ (np.array(point) - camera.position)
    scale = canvas["height"] / 2.0 / np.tan(camera.fov / 2.0) / ahead
    return (
        canvas["x"] + canvas["width"] / 2.0 + scale * right,
        canvas["y"] + canvas["height"] / 2.0 + scale * down,
    )


def test_without_the_packages_it_says_how_to_get_them(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    for kind in (BrowserPanel, NotebookPanel):
        with pytest.raises(RPSPinError, match=r"pip install 'rps-pin\[panel\]'"):
            kind(RPSPanel(MICRO))


def moved(condition: Callable[[], bool]) -> bool:
    """Return whether a condition comes true: viser calls back in threads of its own."""
    deadline = time.monotonic() + 120.0
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
