"""Singularities: measures against independent derivations, determinants against each other."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import brentq

from rps_pin import InputError, RPSParameters, RPSRobot, UnreachableError
from rps_pin.rps.kinematics.leg_equations import jacobian
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.singularity.measure_rates import measure_rates
from rps_pin.rps.singularity.measures import passive_conditioning, singularity_measures
from tests.strategies import LEG_ANGLES, random_motions, random_parameters

Array = NDArray[np.float64]

SEEDS = range(5)
SOKOLOV = RPSParameters.from_preset("sokolov")
ZERO = np.zeros(3)


def random_poses(seed: int, count: int, largest_tilt: float) -> tuple[RPSParameters, Array]:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng)
    return parameters, random_motions(rng, parameters, count, largest_tilt)[0]


def tilt_of(pose: Array) -> Array:
    return np.hypot(pose[..., 1], pose[..., 2])


class Loops:
    """The loops' Jacobian from Pinocchio's frames, without the project's constraint models."""

    def __init__(self, parameters: RPSParameters) -> None:
        self.robot = RPSRobot(parameters)
        self.model = self.robot.mechanism.model
        self.data = self.model.createData()

    def jacobian(self, pose: Array) -> Array:
        """Shape (9, 12): m, with columns of angles in rad."""
        q = self.robot.state(pose, ZERO, ZERO)[0]
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        return np.concatenate(
            [self._frame(f"platform_ball_{i}") - self._frame(f"leg_{i}_ball") for i in (1, 2, 3)]
        )

    def passive(self, pose: Array) -> Array:
        return np.delete(self.jacobian(pose), self.robot.mechanism.actuated_indices, axis=1)

    def _frame(self, name: str) -> Array:
        frame = self.model.getFrameId(name)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return pin.getFrameJacobian(self.model, self.data, frame, axes)[:3]


# What the measures are ----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_type_ii_is_the_least_leg_speed_per_speed_of_the_tips(seed: int) -> None:
    """As a generalised eigenvalue, both quadratic forms from Pinocchio's admissible velocities."""
    parameters, poses = random_poses(seed, 20, 3.0)
    loops = Loops(parameters)
    balls = [loops.model.getFrameId(f"platform_ball_{i}") for i in (1, 2, 3)]
    actuated = loops.robot.mechanism.actuated_indices
    found = singularity_measures(parameters, poses)
    for pose, type_ii, determinant in zip(poses, found.type_ii, found.determinant, strict=True):
        motions = scipy.linalg.null_space(loops.jacobian(pose))
        assert motions.shape == (12, 3)
        tips = [pin.getFrameJacobian(loops.model, loops.data, b, pin.LOCAL)[:3] for b in balls]
        speeds = sum(J.T @ J for J in tips)
        legs = motions[actuated].T @ motions[actuated]
        gains = scipy.linalg.eigvalsh(legs, motions.T @ speeds @ motions)
        assert type_ii**2 == pytest.approx(gains[0], rel=1e-9, abs=1e-14)
        assert determinant**2 == pytest.approx(gains.prod(), rel=1e-9, abs=1e-14)
        assert 0 <= type_ii <= abs(determinant) ** (1 / 3) <= 1


@pytest.mark.parametrize("seed", SEEDS)
def test_sign_is_that_of_the_jacobian_s_determinant(seed: int) -> None:
    parameters, poses = random_poses(seed, 500, 3.1)
    found = singularity_measures(parameters, poses)
    sign = np.sign(np.linalg.det(leg_jacobians(parameters, poses).length_jacobian))
    assert len(set(sign)) == 2
    np.testing.assert_array_equal(np.sign(found.determinant), sign)
    np.testing.assert_array_equal(np.sign(found.signed_type_ii), sign)


@pytest.mark.parametrize("seed", SEEDS)
def test_constraint_is_the_couple_across_the_legs(seed: int) -> None:
    """sum_i B_i x t_i has the size 3 h cos(beta/2), and sum_i t_i = 0."""
    parameters, poses = random_poses(seed, 50, np.pi)
    position, turn = RPSRobot(parameters).platform_placement(poses)
    couple = np.zeros_like(position)
    for angle in LEG_ANGLES:
        arm = turn @ (parameters.platform_radius * np.array([np.cos(angle), np.sin(angle), 0]))
        couple += np.cross(position + arm, [-np.sin(angle), np.cos(angle), 0])
    expected = np.linalg.norm(couple, axis=1) / (3 * parameters.platform_radius)
    found = singularity_measures(parameters, poses).constraint
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_loops_lose_rank_at_half_a_turn_and_nowhere_before(seed: int) -> None:
    parameters, poses = random_poses(seed, 10, 3.0)
    loops = Loops(parameters)
    assert all(scipy.linalg.svdvals(loops.jacobian(pose))[-1] > 1e-4 for pose in poses)
    poses[:, 1:] *= np.pi / tilt_of(poses)[:, None]
    measures = singularity_measures(parameters, poses)
    np.testing.assert_allclose(measures.constraint, 0, atol=1e-15)
    for pose, type_ii in zip(poses, measures.type_ii, strict=True):
        J = loops.jacobian(pose)
        assert scipy.linalg.svdvals(J)[-1] < 1e-14
        assert scipy.linalg.null_space(J, rcond=1e-12).shape == (12, 4)  # a fourth freedom
        assert type_ii > 0


def test_type_i_is_the_shortest_leg() -> None:
    parameters, poses = random_poses(0, 50, 2.0)
    length = RPSRobot(parameters).inverse_kinematics(poses).length
    found = singularity_measures(parameters, poses).type_i
    np.testing.assert_allclose(found, length.min(axis=1) / parameters.platform_radius, rtol=1e-14)


def test_leg_without_length_is_refused_or_masked() -> None:
    parameters = SOKOLOV.replace(platform_radius=SOKOLOV.base_radius)
    with pytest.raises(UnreachableError, match="leg 1 would have length 0 m"):
        singularity_measures(parameters, ZERO)
    found = singularity_measures(parameters, [ZERO, [0.4, 0, 0]], errors="mask")
    assert found.type_i[0] == found.type_ii[0] == found.determinant[0] == 0
    assert found.type_i[1] > 0 and found.type_ii[1] > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_passive_conditioning_is_the_mechanism_s_inverse_condition(seed: int) -> None:
    parameters, poses = random_poses(seed, 30, 3.0)
    robot = RPSRobot(parameters)
    q = robot.state(poses, ZERO, ZERO)[0]
    expected = np.array([1 / robot.mechanism.condition(one) for one in q])
    np.testing.assert_allclose(
        passive_conditioning(parameters, poses), expected, rtol=1e-9, atol=1e-15
    )


# Symmetry -----------------------------------------------------------------------------------------


def test_measures_are_those_of_the_robot_turned_mirrored_and_enlarged() -> None:
    parameters, poses = random_poses(1, 50, 3.0)
    z, wx, wy = poses.T
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = np.stack([z, c * wx - s * wy, s * wx + c * wy], axis=1)
    mirrored = np.stack([z, -wx, wy], axis=1)  # in the plane of leg 1
    below = np.stack([-z, -wx, -wy], axis=1)  # in the base plane
    large = parameters.replace(
        base_radius=3 * parameters.base_radius, platform_radius=3 * parameters.platform_radius
    )
    expected = singularity_measures(parameters, poses)
    for found, sign in (
        (singularity_measures(parameters, turned), 1),
        (singularity_measures(parameters, mirrored), 1),
        (singularity_measures(parameters, below), -1),
        (singularity_measures(large, poses * [3, 1, 1]), 1),
    ):
        np.testing.assert_allclose(found.type_i, expected.type_i, rtol=1e-12)
        np.testing.assert_allclose(found.type_ii, expected.type_ii, rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.constraint, expected.constraint, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found.determinant, sign * expected.determinant, atol=1e-13)


# The determinants and each other ------------------------------------------------------------------


def eq8(parameters: RPSParameters, d: Array, phi: Array) -> Array:
    g, h, c, s = parameters.base_radius, parameters.platform_radius, np.cos(phi), np.sin(phi)
    return np.array(
        [
            d[i] ** 2 + d[j] ** 2 + 3 * g**2 - 3 * h**2
            + d[i] * d[j] * c[i] * c[j] - 2 * d[i] * d[j] * s[i] * s[j]
            - 3 * g * d[i] * c[i] - 3 * g * d[j] * c[j]
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
    )  # fmt: skip


def eq8_jacobian(parameters: RPSParameters, d: Array, phi: Array) -> Array:
    """df/dphi, from the derivative of the tips' distances."""
    g, h = parameters.base_radius, parameters.platform_radius
    return 2 * np.sqrt(3) * h * jacobian(d, phi, g, h)


def test_eq8_jacobian_is_its_derivative() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        d, phi = rng.uniform(0.1, 1, 3), rng.uniform(-3, 3, 3)
        found, step = eq8_jacobian(SOKOLOV, d, phi), 1e-5
        for k, axis in enumerate(step * np.eye(3)):
            ahead, behind = eq8(SOKOLOV, d, phi + axis), eq8(SOKOLOV, d, phi - axis)
            np.testing.assert_allclose(found[:, k], (ahead - behind) / (2 * step), atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_determinants_are_related_as_stated(seed: int) -> None:
    parameters, poses = random_poses(seed, 30, 4.0)
    loops, h = Loops(parameters), parameters.platform_radius
    legs, beta = leg_jacobians(parameters, poses), tilt_of(poses)
    direct = np.array([np.linalg.det(loops.passive(pose)) for pose in poses])
    K = np.linalg.det(legs.length_jacobian)
    expected = legs.length.prod(axis=1) * 3 * np.sqrt(3) / 4 * h * beta / np.tan(beta / 2) * K
    np.testing.assert_allclose(np.abs(direct), np.abs(expected), rtol=1e-8, atol=1e-15)
    eq8_direct = np.linalg.det(eq8_jacobian(parameters, legs.length, legs.angle))
    np.testing.assert_allclose(np.abs(eq8_direct), 8 * np.abs(direct), rtol=1e-8, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_determinants_vanish_together(seed: int) -> None:
    """On lines of poses through the singular surface, each has its zero in the same place."""
    parameters, poses = random_poses(seed, 200, 3.0)
    loops = Loops(parameters)
    sign = np.sign(singularity_measures(parameters, poses).determinant)
    ahead, behind = poses[sign > 0], poses[sign < 0]
    assert len(behind) > 5

    for a, b in zip(ahead[:6], behind[:6], strict=False):

        def at(part: float, a: Array = a, b: Array = b) -> Array:
            return a + part * (b - a)

        def measure(part: float) -> float:
            return float(singularity_measures(parameters, at(part)).determinant)

        def eq8_determinant(part: float) -> float:
            legs = leg_jacobians(parameters, at(part))
            return float(np.linalg.det(eq8_jacobian(parameters, legs.length, legs.angle)))

        def passive(part: float) -> float:
            return float(np.linalg.det(loops.passive(at(part))))

        zero = brentq(measure, 0, 1, xtol=1e-15)
        for other in (eq8_determinant, passive):
            assert other(zero - 1e-9) * other(zero + 1e-9) < 0
            near = brentq(other, zero - 1e-9, zero + 1e-9, xtol=1e-15)
            assert near == pytest.approx(zero, abs=1e-12)
        assert singularity_measures(parameters, at(zero)).type_ii < 1e-13
        assert passive_conditioning(parameters, at(zero)) < 1e-13


# Rates --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_measure_rates_are_derivatives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng)
    poses, rate, _ = random_motions(rng, parameters, 200, largest_tilt=3.0)
    rate = rate * [parameters.platform_radius, 1, 1] / 30
    gains = singularity_measures(parameters, poses)
    # Where two gains are nearly equal, the least one turns too sharply for differences.
    apart = np.abs(gains.determinant) / np.maximum(gains.type_ii, 1e-12) > 2 * gains.type_ii**2
    poses, rate = poses[apart], rate[apart]
    step = 1e-3

    def at(time: float) -> Array:
        return measure_rates(parameters, poses + time * rate, rate).value

    expected = (8 * (at(step) - at(-step)) - at(2 * step) + at(-2 * step)) / (12 * step)
    found = measure_rates(parameters, poses, rate)
    error = np.abs(found.rate - expected)
    assert error[:, 1:].max() < 1e-9
    assert np.quantile(error[:, 0], 0.95) < 1e-9 and error[:, 0].max() < 1e-5
    measures = singularity_measures(parameters, poses)
    np.testing.assert_allclose(found.value[:, 0], measures.signed_type_ii, atol=1e-14)
    np.testing.assert_allclose(found.value[:, 2:].min(axis=1), measures.type_i, rtol=1e-14)


# Bad input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [[0.4, 0], 1.0, "abc", [np.inf, 0, 0]])
def test_bad_poses_are_refused(bad: object) -> None:
    for call in (singularity_measures, passive_conditioning):
        with pytest.raises(InputError):
            call(SOKOLOV, bad)  # type: ignore[operator]


def test_whole_turns_and_unknown_options_are_refused() -> None:
    with pytest.raises(InputError, match=r"tilted by 6\.4 rad"):
        singularity_measures(SOKOLOV, [0.4, 0, 6.4])
    with pytest.raises(InputError, match="errors = 'no'"):
        singularity_measures(SOKOLOV, [0.4, 0, 0], errors="no")  # type: ignore[arg-type]
