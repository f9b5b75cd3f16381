"""The parts of the actuator forces: they sum to the whole, and each is what its name says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSParameters, RPSRobot, SingularityError
from rps_pin.rps.dynamics.force_causes import force_causes
from rps_pin.rps.dynamics.loads import Payload
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
