"""Motions with orientation: SO(3) by its axioms, derivatives by differences, turns of any size."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rps_pin import InputError
from rps_pin.closed_loop.constraints.rotation_vector import rate_matrix, vector_rates
from rps_pin.trajectories import RotationCurve, pose_path
from tests.trajectories.differences import difference
from tests.worst import worst

RNG = np.random.default_rng(3)
POSITIONS = RNG.normal(size=(5, 3)) * 0.1
VECTORS = np.cumsum(RNG.normal(size=(5, 3)) * 0.6, axis=0)


def unskew(matrix: Any) -> Any:
    return np.stack([matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0]], axis=-1)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_angular_velocity_and_acceleration_are_the_derivatives(count: int) -> None:
    knots = np.cumsum([0.0, 0.7, 1.1, 0.4, 0.9])[:count]
    curve = RotationCurve(VECTORS[:count], knots)
    u = np.concatenate([np.linspace(a + 0.05, b - 0.05, 9) for a, b in pairwise(knots)])
    found = curve.at(u)
    slope = difference(lambda x: curve.at(x).rotation, u, 1e-3)
    turning = slope @ np.swapaxes(found.rotation, -1, -2)
    assert worst(turning + np.swapaxes(turning, -1, -2)) < 1e-10
    assert worst(unskew(turning) - found.velocity) < 1e-9
    change = difference(lambda x: curve.at(x).velocity, u, 1e-3)
    assert worst(change - found.acceleration) < 1e-8
    assert (
        worst(curve.at(knots).rotation - Rotation.from_rotvec(VECTORS[:count]).as_matrix()) < 1e-13
    )
    for each in knots[1:-1]:  # continuous, with two derivatives, as far as SciPy solves for them
        before, after = curve.at(each - 1e-9), curve.at(each + 1e-9)
        assert worst(before.velocity - after.velocity) < 1e-7
        assert worst(before.acceleration - after.acceleration) < 1e-6


def test_between_two_rotations_the_axis_stands_still_and_the_rate_is_constant() -> None:
    """A frame elsewhere sees the same curve, turned."""
    curve = RotationCurve(VECTORS[:2], [0, 2.0])
    found = curve.at(np.linspace(0, 2, 7))
    first, last = Rotation.from_rotvec(VECTORS[:2])
    assert worst(found.velocity - (last * first.inv()).as_rotvec() / 2) < 1e-13
    assert worst(found.acceleration) < 1e-12
    by = Rotation.from_rotvec([0.3, -1.0, 2.0])
    elsewhere = RotationCurve((by * Rotation.from_rotvec(VECTORS)).as_matrix(), np.arange(5.0))
    here = RotationCurve(VECTORS, np.arange(5.0))
    u = np.linspace(0, 4, 33)
    assert worst(elsewhere.at(u).rotation - by.as_matrix() @ here.at(u).rotation) < 1e-12


@pytest.mark.parametrize("angle", [0.5, 3.0, 6.0, 20.0])
def test_turns_of_any_size_are_turns_about_one_axis(angle: float) -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3
    curve = RotationCurve.turning(VECTORS[0], [angle * axis], [0, 1.5])
    u = np.linspace(0, 1.5, 40)
    wanted = Rotation.from_rotvec(np.outer(u / 1.5 * angle, axis)) * Rotation.from_rotvec(
        VECTORS[0]
    )
    found = curve.at(u)
    assert worst(found.rotation - wanted.as_matrix()) < 1e-12
    assert worst(found.velocity - angle / 1.5 * axis) < 1e-11
    assert worst(found.acceleration) < 1e-9


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0, 3.0, 3.3, 6.0])
def test_rates_of_rotation_vectors_of_any_size(size: float) -> None:
    """r(t) = r + d t + e t^2 / 2 is given; w by differences of exp(r), then back to d and e."""
    r, d, e = RNG.normal(size=(3, 3))
    r *= size / np.linalg.norm(r)

    def turned(t: Any) -> Any:
        t = np.asarray(t)[..., None]
        return Rotation.from_rotvec((r + d * t + e * t * t / 2).reshape(-1, 3)).as_matrix()

    def velocity(t: Any) -> Any:
        return unskew(difference(turned, t, 1e-2) @ np.swapaxes(turned(t), -1, -2))

    zero = np.zeros(1)
    w, dw = velocity(zero), difference(velocity, zero, 1e-2)
    rate, acceleration = vector_rates(r[None], w, dw)
    assert worst(rate - d) < 1e-8
    assert worst(acceleration - e) < 1e-5
    assert worst(vector_rates(r[None], w, dw)[0][0] - rate_matrix(r) @ w[0]) < 1e-12


@pytest.mark.parametrize("profile", ["quintic", "s-curve"])
def test_a_pose_path_has_exact_derivatives_in_rotation_vectors(profile: Any) -> None:
    path = pose_path(POSITIONS, VECTORS, duration=2.0, profile=profile)
    t = np.linspace(0.1, 1.9, 50)
    found = path.sample(t)
    assert found.pose.shape == (50, 6)
    away = np.abs(path.law.at(t).u[:, None] - path.curve._rotations._knots).min(axis=-1) > 0.01
    near = {"quintic": 0.0, "s-curve": 0.02}[profile]
    pieces = np.array([0.25, 0.5, 1.5, 1.75])  # where the jerk of the law jumps
    away &= np.abs(t[:, None] - pieces).min(axis=-1) > near
    assert away.sum() > 20
    rate = difference(lambda x: path.sample(x).pose, t, 1e-3)
    acceleration = difference(lambda x: path.sample(x).rate, t, 1e-3)
    assert worst((found.rate - rate)[away]) < 1e-8
    assert worst((found.acceleration - acceleration)[away]) < 1e-6
    ends = path.sample([0.0, 2.0])
    assert worst(ends.rate, ends.acceleration) < 1e-12
    assert worst(ends.pose[0] - np.r_[POSITIONS[0], VECTORS[0]]) < 1e-14
    motion = path.motion(t)
    assert worst(Rotation.from_rotvec(found.pose[:, 3:]).as_matrix() - motion.rotation) < 1e-13
    turning = difference(lambda x: path.motion(x).rotation, t, 1e-3)
    w = unskew(turning @ np.swapaxes(motion.rotation, -1, -2))
    assert worst((w - motion.angular_velocity)[away]) < 1e-7
    dw = difference(lambda x: path.motion(x).angular_velocity, t, 1e-3)
    assert worst((dw - motion.angular_acceleration)[away]) < 1e-6
    some = pose_path(POSITIONS, VECTORS, ["ry", "z"], duration=2.0, profile=profile).sample(t)
    assert worst(some.rate - found.rate[:, [4, 2]]) == 0


def test_rotation_vectors_go_on_beyond_half_a_turn() -> None:
    """From -170 to +170 degrees about z the short way, and from 0 by 340 degrees."""
    still = np.zeros((2, 3))
    angle = np.radians(170)
    path = pose_path(still, [[0, 0, -angle], [0, 0, angle]], ["rz"], duration=1.0)
    end = path.sample(1.0).pose
    assert worst(end - np.array([angle - 2 * np.pi])) < 1e-12
    r = path.sample(np.linspace(0, 1, 101)).pose[:, 0]
    assert (np.diff(r) < 0).all()
    turned = pose_path(still, [0, 0, 0], duration=1.0, turns=[[0, 0, 2 * angle]])
    r = turned.sample(np.linspace(0, 1, 101)).pose[:, 5]
    assert (np.diff(r) > 0).all()
    assert r[-1] == pytest.approx(2 * angle, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rotations": [[0, 0, 0], [np.pi, 0, 0]]}, "rotations 0 and 1 are 3.142 rad apart"),
        ({"rotations": np.zeros((2, 3))}, "poses 0 and 1 are the same"),
        ({"rotations": np.zeros((3, 3))}, "3 rotations for 2 positions"),
        ({"rotations": [2 * np.eye(3), np.eye(3)]}, "matrix 0 is no rotation"),
        ({"rotations": [-np.eye(3), np.eye(3)]}, "matrix 0 is no rotation"),
        ({"rotations": [[0, 0, 0], [np.nan, 0, 0]]}, "rotations is not finite"),
        ({"rotations": [0, 0, 1]}, r"rotations has shape \(3,\)"),
        ({"positions": np.zeros((1, 3))}, "two or more are needed"),
        ({"positions": np.zeros((2, 2))}, r"positions has shape \(2, 2\)"),
        ({"coordinates": ["x", "yaw"]}, "coordinates = .*: they are some of x, y, z, rx, ry, rz"),
        ({"rotations": [0, 0, 0], "turns": [[0, 0, 7]]}, "grows to 6.2.* rad at .*%; .*|grows"),
        ({"rotations": [0, 0, 0], "turns": [[0, 0, 1], [0, 0, 1]]}, "for 2 positions"),
        ({"duration": 0.0}, "duration"),
    ],
)
def test_what_is_no_motion_is_refused(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {
        "positions": np.zeros((2, 3)), "rotations": [[0, 0, 0], [1, 0, 0]], "duration": 1.0,
    }  # fmt: skip
    with pytest.raises(InputError, match=message):
        pose_path(**(given | change))


def test_a_whole_turn_is_no_matter_where_no_rotation_vector_is_asked_for() -> None:
    path = pose_path(POSITIONS[:2], [0, 0, 0], ["x", "y"], turns=[[0, 0, 30.0]], duration=1.0)
    assert path.sample(0.5).pose.shape == (2,)
