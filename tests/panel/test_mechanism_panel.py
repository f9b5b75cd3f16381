"""Sliders of any mechanism's actuated joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.panel import MechanismPanel

URDF = Path(__file__).resolve().parents[2] / "urdf"
NAMES = ["four_bar", "five_bar", "slider_crank", "delta", "stewart", "rps"]


@pytest.mark.parametrize("name", NAMES)
def test_joints_go_where_the_sliders_say_and_the_loops_close(name: str) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    panel = MechanismPanel(mechanism)
    rng, (sliders,) = np.random.default_rng(1), panel.groups.values()
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
    (sliders,) = MechanismPanel(ClosedLoopModel.load(URDF / "stewart.yaml")).groups.values()
    assert all(slider.name.endswith("(mm)") and slider.scale == 1e3 for slider in sliders)
    (sliders,) = MechanismPanel(ClosedLoopModel.load(URDF / "four_bar.yaml")).groups.values()
    assert sliders[0].name == "crank_joint (degrees)"
    assert sliders[0].scale == pytest.approx(180 / np.pi)


def test_what_cannot_be_closed_is_said_and_the_last_stays() -> None:
    panel = MechanismPanel(ClosedLoopModel.load(URDF / "delta.yaml"))
    for values in ([9.0, 0.0, 0.0], [np.nan] * 3, [0.0]):
        before = panel.configuration.copy()
        assert not panel.move("joints", values)
        assert panel.trouble[0].startswith("not followed: ")
        np.testing.assert_array_equal(panel.configuration, before)
