"""Joint reactions against Pinocchio's recursion on the open tree, and against Newton and Euler."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, RPSRobot
from rps_pin.rps.dynamics.joint_reactions import joint_reactions
from rps_pin.rps.dynamics.loads import Payload
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import relative_error

Array = NDArray[np.float64]

FRICTION = {
    "prismatic_damping": 30.0,
    "prismatic_friction": 5.0,
    "revolute_damping": 0.4,
    "revolute_friction": 0.3,
    "friction_speed": 0.1,
}


def loaded_robot(rng: np.random.Generator) -> RPSRobot:
    parameters = strategies.random_parameters(rng, tilted_gravity=True).replace(**FRICTION)
    inertia = strategies.rigid_body_inertia(rng, 2.0, 0.1)
    return RPSRobot(parameters).with_payload(Payload(2.0, rng.normal(scale=0.2, size=3), inertia))


@pytest.mark.parametrize("seed", range(5))
def test_wrenches_are_those_of_the_constraint_model(seed: int) -> None:
    """Newton and Euler outwards and back over Pinocchio's tree, loaded by the loops' forces."""
    rng = np.random.default_rng([3, seed])
    robot = loaded_robot(rng)
    motion = strategies.random_motions(rng, robot.parameters, 30)
    wrench = rng.normal(scale=20.0, size=(30, 6))
    found = joint_reactions(robot, *motion, wrench=wrench)
    for i, (q, v, a) in enumerate(zip(*robot.state(*motion), strict=True)):
        solved = robot.inverse_dynamics(q, v, a, wrench=wrench[i])
        scale = np.abs(solved.constraint_forces).max()
        forces = solved.constraint_forces.reshape(3, 3)
        np.testing.assert_allclose(found.spherical[i], forces, rtol=0, atol=1e-10 * scale)
        carried = robot.mechanism.joint_wrenches(
            q, v, a, solved.constraint_forces, wrenches={"platform": wrench[i]}
        )
        for leg in range(3):
            for kind in ("prismatic", "revolute"):
                expected = carried[f"leg_{leg + 1}_{kind}"]
                np.testing.assert_allclose(
                    getattr(found, kind)[i, leg], expected, rtol=0, atol=1e-9 * scale
                )


def test_spherical_reactions_are_newton_and_euler_s() -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        parameters = strategies.random_parameters(rng, tilted_gravity=True)
        motion = strategies.random_motions(rng, parameters, 200)
        found = joint_reactions(RPSRobot(parameters), *motion)
        expected = ne.inverse_dynamics(parameters, *motion).reactions
        assert relative_error(found.spherical, expected, axes=2) < 1e-9
        turned = np.einsum("...ij,...j->...i", found.leg_axes, found.spherical_in_leg)
        assert relative_error(turned, found.spherical, axes=2) < 1e-14


def test_side_load_on_vertical_legs_bends_them_by_force_times_length() -> None:
    """h = g, level: a horizontal force along x is borne by legs 2 and 3 alone, across their planes.

    Leg 1's plane holds x: its revolute joint yields. Legs 2 and 3 have a_i . x = -sqrt(3)/2 and
    +sqrt(3)/2; each bears 2/3 of the force times that, and bends by it times its length.
    """
    parameters = RPSParameters.from_preset("sokolov").replace(
        platform_radius=0.46, leg_mass=0.0, leg_inertia=0.0, gravity=[0.0, 0.0, 0.0]
    )
    still = np.zeros(3)
    found = joint_reactions(
        RPSRobot(parameters), [0.4, 0, 0], still, still, wrench=[90.0, 0, 0, 0, 0, 0]
    )
    np.testing.assert_allclose(found.spherical.sum(axis=0), [-90.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.spherical[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        found.spherical_in_leg[:, 1], 30 * np.sqrt(3) * np.array([0, -1, 1]), atol=1e-12
    )
    moment = found.bending_moment()
    np.testing.assert_allclose(np.abs(moment[:, 1]), 0.4 * 30 * np.sqrt(3) * np.array([0, 1, 1]))
    np.testing.assert_allclose(moment[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.bending_moment(0.2), moment / 2, atol=1e-12)
    np.testing.assert_allclose(found.revolute[:, 4:], moment, atol=1e-12)


def test_a_free_revolute_joint_bears_no_moment_about_its_axis() -> None:
    rng = np.random.default_rng(6)
    parameters = strategies.random_parameters(rng)
    motion = strategies.random_motions(rng, parameters, 100)
    found = joint_reactions(RPSRobot(parameters), *motion)
    scale = np.abs(found.revolute[..., 3:]).max()
    assert np.abs(found.revolute[..., 4]).max() < 1e-12 * scale


@pytest.mark.parametrize("reach", [-0.1, np.nan, [0.1, np.inf, 0.1]])
def test_sections_that_do_not_exist_are_refused(reach: object) -> None:
    robot, still = RPSRobot.from_preset("sokolov"), np.zeros(3)
    found = joint_reactions(robot, [0.4, 0, 0], still, still)
    with pytest.raises(InputError, match="reach"):
        found.bending_moment(reach)
