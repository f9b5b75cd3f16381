"""Copies of objects with a state: the same motion from there on, and nothing shared."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Iterator
from functools import partial
from types import BuiltinMethodType, FunctionType, MethodType
from typing import Any

import numpy as np
import pinocchio as pin
import proxsuite
import pytest
from eigenpy import HhJacobiSVD, PartialPivLU

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop import Stepper
from rps_pin.codegen.build import Library
from rps_pin.control import Answers, ComputedTorque, Gains, PDControl, Plant, RealTimeRobot, Status
from rps_pin.control.estimator.effective_inertia import TaskSpaceInertia
from rps_pin.control.estimator.leg_jacobian import leg_jacobian
from rps_pin.control.generated.tick import Form
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.force_limits import ForceLimits
from rps_pin.errors import RPSPinError
from rps_pin.rps.parameters import RPSParameters
from tests.codegen.engines import of_file

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


LIMIT = 9.0
LAWS: dict[str, Callable[..., Controller]] = {
    "computed torque": partial(ComputedTorque, gains=Gains.placed(15.0, integral=0.2)),
    "actuator space": partial(
        ComputedTorque, gains=Gains.placed(15.0), space="actuator", cut_off=math.inf
    ),
    "PD": partial(PDControl, gains=Gains.placed(15.0, integral=0.1)),
}
#: Of an interpreted controller also by pickle: machine code stays in its process.
OF_CONTROLLERS = {
    "generated": ["copy", "deepcopy"],
    "interpreted": ["copy", "deepcopy", "pickle"],
}


def _ticks(seed: int, count: int = 60) -> Iterator[tuple[Any, Any, Any, float | None]]:
    """Yield a motion with noise, lost readings, bad targets, and steps that saturate."""
    rng = np.random.default_rng(seed)
    robot = RPSRobot.from_preset("micro")
    phase, height = rng.uniform(0, 6), rng.uniform(0, 1e-3)
    for k in range(count):
        t = 1e-3 * k
        shift = height * math.sin(20 * t), 1e-3 * math.sin(30 * t + phase), -2e-3 * t
        pose = _POSE + np.array(shift)
        length = robot.inverse_kinematics(pose).length + rng.normal(0, 2e-7, 3)
        target = pose + (0.03 * rng.normal(size=3) if rng.random() < 0.1 else 0.0)
        given = (target, np.zeros(3), rng.normal(0, 1.0, 3))
        kind = rng.random()
        yield (
            None if kind < 0.05 else length,
            None if kind > 0.9 else (target * np.nan,) * 3 if kind > 0.85 else given,
            rng.normal(0, 1e-2, 3) if rng.random() < 0.3 else None,
            rng.uniform(5e-4, 2e-3) if rng.random() < 0.2 else None,
        )


def _run(controller: Controller, ticks: Any) -> list[Any]:
    """Return all that each tick gives, as bytes and text, which compare bit by bit."""
    found = []
    for tick in ticks:
        length, target, speed, dt = tick
        status = controller.tick(length, target, speed, dt=dt)
        estimate = controller.estimate
        numbers = (controller.pace, estimate.determinant, estimate.age, estimate.elapsed)
        arrays = [one.tobytes() for one in (*estimate.answers, controller.forces)]
        found.append((status, estimate.status, numbers, arrays))
    return [*found, controller.status_text, estimate.status_text, estimate.type_ii, estimate.state]


def _held(one: Any, found: dict[int, Any]) -> dict[int, Any]:
    """Return all that an object holds, in attributes of attributes, by identity."""
    if id(one) not in found and not isinstance(one, UNCHANGING):
        found[id(one)] = one
        parts = list(getattr(one, "__dict__", {}).values())
        if isinstance(one, dict):
            parts = list(one.values())
        elif isinstance(one, (list, tuple, set)):
            parts = list(one)
        elif isinstance(one, (MethodType, BuiltinMethodType)):
            parts = [one.__self__]
        for part in parts:
            _held(part, found)
    return found


#: What a copy may share.
UNCHANGING = (
    *(RPSParameters, Gains, Library, Form, type, FunctionType, str, int, float, slice, type(None)),
    proxsuite.proxqp.QPSolverOutput,
)


def _shared(one: Any, two: Any) -> list[Any]:
    """Return what two objects share that calls may change."""
    ours, theirs = _held(one, {}), _held(two, {})
    for held in (ours, theirs):
        kinds = {type(part) for part in held.values()}
        assert {np.ndarray, pin.Data, pin.Model, HhJacobiSVD, PartialPivLU} <= kinds
    same = [ours[number] for number in ours.keys() & theirs.keys()]
    memory, other = (
        [np.asarray(part) for part in held.values() if isinstance(part, (np.ndarray, memoryview))]
        for held in (ours, theirs)
    )
    overlaps = [a for a in memory if a.flags.writeable for b in other if np.shares_memory(a, b)]
    return overlaps + [part for part in same if not isinstance(part, tuple)]


@pytest.mark.parametrize("how", ["copy", "deepcopy", "pickle"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", [0, 1])
def test_copies_of_controllers_go_their_own_way(
    law: str, how: str, seed: int, both_engines: str
) -> None:
    robot = RPSRobot.from_preset("micro")
    one, alone, fresh = (LAWS[law](robot, _POSE, force_limit=LIMIT) for _ in range(3))
    assert one.compiled is (both_engines == "generated")
    if how not in OF_CONTROLLERS[both_engines]:
        with pytest.raises(RPSPinError, match="machine code cannot be pickled"):
            pickle.dumps(one)
        return
    past, next_of_one, next_of_two = (list(_ticks(3 * seed + k)) for k in range(3))
    for controller in (one, alone):
        _run(controller, past)
    two = COPIES[how](one)
    assert type(two) is type(one) and two.compiled is one.compiled and two.engine == one.engine
    assert not _shared(one, two)
    assert two.forces.tobytes() == one.forces.tobytes() and two.status == one.status
    of_two, of_one = [], []  # in turn, over different inputs
    for tick_of_one, tick_of_two in zip(next_of_one, next_of_two, strict=True):
        of_two.append(_run(two, [tick_of_two]))
        of_one.append(_run(one, [tick_of_one]))
    assert of_one == [_run(alone, [tick]) for tick in next_of_one]
    _run(fresh, past)  # the same inputs as the copy
    assert of_two == [_run(fresh, [tick]) for tick in next_of_two]
    statuses = np.array([int(tick[0][0]) for tick in of_one + of_two])
    assert (statuses & Status.SATURATED).any() and (statuses & Status.TARGET_HELD).any()
    assert (statuses & Status.BAD_INPUT).any()
    assert (two.forces != one.forces).any()
    for controller in (one, two, fresh):  # of another state
        controller.reset(_POSE)
    wanted = _run(fresh, next_of_one)
    assert _run(one, next_of_one) == wanted == _run(two, next_of_one)


@pytest.mark.parametrize("how", ["copy", "deepcopy", "pickle"])
def test_copies_of_estimates_go_their_own_way(how: str, both_engines: str) -> None:
    robot = RPSRobot.from_preset("micro")
    given = Answers.new()
    one = RealTimeRobot(robot, _POSE, answers=given)
    alone, fresh = (RealTimeRobot(robot, _POSE) for _ in range(2))

    def run(loop: RealTimeRobot, seed: int) -> list[Any]:
        found = []
        for length, target, speed, dt in _ticks(seed):
            statuses = [loop.estimate(length, speed, dt=dt), loop.forces_for(np.full(3, 0.1))]
            if target is not None:
                statuses.append(loop.inverse_dynamics(*target))
            numbers = loop.determinant, loop.force_determinant, loop.age, loop.force_age
            found.append((statuses, numbers, [answer.tobytes() for answer in loop.answers]))
        return [*found, loop.state, loop.type_ii, loop.status_text, loop.force_status_text]

    if how not in OF_CONTROLLERS[both_engines]:
        with pytest.raises(RPSPinError, match="machine code cannot be pickled"):
            pickle.dumps(one)
        return
    for loop in (one, alone, fresh):
        run(loop, 0)
    two = COPIES[how](one)
    assert not _shared(one, two)
    of_two, of_one = run(two, 1), run(one, 2)
    assert (of_two, of_one) == (run(fresh, 1), run(alone, 2))
    assert all((mine == its).all() for mine, its in zip(given, one.answers, strict=True))


def test_a_copy_of_a_part_is_a_part_of_a_copy(both_engines: str) -> None:
    """A controller's estimate copied alone brings a controller of its own with it, or none."""
    one = ComputedTorque(RPSRobot.from_preset("micro"), _POSE, Gains.placed(15.0))
    ticks = list(_ticks(0))
    _run(one, ticks)
    estimate = copy.deepcopy(one.estimate)
    assert estimate.state == one.estimate.state
    assert not _shared(estimate, one)
    one.reset(_POSE)
    assert estimate.state != one.estimate.state


def test_limited_forces_depend_on_no_call_before() -> None:
    """Warm starts made them depend, so that copies differed in the last digits."""
    rng = np.random.default_rng(0)
    robot = RPSRobot.from_preset("micro")
    geometry = RealTimeRobot(robot, _POSE, compiled=False).state.geometry
    mass, jacobian = TaskSpaceInertia(robot).of(geometry), leg_jacobian(geometry, 0.1)
    used = ForceLimits((5.0, 6.0, 7.0))
    used.nearest((1e300, -1e300, 1e300), mass * 1e200, jacobian, (1.0, 0.0, 0.0))
    for _ in range(300):
        wanted = tuple(rng.normal(0, 12, 3).tolist())
        found = used.nearest(wanted, mass, jacobian, (0.1, 0.2, 0.3))
        assert found.solved
        new = ForceLimits((5.0, 6.0, 7.0))
        assert new.nearest(wanted, mass, jacobian, (0.1, 0.2, 0.3)) == found
        assert copy.copy(used).nearest(wanted, mass, jacobian, (0.1, 0.2, 0.3)) == found


def test_a_compiled_mechanism_is_its_own_copy() -> None:
    """It has no state; `copy.deepcopy` ended in a TypeError of a lock."""
    mechanism = of_file("four_bar")
    assert copy.deepcopy(mechanism) is copy.copy(mechanism) is mechanism
    with pytest.raises(RPSPinError, match="compile it again"):
        pickle.dumps(mechanism)
