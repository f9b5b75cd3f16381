"""Sizes are refused before the work, with the switch for who needs more."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, RPSRobot, bounds
from rps_pin.bounds import SWITCH, check_size, most
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError, MechanismError
from tests.each import each


def test_the_switch_multiplies(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=f"401 things: at most 400 are taken; .*{SWITCH}=10"):
        check_size(401, 400, "401 things")
    monkeypatch.setenv(SWITCH, "10")
    check_size(4000, 400, "4000 things")
    with pytest.raises(InputError, match="at most 4000 are taken"):
        check_size(4001, 400, "4001 things")


@each("text", ["", "many", "0.5", "nan", "inf", "-1", "1e9"])
def test_a_switch_that_is_no_factor_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SWITCH, text)
    with pytest.raises(InputError, match=f"{SWITCH} = .* must be from 1 to 1e6"):
        most(1)


def test_a_model_of_too_many_velocities_is_refused() -> None:
    model = pin.Model()
    for i in range(401):
        model.addJoint(i, pin.JointModelRX(), pin.SE3.Identity(), f"j{i}")
    with pytest.raises(MechanismError, match=r"the model has 401 velocities; .* at most 400"):
        ClosedLoopModel(model, [], ["j0"])


@each(
    ("times", "why"),
    [
        ({"duration": 1e9}, r"duration / step = 1e\+12 steps: at most 10000000"),
        ({"duration": 0.01, "step": 1e-30}, r"duration / step = 1e\+28 steps"),
        ({"duration": 1e50, "step": 1e-50}, "duration / step = 1e.100 steps"),
        (
            {"duration": 3000.0},
            r"3e\+06 rows to record \(record_every keeps fewer\): at most 2",
        ),
    ],
)
def test_simulations_without_end_are_refused(times: dict[str, float], why: str) -> None:
    mechanism = ClosedLoopModel.load(Path(__file__).parents[1] / "urdf" / "four_bar.yaml")
    with pytest.raises(InputError, match=why):
        mechanism.simulate(mechanism.home, **times)


@each(
    ("settings", "why"),
    [
        ({"delay": 10**12}, "delay = 1000000000000 ticks: at most 100000"),
        ({"delay": 10**23}, "delay = 1.* ticks: at most 100000"),
        ({"substeps": 10**9}, "substeps = 1000000000: at most 1000"),
    ],
)
def test_plants_of_any_size_are_refused(settings: dict[str, int], why: str) -> None:
    robot = RPSRobot.from_preset("micro")
    with pytest.raises(InputError, match=why):
        Plant(robot, np.array([0.223, 0.0, 0.0]), **settings)


def test_the_page_of_limits_lists_every_bound() -> None:
    page = (Path(__file__).parents[1] / "docs" / "limits.md").read_text("utf-8")
    listed = {
        name: int(number.replace(" ", ""))
        for number, name in re.findall(r"\| ([\d ]+) \| `([A-Z_]+)` \|", page)
    }
    there = {
        name: value
        for name, value in vars(bounds).items()
        if name.isupper() and isinstance(value, int)
    }
    assert listed == there
    assert f"`{SWITCH}`" in page


@each(
    ("bound", "content", "read"),
    [
        ("XML", "<robot/>", "urdf"),
        ("YAML", "urdf: a.urdf", "yaml"),
        ("VALUES", "urdf: [a, b]", "yaml"),
    ],
)
def test_larger_files_are_read_with_the_switch(
    bound: str, content: str, read: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("sizes") / f"file.{read}"
    path.write_text(content, "utf-8")

    def refusal() -> str:
        with pytest.raises((InputError, MechanismError)) as caught:
            if read == "urdf":
                ClosedLoopModel.from_urdf(path, [], [])
            else:
                ClosedLoopModel.load(path)
        return str(caught.value)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bounds, bound, 2)
        assert f"more than 2 {'values' if bound == 'VALUES' else 'bytes'}" in refusal()
        assert f"{SWITCH}=10" in refusal()
        patch.setenv(SWITCH, "10")
        assert "more than" not in refusal()
