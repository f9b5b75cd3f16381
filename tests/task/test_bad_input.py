"""Tasks that a mechanism does not have, and arguments that do not fit."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import (
    ClosedLoopModel,
    ClosureError,
    InputError,
    LoopClosure,
    MechanismError,
    RPSPinError,
    SingularityError,
)
from rps_pin.task import Task
from tests.closed_loop.mechanisms import values
from tests.closed_loop.test_completion import flat_parallelogram
from tests.task.robots import compiled, poses, task
from tests.worst import worst


@pytest.fixture(scope="module")
def delta() -> ClosedLoopModel:
    return task("delta").mechanism


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "a task is of a frame and its coordinates, or of joints"),
        ({"frame": "platform"}, "a task is of a frame and its coordinates, or of joints"),
        ({"coordinates": ["x"]}, "a task is of a frame and its coordinates, or of joints"),
        (
            {"frame": "platform", "coordinates": ["x", "y", "z"], "joints": ["arm_1_joint"]},
            "a task is of a frame and its coordinates, or of joints",
        ),
        ({"frame": "hand", "coordinates": ["x"]}, "no frame 'hand'; there are: universe, base"),
        (
            {"frame": "platform", "coordinates": ["x", "y", "z"], "reference": "floor"},
            "no frame 'floor'; there are: universe",
        ),
        ({"frame": "platform", "coordinates": ["w"]}, "no coordinate 'w'; there are: x, y, z, rx"),
        ({"frame": "platform", "coordinates": []}, "no coordinates are named"),
        ({"frame": "platform", "coordinates": ["x", "y", "x"]}, "coordinate 'x' is named twice"),
        ({"frame": "platform", "coordinates": ["x", "y"]}, "too few: the mechanism has 3 motions"),
        (
            {"frame": "platform", "coordinates": ["x", "y", "z", "rz"]},
            r"4 coordinates \(x, y, z, rz\), which are too many: the mechanism has 3 motions",
        ),
        (
            {"frame": "platform", "coordinates": ["x", "y", "rz"]},
            "coordinate rz of the task does not move",
        ),
        ({"joints": ["elbow"]}, "no joint 'elbow'; there are: arm_1_joint"),
        ({"joints": ["platform_joint"]}, "'platform_joint' .* has 7 coordinates"),
        ({"joints": ["arm_1_joint", "arm_1_joint"]}, "'arm_1_joint' is named twice"),
        ({"joints": [3]}, "3 is not a name"),
        (
            {"frame": "platform", "coordinates": ["x", "y", "z"], "placement": np.eye(3)},
            "4 x 4 finite numbers",
        ),
        (
            {"frame": "platform", "coordinates": ["x", "y", "z"], "characteristic_length": -1},
            "characteristic_length",
        ),
    ],
)
def test_tasks_that_do_not_fit_are_refused(delta, options, message) -> None:
    with pytest.raises((InputError, MechanismError), match=message):
        Task(delta, **options)


def test_dependent_coordinates_are_named() -> None:
    """A platform that is held in a plane: x and y depend on each other."""
    m = task("stewart").mechanism
    with pytest.raises(MechanismError, match=r"coordinates .*x.* do not move independently"):
        Task(
            ClosedLoopModel(
                m.model,
                [
                    *m.closures,
                    LoopClosure("platform", "universe", "point_on_plane", axis=(1, 1, 0)),
                ],
                m.actuated,
                home=m.home,
            ),
            "platform",
            ["x", "y", "z", "rx", "ry"],
        )


def test_a_mechanism_without_a_task_says_how_to_give_one() -> None:
    m = ClosedLoopModel.load("urdf/gripper.yaml")
    with pytest.raises(MechanismError, match=r"gripper has no task: give one in its description"):
        _ = m.task


def test_anything_else_than_a_mechanism_is_refused() -> None:
    with pytest.raises(InputError, match="a task is of a ClosedLoopModel, not of str"):
        Task("delta.yaml", joints=["a"])


@pytest.mark.parametrize(
    "given", [np.zeros(2), np.full(3, np.nan), "xyz", np.zeros(3, dtype=complex)]
)
def test_arguments_that_do_not_fit_are_refused(given) -> None:
    one, (_, q) = task("delta"), poses("delta")
    for call in (
        one.to_actuators,
        one.to_task,
        lambda x: one.state(x, np.zeros(3), np.zeros(3)),
        lambda x: one.motion(q[0], x, np.zeros(3)),
        lambda x: one.motion(q[0], np.zeros(3), x),
        lambda x: one.bias(q[0], x),
        lambda x: one.forces_to_actuators(q[0], x),
        lambda x: one.forces_to_task(q[0], x),
        lambda x: one.wrench_to_actuators(q[0], x),
        lambda x: one.gains_to_task(q[0], x),
        lambda x: one.force_polytope(q[0], (x, x)),
        one.jacobian,
        one.at,
        lambda x: one.rate(q[0], x),
        one.singularities,
        one.follow,
    ):
        with pytest.raises(InputError):
            call(given)


def test_a_rotation_vector_of_a_whole_turn_is_refused() -> None:
    one = task("stewart")
    with pytest.raises(InputError, match=r"rotation vector of 6\.4 rad"):
        one.to_actuators([0, 0, 0.63, 0, 0, 6.4])


def test_a_pose_outside_says_by_how_much() -> None:
    one = task("delta")
    with pytest.raises(ClosureError, match="stays open by"):
        one.to_actuators(one.home + 1.0)
    with pytest.raises(ClosureError, match="'leg_1_rod_joint' at"):
        task("stewart").to_actuators([0, 0, 0.96, 0, 0, 0])


@pytest.mark.parametrize("name", ["delta", "ankle", "sokolov"])
@pytest.mark.parametrize("make", [task, compiled], ids=["pinocchio", "generated"])
def test_forces_of_open_loops_are_refused_and_velocities_are_not(make, name) -> None:
    """The rule of a `ClosedLoopModel`: its dynamics refuses open loops, its velocities do not."""
    one, (_, q) = make(name), poses(name)
    rate, count = np.ones(one.size), one.mechanism.actuated_indices.size
    bad = q[1].copy()
    bad[one.of_actuators[0]] += 0.1
    calls = [
        lambda q, **how: one.forces_to_actuators(q, rate, **how),
        lambda q, **how: one.forces_to_task(q, np.ones(count), **how),
        lambda q, **how: one.gains_to_actuators(q, rate, **how),
        lambda q, **how: one.gains_to_task(q, np.ones(count), **how),
        one.mass_matrix,
    ]
    if one.frame is not None:
        calls.append(lambda q, **how: one.wrench_to_actuators(q, np.ones(6), **how))
    for call in calls:
        with pytest.raises(ClosureError, match="not a closed configuration: closure"):
            call(bad)
        with pytest.raises(ClosureError, match=r"sample \(1,\)"):
            call(np.array([q[0], bad]))
        found = call(np.array([q[0], bad, q[1]]), errors="mask")
        assert np.isnan(found[1]).all()
        assert worst(found[[0, 2]] - np.array([call(q[0]), call(q[1])])) < 1e-9 * worst(found[0])
    with pytest.raises(ClosureError, match="not a closed configuration: closure"):
        one.force_polytope(bad)
    assert np.isfinite(one.jacobian(bad)).all()


def end(go) -> float:
    """The largest share that a function takes."""
    low, high = 0.0, 1.0
    for _ in range(28):
        middle = (low + high) / 2
        try:
            go(middle)
        except RPSPinError:
            high = middle
        else:
            low = middle
    return low


def test_measures_vanish_at_singularities_of_their_own_kind_and_forces_are_refused_there() -> None:
    """A five-bar: type II where its forearms are in line, type I where an arm is stretched.

    Measures fall with the square root of the way to a singularity.
    """
    one = task("five_bar")
    m, a = one.mechanism, one.to_actuators(one.home)

    def by_actuators(share):
        values = a + share * np.array([1.2, -1.2])
        return m.complete(values, m.home, within_limits=False, restarts=0)

    def by_task(share):
        return one.configuration(one.home + np.array([0, share]), within_limits=False)

    for go, sort, other in ((by_actuators, "type_ii", "type_i"), (by_task, "type_i", "type_ii")):
        last = end(go)
        near, nearer = (one.singularities(go(last * (1 - d))) for d in (1e-4, 1e-6))
        assert getattr(nearer, sort) < 0.01
        assert abs(getattr(near, sort) / getattr(nearer, sort) - 10) < 0.3
        assert getattr(nearer, other) > 0.1
        assert nearer.distance == getattr(nearer, sort)
        assert nearer.constraint > 0.1
    push = one.forces_to_actuators(by_actuators(0.0), [1.0, 1.0])
    last = end(by_actuators)
    beside = by_actuators(last * (1 - 1e-6))
    assert worst(one.forces_to_actuators(beside, [1.0, 1.0])) > 50 * worst(push)
    strict = ClosedLoopModel(m.model, m.closures, m.actuated, home=m.home, max_condition=100)
    refusing = Task(strict, "left_tip", ["x", "z"])
    with pytest.raises(SingularityError, match="the actuators do not determine the task here"):
        refusing.forces_to_actuators(beside, [1.0, 1.0])


def test_the_constraint_measure_vanishes_where_the_closures_lose_rank() -> None:
    """A parallelogram laid flat, where it may become an antiparallelogram: zero as the sine."""
    m, _ = flat_parallelogram(["crank_joint"])
    one = Task(m, joints=["crank_joint"])
    angles = np.array([1.0, 1e-2, 1e-4, 1e-6])
    names = ("crank_joint", "coupler_joint", "rocker_joint")
    q = np.array([values(m, dict(zip(names, (a, -a, a), strict=True))) for a in angles])
    found = one.singularities(q)
    assert found.constraint[0] > 0.1
    np.testing.assert_allclose(found.constraint[2] / found.constraint[1], 1e-2, rtol=1e-3)
    np.testing.assert_allclose(found.constraint[3] / found.constraint[2], 1e-2, rtol=1e-3)
    np.testing.assert_allclose(found.type_i[0], one.singularities(q[0]).type_i, rtol=1e-12)
