"""Conversions: axioms (there and back), SciPy's Euler angles, the helix, the reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import InputError, UnreachableError
from rps_pin.rps.kinematics import pose as native
from rps_pin.rps.kinematics.conversions import (
    angles_from_pose,
    parasitic_motion,
    pose_from_angles,
    pose_from_position,
    position_from_pose,
)
from rps_pin.trajectories.helix import HelixPath
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import floats, matrices, random_poses

Array = NDArray[np.float64]

H = 0.23
EPS = np.finfo(float).eps

# The paper's angles -------------------------------------------------------------------------------


@given(strategies.poses(largest_tilt=np.pi))
def test_angles_give_back_their_pose(pose: Array) -> None:
    found = angles_from_pose(pose)
    assert found.beta >= 0
    assert -np.pi < found.alpha <= np.pi
    again = pose_from_angles(found.z, found.alpha, found.beta)
    np.testing.assert_allclose(again, pose, rtol=0, atol=4 * EPS * found.beta)


@given(floats(-3.14159, np.pi), floats(1e-6, np.pi))
def test_pose_gives_back_its_angles(alpha: float, beta: float) -> None:
    found = angles_from_pose(pose_from_angles(0.4, alpha, beta))
    np.testing.assert_allclose([*found], [0.4, alpha, beta], rtol=1e-15, atol=1e-15)


def test_angles_are_scipy_s_euler_angles() -> None:
    pose = random_poses(500)
    _, alpha, beta = found = angles_from_pose(pose)
    expected = Rotation.from_euler("ZYZ", np.stack([alpha, beta, found.gamma], -1)).as_matrix()
    np.testing.assert_allclose(matrices(pose), expected, rtol=0, atol=3e-15)


@pytest.mark.parametrize("wx", [0.0, -0.0])
@pytest.mark.parametrize("wy", [0.0, -0.0])
def test_level_pose_has_alpha_zero(wx: float, wy: float) -> None:
    assert angles_from_pose([0.4, wx, wy]) == (0.4, 0, 0)


@pytest.mark.parametrize("wx", [0.0, -0.0, 1e-300, -1e-300])
def test_alpha_is_pi_and_not_minus_pi(wx: float) -> None:
    assert angles_from_pose([0.4, wx, -1.0]) == (0.4, np.pi, 1)


def test_opposite_set_of_the_paper_is_told_as_the_one_with_positive_beta() -> None:
    """(alpha, -beta) is (alpha + pi, beta)."""
    found = angles_from_pose(pose_from_angles(0.4, [0.3, -0.3], -0.7))
    np.testing.assert_allclose(found.alpha, [0.3 - np.pi, np.pi - 0.3], rtol=1e-15)
    np.testing.assert_allclose(found.beta, 0.7, rtol=1e-15)


# The centre ---------------------------------------------------------------------------------------


@given(floats(0, H), floats(-10, 10), st.sampled_from("+-"))
def test_pose_of_a_position_is_there(r: float, phi: float, branch: str) -> None:
    centre = np.array([r * np.cos(phi), r * np.sin(phi), 0.4])
    pose = pose_from_position(centre, H, branch)
    np.testing.assert_allclose(native.position(pose, H), centre, rtol=0, atol=6 * EPS * H)


def test_position_keeps_its_digits_in_micro_moves() -> None:
    """Nanometres and less: relative, not absolute, precision."""
    r, phi = np.geomspace(1e-3, 1e-30, 200), np.linspace(-3, 3, 200)
    centre = np.stack([r * np.cos(phi), r * np.sin(phi), np.full(200, 0.4)], axis=-1)
    for branch in "+-":
        found = native.position(pose_from_position(centre, H, branch), H)
        error = np.abs(found - centre).max(axis=-1) / r
        assert error.max() < 10 * EPS


def test_pose_is_that_of_its_position_and_branch() -> None:
    pose = random_poses(2000)
    found = position_from_pose(pose, H)
    again = pose_from_position(found.position, H, found.branch)
    # Near pi the centre turns back: it knows the tilt to the root of rounding only.
    tilt = np.hypot(*pose.T[1:])
    bound = 20 * EPS * tilt / np.cos(tilt / 2)
    assert (np.abs(again - pose).max(axis=-1) <= bound).all()
    assert set(found.branch) == {"+", "-"}


def test_branches_are_the_helix_s() -> None:
    """Up to half a turn; then phi is atan2's, and the branches change places."""
    for branch, other in (("+", "-"), ("-", "+")):
        path = HelixPath(H, radius=0.03, pitch=0.01, height=0.4, branch=branch)
        times = np.linspace(0, path.duration, 101)
        phi, pose = path.turn(times)[0], path.sample(times).pose
        here = np.where(phi <= np.pi, branch, other)
        found = pose_from_position(native.position(pose, H), H, here)
        clear = np.abs(phi - np.pi) > 1e-9
        np.testing.assert_allclose(found[clear], pose[clear], rtol=0, atol=1e-14)
        np.testing.assert_array_equal(position_from_pose(pose, H).branch[clear], here[clear])


def test_plus_has_alpha_of_half_the_direction() -> None:
    phi = np.linspace(-np.pi, np.pi, 41)[1:]
    centre = np.stack([0.1 * np.cos(phi), 0.1 * np.sin(phi), 0 * phi], axis=-1)
    centre[-1, 1] = 0.0
    plus, minus = (pose_from_position(centre, H, branch) for branch in "+-")
    np.testing.assert_allclose(angles_from_pose(plus).alpha, np.pi / 2 - phi / 2, atol=1e-14)
    np.testing.assert_array_equal(plus[:, 1:], -minus[:, 1:])


@pytest.mark.parametrize("y", [0.0, -0.0])
def test_zero_on_the_negative_axis_has_no_sign(y: float) -> None:
    found = pose_from_position([-0.1, y, 0.4], H)
    np.testing.assert_allclose(angles_from_pose(found).alpha, 0, rtol=0, atol=1e-15)


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_centred_platform_is_level(zero: float) -> None:
    for branch in "+-":
        pose = pose_from_position([zero, 0.0, 0.4], H, branch)
        np.testing.assert_array_equal(pose, [0.4, 0, 0])
    assert position_from_pose([0.4, zero, zero], H).branch == "+"


def test_cylinder_of_radius_h_is_reached_and_no_more() -> None:
    pose = pose_from_position([[H, 0, 0.4], [0, -H, 0.4]], H)
    np.testing.assert_allclose(np.hypot(*pose.T[1:]), np.pi, rtol=1e-15)
    pose_from_position([H * (1 + 1e-13), 0, 0.4], H)
    with pytest.raises(UnreachableError, match=r"entry \(1,\) of 2.* 0 to 0.23 m.* by 0.01 m"):
        pose_from_position([[H, 0, 0.4], [0, -H - 0.01, 0.4]], H)
    with pytest.raises(UnreachableError):
        pose_from_position([H * (1 + 1e-11), 0, 0.4], H)


@pytest.mark.parametrize("branch", ["", "x", 1, None, ["+", "x"], ["+", ["-"]]])
def test_unknown_branches_are_refused(branch: object) -> None:
    with pytest.raises(InputError, match=r"branch = .* must be '\+' or '-'"):
        pose_from_position(np.zeros((2, 3)), H, branch)


def test_branches_may_be_many() -> None:
    found = pose_from_position([0.0, 0.1, 0.4], H, ["+", "-"])
    assert found.shape == (2, 3)
    np.testing.assert_array_equal(found[0, 1:], -found[1, 1:])
    with pytest.raises(InputError, match=r"\(3, 3\) and \(2,\)"):
        pose_from_position(np.zeros((3, 3)), H, ["+", "-"])


def test_parasitic_motion_is_the_reference_s() -> None:
    rng = np.random.default_rng(3)
    state = random_poses(300, largest_tilt=2.0), *rng.normal(size=(2, 300, 3))
    expected = ne.kinematics(ne.ReferenceRobot(0.46, H, 1.0, np.eye(3)), *state)
    found = parasitic_motion(state[0], H, *state[1:])
    for name in found._fields:
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name)[:, :2], rtol=0, atol=4e-14
        )


def test_parasitic_motion_of_a_platform_at_rest_is_none() -> None:
    found = parasitic_motion(random_poses(5), H)
    expected = native.position(random_poses(5), H)[:, :2]
    np.testing.assert_allclose(found.position, expected, rtol=4 * EPS)
    assert not found.velocity.any()
    assert not found.acceleration.any()
