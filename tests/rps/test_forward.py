"""Following poses: forward kinematics of inverse kinematics, symmetry, singularities, trackers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosureError, InputError, SingularityError, UnreachableError
from rps_pin.rps.kinematics import leg_equations as eq
from rps_pin.rps.kinematics.forward_kinematics import EncoderTracker, forward_kinematics
from rps_pin.rps.kinematics.legs import leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import position, rotation
from tests import strategies

Array = NDArray[np.float64]
G, H = 0.4, 0.3


def inverse(pose: Array, g: float = G, h: float = H) -> tuple[Array, Array]:
    """Leg lengths and angles of poses."""
    return leg_angles_and_lengths(tips(position(pose, h), rotation(pose), h), g)


def ways(rng: np.random.Generator, count: int, g: float, h: float) -> tuple[Array, Array]:
    """Pairs of neighbouring poses far from singularities."""
    near = np.concatenate(
        [g * rng.uniform(0.7, 2.0, (count, 1)), rng.uniform(-0.7, 0.7, (count, 2))], axis=-1
    )
    goal = near + rng.uniform(-0.1, 0.1, (count, 3)) * [g, 1, 1]
    parts = np.linspace(0, 1, 5)[:, None, None]
    between = near + parts * (goal - near)
    length, angle = inverse(between, g, h)
    regular = (np.abs(eq.determinant(length, angle, g, h)) > 0.2).all(axis=0)
    return near[regular], goal[regular]


def crossing() -> tuple[Array, Array, float]:
    """Lengths before and behind a fold, and the part of the way at which it lies.

    Level, the way down to the base plane: at height zero the platform can go either way, and there
    the lengths have their least.
    """
    start = np.array([0.3, 0.0, 0.0])
    wanted = np.full(3, 0.05)
    length = math.hypot(G - H, 0.3)
    return start, wanted, (length - (G - H)) / (length - 0.05)


def test_pose_near_that_of_its_inverse_kinematics_comes_back() -> None:
    rng = np.random.default_rng(0)
    for _ in range(15):
        robot = strategies.random_parameters(rng)
        g, h = robot.base_radius, robot.platform_radius
        near, goal = ways(rng, 200, g, h)
        length, angle = inverse(goal, g, h)
        found = forward_kinematics(length, near, g, h)
        assert found.reached.all()
        assert (found.fraction == 1).all()
        np.testing.assert_allclose(found.pose, goal, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(found.angle, angle, rtol=0, atol=1e-10)
        np.testing.assert_allclose(inverse(found.pose, g, h)[0], length, rtol=1e-12)
        jacobian = eq.jacobian(length, angle, g, h)
        condition = np.linalg.cond(jacobian, np.inf)
        np.testing.assert_allclose(found.condition, condition, rtol=1e-8)


def test_long_ways_end_where_small_steps_of_plain_newton_do() -> None:
    rng = np.random.default_rng(1)
    near = np.concatenate([rng.uniform(0.3, 0.8, (40, 1)), rng.uniform(-1.2, 1.2, (40, 2))], -1)
    begin, angle = inverse(near)
    wanted = begin * rng.uniform(0.6, 1.6, begin.shape)
    found = forward_kinematics(wanted, near, G, H, errors="mask")
    assert 5 < found.reached.sum() < 40
    sign = np.sign(eq.determinant(begin, angle, G, H))
    regular = np.ones(40, dtype=bool)
    parts = np.linspace(0, 1, 1501)[1:]
    for part in parts:
        solved = eq.solve_angles(begin + part * (wanted - begin), angle, G, H)
        angle = solved.angle
        regular &= solved.converged & (np.sign(solved.determinant) == sign)
    np.testing.assert_array_equal(found.reached, regular)
    np.testing.assert_allclose(
        np.exp(1j * found.angle[regular]), np.exp(1j * angle[regular]), atol=1e-10
    )


def test_where_not_reached_the_last_pose_on_the_way_is_given() -> None:
    start, wanted, part = crossing()
    both = forward_kinematics([wanted, inverse(start)[0] + 0.01], start, G, H, errors="mask")
    assert both.reached.tolist() == [False, True]
    assert both.fraction[0] == pytest.approx(part, abs=1e-9)
    assert 0 < both.pose[0, 0] < 1e-4
    begin = inverse(start)[0]
    on_the_way = begin + both.fraction[0] * (wanted - begin)
    np.testing.assert_allclose(inverse(both.pose[0])[0], on_the_way, rtol=0, atol=1e-12)


def test_lengths_that_cannot_close_are_refused_with_the_gap() -> None:
    start, wanted, _ = crossing()
    # The tips come no nearer than sqrt(3) (g - d) = sqrt(3) 0.35, and should be sqrt(3) 0.3 apart.
    with pytest.raises(ClosureError, match="cannot close") as refusal:
        forward_kinematics(wanted, start, G, H)
    assert refusal.value.gap == pytest.approx(math.sqrt(3) * 0.05, rel=1e-3)


def test_way_across_a_singularity_is_refused_with_fraction_and_condition() -> None:
    """From one mode there is no way to lengths that only other modes have."""
    near = np.array([0.48, 0.0, 0.0])
    with pytest.raises(SingularityError, match=r"after \d+\.\d+% of the line") as refusal:
        forward_kinematics([[0.5, 0.5, 0.5], [0.2, 0.3, 0.9]], near, G, H)
    assert "entry (1,) of 2" in str(refusal.value)
    assert refusal.value.condition > 1e5
    assert refusal.value.limit == 1e6


def test_start_in_a_singularity_goes_nowhere() -> None:
    level = np.array([0.0, 0.0, 0.0])
    found = forward_kinematics([0.2, 0.2, 0.2], level, G, H, errors="mask")
    assert not found.reached
    assert found.fraction == 0
    assert found.condition > 1e6
    with pytest.raises(SingularityError, match=r"after 0\.0000% of the line"):
        forward_kinematics([0.2, 0.2, 0.2], level, G, H)
    with pytest.raises(SingularityError, match="the pose to start from is singular"):
        EncoderTracker(level, G, H)


def test_turning_the_robot_by_120_degrees_turns_the_pose() -> None:
    rng = np.random.default_rng(2)
    near, goal = ways(rng, 100, G, H)
    length, _ = inverse(goal)
    c, s = math.cos(2 * math.pi / 3), math.sin(2 * math.pi / 3)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    found = forward_kinematics(length[:, [2, 0, 1]], near @ turn.T, G, H)
    np.testing.assert_allclose(found.pose, goal @ turn.T, rtol=0, atol=1e-12)


def test_mirrored_in_the_base_plane_it_goes_the_mirrored_way() -> None:
    rng = np.random.default_rng(3)
    near, goal = ways(rng, 100, G, H)
    found = forward_kinematics(inverse(goal)[0], -near, G, H)
    np.testing.assert_allclose(found.pose, -goal, rtol=0, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 50.0])
def test_scaling_all_lengths_scales_the_answer(scale: float) -> None:
    rng = np.random.default_rng(4)
    near, goal = ways(rng, 100, G, H)
    size = np.array([scale, 1, 1])
    found = forward_kinematics(scale * inverse(goal)[0], near * size, scale * G, scale * H)
    np.testing.assert_allclose(found.pose / size, goal, rtol=0, atol=1e-11)


# The tracker --------------------------------------------------------------------------------------


def test_tracker_follows_a_motion_into_the_caller_s_array() -> None:
    t = np.linspace(0, 1, 500)
    pose = np.stack(
        [0.5 + 0.1 * np.sin(9 * t), 0.5 * np.sin(5 * t), 0.4 * np.sin(8 * t) + 0.1], axis=-1
    )
    length, angle = inverse(pose)
    tracker = EncoderTracker(pose[0], G, H)
    out = np.empty(3)
    conditions = np.linalg.cond(eq.jacobian(length, angle, G, H), np.inf)
    for reading, expected, condition in zip(length, pose, conditions, strict=True):
        assert tracker.update(reading, out) is out
        np.testing.assert_allclose(out, expected, rtol=0, atol=1e-13)
        assert tracker.condition == pytest.approx(condition, rel=1e-8)
    np.testing.assert_array_equal(tracker.pose, out)
    assert tracker.update(length[-1].tolist()) is not out


def test_tracker_goes_where_forward_kinematics_goes() -> None:
    rng = np.random.default_rng(5)
    near, goal = ways(rng, 150, G, H)
    length, _ = inverse(goal)
    expected = forward_kinematics(length, near, G, H).pose
    for start, reading, pose in zip(near, length, expected, strict=True):
        found = EncoderTracker(start, G, H).update(reading)
        np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)


def test_tracker_knows_large_tilts() -> None:
    for tilt in ([2.5, 0.3], [-0.2, 2.9], [1.5, -1.5]):
        pose = np.array([1.5, *tilt])
        found = EncoderTracker(pose, G, H).update(inverse(pose)[0])
        np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)


def test_tracker_refuses_a_singularity_and_keeps_its_pose() -> None:
    start, wanted, _ = crossing()
    tracker = EncoderTracker(start, G, H)
    with pytest.raises(SingularityError, match="The last pose is kept") as refusal:
        tracker.update(wanted)
    assert refusal.value.limit == 1e6
    np.testing.assert_array_equal(tracker.pose, start)
    goal = start + np.array([0.01, 0.01, 0.0])
    np.testing.assert_allclose(tracker.update(inverse(goal)[0]), goal, rtol=0, atol=1e-13)
    tracker.reset(goal + np.array([0.1, 0, 0]))
    assert tracker.pose[0] == pytest.approx(0.41)
    with pytest.raises(ValueError, match="read-only"):
        tracker.pose[0] = 1.0


def test_tracker_does_not_drift() -> None:
    pose = np.array([0.5, 0.2, -0.1])
    tracker = EncoderTracker(pose, G, H)
    there, back = inverse(pose + np.array([0.0, 0.01, 0.01]))[0], inverse(pose)[0]
    for _ in range(2000):
        tracker.update(there)
        tracker.update(back)
    np.testing.assert_allclose(tracker.pose, pose, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("reading", "message"),
    [
        ([1.0, 1.0], r"shape \(2,\)"),
        (np.ones((2, 3)), r"must be \(3,\)"),
        (np.array([1.0, math.nan, 1.0]), "not finite"),
        (np.array([1.0, -1.0, 1.0]), "length of leg 2"),
        ("far", "must be 3 numbers"),
    ],
)
def test_tracker_refuses_bad_readings(reading: object, message: str) -> None:
    tracker = EncoderTracker([0.5, 0, 0], G, H)
    with pytest.raises(InputError, match=message):
        tracker.update(reading)  # type: ignore[arg-type]
    np.testing.assert_array_equal(tracker.pose, [0.5, 0, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"length": [1.0, math.nan, 1.0]}, "length is not finite"),
        ({"length": [1.0, 0.0, 1.0]}, "length of leg 2 is 0 m"),
        ({"near": [1.0, 0.0]}, "near has shape"),
        ({"near": np.zeros((2, 3)), "length": np.ones((4, 3))}, "do not go together"),
        ({"errors": "ignore"}, "must be 'raise' or 'mask'"),
        ({"condition_limit": math.nan}, "condition_limit"),
        ({"base_radius": -1.0}, "base_radius = -1"),
    ],
)
def test_bad_input_is_named(change: dict[str, object], message: str) -> None:
    good = {"length": [1.0] * 3, "near": [0.5, 0, 0], "base_radius": G, "platform_radius": H}
    with pytest.raises(InputError, match=message):
        forward_kinematics(**(good | change))  # type: ignore[arg-type]


def test_pose_in_which_a_leg_vanishes_is_refused() -> None:
    with pytest.raises(UnreachableError, match="length"):
        forward_kinematics([0.2] * 3, [0.0, 0.0, 0.0], 0.3, 0.3)
