"""The parts of the actuator forces: they sum to the whole, and each is what its name says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError
from rps_pin.rps.dynamics.actuator_forces import BLOCK
from rps_pin.rps.dynamics.force_causes import force_causes
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.kinematics.legs import PoseLegs, legs_of_pose
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import Motion, relative_error

Array = NDArray[np.float64]

FRICTION = {
    "prismatic_damping": 30.0,
    "prismatic_friction": 5.0,
    "revolute_damping": 0.4,
    "revolute_friction": 0.3,
    "friction_speed": 0.1,
}


def setting(seed: int) -> tuple[RPSParameters, Payload, Motion, Array]:
    rng = np.random.default_rng([5, seed])
    parameters = strategies.random_parameters(rng, tilted_gravity=True).replace(**FRICTION)
    payload = Payload(
        2.0, rng.normal(scale=0.2, size=3), strategies.rigid_body_inertia(rng, 2, 0.1)
    )
    motion = strategies.random_motions(rng, parameters, 200)
    return parameters, payload, motion, rng.normal(scale=20.0, size=(200, 6))


@pytest.mark.parametrize("seed", range(5))
def test_parts_sum_to_the_whole(seed: int) -> None:
    parameters, payload, motion, wrench = setting(seed)
    robot = RPSRobot(parameters).with_payload(payload)
    causes = force_causes(robot, *motion, wrench=wrench)
    whole = robot.actuator_forces(*motion, wrench=wrench)
    size = np.sum([np.abs(part) for part in causes.parts().values()], axis=0)
    assert (np.abs(causes.total - whole) / size.max(axis=-1, keepdims=True)).max() < 1e-12
    assert all(np.abs(part).max() > 0 for part in causes.parts().values())


@pytest.mark.parametrize("seed", range(3))
def test_parts_are_newton_and_euler_s(seed: int) -> None:
    """Gravity of a robot at rest; inertia and Coriolis of one without weight."""
    parameters, payload, motion, _ = setting(seed)
    causes = force_causes(RPSRobot(parameters).with_payload(payload), *motion)
    pose, rate, acceleration = motion
    weightless, still = parameters.replace(gravity=[0, 0, 0]), np.zeros(3)
    for found, of, given in (
        (causes.gravity, parameters, (pose, still, still)),
        (causes.inertia, weightless, (pose, still, acceleration)),
        (causes.coriolis, weightless, (pose, rate, still)),
    ):
        assert relative_error(found, ne.inverse_dynamics(of, *given).forces) < 1e-9


def test_each_cause_vanishes_with_what_causes_it() -> None:
    parameters, _, (pose, rate, acceleration), _ = setting(0)
    bare = RPSRobot(parameters.replace(**dict.fromkeys(FRICTION, 0.0) | {"friction_speed": 0.1}))
    still = np.zeros(3)
    causes = force_causes(bare, pose, still, still)
    for name in ("inertia", "coriolis", "friction", "payload", "external"):
        np.testing.assert_allclose(getattr(causes, name), 0.0, atol=1e-300)
    assert not force_causes(bare, pose, rate, still).inertia.any()
    assert not force_causes(bare, pose, still, acceleration).coriolis.any()


def test_friction_takes_power_and_coriolis_grows_with_the_square_of_speed() -> None:
    parameters, payload, (pose, rate, acceleration), _ = setting(1)
    robot = RPSRobot(parameters).with_payload(payload)
    speed = ne.kinematics(parameters, pose, rate, acceleration).leg_length_rates
    once = force_causes(robot, pose, rate, acceleration)
    assert ((once.friction * speed).sum(axis=-1) > 0).all()
    twice = force_causes(robot, pose, 2 * rate, acceleration)
    np.testing.assert_allclose(twice.coriolis, 4 * once.coriolis, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(twice.inertia, once.inertia)


def test_singular_samples_are_refused() -> None:
    robot, still = RPSRobot.from_preset("sokolov"), np.zeros(3)
    with pytest.raises(SingularityError, match="sample 1 of 2"):
        force_causes(robot, [[0.4, 0, 0], [0, 0, 0]], still, still)
    assert force_causes(robot, [0.4, 0, 0], still, still).total.shape == (3,)


def legs_of(robot: RPSRobot, pose: Array) -> PoseLegs:
    return legs_of_pose(pose, robot.parameters.base_radius, robot.parameters.platform_radius)


@pytest.mark.parametrize("shape", [(), (1,), (4, 5), (0,), (BLOCK // 2, 3)])
def test_legs_that_are_known_give_the_same_parts_and_motion(shape: tuple[int, ...]) -> None:
    robot = RPSRobot.from_preset("micro").with_payload(Payload(0.5, (0.01, 0.0, 0.02)))
    rng = np.random.default_rng(8)
    pose = [0.225, 0.0, 0.0] + [0.005, 0.05, 0.05] * rng.uniform(-1, 1, (*shape, 3))
    rate, acceleration = rng.normal(size=(2, *shape, 3))
    legs = legs_of(robot, pose)
    known = force_causes(robot, pose, rate, acceleration, legs=legs).parts()
    for name, part in force_causes(robot, pose, rate, acceleration).parts().items():
        np.testing.assert_allclose(known[name], part, rtol=1e-12, atol=1e-12)
    found = robot.motion(pose, rate, acceleration, legs=legs)
    for one, same in zip(found, robot.motion(pose, rate, acceleration), strict=True):
        for values, expected in zip(one, same, strict=True):
            np.testing.assert_array_equal(values, expected)


def test_legs_of_masked_samples_are_left_out() -> None:
    robot, still = RPSRobot.from_preset("micro"), np.zeros(3)
    pose = np.array([[0.223, 0.0, 0.0], [5.0, 0.0, 0.0], [0.225, 0.01, 0.02]])
    legs = legs_of(robot, pose)
    masked = force_causes(robot, pose, still, still, legs=legs, errors="mask").total
    np.testing.assert_array_equal(np.isnan(masked).all(axis=-1), [False, True, False])
    np.testing.assert_allclose(masked[::2], force_causes(robot, pose[::2], still, still).total)
    moved = robot.motion(pose, still, still, legs=legs, errors="mask")[1].length
    np.testing.assert_array_equal(moved[::2], legs.geometry.length[::2])
    assert np.isnan(moved[1]).all()


def test_legs_of_other_poses_are_refused() -> None:
    robot, still = RPSRobot.from_preset("micro"), np.zeros(3)
    legs = legs_of(robot, np.array([[0.223, 0.0, 0.0]] * 2))
    for function in (robot.motion, lambda *motion, legs: force_causes(robot, *motion, legs=legs)):
        with pytest.raises(InputError, match=r"shape \(2, 3\).*shape \(3,\)"):
            function([0.223, 0.0, 0.0], still, still, legs=legs)
