"""The handle: placements of a task's frame are its coordinates, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, RPSRobot
from rps_pin.panel import MechanismPanel, Panel, RPSPanel
from tests.worst import worst

URDF = Path(__file__).resolve().parents[2] / "urdf"
MICRO = RPSRobot.from_preset("micro")


def panel_of(name: str) -> Panel:
    if name == "3rps":
        return RPSPanel(MICRO)
    return MechanismPanel(ClosedLoopModel.load(URDF / f"{name}.yaml"))


@pytest.mark.parametrize("name", ["3rps", "stewart", "delta", "planar_rrr", "five_bar"])
def test_where_the_frame_is_dragged_the_task_goes(name: str) -> None:
    panel, rng = panel_of(name), np.random.default_rng(3)
    handle, task = panel.handle, panel.task
    assert handle is not None
    assert task is not None
    there = panel_of(name)
    for _ in range(5):
        wanted = there.values(there.task_group) + rng.uniform(-0.01, 0.01, task.size)
        assert there.move(there.task_group, wanted), there.trouble
        assert panel.drag(handle.placement(there.configuration))
        assert worst(panel.values(panel.task_group) - wanted) < 1e-9
        assert worst(panel.configuration - there.configuration) < 1e-6


def test_axes_that_are_no_coordinates_are_not_offered_and_do_not_count() -> None:
    panel = RPSPanel(MICRO)
    handle = panel.handle
    assert handle is not None
    assert handle.moves == (False, False, True)
    assert handle.turns == (True, True, False)
    here = pin.SE3(handle.placement(panel.configuration))
    here.translation += np.array([0.05, -0.03, 0.004])
    assert panel.drag(here.homogeneous)
    assert worst(panel.pose - [0.229, 0.0, 0.0]) < 1e-12
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.4])), here.translation)
    assert panel.drag(turned.homogeneous)
    assert worst(panel.pose - [0.229, 0.0, 0.0]) < 1e-12


def test_a_turn_beyond_half_a_turn_goes_on() -> None:
    panel = panel_of("stewart")
    handle, q, x = panel.handle, panel.configuration, panel.values("task")
    assert handle is not None
    x[3:] = [0.0, 0.0, 3.1]
    found = handle.coordinates(pin.SE3(pin.exp3(np.array([0, 0, 3.2])), x[:3]).homogeneous, q, x)
    assert worst(found - [*x[:3], 0.0, 0.0, 3.2]) < 1e-9


def test_a_drag_to_where_it_cannot_be_keeps_the_last_pose_and_says_both() -> None:
    panel = panel_of("delta")
    assert panel.handle is not None
    before, there = panel.configuration.copy(), panel.handle.placement(panel.configuration)
    there[:3, 3] += [0.25, 0.0, 0.25]
    assert not panel.drag(there)
    np.testing.assert_array_equal(panel.configuration, before)
    asked = 1e3 * there[0, 3]
    assert panel.trouble[-1].startswith(f"not followed: x {asked:.3f} mm, z ")


def test_a_task_of_joints_has_no_handle() -> None:
    panel = panel_of("gripper")
    assert panel.handle is None
    with pytest.raises(InputError, match="no frame that can be dragged"):
        panel.drag(np.eye(4))
