"""Poses that are given: copied, read-only, and refused where they are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.trajectories.poses import checked_pose, checked_poses, finite_array, finite_number


def test_a_pose_is_a_read_only_copy() -> None:
    given = np.array([0.2, 0.1, -0.1])
    pose = checked_pose(given, "start")
    given[:] = 9
    np.testing.assert_array_equal(pose, [0.2, 0.1, -0.1])
    with pytest.raises(ValueError, match="read-only"):
        pose[0] = 1


def test_integers_become_floats() -> None:
    assert checked_pose([1, 0, 0], "start").dtype == np.float64
    assert checked_poses([[1, 0, 0], [2, 0, 0]], "poses").dtype == np.float64


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ([0.2, 0.1], r"start has shape \(2,\); a pose is \(z, tilt_x, tilt_y\)"),
        ([[0.2, 0.1, 0.0]], "start = .*: it must be an array of 1 dimension"),
        (0.2, "it must be an array of 1 dimension"),
        ([0.2, np.nan, 0.0], r"start is not finite: entry \(1,\) is nan"),
        ([0.2, 0.0, -np.inf], r"entry \(2,\) is -inf"),
        ([0.2, 0.0, 1e60], "no entry may be beyond 1e"),
        ("abc", "start = 'abc'"),
        (["0.2", "0", "0"], "start = "),
        ([0.2, [0.1], 0.0], "start = "),
        ([True, False, False], "start = "),
        ([0.2, 1j, 0], "start = "),
        (None, "start = None"),
    ],
)
def test_what_is_no_pose_is_refused(bad: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_pose(bad, "start")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ([[0.2, 0.1, 0.0]], r"poses has shape \(1, 3\); it must be \(n, 3\) with n of 2 or more"),
        ([[0.2, 0.1], [0.2, 0.0]], r"poses has shape \(2, 2\)"),
        ([0.2, 0.1, 0.0], "it must be an array of 2 dimension"),
        ([[0.2, 0.1, 0.0], [0.2, 0.1]], "poses = "),
        ([[0.2, 0.1, 0.0], [np.nan, 0.1, 0.0]], r"entry \(1, 0\) is nan"),
    ],
)
def test_what_is_no_list_of_poses_is_refused(bad: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_poses(bad, "poses")


def test_the_largest_number_is_still_taken() -> None:
    np.testing.assert_array_equal(finite_array([1e50, -1e50], 1, "x"), [1e50, -1e50])
    assert finite_number(-1e50, "x") == -1e50


def test_a_finite_number_becomes_a_float() -> None:
    for given in (3, np.int64(3), np.float32(3)):
        found = finite_number(given, "x")
        assert type(found) is float
        assert found == 3


@pytest.mark.parametrize(
    "bad", [np.nan, -np.inf, 1e51, pytest.param(-(10**400), id="huge"), True, "1", None, [1.0], 1j]
)
def test_what_is_no_finite_number_is_refused(bad: Any) -> None:
    with pytest.raises(InputError, match=r"height = .*: it must be a finite number of metres"):
        finite_number(bad, "height", "metres")
