"""State and forces of one tick against the library's, and against the KKT equations themselves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.control.estimator.place import place_of, turning_determinant
from rps_pin.control.estimator.scalar_state import RobotState, state_at
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.kinematics import leg_equations as eq
from tests import strategies

FRICTION = {
    "prismatic_damping": 30.0,
    "prismatic_friction": 4.0,
    "revolute_damping": 2.0,
    "revolute_friction": 0.7,
    "friction_speed": 0.3,
}


def scalar_state(robot: RPSRobot, motion: strategies.Motion) -> RobotState:
    p = robot.parameters
    x, dx, ddx = (tuple(one.tolist()) for one in motion)
    place = place_of(x, p.base_radius, p.platform_radius)
    assert place is not None
    return state_at(place, dx, ddx, p.platform_radius)


def flat(state: RobotState) -> tuple[strategies.Array, ...]:
    angle, length = state.place.angle, state.place.length
    at = [value for pair in zip(angle, length, strict=True) for value in pair]
    return (
        np.array(at + list(state.placement)),
        np.array([value for leg in state.legs for value in leg[:2]] + list(state.velocity)),
        np.array([value for leg in state.legs for value in leg[2:]] + list(state.acceleration)),
    )


def robots() -> list[RPSRobot]:
    rng = np.random.default_rng(1)
    found = [RPSRobot(RPSParameters.from_preset("sokolov"))]
    found.append(RPSRobot(RPSParameters.from_preset("micro").replace(**FRICTION)))
    for k in range(6):
        p = strategies.random_parameters(rng, tilted_gravity=True, heavy_rods=bool(k % 2))
        p = p.replace(**FRICTION) if k % 3 == 0 else p
        load = Payload(2.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04])) if k % 2 else None
        found.append(RPSRobot(p, load))
    return found


@pytest.mark.parametrize("robot", robots(), ids=lambda robot: robot.parameters.name)
def test_state_and_forces_are_the_robot_s(robot: RPSRobot) -> None:
    rng = np.random.default_rng(2)
    p = robot.parameters
    p = p.replace(
        leg_length_limits=(0.0, 1e3), leg_angle_limits=(-np.pi, np.pi), spherical_cone_limit=np.pi
    )
    robot = RPSRobot(p, robot.payload)
    solver = ConstrainedForces(robot)
    checked = 0
    for motion in zip(*strategies.random_motions(rng, p, 250), strict=True):
        state = scalar_state(robot, motion)
        expected = robot.state(*motion)
        for found, array in zip(flat(state), expected, strict=True):
            np.testing.assert_allclose(found, array, rtol=0, atol=1e-12 * np.abs(array).max())
        length, angle = expected[0][[1, 3, 5]], expected[0][[0, 2, 4]]
        determinant = eq.determinant(length, angle, p.base_radius, p.platform_radius)
        turning = turning_determinant(state.place, p.base_radius, p.platform_radius)
        assert turning == pytest.approx(float(determinant), abs=1e-12)
        if abs(turning) < 0.05:
            continue
        solved = solver.solve(state)
        answer = robot.inverse_dynamics(*expected)
        assert solved is not None
        assert strategies.relative_error(np.array(solved[9:]), answer.tau) < 1e-10
        assert strategies.relative_error(np.array(solved[:9]), answer.constraint_forces) < 1e-10
        checked += 1
    assert checked > 100


def test_virtual_power_of_the_forces_is_that_of_the_tree() -> None:
    """In any motion that keeps the loops closed, reactions do no work: tau . d' = rnea . v."""
    rng = np.random.default_rng(3)
    p = strategies.random_parameters(rng)
    robot = RPSRobot(p)
    solver = ConstrainedForces(robot)
    data = robot.mechanism.model.createData()
    pose, rate, acceleration = strategies.random_motions(rng, p, 100)
    for motion in zip(pose, rate, acceleration, strict=True):
        solved = solver.solve(scalar_state(robot, motion))
        assert solved is not None
        q, v, a = robot.state(*motion)
        force = pin.rnea(robot.mechanism.model, data, q, v, a)
        other = robot.state(motion[0], rng.normal(size=3), np.zeros(3))[1]
        power = force @ other
        size = np.abs(force * other).sum() + np.abs(solved[9:]).max()
        assert np.dot(solved[9:], other[[1, 3, 5]]) == pytest.approx(power, abs=1e-9 * size)


def test_leg_without_length_has_no_state() -> None:
    """Radii alike, height 0: every tip stands on its revolute joint."""
    assert place_of((0.0, 0.0, 0.0), 0.3, 0.3) is None
