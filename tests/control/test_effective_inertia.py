"""The inertia by pose: kinetic energy, and the library's own reduced mass matrix."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError
from rps_pin.control import effective_inertia
from rps_pin.control.estimator.effective_inertia import TaskSpaceInertia
from rps_pin.control.estimator.leg_geometry import leg_geometry
from rps_pin.rps.dynamics.loads import Payload
from tests import strategies


def test_energy_of_any_motion_is_that_of_the_tree() -> None:
    rng = np.random.default_rng(0)
    for k in range(8):
        p = strategies.random_parameters(rng, heavy_rods=bool(k % 2))
        load = Payload(2.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04])) if k % 2 else None
        robot = RPSRobot(p, load)
        reduced, data = TaskSpaceInertia(robot), robot.mechanism.model.createData()
        for pose, rate, none in zip(*strategies.random_motions(rng, p, 40), strict=True):
            q, v, _ = robot.state(pose, rate, 0 * none)
            energy = pin.computeKineticEnergy(robot.mechanism.model, data, q, v)
            z, tilt_x, tilt_y = pose.tolist()
            geometry = leg_geometry((z, tilt_x, tilt_y), p.base_radius, p.platform_radius)
            assert geometry is not None
            mass = reduced.of(geometry)
            np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-12 * np.abs(mass).max())
            assert rate @ mass @ rate / 2 == pytest.approx(energy, rel=1e-11)


def test_effective_inertia_is_the_force_for_a_unit_acceleration() -> None:
    """At rest, weight apart: of the legs by inverse dynamics, one leg at a time."""
    robot = RPSRobot(RPSParameters.from_preset("micro").replace(gravity=(0.0, 0.0, 0.0)))
    pose, still = np.array([0.22, 0.1, -0.05]), np.zeros(3)
    found = effective_inertia(robot, pose)
    for leg in range(3):
        v = robot.mechanism.velocity(robot.state(pose, still, still)[0], np.eye(3)[leg])
        q = robot.state(pose, still, still)[0]
        force = robot.inverse_dynamics(q, np.zeros_like(v), v).tau  # at rest a is like v
        assert found[leg] == pytest.approx(force[leg], rel=1e-10)
    in_task = effective_inertia(robot, pose, space="task")
    for axis in range(3):
        state = robot.state(pose, still, np.eye(3)[axis])
        force = robot.inverse_dynamics(*state).tau
        speed = robot.state(pose, np.eye(3)[axis], still)[1][[1, 3, 5]]
        assert in_task[axis] == pytest.approx(force @ speed, rel=1e-10)  # K'f


def test_bad_input_is_refused() -> None:
    robot = RPSRobot.from_preset("micro")
    with pytest.raises(InputError, match="space = 'joint'"):
        effective_inertia(robot, [0.22, 0, 0], space="joint")
    with pytest.raises(InputError, match="shape"):
        effective_inertia(robot, [[0.22, 0, 0]])
    with pytest.raises(SingularityError):  # legs level with the platform
        effective_inertia(RPSRobot.from_preset("sokolov"), [0.0, 0, 0])
