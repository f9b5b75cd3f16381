"""Controllers of any robot with a task: one suite for the 3-RPS's mechanism, Delta, Stewart, ankle.

The plant integrates the mechanism in full coordinates, and shares only Pinocchio with the
controllers. The 3-RPS is controlled here without its closed forms, and compared with these.
"""

from __future__ import annotations

import copy
import pickle
import re
import struct
from collections.abc import Callable
from functools import cache
from threading import Thread
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.control import (
    ComputedTorque,
    Gains,
    PDControl,
    Plant,
    Status,
    TaskEstimate,
    effective_inertia,
)
from rps_pin.control.loop.controller import Controller
from rps_pin.errors import (
    ClosureError,
    InputError,
    MechanismError,
    RPSPinError,
    SingularityError,
    ThreadError,
)
from rps_pin.task import Task
from rps_pin.trajectories import point_to_point
from tests.control.float_ticks import SPECIAL_NUMBERS
from tests.control.tasks import NAMES, ROBOT, plain, start, task
from tests.quick import quick

Make = Callable[..., Controller]


def goal(name: str) -> Array:
    """Coordinates to move to, a little away from the start in each."""
    away = np.array([-0.02, 0.03, -0.02, 0.03, 0.02, -0.03])[: plain(name).size]
    if name == "rps":
        return start(name) + np.array([2e-3, -0.04, 0.03])
    return start(name) + away * np.where(plain(name).angular, 1.0, 0.3)


def pd(robot: Any, near: Array, gains: Gains, **options: Any) -> PDControl:
    """PD control of the same stiffness as computed torque at the start."""
    inertia = effective_inertia(robot, near, space=options.get("space", "actuator"))
    return PDControl(robot, near, gains.times(inertia), **options)


def tracking(name: str, make: Make, period: float, **options: Any) -> Array:
    """Errors (n, m) on a way of 0.1 s, speeds measured."""
    path = point_to_point(start(name), goal(name), duration=0.1)
    gains = Gains.placed(15.0)
    controller = make(task(name), start(name), gains, period=period, force_limit=1e6, **options)
    plant = Plant(plain(name), start(name), period=period, force_limit=1e6)
    errors = []
    for k in range(round(path.duration / period) + 1):
        target = path.sample(min(k * period, path.duration))
        assert controller.tick(plant.reading(), target, plant.speed) == Status.OK
        np.testing.assert_allclose(controller.estimate.answers.pose, plant.pose, atol=1e-9)
        np.testing.assert_allclose(
            controller.estimate.answers.rate, plant.rate, atol=1e-6 * (1 + np.abs(plant.rate).max())
        )
        errors.append(plant.pose - target.pose)
        plant.step(controller.forces)
    return np.array(errors)


def largest(name: str, errors: Array) -> float:
    return float((np.abs(errors) * plain(name).scale).max())


@pytest.mark.parametrize(
    ("name", "space"),
    quick(
        [(name, space) for name in NAMES for space in ("task", "actuator")],
        [("rps", "actuator"), ("delta", "task"), ("ankle", "task"), ("ankle", "actuator")],
    ),
)
def test_a_perfect_model_tracks_to_the_order_of_the_tick(name: str, space: str) -> None:
    """Forces are held within a tick: the error is of order 1 in the period."""
    moved = largest(name, (goal(name) - start(name))[None])
    coarse, fine = (
        largest(name, tracking(name, ComputedTorque, period, space=space))
        for period in (4e-3, 2e-3)
    )
    assert fine < 0.03 * moved
    assert 1.7 < coarse / fine < 2.6


@pytest.mark.parametrize("name", quick(NAMES, ["delta", "ankle"]))
def test_computed_torque_beats_pd_and_so_does_feed_forward(name: str) -> None:
    ours = largest(name, tracking(name, ComputedTorque, 2e-3))
    space = {"rps": "actuator", "ankle": "actuator"}.get(name, "task")
    without = largest(name, tracking(name, pd, 2e-3, space=space, compensation="gravity"))
    ahead = largest(name, tracking(name, pd, 2e-3, space=space, compensation="feed_forward"))
    assert ours < without / 3
    assert ahead < without / 3


@pytest.mark.parametrize("name", NAMES)
def test_each_error_decays_by_its_own_gains(name: str) -> None:
    """e'' + Kd e' + Kp e = 0 from a step of one coordinate, in closed form; the others stay."""
    size, scale = plain(name).size, plain(name).scale
    step = (2e-4 if name == "rps" else 2e-3) / scale[-1]
    w, missed, crossed = 2 * np.pi * 15.0, [], []
    for period in (2e-3, 1e-3):
        controller = ComputedTorque(
            task(name), start(name), Gains.placed(15.0), period=period, force_limit=1e6
        )
        plant = Plant(plain(name), start(name), period=period, force_limit=1e6)
        wanted = start(name)
        wanted[-1] += step
        target = (wanted, np.zeros(size), np.zeros(size))
        errors, times = [], []
        for k in range(round(0.04 / period)):
            status = controller.tick(plant.reading(), target, plant.speed)
            assert status == Status.OK
            errors.append((wanted - plant.pose) / step)
            times.append(k * period)
            plant.step(controller.forces)
        t, e = np.array(times), np.array(errors)
        missed.append(np.abs(e[:, -1] - (1 + w * t) * np.exp(-w * t)).max())
        others = np.abs(e[:, :-1]) * scale[:-1] / scale[-1]
        crossed.append(others.max())
    assert missed[1] < 0.06
    assert 1.7 < missed[0] / missed[1] < 2.4
    assert crossed[1] < 0.04


# The 3-RPS without its closed forms --------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (ComputedTorque, {}),
        (ComputedTorque, {"space": "actuator"}),
        (pd, {}),
        (pd, {"compensation": "feed_forward", "space": "task"}),
        (pd, {"compensation": "none"}),
    ],
)
def test_the_generic_way_gives_the_forces_of_the_closed_form(
    make: Make, options: dict[str, Any]
) -> None:
    """The same readings and targets, filters and integral on; some readings lost, some targets."""
    gains = Gains.placed(15.0, integral=0.2)
    both = [
        make(robot, start("rps"), gains, largest_jump=2.4e-4, near_singular=0.03, **options)
        for robot in (ROBOT, task("rps"))
    ]
    plant, rng = Plant(ROBOT, start("rps")), np.random.default_rng(6)
    path = point_to_point(start("rps"), goal("rps"), duration=0.12)
    sizes = []
    for k in range(36):
        reading = None if k in (30, 31) else plant.reading() + rng.normal(scale=1e-7, size=3)
        target = None if k == 34 else path.sample(k * 1e-3)
        statuses = [one.tick(reading, target) for one in both]
        assert statuses[0] == statuses[1] == (Status.BAD_INPUT if reading is None else 0)
        np.testing.assert_allclose(both[1].forces, both[0].forces, rtol=0, atol=1e-9 * 20)
        answers = [one.estimate.answers for one in both]
        np.testing.assert_allclose(answers[1].pose, answers[0].pose, rtol=0, atol=1e-11)
        np.testing.assert_allclose(answers[1].rate, answers[0].rate, rtol=0, atol=1e-9)
        sizes.append(np.abs(both[0].forces).max())
        plant.step(both[0].forces)
    assert max(sizes) > 3.0


def test_limited_forces_are_those_of_the_closed_form() -> None:
    both = [
        ComputedTorque(robot, start("rps"), Gains.placed(15.0, integral=0.2), force_limit=3.6)
        for robot in (ROBOT, task("rps"))
    ]
    plant = Plant(ROBOT, start("rps"))
    path = point_to_point(start("rps"), goal("rps"), duration=0.06)
    saturated = 0
    for k in range(80):
        target = path.sample(min(k * 1e-3, 0.06))
        statuses = [one.tick(plant.reading(), target) for one in both]
        assert statuses[0] & Status.SATURATED == statuses[1] & Status.SATURATED
        saturated += bool(statuses[0] & Status.SATURATED)
        np.testing.assert_allclose(both[1].forces, both[0].forces, rtol=0, atol=1e-7)
        assert both[1].pace == pytest.approx(both[0].pace, abs=1e-7)
        plant.step(both[0].forces)
    assert saturated > 10


# Limits, faults and statuses ----------------------------------------------------------------------


@cache
def controller(name: str, law: str = "computed torque") -> Controller:
    if law == "PD":
        return pd(task(name), start(name), Gains.placed(15.0, integral=0.2))
    return ComputedTorque(task(name), start(name), Gains.placed(15.0, integral=0.2))


@pytest.mark.parametrize("name", NAMES)
def test_limited_forces_are_the_nearest_in_effect(name: str) -> None:
    """Of many forces within the limits none gives an acceleration nearer to the wanted one."""
    free = ComputedTorque(task(name), start(name), Gains.placed(15.0), force_limit=1e9)
    held = np.abs(free.forces).max()
    limited = ComputedTorque(
        task(name), start(name), Gains.placed(15.0), force_limit=1.05 * held + 1e-3
    )
    wanted = start(name) + 0.3 * (goal(name) - start(name))
    still = np.zeros(len(wanted))
    reading = Plant(plain(name), start(name)).length
    statuses = [one.tick(reading, (wanted, still, still)) for one in (free, limited)]
    assert statuses == [Status.OK, Status.SATURATED]
    limit = 1.05 * held + 1e-3
    assert np.abs(limited.forces).max() <= limit
    assert np.abs(free.forces).max() > limit
    mechanism = plain(name).mechanism
    inverse = np.linalg.inv(mechanism.mass_matrix(limited.estimate.answers.configuration))

    def cost(forces: Array) -> float:
        short = forces - free.forces
        return float(short @ inverse @ short)

    rng = np.random.default_rng(8)
    size = len(reading)
    others = [np.clip(limited.forces + s * rng.normal(size=size), -limit, limit)
              for s in limit * np.geomspace(1e-4, 1, 400)]  # fmt: skip
    assert min(map(cost, others)) >= cost(limited.forces) * (1 - 1e-8)
    turning = mechanism.angular_velocities[mechanism.actuated_indices]
    unit = "N m" if turning.all() else "N"  # of these robots, all turn or none
    said = re.search(
        r"an actuator is at its limit: .* are \([^)]+\) ([N m,]+)", limited.status_text
    )
    assert said and said[1] == unit


@pytest.mark.parametrize("name", NAMES)
def test_lost_readings_jumps_and_targets_out_of_reach(name: str) -> None:
    one = controller(name)
    one.reset(start(name))
    plant = Plant(plain(name), start(name))
    reading, size = plant.reading(), plain(name).size
    assert one.tick(reading) == Status.OK
    held = one.forces.copy()
    np.testing.assert_allclose(held, plant.applied, rtol=1e-6, atol=1e-6)
    assert one.tick(None) == Status.BAD_INPUT
    np.testing.assert_allclose(one.forces, held, rtol=1e-6, atol=1e-6)  # extrapolated at rest
    assert "not as many finite numbers" in one.status_text
    assert one.tick(reading + np.nan) == Status.BAD_INPUT
    assert one.tick(reading) == Status.OK
    assert one.tick(reading + 10.0) == Status.JUMP
    assert "more than" in one.status_text
    assert one.tick(reading[:-1]) == Status.BAD_INPUT
    assert one.tick(reading) == Status.OK
    zero = np.zeros(size)
    for target in ((start(name) + 50.0, zero, zero), (start(name) + np.nan, zero, zero), "target",
                   (start(name)[:-1], zero, zero), (start(name), zero, zero + 1e30)):  # fmt: skip
        one.reset(start(name))
        assert one.tick(reading, target) == Status.TARGET_HELD
        assert "the last valid target is held" in one.status_text
        assert one.tick(reading, (start(name), zero, zero)) == Status.TARGET_HELD  # returning
        assert "returning to the target" in one.status_text
    for k in range(110):
        status = one.tick(reading, (start(name), zero, zero))
        assert status == (Status.TARGET_HELD if k < 98 else Status.OK) or 97 < k < 101
    for _ in range(3):
        assert one.tick(None) == Status.BAD_INPUT
    assert one.tick(None) == Status.BAD_INPUT | Status.STOPPED
    assert "4 readings in a row were refused" in one.status_text
    assert one.tick(reading) == Status.STOPPED
    np.testing.assert_allclose(one.forces, held, rtol=1e-6, atol=1e-6)
    one.reset(start(name))
    assert one.tick(reading) == Status.OK


def test_a_robot_that_returns_to_a_target_moves_there_smoothly() -> None:
    name = "delta"
    one, plant = controller(name), Plant(plain(name), start(name))
    one.reset(start(name))
    far, zero = goal(name), np.zeros(3)
    assert one.tick(plant.reading(), (far + 99.0, zero, zero), plant.speed) == Status.TARGET_HELD
    rates = []
    for _ in range(300):
        status = one.tick(plant.reading(), (far, zero, zero), plant.speed)
        plant.step(one.forces)
        rates.append(plant.rate)
    assert status == Status.OK
    np.testing.assert_allclose(plant.pose, far, rtol=0, atol=2e-5)
    assert np.abs(np.diff(rates, axis=0)).max() < 0.1 * np.abs(rates).max()


def test_joints_beyond_their_limits_are_told_and_refused_as_targets() -> None:
    name = "stewart"
    one = controller(name)
    one.reset(start(name))
    zero = np.zeros(6)
    status = one.tick(
        Plant(plain(name), start(name)).length, (start(name) + 0.3 * np.eye(6)[2], zero, zero)
    )
    assert status == Status.TARGET_HELD
    assert "joint 'leg_1_rod_joint' at" in one.status_text
    assert "it is beyond its limits; the last valid target is held" in one.status_text


def test_it_stops_near_a_singularity_and_refuses_targets_there() -> None:
    name = "delta"
    one = ComputedTorque(
        task(name),
        start(name),
        Gains.placed(15.0),
        near_singular=0.08,
        stop_singular=0.07,
        largest_jump=0.05,
    )
    heights, zero = np.linspace(0.0, 0.24, 40), np.zeros(3)
    down = np.column_stack([0 * heights, 0 * heights, -heights]) + start(name)
    q = plain(name).follow(down)
    distance = plain(name).singularities(q).distance
    assert distance[0] > 0.08
    assert distance[-1] < 0.07
    target = (down[-1], zero, zero)
    assert one.tick(q[0][plain(name).of_actuators], target) == Status.TARGET_HELD
    assert "too near a singularity" in one.status_text
    one.reset(start(name))
    for configuration, here in zip(q, distance, strict=True):
        status = one.tick(configuration[plain(name).of_actuators], None, zero)
        assert one.estimate.type_ii == pytest.approx(here, rel=1e-9)
        assert bool(status & Status.NEAR_SINGULAR) == (here < 0.08)
        assert bool(status & Status.STOPPED) == (here <= 0.07)
        assert np.isfinite(one.forces).all()
    assert "stopped: near a type II singularity" in one.status_text


def test_the_task_of_a_3_rps_has_its_closed_forms() -> None:
    one, other = (
        ComputedTorque(robot, start("rps"), Gains.placed(15.0)) for robot in (ROBOT.task, ROBOT)
    )
    assert one.engine == other.engine
    reading = ROBOT.inverse_kinematics(start("rps")).length
    for each in (one, other):
        assert each.tick(reading + 1e-5) == Status.OK
    np.testing.assert_array_equal(one.forces, other.forces)


# Every float --------------------------------------------------------------------------------------

BITS = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0])
POWERS = st.builds(lambda x, k: x * 10.0**k, st.floats(-9.0, 9.0), st.integers(-320, 307))
ANY = BITS | st.sampled_from(SPECIAL_NUMBERS) | POWERS | st.floats(-1.0, 1.0)
ROWS = st.lists(ANY, min_size=6, max_size=6)
NEAR = st.lists(st.floats(-1e-4, 1e-4), min_size=6, max_size=6)
#: Each row is what it is, or an offset from a good one.
ROW = st.tuples(st.booleans(), ROWS) | st.tuples(st.just(True), NEAR)
TICKS = st.lists(
    st.tuples(
        st.none() | ROW,
        st.none() | st.tuples(ROW, ROW, ROW),
        st.none() | ROW,
        st.none() | ANY | st.just(1e-3),
    ),
    min_size=1,
    max_size=6,
)
HUGE = (False, [1.7e308, -1.7e308, 1e200, -1e154, 5e-324, 1e300])
GOOD = (True, [0.0] * 6)


def row(drawn: tuple[bool, list[float]] | None, centre: Array) -> list[float] | None:
    if drawn is None:
        return None
    near, values = drawn
    with np.errstate(all="ignore"):
        return ((centre if near else 0.0) + np.array(values[: len(centre)])).tolist()


@pytest.mark.parametrize(
    ("name", "law"), [*((name, "computed torque") for name in NAMES), ("delta", "PD")]
)
@given(ticks=TICKS)
@example(ticks=[(GOOD, None, HUGE, None), (None, None, None, None), (GOOD, None, None, None)])
@example(ticks=[(GOOD, None, None, None), (None, None, None, 1e300), (GOOD, None, None, 5e-324)])
@example(ticks=[(GOOD, (GOOD, HUGE, GOOD), None, None), (HUGE, (HUGE, GOOD, GOOD), HUGE, 1e300)])
@settings(deadline=None, max_examples=15)
def test_no_tick_raises(name: str, law: str, ticks: list[Any]) -> None:
    one = controller(name, law)
    one.reset(start(name))
    mechanism = plain(name).mechanism
    limit = mechanism.model.effortLimit[mechanism.actuated_indices]
    zero, length = np.zeros(one.forces.size), one.estimate.answers.position.copy()
    with np.errstate(all="raise"):
        for given_length, given_target, given_speed, dt in ticks:
            reading, speed = row(given_length, length), row(given_speed, zero)
            target = None
            if given_target is not None:
                x, rate, acceleration = given_target
                target = row(x, start(name)), row(rate, zero), row(acceleration, zero)
            status = one.tick(reading, target, speed, dt=dt)
            assert status == one.status
            assert (np.abs(one.forces) <= limit).all(), one.forces  # false of NaN
            assert 0.05 <= one.pace <= 1.0
            assert all(np.isfinite(answer).all() for answer in one.estimate.answers)
            assert one.estimate.type_ii >= 0.0
            assert len(one.status_text) >= 2
            if reading is None or not np.isfinite([*reading, *(speed or ())]).all():
                assert status & (Status.BAD_INPUT | Status.STOPPED)


@pytest.mark.parametrize("argument", ["x", {}, [[1.0, 2.0, 3.0]], [True] * 3, 1j, object(), b"abc"])
def test_no_tick_raises_for_other_kinds(argument: Any) -> None:
    one = controller("delta")
    one.reset(start("delta"))
    reading = one.estimate.answers.position.copy()
    assert one.tick(argument) == Status.BAD_INPUT
    assert one.tick(reading, argument) == Status.TARGET_HELD
    assert one.tick(reading, None, argument) & Status.BAD_INPUT
    assert one.tick(reading, dt=argument) & Status.BAD_INPUT
    assert np.isfinite(one.forces).all()


@given(reading=ROW, speed=st.none() | ROW, dt=st.none() | ANY)
@settings(deadline=None, max_examples=30)
def test_no_estimate_raises(reading: Any, speed: Any, dt: float | None) -> None:
    loop = TaskEstimate(task("ankle"), start("ankle"))
    length, zero = loop.answers.position.copy(), np.zeros(2)
    with np.errstate(all="raise"):
        for _ in range(3):
            status = loop.estimate(row(reading, length), row(speed, zero), dt=dt)
            assert status == loop.status
            assert all(np.isfinite(answer).all() for answer in loop.answers)
            assert len(loop.status_text) >= 2


def test_a_second_thread_is_refused_while_a_tick_runs() -> None:
    one = ComputedTorque(task("ankle"), start("ankle"), Gains.placed(15.0))
    assert one._guard.acquire()
    found: list[BaseException] = []

    def call() -> None:
        for each in (lambda: one.tick(None), lambda: one.estimate.estimate(None)):
            try:
                each()
            except ThreadError as error:
                found.append(error)

    thread = Thread(target=call)
    thread.start()
    thread.join()
    one._guard.release()
    assert len(found) == 2
    assert one.tick(None) == Status.BAD_INPUT


# Copies and arguments -----------------------------------------------------------------------------


@pytest.mark.parametrize("made", [task, plain])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_goes_its_own_way(made: Callable[[str], Any], copied: Callable[[Any], Any]) -> None:
    name = "ankle"
    one = ComputedTorque(made(name), start(name), Gains.placed(15.0, integral=0.2))
    plant = Plant(plain(name), start(name))
    reading, zero = plant.reading(), np.zeros(2)
    one.tick(reading, (goal(name), zero, zero))
    other = copied(one)
    assert other.compiled == one.compiled == (made is task)
    before = one.forces.copy()
    other.tick(reading + 1e-5, (start(name), zero, zero))
    np.testing.assert_array_equal(one.forces, before)
    assert np.abs(other.forces - before).max() > 1e-3
    pair = [each.tick(reading + 1e-5, (start(name), zero, zero)) for each in (one, copied(one))]
    assert pair[0] == pair[1]


def test_a_controller_by_the_pinocchio_engine_can_be_pickled_and_gives_the_same() -> None:
    name = "ankle"
    slow = ComputedTorque(plain(name), start(name), Gains.placed(15.0))
    fast = ComputedTorque(plain(name), start(name), Gains.placed(15.0), compiled=True)
    again = pickle.loads(pickle.dumps(slow))
    assert (slow.compiled, fast.compiled, again.compiled) == (False, True, False)
    off = ComputedTorque(task(name), start(name), Gains.placed(15.0), compiled=False)
    assert not off.compiled
    reading, zero = slow.estimate.answers.position + 1e-5, np.zeros(2)
    for one in (slow, fast, again, off):
        one.tick(reading, (goal(name), zero, zero))
        np.testing.assert_allclose(one.forces, slow.forces, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "kind", "said"),
    [
        ({"gains": Gains([1.0, 2.0], 3.0)}, InputError, "gains are those of 2 errors; there are 3"),
        ({"gains": 3.0}, InputError, "gains must be Gains"),
        ({"near": [0.0, 0.0]}, InputError, "near has shape"),
        ({"near": [9.0, 0.0, 0.0]}, (ClosureError, SingularityError), "."),
        ({"near_singular": 0.5}, SingularityError, "too near a singularity"),
        ({"force_limit": [1.0, 2.0]}, InputError, "force_limit"),
        ({"largest_jump": 0.0}, InputError, "largest_jump"),
        ({"period": -1.0}, InputError, "period"),
        ({"cut_off": 0.0}, InputError, "cut_off"),
        ({"compiled": "yes"}, InputError, "compiled = 'yes'"),
        ({"space": "joint"}, InputError, "space"),
        ({"robot": 3}, InputError, "robot is a int|robot"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(
    changes: dict[str, Any], kind: type[RPSPinError], said: str
) -> None:
    arguments = {"robot": plain("delta"), "near": start("delta"), "gains": Gains.placed(15.0)}
    with pytest.raises(kind, match=said):
        ComputedTorque(**arguments | changes)


def test_too_few_actuators_are_refused() -> None:
    mechanism = ClosedLoopModel.load("urdf/ankle.yaml")
    fewer = mechanism.with_actuated(mechanism.actuated[:1])

    lacking = Task(fewer, joints=plain("ankle").coordinates)
    with pytest.raises(MechanismError, match="1 actuators for 2 coordinates"):
        ComputedTorque(lacking, start("ankle"), Gains.placed(15.0))
    with pytest.raises(MechanismError, match="has no task"):
        ComputedTorque(ClosedLoopModel.load("urdf/gripper.yaml"), [0.0], Gains.placed(15.0))
