"""The shortest time along a curve of a task: against bang-bang motions, another program, and laws.

Limits are checked by the Pinocchio engine's inverse dynamics at random times.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, linprog

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.arrays import Array
from rps_pin.closed_loop import JointEffects
from rps_pin.errors import (
    ClosureError,
    InfeasibleError,
    InputError,
    MechanismError,
    RPSPinError,
    SingularityError,
)
from rps_pin.rps import ActuatorLimits
from rps_pin.rps import time_optimal as rps_time_optimal
from rps_pin.task import MotionLimits, Payload, Task, time_optimal
from rps_pin.task.motion import task_dynamics
from rps_pin.task.motion.limited_motion import LimitedMotion
from rps_pin.task.motion.task_dynamics import TaskDynamics
from rps_pin.task.motion.time_search import KEPT
from rps_pin.trajectories.point_to_point import LineCurve
from rps_pin.trajectories.spline import ChordSpline
from tests.task import robots
from tests.task.slides import ALONG, BACK, MASS, WAY, slide
from tests.worst import worst


def assert_shortest(found: float, expected: float) -> None:
    assert expected * (1 - 2e-6) <= found <= expected * (1 + 1e-4)


# Formulas -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("force", [1.0, 3000.0])
def test_a_mass_is_pushed_and_braked(force: float) -> None:
    found = time_optimal(slide(), ALONG, limits=MotionLimits(force=force))
    assert_shortest(found.duration, 2 * math.sqrt(WAY * MASS / force))


@pytest.mark.parametrize("path", [ALONG, BACK], ids=["along", "back"])
def test_pushes_and_pulls_have_limits_of_their_own(path: LineCurve) -> None:
    pull, push = 5.0, 20.0
    found = time_optimal(slide(), path, limits=MotionLimits(force=[[-pull], [push]]))
    assert_shortest(found.duration, math.sqrt(2 * WAY * (MASS / pull + MASS / push)))
    assert found.sides[:2] == ("slide force +", "slide force -")
    pushed = found.shares()["slide force +"]
    assert pushed == pytest.approx(pull / (push + pull), abs=3e-3)


@pytest.mark.parametrize("name", ["speed", "coordinate_speed"])
@pytest.mark.parametrize(("path", "speed"), [(ALONG, 0.5), (BACK, 0.2)], ids=["along", "back"])
def test_a_trapezoid_up_to_a_speed(name: str, path: LineCurve, speed: float) -> None:
    limits = MotionLimits(force=4.0, **{name: [[-0.2], [0.5]]})
    found = time_optimal(slide(), path, limits=limits)
    assert_shortest(found.duration, WAY / speed + speed / (4.0 / MASS))


@pytest.mark.parametrize("name", ["acceleration", "coordinate_acceleration"])
def test_accelerations_have_limits(name: str) -> None:
    wide = MotionLimits(force=100.0, **{name: [[-0.5], [2.0]]})
    found = time_optimal(slide(), ALONG, limits=wide)
    assert_shortest(found.duration, math.sqrt(2 * WAY * (1 / 0.5 + 1 / 2.0)))
    use = found.use(found.duration / 10)
    assert getattr(use, name) == pytest.approx(1.0, abs=1e-5)
    # Without one of forces it is enough.
    alone = time_optimal(slide(), ALONG, limits=MotionLimits(force=math.inf, **{name: 3.0}))
    assert_shortest(alone.duration, 2 * math.sqrt(WAY / 3.0))


def test_upwards_the_weight_counts() -> None:
    force, weight = 30.0, MASS * 9.81
    found = time_optimal(slide("0 0 1"), ALONG, limits=MotionLimits(force=force))
    up, down = (force - weight) / MASS, (force + weight) / MASS
    assert_shortest(found.duration, math.sqrt(2 * WAY * (1 / up + 1 / down)))


def test_against_damping() -> None:
    force, damping = 3.0, 4.0
    fastest, delay = force / damping, MASS / damping

    def times(pushed: float) -> tuple[float, float]:
        """Way and time, braked to rest after being pushed for a time."""
        gone = 1 - math.exp(-pushed / delay)
        speed, way = fastest * gone, fastest * (pushed - delay * gone)
        braked = delay * math.log((speed + fastest) / fastest)
        way += (speed + fastest) * delay * (1 - math.exp(-braked / delay)) - fastest * braked
        return way, pushed + braked

    pushed = brentq(lambda t: times(t)[0] - WAY, 1e-3, 10.0)
    found = time_optimal(slide(damping=damping), ALONG, limits=MotionLimits(force=force))
    assert_shortest(found.duration, times(pushed)[1])


def test_a_crank_is_as_fast_as_integrated() -> None:
    """Pushed from rest, and backwards from rest at the end, by forward dynamics."""
    task = robots.compiled("slider_crank")
    mechanism, limit = task.mechanism, 5.0
    line = LineCurve(task.home, task.home - 0.1)
    ends = [float(task.to_actuators(x)[0]) for x in (line.start, line.end)]
    way = math.copysign(1.0, ends[1] - ends[0])

    def run(start: float, push: float, direction: float) -> Any:
        def change(_: float, state: Array) -> list[float]:
            q = mechanism.complete([state[0]])
            v = mechanism.velocity(q, [state[1]])
            a = mechanism.forward_dynamics(q, v, np.array([push]))
            return [direction * state[1], direction * a[mechanism.actuated_indices[0]]]

        return solve_ivp(change, (0, 0.12), [start, 0], rtol=1e-8, atol=1e-10, dense_output=True)

    up, down = run(ends[0], way * limit, 1.0), run(ends[1], -way * limit, -1.0)

    def backwards(angle: float) -> float:
        return float(brentq(lambda t: down.sol(t)[0] - angle, 0.0, 0.12))

    def gap(t: float) -> float:
        angle, speed = up.sol(t)
        return float(abs(speed) - abs(down.sol(backwards(angle))[1]))

    switched = brentq(gap, 0.03, 0.1)
    expected = switched + backwards(up.sol(switched)[0])
    found = time_optimal(task, line, limits=MotionLimits(force=limit))
    assert expected * (1 - 2e-6) <= found.duration <= expected * (1 + 3e-4)


# Robots -------------------------------------------------------------------------------------------


def demands(task: Task, motion: LimitedMotion, t: Array) -> tuple[Array, Array, Array]:
    """Forces, speeds and accelerations of the actuators, one sample after the other."""
    slow = Task(task.mechanism, task.frame, task.coordinates)
    sample, found = motion.sample(t), []
    q = slow.mechanism.home
    for x, rate, change in zip(*sample, strict=True):
        q, v, a = slow.state(x, rate, change, q)
        index = slow.mechanism.actuated_indices
        found.append((slow.mechanism.inverse_dynamics(q, v, a).tau, v[index], a[index]))
    force, speed, acceleration = (np.array(part) for part in zip(*found, strict=True))
    return force, speed, acceleration


LINES = {
    "delta": [0.1, 0.05, 0.05],
    "stewart": [0.05, 0.0, 0.02, 0.0, 0.0, 0.3],
}


@cache
def free_motion(name: str) -> tuple[Task, LineCurve, LimitedMotion]:
    """A line, and the shortest time along it under the model's own limits."""
    task = robots.compiled(name)
    line = LineCurve(task.home, task.home + LINES[name])
    return task, line, time_optimal(task, line)


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("limited", [False, True], ids=["own limits", "accelerations"])
def test_limits_are_kept_and_nearly_always_reached(name: str, limited: bool) -> None:
    task, line, free = free_motion(name)
    most = 0.5 * np.abs(demands(task, free, np.linspace(0, free.duration, 50))[2]).max()
    limits = MotionLimits(acceleration=most) if limited else MotionLimits()
    found = time_optimal(task, line, limits=limits) if limited else free
    t = np.sort(np.random.default_rng(3).uniform(0, found.duration, 150))
    force, speed, acceleration = demands(task, found, t)
    model, index = task.mechanism.model, task.mechanism.actuated_indices
    uses = [force / model.effortLimit[index], speed / model.velocityLimit[index]]
    if limited:
        uses.append(acceleration / most)
        assert found.duration > 1.01 * free.duration
    use = np.abs(np.concatenate(uses, axis=1)).max(axis=1)
    assert worst(use) <= 1 + KEPT
    assert (use >= 1 - 1e-3).mean() >= 0.98
    np.testing.assert_allclose(found.use(t).most, use, atol=1e-7)


def by_linear_program(task: Task, line: LineCurve, force: Array, speed: Array, n: int) -> float:
    """The duration of the largest u'^2, a straight line in u on each of n pieces.

    Where two profiles keep the limits, so does the larger of them: so the fastest is the largest
    everywhere, and has the largest sum.
    """
    u, h = np.linspace(0, 1, n + 1), 1 / n
    way, index = line.end - line.start, task.mechanism.actuated_indices
    x = line.at((u[:-1] + u[1:]) / 2).pose
    still = np.zeros_like(x)
    mechanism = task.mechanism

    def forces(rate: Array, change: Array) -> tuple[Array, Array]:
        q, v, a = task.state(x, rate, change)
        found = [mechanism.inverse_dynamics(*one).tau for one in zip(q, v, a, strict=True)]
        return np.array(found), v[:, index]

    held, _ = forces(still, still)
    by_a = forces(still, still + way)[0] - held
    moving, slope = forces(still + way, still)
    by_b = moving - held
    rows, right = [], []
    piece = np.arange(n)
    for sign in (1, -1):
        for i in range(index.size):
            # a = (b1 - b0) / 2h and b = (b0 + b1) / 2 in the middle
            low, high = (sign * (by_b[:, i] / 2 + s * by_a[:, i] / (2 * h)) for s in (-1, 1))
            data, at = np.concatenate([low, high]), np.concatenate([piece, piece + 1])
            rows.append(sparse.csr_array((data, (np.tile(piece, 2), at)), (n, n + 1)))
            right.append(force[i] - sign * held[:, i])
    largest = (1 / np.abs(slope / speed).max(axis=1)) ** 2
    bounds = np.minimum(np.append(largest, largest[-1]), np.append(largest[0], largest))
    bounds[[0, -1]] = 0.0
    found = linprog(
        -np.ones(n + 1), A_ub=sparse.vstack(rows), b_ub=np.concatenate(right),
        bounds=np.column_stack([np.zeros(n + 1), bounds]), method="highs",
    )  # fmt: skip
    assert found.status == 0, found.message
    rate = np.sqrt(found.x)
    return float((2 * h / (rate[:-1] + rate[1:])).sum())


@pytest.mark.parametrize("name", LINES)
def test_another_program_is_no_faster(name: str) -> None:
    task, line, free = free_motion(name)
    model, index = task.mechanism.model, task.mechanism.actuated_indices
    limits = model.effortLimit[index], model.velocityLimit[index]
    expected = by_linear_program(task, line, *limits, 200)
    assert free.duration == pytest.approx(expected, rel=2e-3)


@cache
def without_closed_forms() -> Task:
    plain = Task(RPSRobot.from_preset("sokolov").mechanism, "platform", ["z", "rx", "ry"])
    return plain.compile(functions=("kinematics", "closing", "dynamics"))


@pytest.mark.parametrize("force", [20.0, 100.0])
def test_the_3_rps_without_its_closed_forms(force: float) -> None:
    robot = RPSRobot.from_preset("sokolov")
    line = LineCurve([0.40, 0.05, 0.0], [0.45, -0.05, 0.1])
    expected = rps_time_optimal(robot, line, limits=ActuatorLimits(force, 0.5), intervals=20)
    limits = MotionLimits(force=force, speed=0.5)
    for task in (without_closed_forms(), robots.compiled("sokolov")):
        found = time_optimal(task, line, limits=limits, intervals=20)
        assert found.duration == pytest.approx(expected.duration, rel=1e-6)
        t = np.linspace(0, found.duration, 200)
        np.testing.assert_allclose(found.sample(t).pose, expected.sample(t).pose, atol=1e-6)


@pytest.mark.parametrize("name", robots.GENERATED)
def test_any_robot_along_a_curve_through_poses(name: str) -> None:
    """Of the actuators' own speeds, and a few times the forces that holding takes."""
    task, (x, q) = robots.compiled(name), robots.poses(name)
    mechanism, index = task.mechanism, task.mechanism.actuated_indices
    still = np.zeros((len(q), mechanism.model.nv))
    force = 5 * np.abs(task.actuator_forces(q, still, still)).max()
    limits = MotionLimits(force=force)
    found = time_optimal(task, ChordSpline(x[:3]), limits=limits, near=q[0], intervals=30)
    motion = found.sample(np.sort(np.random.default_rng(7).uniform(0, found.duration, 60)))
    state = task.motion(task.follow(motion.pose, near=q[0]), motion.rate, motion.acceleration)
    tau = [mechanism.inverse_dynamics(*one).tau for one in zip(*state, strict=True)]
    uses = [np.abs(tau) / force, np.abs(state.v[:, index]) / mechanism.model.velocityLimit[index]]
    most = np.concatenate(uses, axis=1).max(axis=1)
    assert worst(most) <= 1 + KEPT
    assert (most >= 1 - 1e-3).mean() >= 0.95
    assert found.shares()["none"] <= 6e-3


def test_more_actuators_than_coordinates_share_the_force() -> None:
    """Forces are those of least norm, under a wrench too."""
    mechanism = robots.task("five_bar").mechanism
    more = mechanism.with_actuated(["left_joint", "left_arm_joint", "right_joint"])
    task, wrench = Task(more, "left_tip", ["x", "z"]), np.array([2.0, 0.0, -5.0, 0.0, 0.0, 0.0])
    line = LineCurve(task.home, task.home + np.array([0.02, 0.01]))
    bounds = MotionLimits(force=10.0, speed=5.0).of(task)
    along = TaskDynamics(task, line, bounds, wrench, None)
    u = np.array([0.1, 0.5, 0.9])
    square, change = np.array([1.0, 2.0, 3.0]), np.array([5.0, -4.0, 2.0])
    use = along.use_along(u, square, change)
    terms = along.terms(u)
    by_terms = terms.inertia * change[:, None] + terms.velocity_product * square[:, None]
    state = task.state(*along.sample(u, square, change))
    for i, one in enumerate(zip(*state, strict=True)):
        tau = more.inverse_dynamics(*one, wrenches={"left_tip": wrench}).tau
        np.testing.assert_allclose(use.force[i] * 10.0, tau, atol=1e-9)
        np.testing.assert_allclose(by_terms[i] + terms.holding[i], tau, atol=1e-9)
    np.testing.assert_allclose(use.speed * 5.0, state.v[:, more.actuated_indices], atol=1e-12)


def test_a_wrench_is_held_along_the_way() -> None:
    task, wrench = robots.compiled("stewart"), np.array([30.0, -50.0, -400.0, 5.0, -8.0, 3.0])
    line = LineCurve(task.home, task.home + LINES["stewart"])
    found = time_optimal(task, line, wrench=wrench)
    t = np.linspace(0, found.duration, 40)
    q, v, a = task.state(*found.sample(t))
    mechanism = task.mechanism
    forces = [
        mechanism.inverse_dynamics(*one, wrenches={"platform": wrench}).tau
        for one in zip(q, v, a, strict=True)
    ]
    limit = mechanism.model.effortLimit[mechanism.actuated_indices]
    np.testing.assert_allclose(found.use(t).force, np.array(forces) / limit, atol=1e-8)
    assert worst(np.abs(forces) / limit) <= 1 + KEPT


def test_a_payload_is_carried_along(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the 3-RPS's closed forms have it, and a heavier mass on a slide."""
    monkeypatch.setattr(task_dynamics, "_FEW_TIMES", 101)
    load = Payload(3.0, (0.05, -0.02, 0.1))
    robot = RPSRobot.from_preset("sokolov")
    line = LineCurve([0.42, 0.0, 0.0], [0.44, -0.02, 0.05])
    expected = rps_time_optimal(
        robot.with_payload(load), line, limits=ActuatorLimits(60.0, 0.5), intervals=8
    )
    limits = MotionLimits(force=60.0, speed=0.5)
    found = time_optimal(robot.task, line, limits=limits, payload=load, intervals=8)
    assert found.duration == pytest.approx(expected.duration, rel=1e-5)
    free = rps_time_optimal(robot, line, limits=ActuatorLimits(60.0, 0.5), intervals=8)
    assert found.duration > 1.001 * free.duration


def test_friction_in_the_joints_is_overcome() -> None:
    plain = robots.task("five_bar").mechanism
    dry, none = np.zeros(plain.model.nv), np.zeros(plain.model.nv)
    index = plain.actuated_indices
    dry[index] = 0.3 * plain.model.effortLimit[index]
    effects = JointEffects(none, dry, none, none)
    rough = ClosedLoopModel(
        plain.model, plain.closures, plain.actuated, home=plain.home, effects=effects
    )
    task = Task(rough, "left_tip", ["x", "z"]).compile()
    line = LineCurve(task.home, task.home + np.array([0.02, 0.01]))
    found = time_optimal(task, line, intervals=8)
    force, speed, _ = demands(task, found, np.linspace(0, found.duration, 150))
    use = np.abs(force / plain.model.effortLimit[index]).max(axis=1)
    use = np.maximum(use, np.abs(speed / plain.model.velocityLimit[index]).max(axis=1))
    assert worst(use) <= 1 + KEPT
    assert (use >= 1 - 1e-3).mean() >= 0.95
    assert found.duration > 1.01 * time_optimal(robots.compiled("five_bar"), line).duration


def test_pinocchio_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_dynamics, "_FEW_TIMES", 101)
    slow, fast = robots.task("five_bar"), robots.compiled("five_bar")
    line = LineCurve(slow.home, slow.home + np.array([0.02, 0.01]))
    found = [time_optimal(task, line, intervals=8) for task in (slow, fast)]
    assert found[0].duration == pytest.approx(found[1].duration, rel=1e-7)


# What is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": ActuatorLimits(10.0)}, "they must be MotionLimits"),
        ({"limits": MotionLimits(force=math.inf)}, "no limit of force"),
        ({"limits": MotionLimits(force=-1.0)}, "force limit = -1.0: it must be positive"),
        ({"limits": MotionLimits(force=math.nan)}, "force limit"),
        ({"limits": MotionLimits(force="much")}, "force limit"),
        ({"limits": MotionLimits(force=[1.0, 2.0])}, r"force limit has shape \(2,\)"),
        ({"limits": MotionLimits(force=[[2.0], [1.0]])}, "the least .* must be below"),
        ({"limits": MotionLimits(force=[[-math.inf], [1.0]])}, "or neither"),
        ({"limits": MotionLimits(force=1.0, speed=[[1.0], [2.0]])}, "speed limit: the least must"),
        ({"limits": MotionLimits(acceleration=[[1.0], [2.0]])}, "acceleration limit: the least"),
        ({"intervals": 7}, "intervals = 7"),
        ({"wrench": np.zeros((4, 6))}, "wrench has shape"),
        ({"wrench": [0, 0, math.nan, 0, 0, 0]}, "wrench"),
    ],
)
def test_bad_arguments_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        time_optimal(slide(), ALONG, **({"limits": MotionLimits(force=1.0)} | options))


def test_other_paths_are_refused() -> None:
    with pytest.raises(InputError, match="task"):
        time_optimal(RPSRobot.from_preset("micro"), ALONG)  # type: ignore[arg-type]
    limits = MotionLimits(force=1.0)
    with pytest.raises(InputError, match="it must be a curve"):
        time_optimal(slide(), 3.0, limits=limits)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"have shape \(2,\); the task has 1 coordinates: slide"):
        time_optimal(slide(), LineCurve([0, 0], [1, 1]), limits=limits)
    for load in ({"wrench": np.zeros(6)}, {"payload": Payload(1.0)}):
        with pytest.raises(MechanismError, match="no output frame for a payload or a wrench"):
            time_optimal(slide(), ALONG, limits=limits, **load)
    with pytest.raises(ClosureError, match=r"at u = 0\.75\d* of 1: .*slide"):
        time_optimal(slide(), LineCurve([0.7], [1.1]), limits=limits)


def test_what_cannot_be_held_is_infeasible() -> None:
    with pytest.raises(InfeasibleError, match=r"slide force of 19\.62 N, and its limit") as caught:
        time_optimal(slide("0 0 1"), ALONG, limits=MotionLimits(force=[[-30.0], [19.0]]))
    (excess,) = caught.value.violations
    assert (excess.value, excess.limit) == (pytest.approx(19.62), 19.0)


def test_where_the_assembly_mode_ends_is_said() -> None:
    task = robots.compiled("slider_crank")
    with pytest.raises(RPSPinError, match=r"at u = 0\.\d+ of 1: .*singularity"):
        time_optimal(task, LineCurve(task.home, task.home + 0.05), limits=MotionLimits(force=5.0))


def test_a_crossed_singularity_is_refused() -> None:
    """A crank-rocker that is driven at the rocker: the crank runs through both of its ends."""
    driven = robots.task("four_bar").mechanism.with_actuated(["rocker_joint"])
    task = Task(driven, joints=["crank_joint"])
    with pytest.raises(SingularityError, match=r"between u = .* crosses a type II singularity"):
        time_optimal(task, LineCurve([1.0], [5.0]), limits=MotionLimits(force=5.0))
