"""Arrays that ticks are given: each is read rightly, or gives a status; none raises or warns.

The rule of calls in a loop, beside that of `closed_loop.test_array_arguments`: what other calls
refuse with an `InputError` has `Status.BAD_INPUT` here, in both engines.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.control import ComputedTorque, Gains, RealTimeRobot, Status
from tests.closed_loop.test_array_arguments import BAD, GOOD, ROUNDED
from tests.worst import worst

pytestmark = pytest.mark.usefixtures("both_engines")

ROBOT = RPSRobot.from_preset("micro")
START = np.array([0.223, 0.02, -0.01])
GIVEN = {
    "length": ROBOT.inverse_kinematics(START).length,
    "speed": np.array([0.01, -0.02, 0.03]),
    "pose": START + 1e-4,
    "rate": np.array([0.02, -0.1, 0.05]),
    "acceleration": np.array([0.2, -1.0, 0.5]),
}


class _Raises:
    def __iter__(self) -> Any:
        raise RuntimeError

    def __float__(self) -> float:
        raise ZeroDivisionError


#: Refused in ticks alone: other calls do not take them either, as their types are others.
HOSTILE: dict[str, Callable[[np.ndarray], Any]] = {
    **BAD,
    "raises": lambda x: _Raises(),
    "what raises inside": lambda x: [_Raises()] * 3,
    "masked inside": lambda x: [np.ma.masked, *x[1:]],
    "text inside": lambda x: [str(x[0]), *x[1:].tolist()],
    "text in an array inside": lambda x: [np.array("0.2"), *x[1:]],
    "truth inside": lambda x: [True, *x[1:].tolist()],
    "durations inside": lambda x: list(x.astype("m8[ns]")),
    "nanoseconds": lambda x: (1e9 * x).astype("M8[ns]"),
}


def _control(controller: ComputedTorque, given: dict[str, Any]) -> tuple[Status, np.ndarray]:
    controller.reset(START)
    target = given["pose"], given["rate"], given["acceleration"]
    status = controller.tick(given["length"], target, given["speed"])
    answers = controller.estimate.answers
    return status, np.concatenate([controller.forces, answers.pose, answers.rate])


def _estimate(loop: RealTimeRobot, given: dict[str, Any]) -> tuple[Status, np.ndarray]:
    loop.reset(START)
    status = loop.estimate(given["length"], given["speed"])
    status |= loop.forces_for(given["acceleration"])
    forces = loop.answers.forces.copy()
    status |= loop.inverse_dynamics(given["pose"], given["rate"], given["acceleration"])
    answers = loop.answers
    return status, np.concatenate([forces, answers.forces, answers.pose, answers.rate])


@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize("kind", ["controller", "estimate"])
def test_arrays_in_ticks_are_read_rightly_or_give_a_status(kind: str, name: str) -> None:
    made: Any = (
        ComputedTorque(ROBOT, START, Gains.placed(15.0), largest_jump=1.0)
        if kind == "controller"
        else RealTimeRobot(ROBOT, START)
    )
    run: Any = _control if kind == "controller" else _estimate
    status, right = run(made, GIVEN)
    assert status == Status.OK
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        for form, convert in GOOD.items():
            status, found = run(made, {**GIVEN, name: convert(GIVEN[name])})
            assert status == Status.OK, form
            assert worst(found - right) <= 1e-12, form
        for form, convert in ROUNDED.items():
            rounded = np.array(convert(GIVEN[name]).tolist(), dtype=np.float64)
            wanted = run(made, {**GIVEN, name: rounded})
            found = run(made, {**GIVEN, name: convert(GIVEN[name])})
            assert found[0] == wanted[0], form
            assert worst(found[1] - wanted[1]) <= 1e-12, form
        for form, convert in HOSTILE.items():
            status, found = run(made, {**GIVEN, name: convert(GIVEN[name])})
            of_target = kind == "controller" and name in ("pose", "rate", "acceleration")
            wanted = Status.TARGET_HELD if of_target else Status.BAD_INPUT
            assert status & wanted, form
            assert np.isfinite(found).all(), form


@pytest.mark.parametrize("dt", ["0.001", b"1", True, np.True_, 1j, [1e-3], np.ma.masked, _Raises()])
def test_times_that_are_none_give_a_status(dt: Any) -> None:
    controller = ComputedTorque(ROBOT, START, Gains.placed(15.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert controller.tick(GIVEN["length"], dt=dt) & Status.BAD_INPUT
    for good in (1e-3, np.float64(1e-3), np.float32(1e-3), 1):
        controller.reset(START)
        assert controller.tick(GIVEN["length"], dt=good) == Status.OK


@pytest.mark.parametrize("target", [_Raises(), "abc", {1, 2, 3}, {"a": 1, "b": 2, "c": 3}, 5, [[]]])
def test_targets_that_are_none_are_held(target: Any) -> None:
    controller = ComputedTorque(ROBOT, START, Gains.placed(15.0))
    for _ in range(2):
        assert controller.tick(GIVEN["length"], target) & Status.TARGET_HELD
