"""Two threads on one object: the second is refused, and no answer is wrong."""

from __future__ import annotations

import copy
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop import ForceDistribution, Stepper
from rps_pin.control import Plant
from rps_pin.errors import RPSPinError, ThreadError

_POSE = np.array([0.223, 0.02, -0.01])


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("micro")


@pytest.fixture
def switching() -> Iterator[None]:
    """Let threads take turns as often as Python can."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


CALLS: dict[str, Callable[[ClosedLoopModel, Any, Any, Any], Any]] = {
    "inverse_dynamics": lambda m, q, v, a: m.inverse_dynamics(q, v, a).tau,
    "forward_dynamics": lambda m, q, v, a: m.forward_dynamics(q, v, a[:3]),
    "acceleration": lambda m, q, v, a: m.acceleration(q, v, a[:3]),
    "jacobian": lambda m, q, v, a: m.jacobian(q),
    "loop_errors": lambda m, q, v, a: np.concatenate(m.loop_errors(q, v, a)),
    "close": lambda m, q, v, a: m.close(q),
    "derivatives": lambda m, q, v, a: m.inverse_dynamics_derivatives(q, v, a)[0],
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.usefixtures("switching")
def test_answers_beside_another_thread_are_right_or_refused(robot: RPSRobot, name: str) -> None:
    mechanism, call = copy.deepcopy(robot.mechanism), CALLS[name]
    rates = [np.array([0.1, 0.2, -0.3]), np.array([-0.2, 1.0, 0.7])]
    poses = [_POSE, _POSE + np.array([0.005, -0.05, 0.03])]
    states = [robot.state(x, dx, dx) for x, dx in zip(poses, rates, strict=True)]
    right = [call(mechanism, *state) for state in states]
    wrong: list[float] = []
    foreign: list[BaseException] = []
    outcomes: list[str] = []

    def work(k: int) -> None:
        for _ in range(500):
            try:
                error = np.abs(call(mechanism, *states[k]) - right[k]).max()
            except ThreadError:
                outcomes.append("refused")
            except BaseException as told:
                foreign.append(told)
            else:
                outcomes.append("answered")
                if not error <= 1e-9 * np.abs(right[k]).max():
                    wrong.append(float(error))

    threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert not foreign
    assert len(outcomes) == 1000
    assert "answered" in outcomes


class _Inside:
    """Wrenches that stop in the midst of a step, until another thread has tried a call."""

    def __init__(self) -> None:
        self.inside, self.tried = threading.Event(), threading.Event()

    def __call__(self, t: float, q: Any, v: Any) -> dict[str, Any]:
        self.inside.set()
        self.tried.wait(240)
        return {}


def _refused_meanwhile(inside: _Inside, step: Callable[[], Any], calls: Any) -> list[str]:
    """Return which calls are refused with a `ThreadError` while another thread is in a step."""
    errors: list[BaseException] = []

    def work() -> None:
        try:
            step()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    assert inside.inside.wait(240)
    refused = []
    try:
        for name, call in calls.items():
            try:
                call()
            except ThreadError as error:
                assert "deepcopy" in str(error)
                refused.append(name)
    finally:
        inside.tried.set()
        thread.join()
    assert not errors
    return refused


def test_objects_that_share_memory_refuse_a_second_thread(robot: RPSRobot) -> None:
    mechanism = copy.deepcopy(robot.mechanism)
    q, v, a = robot.state(_POSE, np.zeros(3), np.zeros(3))
    distribution = ForceDistribution(mechanism)
    other, inside = Stepper(mechanism, q, v), _Inside()
    inside.tried.set()
    stepper = Stepper(mechanism, q, v, wrenches=inside)
    inside.inside.clear()
    inside.tried.clear()
    calls = {
        "inverse_dynamics": lambda: mechanism.inverse_dynamics(q, v, a),
        "forward_dynamics": lambda: mechanism.forward_dynamics(q, v, np.zeros(3)),
        "describe": mechanism.describe,
        "home": lambda: mechanism.home,
        "solve": lambda: distribution.solve(q, v, a),
        "advance": lambda: other.advance(np.zeros(3), 1e-3),
        "same": lambda: stepper.advance(np.zeros(3), 1e-3),
    }
    refused = _refused_meanwhile(inside, lambda: stepper.advance(np.zeros(3), 1e-3), calls)
    assert refused == list(calls)
    for call in calls.values():  # and take calls again afterwards
        call()


def test_a_plant_refuses_a_second_thread() -> None:
    robot, inside = RPSRobot.from_preset("micro"), _Inside()
    inside.tried.set()
    plant = Plant(robot, _POSE, wrenches=inside)
    inside.inside.clear()
    inside.tried.clear()
    motion = robot.state(_POSE, np.zeros(3), np.zeros(3))
    calls = {
        "step": lambda: plant.step(np.ones(3)),
        "inverse_dynamics": lambda: robot.inverse_dynamics(*motion),
    }
    assert _refused_meanwhile(inside, lambda: plant.step(np.ones(3)), calls) == list(calls)


def test_one_thread_after_another_and_copies_at_once(robot: RPSRobot) -> None:
    state = robot.state(_POSE, np.ones(3), np.ones(3))
    right, found = robot.mechanism.inverse_dynamics(*state).tau, []
    copies = [robot.mechanism, copy.copy(robot.mechanism), copy.deepcopy(robot.mechanism)]
    copies.append(pickle.loads(pickle.dumps(robot.mechanism)))

    def work(mechanism: ClosedLoopModel) -> None:
        found.extend(mechanism.inverse_dynamics(*state).tau for _ in range(100))

    threads = [threading.Thread(target=work, args=(one,)) for one in copies]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.shape(found) == (400, 3)
    np.testing.assert_allclose(found, np.tile(right, (400, 1)), rtol=1e-12)


def test_a_failed_call_lets_the_next_thread_in(robot: RPSRobot) -> None:
    state, found = robot.state(_POSE, np.ones(3), np.ones(3)), []
    for call in (robot.mechanism.inverse_dynamics, robot.mechanism.generalised_force):
        with pytest.raises(RPSPinError):
            call(state[0] * np.nan, *state[1:])
        thread = threading.Thread(target=lambda c=call: found.append(c(*state)))
        thread.start()
        thread.join()
    assert len(found) == 2
