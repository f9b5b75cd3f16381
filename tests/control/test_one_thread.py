"""Control objects in two threads: a call beside another is refused, one after another answered."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.control import ComputedTorque, Gains, PDControl, RealTimeRobot, Status
from rps_pin.errors import InputError, ThreadError
from rps_pin.one_thread import TickGuard
from tests.threads import at_once

ROBOT = RPSRobot.from_preset("micro")
POSES = np.array([[0.223, 0.02, -0.01], [0.2235, 0.021, -0.012]])
LENGTHS = ROBOT.inverse_kinematics(POSES).length
SPEEDS = np.array([[0.01, 0.02, 0.03], [-0.03, 0.01, 0.02]])
ZERO = np.zeros(3)


#: What takes the k-th arguments, the array that it writes, and the guard of both.
Work = tuple[Callable[[int], Status], np.ndarray, TickGuard]


def _estimates() -> Work:
    loop = RealTimeRobot(ROBOT, POSES[0])
    return lambda k: loop.estimate(LENGTHS[k], SPEEDS[k]), loop.answers.twist, loop.guard


def _dynamics() -> Work:
    loop = RealTimeRobot(ROBOT, POSES[0])
    call = partial(_of_motions, loop.inverse_dynamics)
    return call, loop.answers.forces, loop.guard


def _of_motions(forces: Any, k: int) -> Status:
    return Status(forces(POSES[k], SPEEDS[k], 100 * SPEEDS[k]))


def _controls() -> Work:
    """A law without memory: forces by the reading and the target alone."""
    gains = Gains(np.full(3, 3e3), np.full(3, 30.0), np.zeros(3))
    loop = PDControl(ROBOT, POSES[0], gains, largest_jump=1.0, force_limit=1e3)
    targets = [(pose, ZERO, ZERO) for pose in POSES[::-1]]
    call: Any = lambda k: loop.tick(LENGTHS[k], targets[k], SPEEDS[k])  # noqa: E731
    return call, loop.forces, loop.estimate.guard


@pytest.mark.parametrize("made", [_estimates, _dynamics, _controls])
@pytest.mark.usefixtures("both_engines")
def test_two_threads_mix_no_arguments(made: Any) -> None:
    """Without the guard some answers belong to the reading of one and the speed of the other."""
    call, answer, guard = made()
    right = []
    for k in (0, 1):
        assert call(k) == Status.OK
        right.append(answer.copy())
    assert np.abs(right[0] - right[1]).max() > 1e-3

    def work(k: int) -> tuple[Status, np.ndarray]:
        status = call(k)
        if not guard.acquire():  # the other thread may be writing
            raise ThreadError
        try:
            return status, answer.copy()
        finally:
            guard.release()

    found, _ = at_once([lambda: work(0), lambda: work(1)], 4000)
    assert [len(one) for one in found] == [4000, 4000]
    for status, numbers in found[0] + found[1]:
        errors = [np.abs(numbers - one).max() for one in right]
        assert status == Status.OK
        assert min(errors) <= 1e-9, (numbers, right)


class _Held(ComputedTorque):
    """Its law waits until another thread has tried its calls."""

    def __init__(self, *given: Any, **options: Any) -> None:
        self.inside, self.tried = threading.Event(), threading.Event()
        self.tried.set()
        super().__init__(*given, **options)

    def _law(self, *given: Any) -> Any:
        assert self.estimate.state == given[0]  # its own thread may call further
        assert self.estimate.type_ii > 0.0
        self.inside.set()
        self.tried.wait(240)
        return super()._law(*given)


def test_calls_beside_a_tick_are_refused_and_leave_it_alone() -> None:
    made = [_Held(ROBOT, POSES[0], Gains.placed(15.0, integral=0.3)) for _ in range(2)]
    controller, alone = made
    for one in made:
        one.tick(LENGTHS[0])
    controller.inside.clear()
    controller.tried.clear()
    thread = threading.Thread(target=controller.tick, args=(LENGTHS[1],))
    thread.start()
    assert controller.inside.wait(240)
    estimate = controller.estimate
    calls: dict[str, Callable[[], Any]] = {
        "tick": lambda: controller.tick(LENGTHS[0]),
        "reset": lambda: controller.reset(POSES[0]),
        "status_text": lambda: controller.status_text,
        "state": lambda: estimate.state,
        "type_ii": lambda: estimate.type_ii,
        "its status_text": lambda: estimate.status_text,
        "force_status_text": lambda: estimate.force_status_text,
        "estimate": lambda: estimate.estimate(LENGTHS[0]),
        "forces_for": lambda: estimate.forces_for(ZERO),
        "inverse_dynamics": lambda: estimate.inverse_dynamics(POSES[0], ZERO, ZERO),
        "its reset": lambda: estimate.reset(POSES[0]),
    }
    refused = []
    try:
        for name, call in calls.items():
            try:
                call()
            except ThreadError as error:
                assert "one thread at a time" in str(error)
                refused.append(name)
        assert np.isfinite(controller.forces).all()  # what is read only, may be
        assert controller.pace == 1.0
        assert controller.status == Status.OK
    finally:
        controller.tried.set()
        thread.join()
    assert refused == list(calls)
    alone.tick(LENGTHS[1])
    assert controller.forces.tobytes() == alone.forces.tobytes()
    for call in calls.values():  # and take calls again afterwards
        call()


def test_one_thread_after_another(both_engines: str) -> None:
    """Made in the main thread, run in one, then in another: the same bits as in one."""
    moved, alone = (ComputedTorque(ROBOT, POSES[0], Gains.placed(15.0, integral=0.2)) for _ in "12")
    assert moved.compiled is (both_engines == "generated")

    def run(controller: ComputedTorque, found: list[bytes]) -> None:
        for k in range(50):
            length = LENGTHS[0] + 1e-6 * k if k % 7 else None
            controller.tick(length, (POSES[0], ZERO, ZERO))
            found.append(controller.forces.tobytes() + controller.status_text.encode())

    right: list[bytes] = []
    run(alone, right)
    run(alone, right)
    found: list[bytes] = []
    for _ in range(2):
        thread = threading.Thread(target=run, args=(moved, found))
        thread.start()
        thread.join()
    assert found == right
    assert len(set(found)) > 50


def test_a_call_that_fails_lets_the_next_thread_in(both_engines: str) -> None:
    controller = ComputedTorque(ROBOT, POSES[0], Gains.placed(15.0))
    with pytest.raises(InputError, match="near"):
        controller.reset("nowhere")
    found: list[Status] = []
    thread = threading.Thread(target=lambda: found.append(controller.tick(LENGTHS[0])))
    thread.start()
    thread.join()
    assert found == [Status.OK]
