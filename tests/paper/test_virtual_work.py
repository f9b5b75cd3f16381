"""Virtual work: against Lagrange's equations of the second kind in the pose, and by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, SingularityError, UnreachableError
from rps_pin.paper.virtual_work import PoseForces, pose_forces, virtual_work_forces
from tests.reference import newton_euler as ne
from tests.reference.lagrange_by_steps import inertia_forces, slopes
from tests.strategies import random_motions, random_parameters, relative_error

Array = NDArray[Any]

LEVEL = [0.4, 0.0, 0.0]
STILL = [0.0, 0.0, 0.0]


def sokolov() -> RPSParameters:
    return RPSParameters.from_preset("sokolov")


def only(parameters: RPSParameters, body: str) -> ne.ReferenceRobot:
    """The robot with the mass of one body, or one from each leg."""
    p = parameters
    masses: dict[str, Any] = {
        "platform": {"platform_mass": p.platform_mass, "platform_inertia": p.platform_inertia},
        "cylinders": {
            "leg_mass": p.leg_mass,
            "leg_com": p.leg_com,
            "leg_inertia_about_com": p.leg_inertia_about_com,
        },
        "rods": {"rod_mass": p.rod_mass, "rod_com": p.rod_com, "rod_inertia": p.rod_inertia},
    }
    nothing = {"platform_mass": 0.0, "platform_inertia": np.zeros((3, 3))}
    return ne.ReferenceRobot(
        base_radius=p.base_radius,
        platform_radius=p.platform_radius,
        gravity=p.gravity,
        **(nothing | masses[body]),
    )


def second_kind(robot: ne.ReferenceRobot, pose: Array, rate: Array, acceleration: Array) -> Array:
    """d/dt dL/dp' - dL/dp in the pose p itself, from the reference's energy: no constraints."""

    def kinetic(p: Array, dp: Array) -> Array:
        return ne.energy(robot, p, dp) - ne.energy(robot, p, 0 * dp)

    def potential(p: Array) -> Array:
        return ne.energy(robot, p, np.zeros(3))

    return inertia_forces(kinetic, pose, rate, acceleration) + slopes(potential, pose)


@pytest.mark.parametrize("body", PoseForces._fields)
def test_each_body_s_share_is_that_of_its_energy(body: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        parameters = random_parameters(rng, tilted_gravity=True)
        motion = random_motions(rng, parameters, 100, largest_tilt=2.5)
        found = getattr(pose_forces(parameters, *motion), body)
        expected = second_kind(only(parameters, body), *motion)
        assert relative_error(found, expected) < 1e-11


def test_actuators_do_the_work_that_the_bodies_take_up() -> None:
    """F . d' = Q . p' = dE/dt."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        parameters = random_parameters(rng, tilted_gravity=True)
        motion = random_motions(rng, parameters, 100)
        work = virtual_work_forces(parameters, *motion)
        work = work * ne.kinematics(parameters, *motion).leg_length_rates
        taken = (pose_forces(parameters, *motion).total * motion[1]).sum(axis=-1)
        gain = ne.power(parameters, *motion)
        size = np.abs(work).sum(axis=-1)
        assert (np.abs(work.sum(axis=-1) - gain) < 1e-10 * size).all()
        np.testing.assert_allclose(taken, gain, rtol=1e-8, atol=1e-10 * np.abs(gain).max())


def test_level_robot_at_rest_carries_its_weight() -> None:
    """By hand: sin(phi) is d(length)/dz, and cos(phi)/d is d(angle)/dz."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        p = random_parameters(rng)
        z = rng.uniform(0.3, 1.5)
        inwards = p.base_radius - p.platform_radius
        d = np.hypot(z, inwards)
        sine, cosine = z / d, inwards / d
        turned = (p.leg_mass * p.leg_com + p.rod_mass * (d - p.rod_com)) * cosine**2 / d
        expected = 9.81 * (p.platform_mass / 3 + turned + p.rod_mass * sine**2) / sine
        found = virtual_work_forces(p, [z, 0, 0], STILL, STILL)
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_level_robot_climbs_as_one_body_and_three_legs() -> None:
    """By hand, from z = 4, g - h = 3 (so d = 5), z' = 1 and z'' = 0.

    d^2 = z^2 + 9 gives d' = 4/5 and d d'' = 1 - d'^2; phi = atan(z/3) gives phi' = 3/d^2 and
    phi'' = -6 z/d^4.
    """
    p = sokolov().replace(
        base_radius=3.5, platform_radius=0.5, rod_mass=2.0, rod_com=1.0, rod_inertia=0.3,
        gravity=[0.0, 0.0, 0.0],
    )  # fmt: skip
    dd, dphi = 0.8, 3 / 25
    ddd, ddphi = (1 - 0.64) / 5, -24 / 5**4
    along = 2.0 * (ddd - 4.0 * dphi**2)
    across = 2.0 * (4.0 * ddphi + 2 * dd * dphi)
    moment = 0.05 * ddphi + 4.0 * across + 0.3 * ddphi
    expected = along + moment * dphi / dd  # virtual motion: the motion itself
    found = virtual_work_forces(p, [4.0, 0, 0], [1.0, 0, 0], STILL)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_free_fall_of_a_robot_without_turning_bodies_needs_no_force() -> None:
    """Vertical legs (h = g), level: everything falls with gravity, no part turns."""
    p = sokolov().replace(
        platform_radius=sokolov().base_radius, leg_mass=0.0, leg_com=0.0, leg_inertia=0.0,
        rod_mass=1.5, rod_com=0.1, rod_inertia=0.2,
    )  # fmt: skip
    found = virtual_work_forces(p, [0.5, 0, 0], [-2.0, 0, 0], [-9.81, 0, 0])
    np.testing.assert_allclose(found, 0, rtol=0, atol=1e-14)


def test_batches_are_their_single_states() -> None:
    rng = np.random.default_rng(4)
    parameters = random_parameters(rng)
    motion = tuple(x.reshape(2, 3, 3) for x in random_motions(rng, parameters, 6))
    batch = virtual_work_forces(parameters, *motion)
    for index in np.ndindex(2, 3):
        one = virtual_work_forces(parameters, *(x[index] for x in motion))
        np.testing.assert_allclose(batch[index], one, rtol=1e-11)
    pose, rate, acceleration = motion
    spread = virtual_work_forces(parameters, pose, rate[0, 0], acceleration[0, 0])
    one = virtual_work_forces(parameters, pose[1, 2], rate[0, 0], acceleration[0, 0])
    np.testing.assert_allclose(spread[1, 2], one, rtol=1e-11)
    assert virtual_work_forces(parameters, *(np.zeros((0, 3)),) * 3).shape == (0, 3)


def test_singular_poses_are_refused_and_their_pose_forces_are_not() -> None:
    with pytest.raises(SingularityError, match="cannot hold the platform here: ") as caught:
        virtual_work_forces(sokolov(), STILL, STILL, STILL)
    assert caught.value.condition > caught.value.limit == 1e8
    with pytest.raises(SingularityError, match=r"entry \(1,\) of 2"):
        virtual_work_forces(sokolov(), [LEVEL, STILL], STILL, STILL)
    with pytest.raises(SingularityError, match=r"at most 0\.1 times"):
        virtual_work_forces(sokolov(), LEVEL, STILL, STILL, max_gain=0.1)
    weight = pose_forces(sokolov(), STILL, STILL, STILL).platform
    np.testing.assert_allclose(weight, [9.81 * 0.18, 0, 0], rtol=1e-13)


def test_bad_input_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="acceleration has shape"):
        virtual_work_forces(sokolov(), LEVEL, STILL, [0.0, 0.0])
    with pytest.raises(InputError, match="pose is not finite"):
        pose_forces(sokolov(), [np.inf, 0, 0], STILL, STILL)
    with pytest.raises(InputError, match="do not go together"):
        virtual_work_forces(sokolov(), np.full((2, 3), 0.1), np.zeros((4, 3)), STILL)
    with pytest.raises(InputError, match="max_gain = nan: it must be positive"):
        virtual_work_forces(sokolov(), LEVEL, STILL, STILL, max_gain=np.nan)
    upright = sokolov().replace(platform_radius=sokolov().base_radius)
    with pytest.raises(UnreachableError, match="leg 1 would have length 0 m"):
        virtual_work_forces(upright, STILL, STILL, STILL)
