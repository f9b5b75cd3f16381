"""The pages in a real browser: they draw, they move, they ask nobody for anything."""

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page

from rps_pin.viewer import LocalViewer, Scene
from tests.viewer.conftest import Watched, open_text, watching
from tests.viewer.robots import motion_page

# Mean over the picture of the absolute difference of two pixels, in 1 / 255.
DIFFERENT = 1.0
SAME = 0.01
ALLOWED = ("file:", "data:", "blob:")


def difference(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one - other).mean())


def sample_page(sample, **options) -> str:
    return motion_page(sample.model, sample.visual, sample.times, sample.configurations, **options)


@pytest.fixture(scope="module")
def opened(sample, browser, tmp_path_factory) -> Iterator[Watched]:
    """One page for all tests that leave it as it is but for its time; it plays by itself."""
    watch = watching(browser)
    text = sample_page(sample, title="Sample <robot>")
    open_text(watch, text, tmp_path_factory.mktemp("page") / "page.html")
    assert watch.page.evaluate("viewer.animator.playing")
    watch.page.evaluate("viewer.animator.pause()")
    yield watch
    watch.page.close()


@pytest.fixture
def playing(opened) -> Iterator[Watched]:
    """The same, from its beginning; it pauses for the next test, or would take its processor."""
    opened.page.evaluate("viewer.animator.reset(); viewer.animator.play()")
    yield opened
    opened.page.evaluate("viewer.animator.pause()")


def time_of(page: Page) -> float:
    return float(page.evaluate("viewer.animator.time"))


def stop_at(page: Page, time: float) -> None:
    page.evaluate(f"viewer.animator.pause(); viewer.animator.seek({time})")


def share_coloured(picture: np.ndarray) -> float:
    """Return the share of pixels with a distinct colour: the robot's, not the stage's greys."""
    return float(((picture.max(axis=2) - picture.min(axis=2)) > 60).mean())


def test_the_page_draws_the_robot_without_complaint_or_network(opened):
    watched = opened
    picture = watched.picture()
    assert picture.shape == (600, 800, 3)
    assert picture.std() > 10.0
    assert 0.02 < share_coloured(picture) < 0.5
    assert watched.page.title() == "Sample <robot>"
    caption = watched.page.locator("#caption")
    assert caption.is_visible()
    assert caption.inner_text().split("\n") == [
        "Sample <robot>",
        "2 s, in a loop · grid 50 mm",
    ]
    assert watched.complaints == []
    assert [url for url in watched.requests if not url.startswith(ALLOWED)] == []


def test_the_browser_itself_forbids_the_page_any_network(sample, show):
    watched = show(sample_page(sample))
    answer = watched.page.evaluate(
        "fetch('http://127.0.0.1:9/').then(() => 'answered', (error) => 'refused')"
    )
    assert answer == "refused"
    assert any("Content Security Policy" in complaint for complaint in watched.complaints)


def test_it_plays_by_itself_and_in_a_loop(playing):
    watched = playing  # `opened` has seen that it starts by itself
    assert watched.page.evaluate("viewer.animator.duration") == pytest.approx(2.0)
    # Many times its length later it is still within its length, and moving: it has begun again.
    watched.page.evaluate("viewer.animator.mixer.update(21)")
    watched.wait("viewer.animator.time > 1.2")
    watched.wait("viewer.animator.time < 1.0")
    assert watched.page.evaluate("viewer.animator.playing")


def test_the_picture_changes_with_the_time_and_only_then(playing):
    watched = playing
    stop_at(watched.page, 0.5)
    early = watched.picture()
    watched.page.wait_for_timeout(300)
    assert difference(early, watched.picture()) < SAME
    stop_at(watched.page, 1.5)
    assert difference(early, watched.picture()) > DIFFERENT
    stop_at(watched.page, 0.5)
    assert difference(early, watched.picture()) < SAME


def test_the_playback_controls_work(playing):
    watched = playing
    page = watched.page
    controls = page.locator("#playback")
    controls.get_by_text("Pause", exact=True).click()
    stopped = time_of(page)
    page.wait_for_timeout(300)
    assert time_of(page) == stopped
    controls.get_by_text("Play", exact=True).click()
    watched.wait(f"viewer.animator.time !== {stopped}")
    # In one step: while it plays, the page itself moves the slider.
    page.locator("#playback input").evaluate(
        "(slider) => { slider.value = 1.25; slider.dispatchEvent(new Event('input')); }"
    )
    watched.wait("document.getElementById('clock').textContent === 't = 1.25 s'")
    controls.locator("select").select_option("0.5")
    assert page.evaluate("viewer.animator.mixer.timeScale") == 0.5
    controls.locator("select").select_option("1")


def test_a_link_on_the_page_stands_where_pinocchio_puts_it(sample, playing):
    """Through packing, three.js's interpolation and the scene tree, to the browser's matrices."""
    page = playing.page
    stop_at(page, 1.25)
    found = page.evaluate(
        """() => {
            const find = (...path) => viewer.scene_tree.find(path).object;
            viewer.scene.updateMatrixWorld(true);
            const world = find("world").matrixWorld.clone().invert();
            return world.multiply(find("world", "robot", "platform").matrixWorld).elements;
        }"""
    )
    start = sample.model.joints[sample.model.getJointId("float")].idx_q
    expected = sample.configurations[1250][start : start + 3]
    np.testing.assert_allclose(np.reshape(found, (4, 4)).T[:3, 3], expected, atol=1e-4)


def test_a_single_pose_is_shown_too(sample, show):
    watched = show(motion_page(sample.model, sample.visual, [0.0], sample.configurations[:1]))
    assert share_coloured(watched.picture()) > 0.02
    assert watched.complaints == []


def test_without_webgl_the_page_says_why_it_is_empty(sample, watched, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(sample_page(sample), encoding="utf-8")
    watched.page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    watched.page.goto(path.as_uri())
    watched.wait("document.getElementById('note').textContent.includes('needs WebGL')")


def test_the_local_viewer_shows_the_robot_and_moves_it(sample, watched):
    with LocalViewer(title="Live") as viewer:
        scene = Scene(sample.model, sample.visual, viewer.window, sample.configurations)
        watched.page.goto(viewer.url)
        loaded = "viewer.scene_tree.children.world?.children.robot !== undefined"
        watched.wait(f"typeof viewer !== 'undefined' && {loaded}")
        before = watched.picture()
        assert share_coloured(before) > 0.02
        assert difference(before, watched.picture()) < SAME

        told = watched.page.evaluate("viewer.num_messages_received")
        scene.display(sample.configurations[500])
        watched.wait(f"viewer.num_messages_received >= {told} + 3")
        after = watched.picture()
        assert difference(before, after) > DIFFERENT

        # A tab that opens late, here the same one again, sees the robot as it stands by now.
        watched.page.reload()
        watched.wait(f"typeof viewer !== 'undefined' && {loaded}")
        assert difference(after, watched.picture()) < SAME
        assert watched.complaints == []
        own = (viewer.url, viewer.url.replace("http:", "ws:"), "data:")
        assert [url for url in watched.requests if not url.startswith(own)] == []
    watched.wait("document.getElementById('note').textContent.startsWith('No connection')")


def test_the_page_and_the_server_show_the_same_picture(sample, watched, show):
    q = sample.configurations[:1]
    on_disk = show(motion_page(sample.model, sample.visual, [0.0], q)).picture()
    with LocalViewer() as viewer:
        Scene(sample.model, sample.visual, viewer.window, q)
        watched.page.goto(viewer.url)
        watched.wait("typeof viewer !== 'undefined' && viewer.num_messages_received > 30")
        assert difference(on_disk, watched.picture()) < SAME
