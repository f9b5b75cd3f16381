"""The page of a run, as `rps-pin helix` writes it, opened from disk in a real browser."""

from pathlib import Path

import numpy as np
import pytest

from rps_pin import RPSRobot, helix
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.viewer import fitting_layers, save_html


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module")
def run(robot: RPSRobot) -> MotionRun:
    return run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 100.0)


def test_the_helix_page_loads_shows_the_robot_and_moves(robot, run, watched, tmp_path: Path):
    page = tmp_path / "viewer.html"
    save_html(page, robot, run, layers=fitting_layers(robot, run), title="a helix")
    watched.page.context.set_offline(True)
    watched.page.set_viewport_size({"width": 400, "height": 300})
    watched.page.goto(page.as_uri())
    watched.wait("typeof viewer !== 'undefined' && !viewer.needs_render")
    assert watched.page.evaluate("viewer.animator.duration") == pytest.approx(5.2388, abs=1e-3)
    for link in ("base", "platform", "leg_1_cylinder", "leg_2_rod"):
        assert watched.page.evaluate(
            f"!!viewer.scene_tree.find(['world', 'robot', '{link}']).object.children.length"
        ), link

    pictures = []
    for seconds in (0.5, 2.5):
        watched.page.evaluate(f"viewer.animator.pause(); viewer.animator.seek({seconds})")
        pictures.append(watched.picture())
    first, second = pictures
    assert first.std() > 10.0
    assert np.abs(first - second).mean() > 0.5

    assert watched.complaints == []
    assert watched.requests == [page.as_uri()]
