"""The plant: closed forms of its state, energy, rest, delay, limits, order, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError, RPSPinError, UnreachableError
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.kinematics.pose import platform_pose
from rps_pin.trajectories.point_to_point import point_to_point
from tests import strategies

Array = NDArray[np.float64]

STILL = np.zeros(3)
POSE = np.array([0.223, 0.05, -0.03])


def micro(**changes: Any) -> RPSRobot:
    return RPSRobot(RPSParameters.from_preset("micro").replace(**changes))


def robots(count: int, seed: int) -> list[RPSRobot]:
    rng = np.random.default_rng(seed)
    load = Payload(2.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04]))
    parameters = (strategies.random_parameters(rng, tilted_gravity=True) for _ in range(count))
    return [RPSRobot(p, load if k % 2 else None) for k, p in enumerate(parameters)]


def weight(robot: RPSRobot, pose: Array) -> Array:
    """Forces that hold the robot at rest, in closed form."""
    forces: Array = robot.actuator_forces(pose, STILL, STILL)
    return forces


def energy(plant: Plant) -> float:
    stepper = plant._stepper
    return sum(plant.robot.mechanism.energy(stepper.q, stepper.v))


# Its state ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("largest", [1e-6, 0.5, 1.4, 3.0])
def test_pose_and_rate_are_those_whose_state_it_is_in(largest: float) -> None:
    """All of q and v are closed forms of pose and rate, legs included; thrown about by forces."""
    rng = np.random.default_rng(int(10 * largest))
    checked = 0
    for robot in robots(6, seed=3):
        for pose in strategies.random_motions(rng, robot.parameters, 6, largest)[0]:
            try:
                plant = Plant(robot, pose, period=2e-3)
                for _ in range(8):
                    plant.step(plant.applied + rng.normal(scale=30.0, size=3))
            except RPSPinError:  # too near a singularity
                continue
            if np.abs(plant.rate).max() > 30 or np.hypot(*plant.pose[1:]) > 3.1:
                continue
            q, v, _ = robot.state(plant.pose, plant.rate, STILL)
            found = plant.configuration.copy()
            found[9:] *= np.sign(found[9:] @ q[9:])  # -q is the same rotation
            assert np.abs(plant.rate).max() > 0.01
            np.testing.assert_allclose(found[6:], q[6:], rtol=0, atol=1e-10)
            assert np.abs(np.sin((found[:6:2] - q[:6:2]) / 2)).max() < 1e-10  # angles, by turns
            np.testing.assert_allclose(plant.length, q[1:6:2], rtol=0, atol=1e-10)
            np.testing.assert_allclose(plant.speed, v[1:6:2], rtol=0, atol=1e-8)
            np.testing.assert_allclose(plant._stepper.v, v, rtol=0, atol=1e-8 * np.abs(v).max())
            assert plant.gap < 1e-11
            checked += 1
    assert checked > 15


def test_it_starts_at_rest_in_its_pose() -> None:
    for pose in strategies.random_poses(60, seed=4, largest_tilt=2.5):
        for robot in robots(1, seed=5):
            try:
                plant = Plant(robot, pose)
            except RPSPinError:
                continue
            np.testing.assert_allclose(plant.pose, pose, rtol=0, atol=1e-10)
            np.testing.assert_array_equal([*plant.rate, *plant.speed, plant.time], 0.0)
            legs = robot.inverse_kinematics(pose)
            np.testing.assert_allclose(plant.length, legs.length, rtol=0, atol=1e-10)
            np.testing.assert_allclose(
                plant.applied, weight(robot, pose), rtol=0, atol=1e-7 * np.abs(plant.applied).max()
            )


@pytest.mark.parametrize("sign", [1, -1])
def test_the_tilt_is_the_rotation_vector(sign: int) -> None:
    """Whatever sign the quaternion has; many at once as one by one."""
    poses = strategies.random_poses(400, seed=6, largest_tilt=np.pi - 1e-9)
    poses = np.concatenate([poses, [[1.0, 0.0, 0.0], [1.0, 1e-12, 0.0], [1.0, 0.0, -1e-300]]])
    turns = Rotation.from_rotvec(np.column_stack([poses[:, 1:], 0 * poses[:, 0]]))
    q = np.random.default_rng(7).normal(size=(len(poses), 13))
    q[:, 8], q[:, 9:] = poses[:, 0], sign * turns.as_quat()
    found = platform_pose(q)
    np.testing.assert_allclose(found, poses, rtol=1e-14, atol=1e-15)
    np.testing.assert_array_equal(found, [platform_pose(row) for row in q])
    np.testing.assert_array_equal(found.reshape(-1, 13, 3), platform_pose(q.reshape(-1, 13, 13)))


# Its motion ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("dry", [0.0, 2.0])
def test_what_friction_takes_is_missing_from_the_work(dry: float) -> None:
    """Forces are held within a tick, so their work is applied' (d_k+1 - d_k), exactly."""
    lossless = energy_balance(micro(actuator_force_limit=np.inf), 0.0, 0.0)
    assert abs(lossless) < 1e-9
    friction = {"prismatic_damping": 9.0, "prismatic_friction": dry, "friction_speed": 0.05}
    for more in ({}, {"revolute_damping": 0.03, "revolute_friction": 0.02 * dry}):
        robot = micro(actuator_force_limit=np.inf, **friction, **more)
        energy_balance(robot, 2e-7, more.get("revolute_damping", 0.0))


def energy_balance(robot: RPSRobot, tolerance: float, revolute: float) -> float:
    """Energy gained, less the work, plus what friction takes by its law; J, of 0.05 J moved."""
    p, period = robot.parameters, 1e-4
    plant = Plant(robot, POSE, period=period, substeps=1)
    rng = np.random.default_rng(8)
    start, work, rates = energy(plant), 0.0, [plant._stepper.v[:6]]
    moved = 0.0
    for k in range(600):
        if k % 100 == 0:
            forces = plant.applied + rng.normal(scale=3.0, size=3)
        before = plant.length
        plant.step(forces)
        work += plant.applied @ (plant.length - before)
        moved += np.abs(plant.applied @ (plant.length - before))
        rates.append(plant._stepper.v[:6])
    assert moved > 0.05
    speed = np.array(rates)
    damping = np.tile([revolute, p.prismatic_damping], 3)
    dry = np.tile([p.revolute_friction, p.prismatic_friction], 3)
    power = ((damping * speed + dry * np.tanh(speed / p.friction_speed)) * speed).sum(axis=1)
    loss = float(((power[:-1] + power[1:]) / 2).sum() * period)  # each tick to order 2
    balance = energy(plant) - start - work + loss
    if tolerance:
        assert loss > 0.005
        assert abs(balance) < tolerance
    return balance


def test_it_stays_where_its_weight_is_held() -> None:
    for robot in robots(6, seed=9):
        pose = np.array([1.5 * robot.parameters.base_radius, 0.1, -0.2])
        push = np.array([3.0, -2.0, 5.0, 0.2, 0.1, -0.3])
        q, v, a = robot.state(pose, STILL, STILL)
        for wrenches, forces in (
            (None, weight(robot, pose)),
            ({"platform": push}, robot.inverse_dynamics(q, v, a, wrench=push).tau),
        ):
            plant = Plant(robot, pose, wrenches=wrenches)
            for _ in range(50):
                plant.step(forces)
            np.testing.assert_allclose(plant.pose, pose, rtol=0, atol=1e-9)
            assert plant.time == pytest.approx(0.05, rel=1e-12)
        plant = Plant(robot, pose, wrenches={"platform": push})
        for _ in range(50):
            plant.step(weight(robot, pose))
        assert np.abs(plant.pose - pose).max() > 1e-4  # pushed away


def test_inverse_dynamics_forces_lead_it_along_a_path() -> None:
    """Forces of the middle of each tick, held: to order 2 those of the path."""
    robot = RPSRobot.from_preset("micro")
    path = point_to_point(POSE, POSE + np.array([4e-3, -0.06, 0.08]), duration=0.1)
    missed = []
    for ticks in (50, 100):
        period = path.duration / ticks
        plant = Plant(robot, path.sample(0.0).pose, period=period)
        for k in range(ticks):
            plant.step(robot.actuator_forces(*path.sample((k + 0.5) * period)))
        missed.append(np.abs(plant.pose - path.sample(path.duration).pose).max())
    assert missed[1] < 8e-5  # of 0.08
    assert 3.0 < missed[0] / missed[1] < 5.0


def test_substeps_are_of_order_4() -> None:
    robot = micro(prismatic_damping=3.0)
    forces = np.random.default_rng(10).normal(scale=4.0, size=(10, 3)) + weight(robot, POSE)

    def after(substeps: int) -> Array:
        plant = Plant(robot, POSE, period=4e-3, substeps=substeps)
        for row in forces:
            plant.step(row)
        return np.concatenate([plant.pose, plant.rate])

    best = after(64)
    errors = np.array([np.abs(after(substeps) - best).max() for substeps in (1, 2, 4)])
    assert np.abs(np.log2(errors[:-1] / errors[1:]) - 4).max() < 0.5


# Between command and actuators --------------------------------------------------------------------


@pytest.mark.parametrize("delay", range(5))
def test_a_command_acts_after_the_delay_and_within_the_limit(delay: int) -> None:
    limit = 6.0
    robot = micro(actuator_force_limit=limit)
    plant = Plant(robot, POSE, delay=delay)
    hold = weight(robot, POSE)
    assert np.abs(hold).max() < limit
    commands = np.random.default_rng(11).normal(scale=8.0, size=(20, 3))
    prompt = Plant(robot, POSE)
    for k, command in enumerate(commands):
        given = command.copy()
        plant.step(given)
        given[:] = np.nan  # the command was copied
        wanted = commands[k - delay] if k >= delay else hold
        cut = np.minimum(np.maximum(wanted, -limit), limit)
        np.testing.assert_allclose(plant.applied, cut, rtol=1e-9)
        prompt.step(cut)
        np.testing.assert_allclose(plant.pose, prompt.pose, rtol=0, atol=1e-12)
    assert (np.abs(commands) > limit).any()


def test_one_too_weak_for_its_weight_sinks() -> None:
    robot = micro(actuator_force_limit=1.0)
    for delay in (0, 3):
        plant = Plant(robot, POSE, delay=delay)
        np.testing.assert_array_equal(plant.applied, 1.0)
        for _ in range(10):
            plant.step([100.0, 100.0, 100.0])
            np.testing.assert_array_equal(plant.applied, 1.0)
        assert plant.rate[0] < -0.03


@pytest.mark.parametrize(
    "forces", [[np.nan, 0, 0], [0, -np.inf, 0], [1.0, 2.0], [[1.0, 2.0, 3.0]], None, "push", 3.0]
)
@pytest.mark.parametrize("delay", [0, 2])
def test_refused_forces_change_nothing(forces: Any, delay: int) -> None:
    robot = RPSRobot.from_preset("micro")
    plant, other = Plant(robot, POSE, delay=delay), Plant(robot, POSE, delay=delay)
    for k in range(6):
        with pytest.raises(InputError, match="forces"):
            plant.step(forces)
        for each in (plant, other):
            each.step([3.0 + k, 5.0, 4.0 - k])
        np.testing.assert_array_equal(plant.applied, other.applied)
    np.testing.assert_allclose(plant.configuration, other.configuration, rtol=0, atol=1e-13)
    assert plant.time == other.time


# Encoders -----------------------------------------------------------------------------------------


def test_readings_are_of_the_true_lengths_and_do_not_move_it() -> None:
    robot = RPSRobot.from_preset("micro")
    assert (Plant(robot, POSE).reading() == Plant(robot, POSE).length).all()
    encoders = Encoders(1e-6, 3e-6, seed=5)
    plants = [Plant(robot, POSE, encoders=encoders) for _ in range(2)]
    plants.append(Plant(robot, POSE))
    for k in range(30):
        one, two = plants[0].reading(), plants[1].reading()
        np.testing.assert_array_equal(one, two)
        assert (one != plants[0].length).any()
        assert np.abs(one - plants[0].length).max() < 3e-5
        for plant in plants:
            plant.step([4.0, 5.0 + 0.1 * k, 4.5])
    np.testing.assert_allclose(plants[0].configuration, plants[2].configuration, rtol=0, atol=1e-13)


# Arguments ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "kind", "said"),
    [
        ({"pose": [0.223, 0.0]}, InputError, "pose has shape"),
        ({"pose": [[0.223, 0.0, 0.0]]}, InputError, r"pose has shape \(1, 3\); it must be \(3,\)"),
        ({"pose": [np.nan, 0.0, 0.0]}, InputError, "pose is not finite"),
        ({"pose": [0.5, 0.0, 0.0]}, UnreachableError, "out of reach"),
        ({"period": 0.0}, InputError, "period = 0"),
        ({"period": np.inf}, InputError, "period = inf"),
        ({"substeps": 0}, InputError, "substeps = 0: it must be a whole number, at least 1"),
        ({"substeps": 1.5}, InputError, "substeps = 1.5"),
        ({"delay": -1}, InputError, "delay = -1: it must be a whole number, at least 0"),
        ({"delay": 0.5}, InputError, "delay = 0.5"),
        ({"substeps": True}, InputError, "substeps = True"),
        ({"encoders": None}, InputError, "encoders is a NoneType; it must be Encoders"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(
    changes: dict[str, Any], kind: type[Exception], said: str
) -> None:
    arguments = {"pose": POSE} | changes
    with pytest.raises(kind, match=said):
        Plant(RPSRobot.from_preset("micro"), **arguments)


def test_numpy_s_whole_numbers_are_whole_numbers() -> None:
    robot = RPSRobot.from_preset("micro")
    positions = []
    for whole in (int, np.int64):
        plant = Plant(robot, [0.223, 0.0, 0.0], substeps=whole(3), delay=whole(1))
        for _ in range(3):
            plant.step((0.0, 0.0, 0.0))
        positions.append(plant.pose)
    np.testing.assert_array_equal(*positions)
