"""State and forces of one tick against the library's, and against the KKT equations themselves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.control.estimator.leg_geometry import (
    LegGeometry,
    closure_determinant,
    leg_geometry,
)
from rps_pin.control.estimator.robot_state import leg_motion, robot_state
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


Three = tuple[float, float, float]


def in_floats(robot: RPSRobot, motion: strategies.Motion) -> tuple[LegGeometry, Three, Three]:
    p = robot.parameters
    x, dx, ddx = (tuple(one.tolist()) for one in motion)
    geometry = leg_geometry(x, p.base_radius, p.platform_radius)
    assert geometry is not None
    return geometry, dx, ddx


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
        geometry, *derivatives = in_floats(robot, motion)
        state = robot_state(geometry, *derivatives, p.platform_radius)
        expected = robot.state(*motion)
        for found, array in zip(np.split(state, [13, 25]), expected, strict=True):
            np.testing.assert_allclose(found, array, rtol=0, atol=1e-12 * np.abs(array).max())
        legs = leg_motion(geometry, *derivatives, p.platform_radius)
        assert legs == (state[14:19:2], state[26:31:2])
        length, angle = expected[0][[1, 3, 5]], expected[0][[0, 2, 4]]
        determinant = eq.determinant(length, angle, p.base_radius, p.platform_radius)
        closure = closure_determinant(geometry, p.base_radius, p.platform_radius)
        assert closure == pytest.approx(float(determinant), abs=1e-12)
        if abs(closure) < 0.05:
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
        solved = solver.solve(robot_state(*in_floats(robot, motion), p.platform_radius))
        assert solved is not None
        q, v, a = robot.state(*motion)
        force = pin.rnea(robot.mechanism.model, data, q, v, a)
        other = robot.state(motion[0], rng.normal(size=3), np.zeros(3))[1]
        power = force @ other
        size = np.abs(force * other).sum() + np.abs(solved[9:]).max()
        assert np.dot(solved[9:], other[[1, 3, 5]]) == pytest.approx(power, abs=1e-9 * size)


def test_leg_without_length_has_no_state() -> None:
    """Radii alike, height 0: every tip stands on its revolute joint."""
    assert leg_geometry((0.0, 0.0, 0.0), 0.3, 0.3) is None
