"""Pages with layers, pictures and films, drawn by a real browser."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence

from rps_pin import ClosedLoopModel, RPSRobot, helix
from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer import Recorder, View, save_html, save_png, save_video
from rps_pin.viewer.files.browser import find_browser
from rps_pin.viewer.files.film import write_film
from rps_pin.viewer.files.pictures import pixels_of
from tests.viewer.conftest import Watched

STORED = Path(__file__).with_name("pictures")
URDF = Path(__file__).parents[2] / "urdf"
BLOCK = 8
"""Pixels a side that are averaged before pictures are compared: edges differ between renderers."""
ALIKE, OTHER = 1.5, 3.0
"""Greatest mean difference of pictures of the same thing, and least of different ones, in 1/255."""


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module")
def path(robot):
    return helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)


@pytest.fixture
def chromium(monkeypatch):
    if find_browser() is None:
        pytest.skip("no Chromium found")


SEEN = """(points) => {
    const pane = document.getElementById('meshcat-pane').getBoundingClientRect();
    const world = viewer.scene_tree.find(['world']).object;
    viewer.scene.updateMatrixWorld(true);
    viewer.camera.updateMatrixWorld();
    return points.map((point) => {
        const at = viewer.camera.position.clone().set(...point);
        at.applyMatrix4(world.matrixWorld).project(viewer.camera);
        return [pane.width * (1 + at.x) / 2, pane.height * (1 - at.y) / 2];
    });
}"""
"""Where points of the world are seen, in pixels of the pane."""


def check_picture(watched: Watched, size: tuple[int, int], points: np.ndarray) -> None:
    """Check that robot, arrows and ring are in the picture, and clear of the legend and the bar."""
    width, height = size
    watched.page.set_viewport_size({"width": width, "height": height})
    watched.page.evaluate("document.getElementById('legend').open = true")
    watched.page.evaluate("viewer.set_3d_pane_size()")
    seen = np.array(watched.page.evaluate(SEEN, points.tolist()))
    free = watched.page.evaluate("freePart(document.getElementById('meshcat-pane'))")
    assert (seen >= [free["left"], free["top"]]).all(), size
    assert (seen <= [free["right"], free["bottom"]]).all(), size
    assert 0.6 < (np.ptp(seen, axis=0) / [free["width"], free["height"]]).max() <= 0.95, size
    if width < height:  # a phone: the robot first, over the whole width
        assert free["width"] == width and free["height"] > 0.4 * height


def blocks(picture: np.ndarray) -> np.ndarray:
    h, w = (side // BLOCK * BLOCK for side in picture.shape[:2])
    cut = picture[:h, :w].astype(float)
    return cut.reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, 3).mean(axis=(1, 3))


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the mean difference of two pictures' blocks, in 1/255."""
    return float(np.abs(blocks(one) - blocks(other)).mean())


def read(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"))


def find(watched: Watched, expression: str):
    return watched.page.evaluate(f"(() => {{ {expression} }})()")


def test_a_page_with_layers_holds_them_moves_them_and_ticks_them_off(
    robot, path, watched, tmp_path
):
    page = tmp_path / "page.html"
    save_html(
        page, robot, path, layers=["trail", "singularity"], hidden=["forces"], title="A helix"
    )
    watched.page.context.set_offline(True)
    watched.page.set_viewport_size({"width": 400, "height": 300})
    watched.page.goto(page.as_uri())
    watched.wait("typeof viewer !== 'undefined' && !viewer.needs_render")
    watched.page.evaluate("viewer.animator.pause()")
    tree = find(
        watched,
        """const of = (node) => Object.keys(node.children);
        const layers = viewer.scene_tree.children.world.children.layers;
        return Object.fromEntries(of(layers).map((n) => [n, of(layers.children[n])]))""",
    )
    assert sorted(tree) == ["forces", "singularity", "trail"]
    assert sorted(tree["trail"]) == ["path", "point"]
    assert [name for name in tree["forces"] if name.endswith("prismatic")] == tree["forces"]

    seen = "return viewer.scene_tree.find(['world', 'layers', '%s']).object.visible"
    assert find(watched, seen % "trail") is True
    assert find(watched, seen % "forces") is False
    watched.page.locator("#legend summary").click()  # folded in a small window
    forces = watched.page.locator("#layers input[name=forces]")
    forces.check()
    assert find(watched, seen % "forces") is True
    forces.uncheck()
    assert find(watched, seen % "forces") is False
    assert "magnified 100 times" in watched.page.locator("#layers").inner_text()

    # Keyframes, through packing and three.js: the ball on the trail, an arrow's length, a colour.
    watched.page.evaluate("viewer.animator.seek(1.5)")
    node = "const n = viewer.scene_tree.find(['world', 'layers', %s]).object; "
    point = find(watched, node % "'trail', 'point'" + "return n.position.toArray()")
    centre = [robot.platform_placement(path.sample(t)[0])[0] for t in (0.0, 1.5)]
    np.testing.assert_allclose(point, centre[0] + 100 * (centre[1] - centre[0]), atol=2e-4)
    length = find(watched, node % "'forces', 'leg_1_prismatic'" + "return n.scale.toArray()")
    force = robot.actuator_forces(*path.sample(1.5))[0]
    np.testing.assert_allclose(length, 0.2 * force, rtol=2e-3)  # 200 mm for 1 N
    ring = node % "'singularity', 'ring', 'annulus', '<object>'"
    colour = ring + "return n.material.color.toArray()"
    found = []
    for time in (0.1, 2.6):
        watched.page.evaluate(f"viewer.animator.seek({time})")
        found.append(find(watched, colour))
        measure = 1 / robot.mechanism.condition(robot.state(*path.sample(time))[0])
        share = np.log(measure) / np.log(1e-3)  # blue, yellow in the middle
        blue, yellow = np.array([0x00, 0x72, 0xB2]) / 255, np.array([0xF0, 0xE4, 0x42]) / 255
        np.testing.assert_allclose(found[-1], blue + 2 * share * (yellow - blue), atol=4e-4)
    assert np.abs(np.subtract(*found)).max() > 8e-4
    view = View(Recorder(), robot, path, layers=["trail", "singularity"], hidden=["forces"])
    for size in ((700, 500), (390, 700)):
        check_picture(watched, size, view.scene.frame.points)
    assert watched.complaints == []
    assert watched.requests == [page.as_uri()]


def test_a_picture_is_as_stored_and_differs_where_the_robot_moved(robot, chromium, tmp_path):
    now, other = tmp_path / "now.png", tmp_path / "other.png"
    options = {"size": (320, 240), "layers": ["forces"], "captions": False}
    save_png(now, robot, [0.4, 0.1, -0.05], **options)
    save_png(other, robot, [0.36, 0.1, -0.05], **options)
    assert read(now).shape == (240, 320, 3)
    stored = read(STORED / "robot.png")
    assert difference(read(now), stored) < ALIKE
    assert difference(read(other), stored) > OTHER


FRAME_RATE = 5.0


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> tuple[Path, list[bytes]]:
    """A film that `save_video` wrote, and the pictures that it wrote it from."""
    if find_browser() is None:
        pytest.skip("no Chromium found")
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    motion = four_bar.simulate(four_bar.home, duration=0.4)
    film, pictures = tmp_path_factory.mktemp("film") / "film.mp4", []

    def remember(path, given, frame_rate):
        pictures.extend(given)
        write_film(path, pictures, frame_rate)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rps_pin.viewer.save.write_film", remember)
        save_video(film, four_bar, motion, size=(160, 120), frame_rate=FRAME_RATE, captions=False)
    return film, pictures


@pytest.mark.parametrize("name", ["film.gif", "film.webp", "film.mp4"])
def test_a_film_moves(drawn, tmp_path, name):
    saved, drawings = drawn
    film = tmp_path / name
    write_film(film, drawings, FRAME_RATE)
    if film.suffix == saved.suffix:
        assert film.read_bytes() == saved.read_bytes()
    pictures = frames_of(film)
    assert len(pictures) == 2
    for picture, drawing in zip(pictures, drawings, strict=True):
        assert picture.shape == (120, 160, 3)
        assert np.abs(picture.astype(float) - pixels_of(drawing)).mean() < 3.0
    assert np.abs(pictures[0].astype(float) - pictures[1]).mean() > 1.0


def test_a_film_has_its_rate_begins_again_and_may_have_odd_sides(tmp_path):
    rng, pictures = np.random.default_rng(0), []
    for _ in range(3):
        picture = io.BytesIO()
        Image.fromarray(rng.integers(0, 256, (121, 161, 3), dtype=np.uint8)).save(picture, "PNG")
        pictures.append(picture.getvalue())
    for name in ("film.gif", "film.webp", "film.mp4"):
        write_film(tmp_path / name, pictures, 25.0)
    with Image.open(tmp_path / "film.gif") as gif:
        assert [one.info["duration"] for one in ImageSequence.Iterator(gif)] == [40] * 3
        assert gif.info["loop"] == 0
        assert gif.size == (161, 121)
    with Image.open(tmp_path / "film.webp") as webp:
        assert (webp.n_frames, webp.size, webp.info["loop"]) == (3, (161, 121), 0)
    details = next(imageio_ffmpeg.read_frames(tmp_path / "film.mp4"))
    assert (details["fps"], details["size"], details["codec"]) == (25.0, (160, 120), "h264")


def frames_of(film: Path) -> list[np.ndarray]:
    if film.suffix == ".mp4":
        decode = ["-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(film), *decode]
        raw = subprocess.run(command, capture_output=True, check=True).stdout
        return list(np.frombuffer(raw, np.uint8).reshape(-1, 120, 160, 3))
    with Image.open(film) as opened:
        return [np.asarray(one.convert("RGB")) for one in ImageSequence.Iterator(opened)]


def test_a_transparent_picture_is_one(chromium, tmp_path):
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    clear = tmp_path / "clear.png"
    save_png(clear, four_bar, size=(80, 60), scale=2.0, background="transparent", captions=False)
    alpha = np.asarray(Image.open(clear))[..., 3]
    assert alpha.shape == (120, 160)
    assert alpha.min() == 0 and alpha.max() == 255


@pytest.mark.parametrize(
    ("name", "options", "complaint"),
    [
        ("a.jpg", {}, "written as .png"),
        ("missing/a.png", {}, "cannot write"),
        ("a.png", {"size": (5, 5)}, "5 x 5"),
        ("a.png", {"size": "large"}, "width and a height"),
        ("a.png", {"time": 9.0}, "lasts from 0 to 5.2"),
    ],
)
def test_pictures_that_cannot_be_are_refused_before_anything_is_drawn(
    robot, path, tmp_path, name, options, complaint
):
    with pytest.raises(InputError, match=complaint):
        save_png(tmp_path / name, robot, path, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "pose", "options", "complaint"),
    [
        ("a.avi", False, {}, "written as one of .mp4, .gif, .webp"),
        ("a.gif", True, {}, "a single pose makes no film"),
        ("a.gif", False, {"background": "transparent"}, "no transparent"),
        ("a.gif", False, {"frame_rate": 0.0}, "frame_rate"),
    ],
)
def test_films_that_cannot_be_are_refused(robot, path, tmp_path, name, pose, options, complaint):
    with pytest.raises(InputError, match=complaint):
        save_video(tmp_path / name, robot, [0.4, 0.1, 0.0] if pose else path, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("module", "name"),
    [("playwright.sync_api", "a.png"), ("imageio_ffmpeg", "a.mp4"), ("imageio.v2", "a.gif")],
)
def test_what_is_missing_is_said_with_how_to_install_it(
    robot, path, tmp_path, monkeypatch, module, name
):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RPSPinError, match=r"pip install 'rps-pin\[pictures\]'"):
        (save_png if name.endswith("png") else save_video)(tmp_path / name, robot, path)
    assert list(tmp_path.iterdir()) == []


def test_a_browser_that_is_none_is_said(robot, tmp_path, monkeypatch):
    monkeypatch.setenv("RPS_PIN_CHROMIUM", "/nowhere/chromium")
    with pytest.raises(RPSPinError, match="apt-get install chromium"):
        save_png(tmp_path / "a.png", robot, [0.4, 0.1, 0.0])
