"""Eq. 8 and Newton's method on it: the paper's own form, points in space, central differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError
from rps_pin.rps.kernels import leg_equations as kernels
from rps_pin.rps.kinematics import leg_equations as eq
from rps_pin.rps.kinematics.legs import RADIAL, leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import position, rotation
from tests import strategies

Array = NDArray[np.float64]


def random_closed(
    rng: np.random.Generator, count: int, g: float, h: float
) -> tuple[Array, Array, Array]:
    """Poses, and the leg lengths and angles they have by inverse kinematics."""
    height = g * rng.uniform(0.2, 2, count) * rng.choice([-1, 1], count)
    size, way = rng.uniform(0, 3.1, count), rng.uniform(-np.pi, np.pi, count)
    pose = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    length, angle = leg_angles_and_lengths(tips(position(pose, h), rotation(pose), h), g)
    return pose, length, angle


def test_residuals_vanish_at_poses_and_are_the_tips_distances_elsewhere() -> None:
    rng = np.random.default_rng(0)
    _, length, angle = random_closed(rng, 1000, 0.5, 0.3)
    assert np.abs(eq.residuals(length, angle, 0.5, 0.3)).max() < 1e-15 * 4
    angle = rng.uniform(-np.pi, np.pi, angle.shape)
    point = (0.5 - length * np.cos(angle))[..., None] * RADIAL
    point[..., 2] = length * np.sin(angle)
    gap = np.linalg.norm(point - point[:, [1, 2, 0]], axis=-1) - math.sqrt(3) * 0.3
    np.testing.assert_allclose(eq.residuals(length, angle, 0.5, 0.3), gap, rtol=0, atol=2e-15)


def test_left_sides_are_the_paper_s() -> None:
    """Equation 8 as it is printed."""
    rng = np.random.default_rng(1)
    d, phi = rng.uniform(0.1, 1, (3, 50)), rng.uniform(-np.pi, np.pi, (3, 50))
    g, h = 0.4, 0.25
    c, s = np.cos(phi), np.sin(phi)
    found = kernels.residuals(d * c, d * s, g, kernels.constants(d, g, h))
    for f, (i, j) in zip(found, [(0, 1), (1, 2), (2, 0)], strict=True):
        printed = d[i] ** 2 + d[j] ** 2 + 3 * g**2 - 3 * h**2 + d[i] * d[j] * c[i] * c[j]
        printed += -2 * d[i] * d[j] * s[i] * s[j] - 3 * g * d[i] * c[i] - 3 * g * d[j] * c[j]
        np.testing.assert_allclose(f, printed, rtol=0, atol=1e-14)


def test_jacobian_and_determinant_are_derivatives() -> None:
    rng = np.random.default_rng(2)
    _, length, angle = random_closed(rng, 200, 0.5, 0.3)
    found = eq.jacobian(length, angle, 0.5, 0.3)
    step = 1e-6
    for k, turn in enumerate(step * np.eye(3)):
        ahead, behind = (eq.residuals(length, angle + t, 0.5, 0.3) for t in (turn, -turn))
        np.testing.assert_allclose(found[..., k], (ahead - behind) / (2 * step), atol=1e-9)
    cosines = found / length[:, None]
    assert np.abs(cosines).max() <= 1 + 1e-14
    np.testing.assert_allclose(
        eq.determinant(length, angle, 0.5, 0.3), np.linalg.det(cosines), rtol=0, atol=1e-14
    )


def test_placement_is_that_of_the_pose() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        robot = strategies.random_parameters(rng)
        g, h = robot.base_radius, robot.platform_radius
        pose, length, angle = random_closed(rng, 500, g, h)
        found = eq.placement_from_angles(length, angle, g, h)
        assert found.in_plane_mode.all()
        np.testing.assert_allclose(found.rotation, rotation(pose), rtol=0, atol=2e-13)
        np.testing.assert_allclose(found.position, position(pose, h), rtol=0, atol=1e-14)
        np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-5, math.pi / 2, math.pi - 1e-7])
def test_tilt_is_sharp_where_its_formula_changes(tilt: float) -> None:
    way = np.linspace(-3, 3, 25)
    pose = np.stack([np.full(25, 0.4), tilt * np.cos(way), tilt * np.sin(way)], axis=-1)
    length, angle = leg_angles_and_lengths(tips(position(pose, 0.3), rotation(pose), 0.3), 0.5)
    found = eq.placement_from_angles(length, angle, 0.5, 0.3)
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=5e-15)


def test_half_turns_about_any_other_axis_have_no_pose() -> None:
    """Half turns R = 2 n n' - 1 with the centre that the leg planes ask for close the robot."""
    rng = np.random.default_rng(4)
    n = rng.normal(size=(200, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    turn = 2 * n[:, :, None] * n[:, None, :] - np.eye(3)
    centre = np.stack(
        [0.15 * (turn[:, 0, 0] - turn[:, 1, 1]), -0.3 * turn[:, 1, 0], rng.uniform(0.1, 1, 200)],
        axis=-1,
    )
    length, angle = leg_angles_and_lengths(tips(centre, turn, 0.3), 0.5)
    assert np.abs(eq.residuals(length, angle, 0.5, 0.3)).max() < 1e-15 * 4
    found = eq.placement_from_angles(length, angle, 0.5, 0.3)
    assert not found.in_plane_mode.any()
    assert np.isnan(found.pose).all()
    np.testing.assert_allclose(found.rotation, turn, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.position, centre, rtol=0, atol=1e-14)


def test_newton_finds_the_angles_again_from_nearby() -> None:
    rng = np.random.default_rng(5)
    _, length, angle = random_closed(rng, 20_000, 0.5, 0.3)
    regular = np.abs(eq.determinant(length, angle, 0.5, 0.3)) > 0.05
    length, angle = length[regular], angle[regular]
    found = eq.solve_angles(length, angle + 1e-3, 0.5, 0.3)
    assert found.converged.all()
    assert found.residual.max() < 1e-13
    np.testing.assert_allclose(np.exp(1j * found.angle), np.exp(1j * angle), atol=1e-11)
    det = eq.determinant(length, angle, 0.5, 0.3)
    np.testing.assert_allclose(found.determinant, det, rtol=0, atol=1e-11)


def test_newton_solves_the_paper_s_workspace_grid_and_blocks_do_not_matter() -> None:
    side = np.linspace(0.2, 0.25, 28)
    length = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1)
    found = eq.solve_angles(length, np.pi / 2, 0.12, 0.12)
    assert found.angle.shape == (28, 28, 28, 3)
    assert found.converged.all()
    assert found.determinant.min() > 1
    some = (3, slice(None), 5)
    alone = eq.solve_angles(length[some], [np.pi / 2] * 3, 0.12, 0.12)
    np.testing.assert_allclose(alone.angle, found.angle[some], rtol=0, atol=1e-15)


def test_what_cannot_close_is_said_not_to_have_converged_and_stays_finite() -> None:
    length = np.array([[0.001, 0.9, 0.22], [0.2, 0.2, 0.2]])
    found = eq.solve_angles(length, [[1.5, 1.5, 1.5], [1.5, 1.6, 1.5]], 0.12, 0.12)
    assert found.converged.tolist() == [False, True]
    assert all(np.isfinite(field).all() for field in found)
    assert found.residual[0] > 0.1
    flat = eq.solve_angles([0.2, 0.2, 0.2], 0.0, 0.12, 0.12)  # Jacobian zero
    assert np.isfinite(flat.angle).all()


def test_no_triples_are_no_work() -> None:
    assert eq.solve_angles(np.empty((0, 3)), 1.0, 0.1, 0.1).angle.shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"length": [1.0, 2.0]}, r"shape \(2,\)"),
        ({"length": [1.0, 2.0, math.nan]}, "not finite: entry"),
        ({"length": [1.0, -2.0, 1.0]}, "length of leg 2 is -2 m"),
        ({"length": "long"}, "must be numbers"),
        ({"start": math.inf}, "start is not finite"),
        ({"start": "up"}, "start = .up.: it must be numbers"),
        ({"start": np.ones((2, 2))}, "do not go together"),
        ({"base_radius": 0.0}, "base_radius = 0"),
        ({"platform_radius": "wide"}, "platform_radius = .wide.: it must be"),
        ({"tolerance": -1.0}, "tolerance = -1"),
        ({"iterations": 0}, "at least 1"),
        ({"iterations": 2.5}, "whole number"),
    ],
)
def test_bad_input_is_named(change: dict[str, object], message: str) -> None:
    good = {"length": [1.0, 1.0, 1.0], "start": 1.0, "base_radius": 1.0, "platform_radius": 1.0}
    with pytest.raises(InputError, match=message):
        eq.solve_angles(**(good | change))  # type: ignore[arg-type]


def test_length_and_angle_must_go_together() -> None:
    with pytest.raises(InputError, match="do not go together"):
        eq.residuals(np.ones((2, 3)), np.ones((4, 3)), 1.0, 1.0)
