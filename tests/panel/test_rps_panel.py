"""What the sliders of a 3-RPS mean, and that no value of theirs raises."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rps_pin import InputError, RPSRobot
from rps_pin.panel import RPSPanel
from rps_pin.rps import Payload

MICRO = RPSRobot.from_preset("micro").with_payload(Payload(mass=0.5))
SLIDER = st.one_of(st.floats(0.1, 0.35), st.floats(-1.2, 1.2), st.floats())
MOVE = st.tuples(st.sampled_from(["pose", "lengths"]), SLIDER, SLIDER, SLIDER)


@pytest.fixture
def panel() -> RPSPanel:
    return RPSPanel(MICRO)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.21, 0.24), st.floats(-0.08, 0.08), st.floats(-0.08, 0.08))
def test_a_pose_is_read_out_as_the_robot_has_it(z: float, x: float, y: float) -> None:
    panel, pose, still = RPSPanel(MICRO), np.array([z, x, y]), np.zeros(3)
    assert panel.move("pose", pose)
    np.testing.assert_array_equal(panel.values("pose"), pose)
    legs = MICRO.inverse_kinematics(pose)
    np.testing.assert_allclose(panel.values("lengths"), legs.length, rtol=0, atol=1e-15)
    q, v, a = MICRO.state(pose, still, still)
    np.testing.assert_allclose(panel.configuration, q, rtol=0, atol=1e-12)
    held = MICRO.inverse_dynamics(q, v, a).tau  # through the constraint models
    np.testing.assert_allclose(panel.force, held, rtol=0, atol=1e-9)
    assert panel.trouble == []
    rows = dict(panel.readings())
    assert rows["height"] == f"{1e3 * z:.3f} mm"
    assert str(f"{held[0]:.3f}") in rows["forces that hold it"]


def test_lengths_are_followed_in_the_same_assembly_mode(panel: RPSPanel) -> None:
    wanted = np.array([0.224, 0.06, -0.03])
    assert panel.move("lengths", MICRO.inverse_kinematics(wanted).length)
    np.testing.assert_allclose(panel.values("pose"), wanted, rtol=0, atol=1e-12)


def test_beyond_a_limit_it_is_shown_and_said(panel: RPSPanel) -> None:
    assert panel.move("pose", [0.255, 0.0, 0.0])
    assert panel.pose[0] == 0.255
    assert len(panel.trouble) == 3
    assert "leg 1: length would be 255 mm; its limits are 200 to 250 mm" in panel.trouble
    assert panel.move("pose", [0.225, 0.0, 0.0])
    assert panel.trouble == []


def test_what_cannot_be_is_refused_and_the_last_stays(panel: RPSPanel) -> None:
    before = panel.configuration.copy()
    for group, values in (
        ("lengths", [0.19, 0.26, 5.0]),
        ("pose", [np.nan, 0.0, 0.0]),
        ("pose", [0.2, 0.1]),
        ("colour", [1.0]),
    ):
        assert not panel.move(group, values)
        assert panel.trouble[-1].startswith("not followed: ")
        np.testing.assert_array_equal(panel.configuration, before)


@settings(max_examples=30, deadline=None)
@given(st.lists(MOVE, max_size=6))
def test_nothing_raises_and_the_loops_stay_closed(moves: list) -> None:
    panel = RPSPanel(MICRO)
    for group, *values in moves:
        with np.errstate(all="ignore"):
            panel.move(group, values)
        assert MICRO.mechanism.loop_gap(panel.configuration) < 1e-9
        assert np.isfinite(panel.force).all()
        assert len(panel.readings()) == 8


@pytest.mark.parametrize("preset", ["micro", "sokolov"])
def test_sliders_hold_where_the_robot_starts(preset: str) -> None:
    panel = RPSPanel(RPSRobot.from_preset(preset))
    for group, sliders in panel.groups.items():
        for slider, value in zip(sliders, panel.values(group), strict=True):
            assert slider.low < slider.scale * value < slider.high
            assert 0.0 < slider.step < slider.high - slider.low


def test_nonsense_is_refused() -> None:
    with pytest.raises(InputError, match=r"it must be \(3,\)"):
        RPSPanel(MICRO, [[0.2, 0.0, 0.0]])
