"""Ticks of a control loop: the library's answers, every kind of trouble, threads and memory."""

from __future__ import annotations

import gc
import math
import sys
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError
from rps_pin.control import Answers, RealTimeRobot, Status
from rps_pin.rps.kinematics import rates
from rps_pin.rps.singularity.measures import singularity_measures
from tests import strategies

pytestmark = pytest.mark.usefixtures("both_engines")
Array = NDArray[np.float64]
PERIOD = 1e-3


def unlimited(p: RPSParameters) -> RPSRobot:
    return RPSRobot(
        p.replace(
            leg_length_limits=(0.0, math.inf),
            leg_angle_limits=(-math.pi, math.pi),
            spherical_cone_limit=math.pi,
            actuator_force_limit=math.inf,
            actuator_speed_limit=math.inf,
        )
    )


def micro() -> RPSRobot:
    return RPSRobot.from_preset("micro")


def motion(robot: RPSRobot, count: int, seed: int = 0) -> strategies.Motion:
    """A smooth motion of a few sines: pose, rate and acceleration at each tick, (count, 3)."""
    rng = np.random.default_rng(seed)
    size = 0.06 * np.array([robot.parameters.base_radius, 1.0, 1.0])
    w = rng.uniform(5.0, 25.0, (3, 3))
    phase = w * PERIOD * np.arange(count)[:, None, None] + rng.uniform(0, 6, (3, 3))
    middle = np.array([1.6 * robot.parameters.base_radius, 0.0, 0.0])
    return (
        middle + (size * np.sin(phase)).sum(axis=1),
        (size * w * np.cos(phase)).sum(axis=1),
        (-size * w**2 * np.sin(phase)).sum(axis=1),
    )


def random_robots() -> list[RPSRobot]:
    rng = np.random.default_rng(5)
    presets = [unlimited(RPSParameters.from_preset(name)) for name in ("sokolov", "micro")]
    return presets + [RPSRobot(strategies.random_parameters(rng)) for _ in range(10)]


def everything(loop: RealTimeRobot) -> Array:
    return np.concatenate([*loop.answers, [loop.type_ii, loop.determinant]])


# The library's answers ----------------------------------------------------------------------------


def test_estimates_along_motions_are_the_library_s() -> None:
    ticks = 0
    for seed, robot in enumerate(random_robots()):
        p = robot.parameters
        pose, rate, _ = motion(robot, 250, seed)
        legs = rates.leg_jacobians(p, pose)
        speed = np.einsum("nij,nj->ni", legs.length_jacobian, rate)
        found_pose = robot.forward_kinematics(legs.length, pose[0])
        found_rate = rates.pose_rate(p, found_pose, speed).value
        twist = rates.platform_twist(p, found_pose, found_rate).total
        measure = singularity_measures(p, pose)
        loop = RealTimeRobot(robot, pose[0])
        for i in range(len(pose)):
            status = loop.estimate(legs.length[i], speed[i])
            assert not status.kept, loop.status_text
            assert bool(status & Status.NEAR_SINGULAR) == (measure.type_ii[i] < 0.05)
            answer = loop.answers
            np.testing.assert_allclose(answer.pose, found_pose[i], rtol=0, atol=1e-11)
            np.testing.assert_allclose(answer.angle, legs.angle[i], rtol=0, atol=1e-11)
            np.testing.assert_array_equal(answer.speed, speed[i])
            assert strategies.relative_error(answer.rate, found_rate[i]) < 1e-10
            assert strategies.relative_error(answer.twist, twist[i]) < 1e-10
            assert loop.type_ii == pytest.approx(measure.type_ii[i], abs=1e-11)
            assert loop.determinant == pytest.approx(measure.determinant[i], abs=1e-11)
            ticks += 1
    assert ticks == 3000


def test_forces_along_motions_are_the_library_s() -> None:
    for seed, robot in enumerate(random_robots()):
        pose, rate, acceleration = motion(robot, 100, seed)
        loop = RealTimeRobot(robot, pose[0])
        for x, dx, ddx in zip(pose, rate, acceleration, strict=True):
            assert loop.inverse_dynamics(x, dx, ddx) == Status.OK, loop.force_status_text
            expected = robot.inverse_dynamics(*robot.state(x, dx, ddx))
            assert strategies.relative_error(loop.answers.forces, expected.tau) < 1e-10
            reactions = expected.constraint_forces
            assert strategies.relative_error(loop.answers.reactions, reactions) < 1e-10


def test_speeds_that_are_not_given_are_filtered_differences() -> None:
    robot = unlimited(RPSParameters.from_preset("micro"))
    start = robot.inverse_kinematics([0.2, 0.0, 0.0]).length
    speed = np.array([0.05, 0.02, -0.03])
    loop = RealTimeRobot(robot, [0.2, 0.0, 0.0], period=PERIOD, cut_off=40.0)
    for i in range(100):
        assert loop.estimate(start + speed * PERIOD * i) == Status.OK
    expected = speed * -math.expm1(-2 * math.pi * 40.0 * PERIOD * 99)
    np.testing.assert_allclose(loop.answers.speed, expected, rtol=0, atol=1e-11)
    determined = rates.pose_rate(robot.parameters, loop.answers.pose, expected)
    np.testing.assert_allclose(loop.answers.rate, determined.value, rtol=0, atol=1e-9)


def test_time_lost_with_bad_readings_counts_for_the_speed() -> None:
    """A constant speed stays what it is when readings are missing or ticks are late."""
    robot = unlimited(RPSParameters.from_preset("micro"))
    start = robot.inverse_kinematics([0.2, 0.0, 0.0]).length
    loop = RealTimeRobot(robot, [0.2, 0.0, 0.0], cut_off=math.inf)
    speed, time = np.array([0.05, 0.02, -0.03]), 0.0
    for i in range(60):
        dt = PERIOD * (1 + i % 3)
        time += dt
        lost = i % 7 == 3
        loop.estimate(np.full(3, np.nan) if lost else start + speed * time, dt=dt)
        if i > 1:
            np.testing.assert_allclose(loop.answers.speed, speed, rtol=0, atol=1e-10)


# Trouble ------------------------------------------------------------------------------------------

NUMBERS = st.floats() | st.floats(0.0, 1.0) | st.floats(0.19, 0.26)
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@given(
    readings=st.lists(
        st.tuples(TRIPLES, st.none() | TRIPLES, st.none() | st.floats()), min_size=1, max_size=12
    )
)
def test_no_numbers_make_an_estimate_raise_or_answer_nonsense(
    readings: list[tuple[tuple[float, ...], tuple[float, ...] | None, float | None]],
) -> None:
    loop = LOOP
    loop.reset([0.2, 0.0, 0.0])
    age = 0
    for length, speed, dt in readings:
        before = everything(loop)
        status = loop.estimate(length, speed, dt=dt)
        assert status == loop.status
        assert np.isfinite(everything(loop)).all()
        age = age + 1 if status.kept else 0
        assert loop.age == age
        if status.kept:
            np.testing.assert_array_equal(everything(loop), before)
        else:
            closed = LOOP_ROBOT.inverse_kinematics(loop.answers.pose, errors="mask").length
            np.testing.assert_allclose(closed, length, rtol=1e-9)
        assert len(loop.status_text) >= 2


@given(pose=TRIPLES, rate=TRIPLES, acceleration=TRIPLES)
def test_no_numbers_make_forces_raise_or_answer_nonsense(
    pose: tuple[float, ...], rate: tuple[float, ...], acceleration: tuple[float, ...]
) -> None:
    loop = LOOP
    loop.reset([0.2, 0.0, 0.0])
    status = loop.inverse_dynamics(pose, rate, acceleration)
    assert np.isfinite(everything(loop)).all()
    assert status.kept == (loop.force_age == 1)
    if status.kept:
        assert not loop.answers.forces.any()
    assert len(loop.force_status_text) >= 2


LOOP_ROBOT = micro()
LOOP = RealTimeRobot(LOOP_ROBOT, [0.2, 0.0, 0.0])


@pytest.mark.parametrize(
    "reading",
    [
        (np.nan, 0.2, 0.2),
        (0.2, np.inf, 0.2),
        (0.2, 0.2, -0.2),
        (0.2, 0.0, 0.2),
        (1e300, 0.2, 0.2),
        (0.2, 0.2),
        "abc",
        None,
        ("a", "b", "c"),
        10**400,
    ],
)
def test_bad_reading_keeps_the_last_answer_and_the_next_good_one_continues(reading: object) -> None:
    robot = micro()
    loop = RealTimeRobot(robot, [0.21, 0.05, 0.0])
    good = robot.inverse_kinematics([0.212, 0.05, 0.01]).length
    assert loop.estimate(good) == Status.OK
    assert loop.status_text == "ok"
    before = everything(loop)
    for age in (1, 2):
        assert loop.estimate(reading) == Status.BAD_INPUT  # type: ignore[arg-type]
        assert loop.age == age
        assert f"{age} ticks old" in loop.status_text
    np.testing.assert_array_equal(everything(loop), before)
    assert loop.estimate(good + 1e-5) == Status.OK
    assert loop.age == 0
    np.testing.assert_allclose(
        loop.answers.pose, robot.forward_kinematics(good + 1e-5, [0.21, 0, 0]), atol=1e-12
    )


@pytest.mark.parametrize("dt", [0.0, -1e-3, math.nan, math.inf])
def test_bad_time_step_is_refused(dt: float) -> None:
    robot = micro()
    loop = RealTimeRobot(robot, [0.21, 0.05, 0.0])
    good = robot.inverse_kinematics([0.21, 0.05, 0.0]).length
    assert loop.estimate(good, dt=dt) == Status.BAD_INPUT
    assert loop.estimate(good) == Status.OK


def test_jump_of_a_millimetre_is_followed_and_back() -> None:
    robot = micro()
    pose = [0.21, 0.05, -0.02]
    loop = RealTimeRobot(robot, pose)
    good = robot.inverse_kinematics(pose).length
    for reading in (good, good + np.array([1e-3, 0, 0]), good):
        assert not loop.estimate(reading, (0.0, 0.0, 0.0)).kept
        expected = robot.forward_kinematics(reading, pose)
        np.testing.assert_allclose(loop.answers.pose, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(loop.answers.pose, pose, rtol=0, atol=1e-12)


def test_jump_larger_than_allowed_is_refused_until_time_enough_has_passed() -> None:
    robot = micro()
    pose = [0.21, 0.05, -0.02]
    loop = RealTimeRobot(robot, pose, largest_jump=4e-4)
    good = robot.inverse_kinematics(pose).length
    moved = good + np.array([1e-3, 0, 0])
    assert loop.estimate(good) == Status.OK
    assert loop.estimate(moved) == Status.JUMP
    assert "more than 0.0004 m a tick" in loop.status_text
    assert loop.estimate(good) == Status.OK
    found = [loop.estimate(moved, (0.0, 0.0, 0.0)) for _ in range(3)]
    assert found == [Status.JUMP, Status.JUMP, Status.OK]


def test_lengths_that_cannot_close_are_not_converged() -> None:
    loop = RealTimeRobot(micro(), [0.21, 0.0, 0.0])
    assert loop.estimate([0.05, 0.3, 0.6]) == Status.NOT_CONVERGED
    assert "cannot be followed in 20 steps" in loop.status_text
    assert loop.age == 1


def test_near_a_singularity_the_status_says_so_with_the_library_s_distance() -> None:
    p = strategies.random_parameters(np.random.default_rng(0)).replace(
        base_radius=0.4, platform_radius=0.3
    )
    robot = RPSRobot(p)
    loop = RealTimeRobot(robot, [0.05, 0.0, 0.0])
    seen = []
    for height in np.linspace(0.05, 0.001, 200):
        status = loop.estimate(robot.inverse_kinematics([height, 0.0, 0.0]).length, np.zeros(3))
        measure = singularity_measures(p, [height, 0.0, 0.0]).type_ii
        assert loop.type_ii == pytest.approx(float(measure), abs=1e-9)
        assert bool(status & Status.NEAR_SINGULAR) == (measure < 0.05)
        seen.append(status)
    assert seen[0] == Status.OK
    assert seen[-1] == Status.NEAR_SINGULAR
    assert "near a type II singularity" in loop.status_text
    lost = loop.estimate([0.09, 0.09, 0.09])  # shorter than the base plane allows
    assert lost == Status.NOT_CONVERGED | Status.NEAR_SINGULAR
    forces = loop.inverse_dynamics([0.001, 0.0, 0.0], np.zeros(3), np.zeros(3))
    assert forces == Status.NEAR_SINGULAR
    assert "near a singularity" in loop.force_status_text
    assert loop.inverse_dynamics(np.zeros(3), np.zeros(3), np.zeros(3)).kept
    assert "not determined" in loop.force_status_text
    with pytest.raises(SingularityError, match="start from is singular"):
        RealTimeRobot(robot, np.zeros(3))


def test_limits_are_the_robot_s() -> None:
    """Length, angle and ball joint: beyond a limit exactly where inverse kinematics says so."""
    rng = np.random.default_rng(7)
    count = {True: 0, False: 0}
    for rest in (0.0, 0.15, -0.3):
        p = RPSParameters.from_preset("micro").replace(
            spherical_rest_angle=rest,
            spherical_cone_limit=0.4,
            leg_angle_limits=(1.35, 1.75),
            actuator_force_limit=math.inf,
        )
        robot = RPSRobot(p)
        loop = RealTimeRobot(robot, [0.22, 0.0, 0.0], most_steps=200)
        for pose in rng.uniform([0.195, -0.25, -0.25], [0.255, 0.25, 0.25], (300, 3)):
            legs = robot.inverse_kinematics(pose, errors="mask")
            status = loop.estimate(legs.length, np.zeros(3))
            expected = Status.OK if legs.reachable else Status.BEYOND_LIMIT
            assert status == expected, loop.status_text
            assert loop.inverse_dynamics(pose, np.zeros(3), np.zeros(3)) == expected
            assert ("its limits are" in loop.status_text) == (not legs.reachable)
            assert ("its limits are" in loop.force_status_text) == (not legs.reachable)
            count[bool(legs.reachable)] += 1
    assert min(count.values()) > 100


def test_speeds_and_forces_beyond_the_actuators_are_told() -> None:
    robot = micro()
    loop = RealTimeRobot(robot, [0.22, 0.0, 0.0])
    length = robot.inverse_kinematics([0.22, 0.0, 0.0]).length
    assert loop.estimate(length, [0.19, -0.19, 0.0]) == Status.OK
    assert loop.estimate(length, [0.1, -0.21, 0.0]) == Status.BEYOND_LIMIT
    assert "leg 2: speed is -0.21 m/s; its limit is 0.2 m/s" in loop.status_text
    still = np.zeros(3)
    assert loop.inverse_dynamics([0.22, 0, 0], still, still) == Status.OK
    assert loop.inverse_dynamics([0.22, 0, 0], still, [200.0, 0, 0]) == Status.BEYOND_LIMIT
    assert "its limit is 100 N" in loop.force_status_text


@pytest.mark.parametrize(
    "motion_",
    [
        ([np.nan, 0, 0], [0, 0, 0], [0, 0, 0]),
        ([0.22, 0, 0], [np.inf, 0, 0], [0, 0, 0]),
        ([0.22, 0, 0], [0, 0, 0], [0, 0]),
        ([0.22, 7.0, 0], [0, 0, 0], [0, 0, 0]),
        ([0.22, 0, 0], [1e200, 1e200, 0], [0, 0, 0]),
    ],
)
def test_motion_that_is_none_keeps_the_last_forces(motion_: tuple[list[float], ...]) -> None:
    loop = RealTimeRobot(micro(), [0.22, 0.0, 0.0])
    loop.inverse_dynamics([0.22, 0, 0], [0, 0, 0], [0, 0, 0])
    before = everything(loop)
    assert loop.inverse_dynamics(*motion_) == Status.BAD_INPUT
    np.testing.assert_array_equal(everything(loop), before)
    assert loop.force_age == 1
    assert "1 ticks old" in loop.force_status_text


# Memory and threads -------------------------------------------------------------------------------


def test_answers_go_into_the_caller_s_arrays() -> None:
    robot = micro()
    log = np.zeros(30)
    own = Answers(*np.split(log, [3, 6, 12, 15, 18, 21]))
    loop = RealTimeRobot(robot, [0.22, 0.0, 0.0], answers=own)
    loop.estimate(robot.inverse_kinematics([0.221, 0.02, 0.01]).length, [0.1, 0.1, 0.1])
    loop.inverse_dynamics([0.22, 0, 0], np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(log[:3], [0.221, 0.02, 0.01], atol=1e-12)
    np.testing.assert_array_equal(log[15:18], 0.1)
    assert log[18:21].sum() > 0
    np.testing.assert_allclose(log[21:].reshape(3, 3)[:, 2].sum(), 1.2 * 9.81, rtol=1e-10)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"pose": np.zeros(4)}, r"pose has shape \(4,\)"),
        ({"rate": np.zeros(3, dtype=np.float32)}, "rate must be a float64 array"),
        ({"twist": np.broadcast_to(0.0, 6)}, "writeable: False"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_when_the_object_is_made(
    change: dict[str, Array], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        RealTimeRobot(micro(), [0.22, 0, 0], answers=Answers.new()._replace(**change))
    same = np.zeros(3)
    with pytest.raises(InputError, match=r"pose and answers\.rate share memory"):
        RealTimeRobot(micro(), [0.22, 0, 0], answers=Answers.new()._replace(pose=same, rate=same))


def run(robot: RPSRobot, seed: int, count: int) -> Array:
    """All answers of a motion with bad readings among the good ones, (count, 32)."""
    rng = np.random.default_rng(seed)
    pose, rate, acceleration = motion(robot, count, seed)
    length = robot.inverse_kinematics(pose, errors="mask").length
    length[rng.integers(1, count, count // 20)] = np.nan
    loop = RealTimeRobot(robot, pose[0])
    found = np.empty((count, 32))
    for i in range(count):
        loop.estimate(length[i])
        loop.inverse_dynamics(pose[i], rate[i], acceleration[i])
        found[i] = everything(loop)
    return found


def test_objects_of_one_robot_in_several_threads_do_not_disturb_each_other() -> None:
    robot = micro()
    alone = [run(micro(), seed, 3000) for seed in range(4)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)  # in the middle of ticks
    try:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lambda seed: run(robot, seed, 3000), range(4)))
    finally:
        sys.setswitchinterval(interval)
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(alone[0], alone[1])


def test_memory_does_not_grow() -> None:
    robot = micro()
    pose, rate, acceleration = motion(robot, 100)
    length = robot.inverse_kinematics(pose, errors="mask").length
    length[13] = np.nan
    loop = RealTimeRobot(robot, pose[0])

    def ticks(count: int) -> None:
        for i in range(count):
            loop.estimate(length[i % 100])
            loop.inverse_dynamics(pose[i % 100], rate[i % 100], acceleration[i % 100])

    gc.collect()  # it empties Python's free lists: they fill again in the first window
    gc.disable()
    try:
        growth = []
        for _ in range(4):  # what others begin once in this process is in one of them at most
            blocks = sys.getallocatedblocks()
            ticks(3000)
            growth.append(sys.getallocatedblocks() - blocks)
    finally:
        gc.enable()
    assert min(growth) < 30  # less than one in a hundred ticks
    tracemalloc.start()  # NumPy's memory too, and slow
    try:
        ticks(200)
        before, _ = tracemalloc.get_traced_memory()
        ticks(1000)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 1000  # bytes: less than one a tick


def test_rates_whose_squares_are_not_finite_are_refused_by_both_engines() -> None:
    """At zero tilt generated code has finite forces of damping there; Pinocchio has none."""
    loop = RealTimeRobot(RPSRobot.from_preset("micro"), [0.223, 0.0, 0.0])
    rate, still = [1e200, 0.0, 0.0], [0.0, 0.0, 0.0]
    assert loop.inverse_dynamics([0.223, 0.0, 0.0], rate, still) == Status.BAD_INPUT
    assert loop.inverse_dynamics([0.223, 0.0, 0.0], still, still) == Status.OK
