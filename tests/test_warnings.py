"""Warnings point to the line of the user's code."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop.visuals import visual_model
from rps_pin.errors import AccuracyWarning
from tests.closed_loop.test_rounded_files import FIVE_BAR

MJCF = """<mujoco><worldbody><body><joint name="j" type="ball" range="0 1"/>
    <geom size="0.1"/></body></worldbody></mujoco>"""
URDF = """<robot name="r"><link name="base"><visual><geometry><mesh filename="none.stl"/></geometry>
    </visual></link><link name="arm"/><joint name="j" type="revolute"><parent link="base"/>
    <child link="arm"/><axis xyz="0 1 0"/><limit effort="1" velocity="1"/></joint></robot>"""


def _proximal(folder: Path) -> Any:
    robot = RPSRobot.from_preset("micro")
    q, v, _ = robot.state([0.223, 0.0, 0.0], np.zeros(3), np.zeros(3))
    return robot.mechanism.forward_dynamics(q, v, np.zeros(3), method="proximal")


def _not_drawn(folder: Path) -> Any:
    (folder / "r.urdf").write_text(URDF)
    return visual_model(folder / "r.urdf", ClosedLoopModel.from_urdf(URDF, [], ["j"]).model)


CALLS: dict[str, tuple[type[Warning], Callable[[Path], Any]]] = {
    "a word that is not read": (UserWarning, lambda _: ClosedLoopModel.from_mjcf(MJCF)),
    "a rounded file": (
        AccuracyWarning,
        lambda _: ClosedLoopModel.from_mjcf(FIVE_BAR.format(turn="1.5708")),
    ),
    "an old argument": (DeprecationWarning, _proximal),
    "a mesh that is missing": (UserWarning, _not_drawn),
}


@pytest.mark.parametrize("name", CALLS)
def test_warnings_point_to_the_caller(name: str, tmp_path: Path) -> None:
    category, call = CALLS[name]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        call(tmp_path)
    places = {warning.filename for warning in told if issubclass(warning.category, category)}
    assert places == {__file__}
