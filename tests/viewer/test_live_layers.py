"""Layers in a live page: they move, and the page's ticks follow Python."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from rps_pin import RPSRobot, helix
from rps_pin.errors import InputError
from rps_pin.viewer import show


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


def test_a_live_page_follows_python(robot, watched):
    node = "viewer.scene_tree.find(['world', 'layers', 'frames', 'platform_free'])"
    point = f"{node}.object.position.z"
    tick = "document.querySelector('#layers input[name=%s]')"
    watched.page.set_viewport_size({"width": 300, "height": 200})
    with show(robot, [0.4, 0.1, 0.0], layers=["frames"], hidden=["closures"]) as view:
        assert view.url.startswith("http://127.0.0.1:")
        watched.page.goto(view.url)
        watched.wait(f"typeof viewer !== 'undefined' && {tick % 'closures'} !== null")
        assert watched.page.evaluate(f"({tick % 'closures'}).checked") is False
        view.display([0.38, 0.1, 0.0])
        watched.wait(f"Math.abs({point} - 0.38) < 1e-6")
        view.set_visible("closures", True)
        watched.wait(f"({tick % 'closures'}).checked")
        closures = "viewer.scene_tree.find(['world', 'layers', 'closures']).object.visible"
        assert watched.page.evaluate(closures) is True
        watched.page.reload()  # a tab that opens late sees the same
        watched.wait(f"typeof viewer !== 'undefined' && {tick % 'closures'} !== null")
        watched.wait(f"({tick % 'closures'}).checked && Math.abs({point} - 0.38) < 1e-6")
        assert watched.complaints == []


def test_a_view_plays_until_it_is_told_to_stop(robot):
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    stop = threading.Event()
    with show(robot, path, layers=["trail", "forces"]) as view:
        seen: list[np.ndarray] = []
        display = view.scene.display

        def watching(q):
            seen.append(np.array(q))
            display(q)
            if len(seen) == 3:
                stop.set()

        view.scene.display = watching
        view.play(stop, frame_rate=50.0)
    assert len(seen) == 3
    assert np.abs(seen[2] - seen[0]).max() > 0.0


@pytest.mark.parametrize(
    ("state", "complaint"),
    [
        (([0.4, np.nan, 0.0],), "finite"),
        (([0.4, 0.1],), r"must be \(13,\)"),
        (([0.4, 0.1, 0.0], [1.0]), "v has shape"),
    ],
)
def test_states_that_do_not_fit_are_refused(robot, state, complaint):
    with show(robot, [0.4, 0.1, 0.0]) as view, pytest.raises(InputError, match=complaint):
        view.display(*state)
