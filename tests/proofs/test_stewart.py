"""urdf/stewart.yaml against closed forms, Newton-Euler leg by leg, and MuJoCo on the same URDF."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from tests.proofs import common
from tests.reference import stewart
from tests.reference.mujoco_loops import MujocoLoops

Array = NDArray[np.float64]

DRIVES = [f"leg_{i}_rod_joint" for i in range(1, 7)]


@pytest.fixture(scope="module", params=common.ENGINES)
def mechanism(request: pytest.FixtureRequest) -> Any:
    return common.loaded_in(request.param, "stewart")


def turned(curve: Array) -> Array:
    """Rotation about x by the first angle, then about y by the second, then about z."""
    turn = np.eye(3)
    for axis, angle in enumerate(curve):
        c, s = np.cos(angle), np.sin(angle)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[i, i], one[i, j], one[j, i], one[j, j] = c, -s, s, c
        turn = one @ turn
    return turn


def motions(count: int = 12) -> list[stewart.Motion]:
    """Along a smooth motion of all six coordinates; spins of a rotation about fixed x, y, z."""
    found = []
    centre, reach = [0.01, -0.02, 0.62, 0.05, -0.03, 0.02], [0.07, 0.06, 0.08, 0.2, 0.25, 0.3]
    for curve in common.swing(centre, reach, [6.0, 5.0, 7.0, 4.0, 6.5, 5.5], count):
        angles, rates, pulls = (x[3:] for x in (curve.value, curve.first, curve.second))
        # omega = sum of a_k r_k, each axis turned by the rotations that come after its own.
        y_turn, z_turn = turned(np.array([0, angles[1], 0])), turned(np.array([0, 0, angles[2]]))
        axes = np.array([z_turn @ y_turn @ [1, 0, 0], z_turn @ [0, 1, 0], [0, 0, 1]])
        spin = rates @ axes
        carried = [rates[1] * axes[1] + rates[2] * axes[2], rates[2] * axes[2], np.zeros(3)]
        moving = [r * np.cross(c, u) for r, c, u in zip(rates, carried, axes, strict=True)]
        turn = pulls @ axes + np.sum(moving, axis=0)
        where, how, pull = (x[:3] for x in (curve.value, curve.first, curve.second))
        found.append(stewart.Motion.of(where, turned(angles), how, spin, pull, turn))
    return found


def state(mechanism: ClosedLoopModel, motion: stewart.Motion) -> common.State:
    free = ("platform_joint", motion.position, motion.rotation)
    return common.state(mechanism, stewart.joints(motion), free)


def test_closes_from_rough_guesses(mechanism: ClosedLoopModel) -> None:
    for guess in common.guesses(mechanism, 0.15, 10):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert common.distances(mechanism, q).max() <= 1e-12


def test_leg_lengths_are_those_of_the_closed_form(mechanism: ClosedLoopModel) -> None:
    """With the platform held where the closed form has it, every leg finds its three values."""
    for motion in motions():
        expected, _, _ = state(mechanism, motion)
        place = expected[
            mechanism.model.joints[mechanism.model.getJointId("platform_joint")].idx_q :
        ]
        q = mechanism.complete({"platform_joint": place[:7]})
        np.testing.assert_allclose(q, expected, rtol=0, atol=1e-11)


def test_direct_kinematics_brings_the_pose_back(mechanism: ClosedLoopModel) -> None:
    for motion in motions():
        expected, _, _ = state(mechanism, motion)
        lengths = {name: one.length.value for name, one in zip(DRIVES, motion.legs(), strict=True)}
        rng = np.random.default_rng(0)
        q = mechanism.complete(lengths, expected + 0.02 * rng.normal(size=expected.size))
        np.testing.assert_allclose(q, expected, rtol=0, atol=1e-10)


def test_dynamics_along_a_motion(mechanism: ClosedLoopModel) -> None:
    """Forces of the drives, and of each leg on the platform at its ball."""
    for motion in motions():
        q, v, a = state(mechanism, motion)
        common.check_motion(mechanism, q, v, a)
        expected, on_platform = stewart.newton_euler(motion)
        forces = common.check_forces(mechanism, q, v, a, expected)
        wrenches = mechanism.closure_wrenches(q, forces)
        found = [wrenches[f"ball_{i}"][:3] for i in range(1, 7)]
        size = np.abs(on_platform).max()
        np.testing.assert_allclose(found, on_platform, rtol=0, atol=1e-9 * size)


def test_gravity_from_any_side() -> None:
    """The same file in another gravity: on a wall, or hung from a ceiling."""
    rng = np.random.default_rng(2)
    motion = motions(3)[1]
    mechanism = common.loaded("stewart")
    for _ in range(3):
        gravity = rng.normal(scale=9.81, size=3)
        turned_model = mechanism.model.copy()
        turned_model.gravity.linear = gravity
        other = ClosedLoopModel(turned_model, mechanism.closures, mechanism.actuated)
        q, v, a = state(other, motion)
        common.check_forces(other, q, v, a, stewart.newton_euler(motion, gravity)[0])


def test_mujoco_has_the_same_reduced_mass_matrix_and_bias(mechanism: ClosedLoopModel) -> None:
    """T' M T and T' (M a + bias) of the same URDF, the loops' Jacobian MuJoCo's too."""
    pairs = [(("platform", stewart.BALLS[i]), (f"leg_{i + 1}_rod", np.zeros(3))) for i in range(6)]
    twin = MujocoLoops("stewart", pairs)
    for motion in motions():
        q, v, a = state(mechanism, motion)
        twin.put(stewart.joints(motion))
        twin.put_free("platform_joint", motion.position, motion.rotation)
        tau, _, _ = twin.inverse_dynamics(DRIVES)
        mass = twin.reduced_mass(DRIVES)
        found = mechanism.mass_matrix(q)
        np.testing.assert_allclose(found, mass, rtol=0, atol=1e-10 * np.abs(mass).max())
        bias = tau - mass @ a[mechanism.actuated_indices]
        found = mechanism.bias(q, v)
        np.testing.assert_allclose(found, bias, rtol=0, atol=1e-9 * np.abs(tau).max())


def test_describes_a_mobility_of_six() -> None:
    common.check_description(common.loaded("stewart"), rows=18, rank=18, mobility=6)
