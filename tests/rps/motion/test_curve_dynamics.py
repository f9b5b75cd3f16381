"""Forces and speeds along a curve, against the constraint models and differences."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.rps import ActuatorLimits, Payload, RPSParameters, RPSRobot
from rps_pin.rps.motion.curve_dynamics import CurveDynamics
from rps_pin.trajectories.spline import ChordSpline

MICRO = RPSParameters.from_preset("micro")
ROUGH = MICRO.replace(
    prismatic_damping=20.0,
    prismatic_friction=3.0,
    revolute_damping=0.02,
    revolute_friction=0.05,
    friction_speed=0.05,
)
WRENCH = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.05])


def dynamics(parameters: RPSParameters, seed: int) -> CurveDynamics:
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(0.215, 0.235, 4), *rng.uniform(-0.1, 0.1, (2, 4))])
    robot = RPSRobot(parameters).with_payload(Payload(0.5, (0.02, -0.01, 0.05)))
    return CurveDynamics(robot, ChordSpline(poses), ActuatorLimits(30.0, 0.5), WRENCH)


@pytest.mark.parametrize("parameters", [MICRO, ROUGH], ids=["smooth", "rough"])
@pytest.mark.parametrize("seed", range(4))
def test_terms_make_up_the_forces_of_the_constraint_models(
    parameters: RPSParameters, seed: int
) -> None:
    along = dynamics(parameters, seed)
    rng = np.random.default_rng(seed)
    u = rng.uniform(0, along.curve.length, 20)
    square, acceleration = rng.uniform(0, 0.1, 20), rng.normal(size=20)
    terms, (friction, _) = along.terms(u), along.friction(u, square)
    force = terms.inertia * acceleration[:, None] + terms.velocity_product * square[:, None]
    force += terms.holding + friction
    motion = along.sample(u, square, acceleration)
    q, v, a = along.robot.state(*motion)
    for i in range(20):
        expected = along.robot.inverse_dynamics(q[i], v[i], a[i], wrench=WRENCH).tau
        np.testing.assert_allclose(force[i], expected, atol=1e-9)
    speed = along.robot.motion(*motion)[1].speed
    np.testing.assert_allclose(terms.length_slope * np.sqrt(square)[:, None], speed, atol=1e-12)
    use = along.use(motion)
    np.testing.assert_allclose(use.force * 30.0, force, atol=1e-9)
    np.testing.assert_allclose(use.speed * 0.5, speed, atol=1e-12)


def test_the_slope_of_friction_is_its_derivative() -> None:
    along = dynamics(ROUGH, 1)
    u = np.linspace(0, along.curve.length, 30)
    for square in (1e-4, 1e-2, 1.0):
        b, step = np.full(30, square), 1e-4 * square
        slope = along.friction(u, b)[1]
        change = (along.friction(u, b + step)[0] - along.friction(u, b - step)[0]) / (2 * step)
        np.testing.assert_allclose(slope, change, rtol=1e-5, atol=1e-7 * np.abs(change).max())


def test_there_is_no_friction_at_rest_or_without_any() -> None:
    u = np.linspace(0, dynamics(ROUGH, 2).curve.length, 10)
    for parameters, square in ((ROUGH, 0.0), (MICRO, 0.5)):
        for part in dynamics(parameters, 2).friction(u, np.full(10, square)):
            np.testing.assert_allclose(part, 0, atol=1e-11)


def test_sides_and_the_most_used() -> None:
    along = dynamics(ROUGH, 3)
    u = np.linspace(0, along.curve.length, 10)
    use = along.use(along.sample(u, np.full(10, 0.1), np.full(10, -1.0)))
    np.testing.assert_array_equal(use.sides[:, :3], use.force)
    np.testing.assert_array_equal(use.sides[:, 3:6], -use.force)
    np.testing.assert_array_equal(use.sides[:, 6:], np.abs(use.speed))
    expected = np.maximum(np.abs(use.force).max(axis=-1), np.abs(use.speed).max(axis=-1))
    np.testing.assert_array_equal(use.most, expected)
