"""Poses: rotation, parasitic motion and their derivatives, against SciPy, the paper and jets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import InputError, RPSRobot
from rps_pin.rps.kinematics.conversions import pose_from_angles
from rps_pin.rps.kinematics.pose import (
    checked_motion,
    checked_pose,
    platform_motion,
    position,
    quaternion,
    rotation,
)
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import LEG_ANGLES, Motion, floats, poses, vectors

Array = NDArray[np.float64]

RADIUS = 0.23
#: Level, tiny, at the switch between series and closed form (tilt 1), and large tilts.
TILTS = [0.0, 1e-200, 1e-12, 1e-6, 1e-3, 0.3, 1 - 1e-13, 1.0, 1 + 1e-13, 2.0, 3.0, np.pi]


def ring(tilt: float, count: int = 60) -> Array:
    """Poses of one tilt about axes in every direction."""
    way = np.linspace(0, 2 * np.pi, count)
    return np.stack([np.full(count, 0.4), tilt * np.cos(way), tilt * np.sin(way)], axis=-1)


def rotation_vectors(pose: Array) -> Array:
    return np.concatenate([pose[..., 1:], np.zeros_like(pose[..., :1])], axis=-1)


def motions(tilt: float, seed: int = 0) -> Motion:
    rng = np.random.default_rng(seed)
    pose = ring(tilt)
    return pose, rng.normal(size=pose.shape), rng.normal(size=pose.shape)


# Orientation --------------------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", TILTS)
def test_rotation_is_that_of_the_rotation_vector(tilt: float) -> None:
    expected = Rotation.from_rotvec(rotation_vectors(ring(tilt))).as_matrix()
    np.testing.assert_allclose(rotation(ring(tilt)), expected, rtol=0, atol=2e-15)


@given(poses(largest_tilt=np.pi))
def test_rotation_is_orthonormal_and_right_handed(pose: Array) -> None:
    R = rotation(pose)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=2e-15)
    assert np.linalg.det(R) == pytest.approx(1, abs=3e-15)


@pytest.mark.parametrize("tilt", TILTS)
def test_quaternion_is_a_unit_quaternion_of_the_same_rotation(tilt: float) -> None:
    found = quaternion(ring(tilt))
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, rtol=0, atol=5e-16)
    matrices = Rotation.from_quat(found).as_matrix()
    np.testing.assert_allclose(matrices, rotation(ring(tilt)), rtol=0, atol=2e-15)


@given(floats(-np.pi, np.pi), floats(-np.pi, np.pi))
def test_paper_s_angles_give_the_paper_s_rotation(alpha: float, beta: float) -> None:
    """R = Rz(alpha) Ry(beta) Rz(-alpha)."""
    expected = Rotation.from_euler("ZYZ", [alpha, beta, -alpha]).as_matrix()
    found = rotation(pose_from_angles(0.4, alpha, beta))
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-15)


@given(floats(-np.pi, np.pi), floats(-np.pi, np.pi))
def test_opposite_tilt_is_the_same_tilt_about_the_opposite_axis(alpha: float, beta: float) -> None:
    one, other = pose_from_angles(0.4, alpha, -beta), pose_from_angles(0.4, alpha + np.pi, beta)
    np.testing.assert_allclose(one, other, rtol=0, atol=2e-15)


def test_pose_from_angles_broadcasts() -> None:
    pose = pose_from_angles(0.4, np.zeros((2, 1)), np.linspace(0, 1, 3))
    assert pose.shape == (2, 3, 3)
    np.testing.assert_array_equal(pose[1, 2], [0.4, 0.0, 1.0])


@pytest.mark.parametrize(
    "bad", [(0.4, np.nan, 0.0), (0.4, 0.0, np.inf), (np.zeros(2), np.zeros(3), 0.0), ("z", 0, 0)]
)
def test_angles_that_give_no_pose_are_refused(bad: tuple[object, object, object]) -> None:
    with pytest.raises(InputError):
        pose_from_angles(*bad)


# Position -----------------------------------------------------------------------------------------


@given(poses(largest_tilt=np.pi))
def test_every_tip_lies_in_the_plane_of_its_leg(pose: Array) -> None:
    """Eq. 3: the tips P + h R e have no component across their legs' vertical planes."""
    e = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
    across = np.stack([-np.sin(LEG_ANGLES), np.cos(LEG_ANGLES), np.zeros(3)], axis=-1)
    tips = position(pose, RADIUS) + RADIUS * e @ rotation(pose).T
    assert np.abs(np.sum(tips * across, axis=-1)).max() <= 4 * np.finfo(float).eps * RADIUS


@given(floats(-np.pi, np.pi), floats(-np.pi, np.pi))
def test_parasitic_motion_is_equation_5_with_its_components_swapped(a: float, b: float) -> None:
    found = position(pose_from_angles(0.4, a, b), RADIUS)
    size = RADIUS / 2 * (1 - np.cos(b))
    expected = [-size * np.cos(2 * a), size * np.sin(2 * a), 0.4]
    np.testing.assert_allclose(found, expected, rtol=0, atol=4 * np.finfo(float).eps * RADIUS)


@pytest.mark.parametrize("tilt", TILTS)
def test_height_is_the_pose_s(tilt: float) -> None:
    np.testing.assert_array_equal(position(ring(tilt), RADIUS)[:, 2], 0.4)


# Motion -------------------------------------------------------------------------------------------

FIELDS = ("position", "velocity", "acceleration", "rotation")


@pytest.mark.parametrize("tilt", TILTS)
def test_motion_is_the_reference_s(tilt: float) -> None:
    """The reference differentiates by jets and gives angular rates in base axes."""
    state = motions(tilt)
    robot = ne.ReferenceRobot(0.46, RADIUS, 1.0, np.eye(3))
    expected, found = ne.kinematics(robot, *state), platform_motion(*state, RADIUS)
    # The reference sums its series for large tilts too, where they cancel.
    bound = 4e-14 if tilt < 2.5 else 1e-12
    for name in FIELDS:
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=0, atol=bound, err_msg=name
        )
    for name in ("angular_velocity", "angular_acceleration"):
        in_base = (found.rotation @ getattr(found, name)[..., None])[..., 0]
        np.testing.assert_allclose(
            in_base, getattr(expected, name), rtol=0, atol=bound, err_msg=name
        )


@pytest.mark.parametrize("tilt", TILTS)
def test_motion_is_what_central_differences_show(tilt: float) -> None:
    """Position by differences; rotation by the logarithm of what turns in a short time."""
    pose, rate, acceleration = motions(tilt, seed=1)
    found = platform_motion(pose, rate, acceleration, RADIUS)
    h = 2e-3
    times = h * np.array([-2, -1, 1, 2])[:, None, None]
    nearby = pose + rate * times + acceleration * times**2 / 2
    R = Rotation.from_rotvec(rotation_vectors(pose))
    turned = [(R.inv() * Rotation.from_rotvec(rotation_vectors(x))).as_rotvec() for x in nearby]
    moved = position(nearby, RADIUS) - found.position
    first, second = np.array([1, -8, 8, -1]) / 12 / h, np.array([-1, 16, 16, -1]) / 12 / h**2
    for steps, rates, accelerations in (
        (moved, found.velocity, found.acceleration),
        (np.array(turned), found.angular_velocity, found.angular_acceleration),
    ):
        np.testing.assert_allclose(rates, np.tensordot(first, steps, 1), rtol=0, atol=2e-9)
        np.testing.assert_allclose(accelerations, np.tensordot(second, steps, 1), rtol=0, atol=2e-8)


def test_level_pose_turns_as_its_tilt_does() -> None:
    found = platform_motion(
        np.array([0.4, 0, 0]), np.array([0.1, 2.0, -3.0]), np.array([0.2, 5.0, 7.0]), RADIUS
    )
    np.testing.assert_array_equal(found.angular_velocity, [2, -3, 0])
    np.testing.assert_array_equal(found.angular_acceleration, [5, 7, 0])
    # p_x = h/4 (w_x^2 - w_y^2) and p_y = -h/2 w_x w_y near level.
    expected = [RADIUS / 2 * (4 - 9), -RADIUS * 2 * -3, 0.2]
    np.testing.assert_allclose(found.acceleration, expected, rtol=1e-15)


def test_spinning_about_a_fixed_axis_is_plain() -> None:
    """w = (t, 0): angular velocity (1, 0, 0) at every tilt."""
    tilt = np.linspace(0, np.pi, 50)
    pose = np.stack([0 * tilt, tilt, 0 * tilt], axis=-1)
    rate = np.broadcast_to([0.0, 1.0, 0.0], pose.shape)
    found = platform_motion(pose, rate, np.zeros_like(pose), RADIUS)
    np.testing.assert_allclose(found.angular_velocity, [[1, 0, 0]] * 50, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.angular_acceleration, np.zeros((50, 3)), rtol=0, atol=1e-15)


def test_motion_does_not_jump_where_series_and_closed_form_meet() -> None:
    """Steps of 1e-13 across tilt 1 change nothing by more than steps of 1e-13 can."""
    below, above = (motions(tilt) for tilt in (1 - 1e-13, 1 + 1e-13))
    pairs = zip(platform_motion(*below, RADIUS), platform_motion(*above, RADIUS), strict=True)
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=0, atol=3e-12)


@given(poses(), vectors(3.0), vectors(20.0))
def test_batch_equals_single(pose: Array, rate: Array, acceleration: Array) -> None:
    single = platform_motion(pose, rate, acceleration, RADIUS)
    batch = platform_motion(
        np.tile(pose, (2, 2, 1)),
        np.tile(rate, (2, 2, 1)),
        np.tile(acceleration, (2, 2, 1)),
        RADIUS,
    )
    for one, many in zip(single, batch, strict=True):
        assert many.shape == (2, 2, *one.shape)
        np.testing.assert_allclose(many[1, 0], one, rtol=1e-13, atol=1e-14)


# What is no pose ----------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [1.0, [1.0, 2.0], np.zeros((3, 4)), "abc", None, [[1, 2], [3]]])
def test_wrong_shapes_are_refused_by_name(bad: object) -> None:
    with pytest.raises(InputError, match=r"^rate .*3\)"):
        checked_pose(bad, "rate")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_first_entry_that_is_not_finite_is_named(bad: float) -> None:
    pose = np.zeros((2, 2, 3))
    pose[1, 0, 2] = pose[1, 1, 1] = bad
    with pytest.raises(InputError, match=rf"pose is not finite: entry \(1, 0, 2\) is {bad}"):
        checked_pose(pose)


def test_integers_become_floats() -> None:
    assert checked_pose([1, 0, 0]).dtype == np.float64


def test_motion_takes_one_shape() -> None:
    shapes = {x.shape for x in checked_motion(np.zeros((4, 1, 3)), np.zeros((5, 3)), [0, 0, 0])}
    assert shapes == {(4, 5, 3)}


def test_shapes_that_cannot_be_one_are_all_told() -> None:
    with pytest.raises(InputError, match=r"pose \(4, 3\), rate \(5, 3\), acceleration \(3,\)"):
        checked_motion(np.zeros((4, 3)), np.zeros((5, 3)), np.zeros(3))


def test_the_strategies_cover_level_and_large_tilts() -> None:
    """A guard of these tests: Hypothesis draws from where the formulas change."""
    seen = set()

    @given(strategies.poses())
    def look(pose: Array) -> None:
        tilt = np.hypot(*pose[1:])
        seen.update({"level"} if tilt == 0 else {"series"} if tilt < 1 else {"closed form"})

    look()
    assert seen == {"level", "series", "closed form"}


@pytest.mark.parametrize("pose", [(0.22, 1e200, 1e200), (1e308, 1e308, 1e308)])
def test_a_tilt_whose_square_overflows_is_an_input_error(pose):
    robot = RPSRobot.from_preset("micro")
    for compute in (robot.inverse_kinematics, robot.platform_placement):
        with pytest.raises(InputError, match=r"beyond 1e\+50"):
            compute(pose)
