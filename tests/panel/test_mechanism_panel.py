"""Sliders of any mechanism's actuated joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.panel import MechanismPanel

URDF = Path(__file__).resolve().parents[2] / "urdf"
NAMES = ["four_bar", "five_bar", "slider_crank", "delta", "stewart", "rps"]
NAMES += ["rotary_stewart", "linear_delta", "planar_rrr"]


@pytest.mark.parametrize("name", NAMES)
def test_joints_go_where_the_sliders_say_and_the_loops_close(name: str) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    panel = MechanismPanel(mechanism)
    rng, sliders = np.random.default_rng(1), panel.groups["joints"]
    home = panel.values()
    for _ in range(5):
        wanted = home + rng.uniform(-0.01, 0.01, home.size)
        assert panel.move("joints", wanted), panel.trouble
        np.testing.assert_allclose(panel.values(), wanted, rtol=0, atol=1e-12)
        assert mechanism.loop_gap(panel.configuration) < 1e-9
        still = np.zeros(mechanism.model.nv)
        held = mechanism.inverse_dynamics(panel.configuration, still, still).tau
        rows = dict(panel.readings())
        for joint, tau in zip(mechanism.actuated, held, strict=True):
            assert rows[f"holds: {joint}"].startswith(f"{tau:.3f}")
    assert [slider.name.split(" (")[0] for slider in sliders] == list(mechanism.actuated)


def test_units_are_the_joints() -> None:
    sliders = MechanismPanel(ClosedLoopModel.load(URDF / "stewart.yaml")).groups["joints"]
    assert all(slider.name.endswith("(mm)") and slider.scale == 1e3 for slider in sliders)
    sliders = MechanismPanel(ClosedLoopModel.load(URDF / "four_bar.yaml")).groups["joints"]
    assert sliders[0].name == "crank_joint (degrees)"
    assert sliders[0].scale == pytest.approx(180 / np.pi)


def test_what_cannot_be_closed_is_said_and_the_last_stays() -> None:
    panel = MechanismPanel(ClosedLoopModel.load(URDF / "delta.yaml"))
    for values in ([9.0, 0.0, 0.0], [np.nan] * 3, [0.0]):
        before = panel.configuration.copy()
        assert not panel.move("joints", values)
        assert panel.trouble[0].startswith("not followed: ")
        np.testing.assert_array_equal(panel.configuration, before)


def test_a_passive_joint_beyond_its_limit_is_shown_and_said(tmp_path: Path) -> None:
    """The coupler of this four-bar must stay below 0.2 rad; it cannot where the crank is low."""
    text = (URDF / "four_bar.urdf").read_text("utf-8")
    crank, coupler = text.split('<joint name="coupler_joint"')
    coupler = coupler.replace('lower="-6.283185307179586"', 'lower="-2.0"', 1)
    coupler = coupler.replace('upper="6.283185307179586"', 'upper="0.2"', 1)
    (tmp_path / "four_bar.urdf").write_text(f'{crank}<joint name="coupler_joint"{coupler}')
    (tmp_path / "four_bar.yaml").write_text((URDF / "four_bar.yaml").read_text("utf-8"))
    panel = MechanismPanel(ClosedLoopModel.load(tmp_path / "four_bar.yaml"))
    assert panel.trouble == []
    assert panel.move("joints", [0.056])
    assert panel.configuration[1] > 0.8
    (words,) = panel.trouble
    assert words.startswith("joint 'coupler_joint' at 46.")
    assert words.endswith(" degrees (-114.592 to 11.4592)")
    assert panel.mechanism.loop_gap(panel.configuration) < 1e-9
    assert panel.move("joints", [1.0])
    assert panel.trouble == []


def test_an_actuator_that_is_too_weak_to_hold_it_is_said() -> None:
    mechanism = ClosedLoopModel.load(URDF / "four_bar.yaml")
    joint = mechanism.model.joints[mechanism.model.getJointId("crank_joint")]
    mechanism.model.upperEffortLimit[joint.idx_v] = 1e-3
    mechanism.model.lowerEffortLimit[joint.idx_v] = -1e-3
    panel = MechanismPanel(mechanism)
    still = np.zeros(mechanism.model.nv)
    (needed,) = mechanism.inverse_dynamics(panel.configuration, still, still).tau
    assert abs(needed) > 1e-3
    (words,) = panel.trouble
    assert words == f"joint 'crank_joint' would need {needed:.6g} N m (-0.001 to 0.001)"


@pytest.mark.parametrize("name", ["stewart", "delta", "ankle", "five_bar"])
def test_the_task_goes_where_its_sliders_say_and_both_groups_follow_each_other(name: str) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    panel, task, rng = MechanismPanel(mechanism), mechanism.task, np.random.default_rng(2)
    assert list(panel.groups) == ["task", "joints"]
    home = panel.values("task")
    for _ in range(5):
        wanted = home + rng.uniform(-0.02, 0.02, home.size)
        assert panel.move("task", wanted), panel.trouble
        np.testing.assert_array_equal(panel.values("task"), wanted)
        lengths = task.to_actuators(wanted, panel.configuration)
        np.testing.assert_allclose(panel.values("joints"), lengths, rtol=0, atol=1e-11)
        assert mechanism.loop_gap(panel.configuration) < 1e-9
        assert panel.move("joints", panel.values("joints") + 0.005)
        np.testing.assert_allclose(panel.values("task"), task.at(panel.configuration), atol=1e-12)
    rows = dict(panel.readings())
    for coordinate, turns in zip(task.coordinates, task.angular, strict=True):
        assert rows[coordinate].endswith("degrees" if turns else "mm")
    assert float(rows["distance to type II"].split()[0]) > 0


def test_a_pose_that_is_not_reached_is_said_and_the_last_stays() -> None:
    panel = MechanismPanel(ClosedLoopModel.load(URDF / "delta.yaml"))
    before = panel.configuration.copy()
    assert not panel.move("task", panel.values("task") + np.array([0.25, 0.0, 0.25]))
    assert panel.trouble[-1].startswith("not followed: ")
    np.testing.assert_array_equal(panel.configuration, before)


def test_a_mechanism_without_a_task_has_sliders_of_its_joints_alone() -> None:
    assert list(MechanismPanel(ClosedLoopModel.load(URDF / "gripper.yaml")).groups) == ["joints"]
