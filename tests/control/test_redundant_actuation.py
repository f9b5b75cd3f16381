"""Controllers of mechanisms with more actuators than coordinates: forces of least norm, in limits.

The five-bar with a motor in an elbow too, and the planar 3-RRR with two motors more. What the
forces do is compared with that of the mechanism with as many motors as coordinates.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.control import ComputedTorque, DriveControl, Gains, PDControl, Plant, Status
from rps_pin.errors import InputError
from rps_pin.task import Task
from rps_pin.trajectories import point_to_point
from tests.worst import worst

MORE = {"five_bar": 1, "planar_rrr": 2}


@cache
def square(name: str) -> Task:
    return ClosedLoopModel.load(f"urdf/{name}.yaml").task


@cache
def redundant(name: str) -> Task:
    mechanism = square(name).mechanism
    others = [joint for joint in list(mechanism.model.names)[1:] if joint not in mechanism.actuated]
    names = [*mechanism.actuated, *others[: MORE[name]]]
    return square(name).with_mechanism(mechanism.with_actuated(names))


def near(name: str) -> Array:
    one = square(name)
    return one.home + 0.05 * one.characteristic_length / one.scale * np.linspace(-1, 1, one.size)


@pytest.mark.parametrize("law", [ComputedTorque, PDControl])
@pytest.mark.parametrize("name", MORE)
def test_forces_do_the_same_and_none_does_so_with_less(name: str, law: type) -> None:
    gains = Gains(300.0, 30.0)
    pair = [law(one(name), near(name), gains, space="task", force_limit=1e9, largest_jump=1.0)
            for one in (square, redundant)]  # fmt: skip
    rng, still = np.random.default_rng(1), np.zeros(square(name).size)
    goal = near(name) + 0.01 * square(name).characteristic_length
    q = square(name).configuration(near(name) + 1e-3)
    speed = square(name).jacobian(q) @ (0.1 * rng.normal(size=still.size))
    v = square(name).velocity_of(q, speed)
    for one, task in zip(pair, (square(name), redundant(name)), strict=True):
        actuated = task.mechanism.actuated_indices
        assert one.tick(q[task.of_actuators], (goal, still, still), v[actuated]) == Status.OK
    few, many = (one.forces for one in pair)
    assert many.size == few.size + MORE[name]
    for field in ("pose", "rate"):
        ours, theirs = (getattr(one.estimate.answers, field) for one in pair)
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    K_few, K_many = square(name).jacobian(q), redundant(name).jacobian(q)
    np.testing.assert_allclose(K_many.T @ many, K_few.T @ few, rtol=1e-8, atol=1e-8)
    without = np.linalg.svd(K_many.T)[2][still.size :]  # all revolute: one unit
    np.testing.assert_allclose(without @ many, 0.0, atol=1e-8 * np.abs(many).max())


@pytest.mark.parametrize("name", MORE)
def test_a_perfect_model_is_tracked(name: str) -> None:
    goal = near(name) + 0.03 * square(name).characteristic_length / square(name).scale
    path, task = point_to_point(near(name), goal, duration=0.1), redundant(name)
    one = ComputedTorque(task, near(name), Gains.placed(15.0), force_limit=1e6, largest_jump=1.0)
    plant = Plant(task, near(name), force_limit=1e6)
    errors = []
    for k in range(100):
        target = path.sample(k * 1e-3)
        assert one.tick(plant.reading(), target, plant.speed) == Status.OK
        errors.append(worst(np.abs(plant.pose - target.pose)))
        plant.step(one.forces)
    assert worst(errors) < 0.01 * np.abs(goal - near(name)).max()


@pytest.mark.parametrize("name", MORE)
def test_noise_of_more_readings_fits_with_the_least_error(name: str) -> None:
    """Of positions that no configuration has: no coordinates near fit better."""
    task, rng = redundant(name), np.random.default_rng(2)
    one = ComputedTorque(task, near(name), Gains.placed(15.0), largest_jump=1.0, force_limit=1e6)
    q = task.configuration(near(name))
    reading = q[task.of_actuators] + 1e-3 * rng.normal(size=task.of_actuators.size)
    assert not one.tick(reading, None, 0 * reading).kept
    x = one.estimate.answers.pose.copy()

    def error(pose: Array) -> float:
        found = task.configuration(pose, q, within_limits=False)[task.of_actuators]
        return float(np.sum((found - reading) ** 2))

    least = error(x)
    assert 0 < least < error(near(name))
    for _ in range(20):
        assert error(x + 1e-5 * rng.normal(size=x.size)) > least


@pytest.mark.parametrize("name", MORE)
def test_forces_beyond_limits_are_replaced_by_the_nearest_in_effect(name: str) -> None:
    task, rng = redundant(name), np.random.default_rng(3)
    free = ComputedTorque(task, near(name), Gains.placed(15.0), force_limit=1e6, largest_jump=1.0)
    q, still = task.configuration(near(name)), np.zeros(task.size)
    reading = q[task.of_actuators]
    goal = near(name) + 0.02 * task.characteristic_length / task.scale
    free.tick(reading, (goal, still, still), 0 * reading)
    wanted = free.forces.copy()
    # The largest force a little above its limit: the others, above the least norm, can help.
    weak = np.abs(wanted) + 0.5 * np.abs(wanted).max()
    weak[np.abs(wanted).argmax()] = 0.97 * np.abs(wanted).max()
    one = ComputedTorque(task, near(name), Gains.placed(15.0), force_limit=weak, largest_jump=1.0)
    status = one.tick(reading, (goal, still, still), 0 * reading)
    assert status == Status.SATURATED
    assert (np.abs(one.forces) <= weak).all()
    K, mass = task.jacobian(q), task.mass_matrix(q)

    def missing(force: Array) -> float:
        change = K.T @ (force - wanted)
        return float(change @ np.linalg.solve(mass, change))

    size = float(K.T @ wanted @ np.linalg.solve(mass, K.T @ wanted))
    assert missing(one.forces) < 1e-9 * size  # the same effect
    clipped = np.clip(wanted, -weak, weak)
    assert missing(clipped) > 1e-5 * size
    # With limits too low for that, no forces within them come nearer.
    low = ComputedTorque(task, near(name), Gains.placed(15.0), force_limit=0.5 * weak.min())
    assert low.tick(reading, (goal, still, still), 0 * reading) == Status.SATURATED
    best = missing(low.forces)
    for _ in range(200):
        other = np.clip(
            low.forces + 0.1 * weak * rng.normal(size=weak.size),
            -0.5 * weak.min(),
            0.5 * weak.min(),
        )
        assert missing(other) > best * (1 - 1e-6)


def test_errors_of_the_actuators_are_refused() -> None:
    one = redundant("five_bar")
    with pytest.raises(InputError, match="errors of 3 actuators are not free; take space='task'"):
        ComputedTorque(one, near("five_bar"), Gains.placed(15.0), space="actuator")
    with pytest.raises(InputError, match="errors of 3 actuators"):
        DriveControl(one, near("five_bar"))
