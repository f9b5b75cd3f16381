"""The plant of any mechanism with a task, and drives that take positions or speeds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.control import Encoders, Plant, ServoDrives
from rps_pin.errors import ClosureError, InputError, MechanismError
from tests.control.tasks import NAMES, ROBOT, plain, start
from tests.worst import worst


def weight(plant: Plant) -> Array:
    """Forces that hold it where it is, by virtual work of the tree's weight."""
    return plain_mechanism(plant).gravity_forces(plant.configuration)


def plain_mechanism(plant: Plant) -> ClosedLoopModel:
    return plant._task.mechanism


@pytest.mark.parametrize("name", NAMES)
def test_it_starts_at_rest_and_stays_where_its_weight_is_held(name: str) -> None:
    plant = Plant(plain(name), start(name), force_limit=np.inf)
    np.testing.assert_allclose(plant.pose, start(name), rtol=0, atol=1e-10)
    held = weight(plant)
    assert np.abs(held).max() > 1e-3
    np.testing.assert_allclose(plant.applied, held, rtol=1e-8, atol=1e-8)
    for _ in range(10):
        plant.step(held)
    np.testing.assert_allclose(plant.pose, start(name), rtol=0, atol=1e-8)
    assert plant.time == pytest.approx(0.01)
    assert plant.gap < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_energy_is_the_work_and_rates_are_the_slopes_of_poses(name: str) -> None:
    """Forces are held within a tick: their work is applied . (a_k+1 - a_k), exactly."""
    plant = Plant(plain(name), start(name), force_limit=np.inf, period=2e-4, substeps=1)
    mechanism = plain_mechanism(plant)
    assert mechanism.effects is None

    def energy() -> float:
        return float(sum(mechanism.energy(plant.configuration, plant._stepper.v)))

    size = 0.3 * np.abs(plant.applied).max()
    push = size * np.random.default_rng(3).uniform(-1, 1, size=plant.applied.size)
    begin, work, moved = energy(), 0.0, 0.0
    poses, rates, positions, speeds = [plant.pose], [plant.rate], [plant.length], [plant.speed]
    for _ in range(40):
        plant.step(weight(plant) + push)
        poses, rates = [*poses, plant.pose], [*rates, plant.rate]
        positions, speeds = [*positions, plant.length], [*speeds, plant.speed]
        done = float(plant.applied @ (positions[-1] - positions[-2]))
        work, moved = work + done, moved + abs(done)
    assert moved > 1e-6
    assert abs(energy() - begin - work) < 1e-7 * moved + 1e-12
    for values, slopes in ((poses, rates), (positions, speeds)):
        x, v = np.array(values), np.array(slopes)
        found = (x[2:] - x[:-2]) / (2 * plant.period)
        np.testing.assert_allclose(found, v[1:-1], rtol=0, atol=2e-3 * np.abs(v).max())
        assert np.abs(v).max() > 1e-3


def test_the_mechanism_of_a_3_rps_moves_as_the_robot() -> None:
    pose = np.array([0.223, 0.05, -0.03])
    plants = [Plant(one, pose, delay=1, force_limit=5.0) for one in (ROBOT, plain("rps"))]
    rng, limited = np.random.default_rng(4), 0
    for _ in range(25):
        forces = plants[0].applied + rng.normal(scale=3.0, size=3)
        for plant in plants:
            plant.step(forces)
        for quantity in ("pose", "rate", "length", "speed", "applied", "configuration"):
            one, two = (getattr(plant, quantity) for plant in plants)
            np.testing.assert_allclose(one, two, rtol=0, atol=1e-9, err_msg=quantity)
        limited += int((np.abs(plants[0].applied) == 5.0).sum())
    assert limited > 2


@pytest.mark.parametrize("delay", [0, 2])
def test_commands_wait_and_are_limited_by_the_model(delay: int) -> None:
    mechanism = ClosedLoopModel.load("urdf/delta.yaml")
    limit = float(mechanism.model.effortLimit[mechanism.actuated_indices][0])
    plant = Plant(mechanism, start("delta"), delay=delay)
    held = plant.applied
    commands = [np.full(3, 2.0 + k) for k in range(3)] + [np.array([1e9, -1e9, 0.0])] * (delay + 1)
    for k, command in enumerate(commands):
        plant.step(command)
        wanted = commands[k - delay] if k >= delay else held
        np.testing.assert_array_equal(plant.applied, np.clip(wanted, -limit, limit))
    np.testing.assert_array_equal(plant.applied, [limit, -limit, 0.0])


def test_encoders_read_every_actuator() -> None:
    plants = [
        Plant(plain("stewart"), start("stewart"), encoders=Encoders(1e-5, 3e-5, seed=2))
        for _ in range(2)
    ]
    one, two = (plant.reading() for plant in plants)
    np.testing.assert_array_equal(one, two)
    assert one.shape == (6,)
    assert 0 < np.abs(one - plants[0].length).max() < 3e-4
    np.testing.assert_allclose(one / 1e-5, np.round(one / 1e-5), rtol=0, atol=1e-6)


# Drives with loops of their own -------------------------------------------------------------------


def response(drives: ServoDrives, time: float, change: Array) -> Array:
    """The drives' answer to a step of the command, from rest, in closed form."""
    w = 2 * np.pi * drives.bandwidth
    if drives.command == "speed":
        return np.asarray(change * (time - (1 - np.exp(-w * time)) / w))
    if drives.damping == 1.0:
        return np.asarray(change * (1 - (1 + w * time) * np.exp(-w * time)))
    wd = w * np.sqrt(1 - drives.damping**2)
    decay = np.exp(-drives.damping * w * time)
    turned = np.cos(wd * time) + drives.damping * w / wd * np.sin(wd * time)
    return np.asarray(change * (1 - decay * turned))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "drives",
    [ServoDrives(bandwidth=20.0), ServoDrives(bandwidth=20.0, damping=0.5),
     ServoDrives("speed", bandwidth=25.0)],
    ids=["position", "less damped", "speed"],
)  # fmt: skip
def test_drives_answer_as_their_law_says(name: str, drives: ServoDrives) -> None:
    task = plain(name)
    change = 0.02 * np.array([1.0, -0.7, 0.5, -0.2, 0.9, 0.4])[: task.of_actuators.size]
    change = change * (0.1 if name == "rps" else 0.5)
    errors = []
    for substeps in (1, 2):
        plant = Plant(task, start(name), drives=drives, force_limit=np.inf, period=4e-3,
                      substeps=substeps)  # fmt: skip
        begin = plant.length
        command = change / (0.02 if drives.command == "speed" else 1.0)
        if drives.command == "position":
            command = begin + change
        for _ in range(4):
            plant.step(command)
        given = command if drives.command == "speed" else change
        errors.append(np.abs(plant.length - begin - response(drives, 0.016, given)).max())
        assert np.abs(plant.length - begin).max() > 1e-4
    assert errors[1] < 2e-3 * np.abs(change).max()
    assert errors[0] / errors[1] > 10  # of order 4


def test_drives_keep_their_limits_of_speed_and_force() -> None:
    task = plain("delta")
    drives = ServoDrives(bandwidth=20.0, speed_limit=0.3)
    slow = Plant(task, start("delta"), drives=drives, force_limit=np.inf)
    goal = slow.length + np.array([0.1, 0.08, 0.09])
    speeds = []
    for _ in range(60):
        slow.step(goal)
        speeds.append(np.abs(slow.speed).max())
    assert 0.29 < max(speeds) < 0.3 * (1 + 1e-6)
    strong, weak = (
        Plant(task, start("delta"), drives=ServoDrives(bandwidth=20.0), force_limit=limit)
        for limit in (np.inf, 1.2 * np.abs(slow.applied).max())
    )
    largest, behind = 0.0, 0.0
    for _ in range(30):
        strong.step(goal)
        weak.step(goal)
        largest = worst(largest, strong.applied)
        behind = worst(behind, strong.length - weak.length)
        assert np.abs(weak.applied).max() <= 1.2 * np.abs(slow.applied).max()
    assert largest > 2 * 1.2 * np.abs(slow.applied).max()
    assert behind > 1e-3


def test_drives_hold_before_the_first_command_has_arrived() -> None:
    for drives in (ServoDrives(), ServoDrives("speed")):
        plant = Plant(plain("delta"), start("delta"), drives=drives, delay=3)
        begin = plant.length
        for _ in range(3):
            plant.step(begin + 0.05)
            np.testing.assert_allclose(plant.length, begin, rtol=0, atol=1e-9)
        plant.step(begin)
        assert np.abs(plant.length - begin).max() > 1e-6


# Arguments ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "kind", "said"),
    [
        ({"pose": [0.0, 0.0]}, InputError, r"pose has shape \(2,\); it must be \(3,\)"),
        ({"pose": [0.0, 0.0, -9.0]}, ClosureError, "no closed configuration"),
        ({"force_limit": [1.0, 2.0]}, InputError, "force_limit"),
        ({"force_limit": -1.0}, InputError, "force_limit = -1.0: it must be positive"),
        ({"robot": "delta"}, InputError, "robot is a str; it must be an RPSRobot, a Task, or"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(
    changes: dict[str, Any], kind: type[Exception], said: str
) -> None:
    arguments = {"robot": plain("delta"), "pose": start("delta")} | changes
    with pytest.raises(kind, match=said):
        Plant(**arguments)


def test_a_mechanism_without_a_task_is_refused() -> None:
    with pytest.raises(MechanismError, match="has no task"):
        Plant(ClosedLoopModel.load("urdf/gripper.yaml"), [0.0])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"command": "force"}, "command"),
        ({"bandwidth": 0.0}, "bandwidth = 0"),
        ({"damping": -1.0}, "damping = -1"),
        ({"speed_limit": np.nan}, "speed_limit"),
    ],
)
def test_drives_that_do_not_exist_are_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ServoDrives(**options)
