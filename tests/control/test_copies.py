"""Copies of objects with a state: the same motion from there on, and nothing shared."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop import Stepper
from rps_pin.control import ComputedTorque, Gains, Plant
from rps_pin.control.estimator.real_time_robot import RealTimeRobot
from rps_pin.errors import RPSPinError

_POSE = np.array([0.223, 0.02, -0.01])
COPIES: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("file", ["four_bar", "delta", "stewart"])
def test_copies_of_a_stepper_go_their_own_way(file: str, how: str) -> None:
    mechanism = ClosedLoopModel.load(f"urdf/{file}.yaml")
    tau = np.full(len(mechanism.actuated), 0.1)
    one, alone = Stepper(mechanism, mechanism.home), Stepper(mechanism, mechanism.home)
    for stepper in (one, alone):
        stepper.advance(tau, 2e-3)
    two = COPIES[how](one)
    assert two.time == one.time and two.gap == one.gap
    for _ in range(3):
        two.advance(-tau, 1e-3)  # does not move the first
        one.advance(tau, 1e-3)
        alone.advance(tau, 1e-3)
    np.testing.assert_allclose(one.q, alone.q, rtol=0, atol=1e-13)
    assert np.abs(two.v - one.v).max() > 1e-6
    three = COPIES[how](one)
    for stepper in (one, three):
        stepper.advance(tau, 1e-3)
    np.testing.assert_allclose(three.q, one.q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(three.v, one.v, rtol=0, atol=1e-11)


@pytest.mark.parametrize("how", COPIES)
def test_copies_of_a_plant_go_their_own_way(how: str) -> None:
    robot = RPSRobot.from_preset("micro")
    one, force = Plant(robot, _POSE, delay=2), np.array([3.0, 4.0, 5.0])
    one.step(force)
    two = COPIES[how](one)
    np.testing.assert_array_equal(two.configuration, one.configuration)
    before = one.configuration.copy()
    for _ in range(5):
        two.step(-force)
    np.testing.assert_array_equal(one.configuration, before)
    three = COPIES[how](one)
    for plant in (one, three):
        for _ in range(5):
            plant.step(force)
    np.testing.assert_allclose(three.configuration, one.configuration, rtol=0, atol=1e-13)
    assert np.abs(two.speed - one.speed).max() > 1e-3
    assert np.isfinite(two.robot.inverse_dynamics(*robot.state(_POSE, _POSE, _POSE)).tau).all()


@pytest.mark.parametrize("how", COPIES)
def test_copies_of_what_generated_code_writes_to_are_refused(how: str) -> None:
    """They shared forces and estimate (copy), or ended in Boost's RuntimeError."""
    robot = RPSRobot.from_preset("micro")
    controller = ComputedTorque(robot, _POSE, Gains.placed(15.0), compiled=False)
    for one in (controller, RealTimeRobot(robot, _POSE, compiled=False)):
        with pytest.raises(RPSPinError, match="make another one with the same arguments"):
            COPIES[how](one)
