"""Placements: Eq. 3 against Eq. 4, poses there and back, and the other operation mode."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import ClosureError, InputError
from rps_pin.rps.kinematics import pose as native
from rps_pin.rps.kinematics.placement import constraint_residuals, pose_from_placement
from tests.strategies import LEG_ANGLES, matrices, random_poses, vectors

Array = NDArray[np.float64]

H = 0.23
EPS = np.finfo(float).eps


def half_turns(count: int) -> tuple[Array, Array]:
    """Placements of the other operation mode: about axes 0.2 to 1.5 rad out of the base plane."""
    rng = np.random.default_rng(6)
    way, lift = rng.uniform(-3, 3, count), rng.uniform(0.2, 1.5, count)
    axis = np.stack([np.cos(way) * np.cos(lift), np.sin(way) * np.cos(lift), np.sin(lift)], -1)
    R = Rotation.from_rotvec(np.pi * axis).as_matrix()
    x, y = H / 2 * (R[:, 0, 0] - R[:, 1, 1]), -H * R[:, 1, 0]
    return np.stack([x, y, np.full(count, 0.4)], axis=-1), R


@given(vectors(1.0), vectors(4.0))
def test_residuals_are_the_tips_distances_from_their_planes(centre: Array, turn: Array) -> None:
    """Eq. 3, for any placement: q_1y, q_2y + sqrt(3) q_2x, q_3y - sqrt(3) q_3x."""
    R = Rotation.from_rotvec(turn).as_matrix()
    e = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
    tip = centre + H * e @ R.T
    equation_3 = [tip[0, 1], tip[1, 1] + 3**0.5 * tip[1, 0], tip[2, 1] - 3**0.5 * tip[2, 0]]
    r = constraint_residuals(centre, R, H)
    mixed = [r[1], r[1] - 1.5 * r[0] + 3**0.5 * r[2], r[1] - 1.5 * r[0] - 3**0.5 * r[2]]
    np.testing.assert_allclose(mixed, equation_3, rtol=0, atol=5e-15)


def test_poses_and_half_turns_keep_the_constraints() -> None:
    pose = random_poses(500)
    for placement in ((native.position(pose, H), native.rotation(pose)), half_turns(100)):
        assert np.abs(constraint_residuals(*placement, H)).max() < 1e-15


def test_pose_is_that_of_its_placement() -> None:
    pose = random_poses(2000)
    found = pose_from_placement(native.position(pose, H), native.rotation(pose), H)
    np.testing.assert_allclose(found, pose, rtol=0, atol=3e-15)
    found = pose_from_placement(native.position(pose, H), matrices(pose), H)
    np.testing.assert_allclose(found, pose, rtol=0, atol=5e-15)


def test_level_pose_is_that_of_its_placement() -> None:
    np.testing.assert_array_equal(pose_from_placement([0, 0, 0.4], np.eye(3), H), [0.4, 0, 0])


def test_half_turn_in_the_base_plane_has_a_pose() -> None:
    way = np.linspace(-3, 3, 31)
    pose = np.stack([0 * way + 0.4, np.pi * np.cos(way), np.pi * np.sin(way)], axis=-1)
    found = pose_from_placement(native.position(pose, H), native.rotation(pose), H)
    np.testing.assert_allclose(native.rotation(found), native.rotation(pose), rtol=0, atol=2e-15)
    np.testing.assert_allclose(np.hypot(*found.T[1:]), np.pi, rtol=1e-15)


def test_other_operation_mode_has_no_pose() -> None:
    for centre, R in zip(*half_turns(50), strict=True):
        with pytest.raises(InputError, match="other operation mode") as caught:
            pose_from_placement(centre, R, H)
        assert not isinstance(caught.value, ClosureError)
    turned = np.diag([-1.0, -1.0, 1.0])
    with pytest.raises(InputError, match=r"axis 1\.5708 rad out of the base plane"):
        pose_from_placement([0, 0, 0.4], turned, H)


def test_broken_constraints_are_told_with_their_size() -> None:
    pose = random_poses(3, largest_tilt=1.0)
    centre, R = native.position(pose, H), native.rotation(pose)
    centre[1] += [0.003, 0, 0]
    with pytest.raises(ClosureError, match=r"entry \(1,\) of 3.* 0.003 m") as caught:
        pose_from_placement(centre, R, H)
    assert caught.value.gap == pytest.approx(0.003, abs=1e-15)
    with pytest.raises(ClosureError) as caught:
        pose_from_placement([0, 0, 0.4], Rotation.from_rotvec([0, 0, 0.02]).as_matrix(), H)
    assert caught.value.gap == pytest.approx(2 * H * np.sin(0.01), rel=1e-12)


def test_tolerance_is_kept() -> None:
    pose = np.array([0.4, 0.3, -0.2])
    centre, R = native.position(pose, H), native.rotation(pose)
    moved = centre + np.array([0, 1e-5, 0])
    np.testing.assert_allclose(
        pose_from_placement(moved, R, H, tolerance=1.01e-5), pose, atol=1e-15
    )
    for tolerance in (0.99e-5, None):
        with pytest.raises(ClosureError):
            pose_from_placement(moved, R, H, tolerance=tolerance)
    for bad in (0.0, -1.0, np.nan, "1"):
        with pytest.raises(InputError, match=r"^tolerance = "):
            pose_from_placement(centre, R, H, tolerance=bad)


@pytest.mark.parametrize("call", [constraint_residuals, pose_from_placement])
def test_what_is_no_placement_is_refused(call: Callable[..., object]) -> None:
    for bad in (2 * np.eye(3), -np.eye(3), np.zeros((3, 3)), np.diag([1, 1, 1.001])):
        with pytest.raises(InputError, match="rotation is not a rotation: R'R differs from I by"):
            call(np.zeros(3), bad, H)
    with pytest.raises(InputError, match=r"rotation \(entry \(1,\) of 2\) is not a rotation"):
        call(np.zeros(3), [np.eye(3), -np.eye(3)], H)
    for bad in (np.eye(4), np.zeros(3), np.full((3, 3), np.nan), "R"):
        with pytest.raises(InputError, match=r"^rotation "):
            call(np.zeros(3), bad, H)
    for bad in (0.4, np.zeros(2), [0, np.nan, 0], "p"):
        with pytest.raises(InputError, match=r"^position "):
            call(bad, np.eye(3), H)
    with pytest.raises(InputError, match=r"\(2, 3\) and \(3, 3, 3\), which do not go together"):
        call(np.zeros((2, 3)), [np.eye(3)] * 3, H)


def test_placements_broadcast() -> None:
    heights = np.stack([np.zeros(4), np.zeros(4), np.arange(4.0)], axis=-1)
    found = pose_from_placement(heights, np.eye(3), H)
    np.testing.assert_array_equal(found[:, 0], np.arange(4))
    many = np.broadcast_to(np.eye(3), (2, 2, 3, 3))
    assert constraint_residuals(np.zeros(3), many, H).shape == (2, 2, 3)
