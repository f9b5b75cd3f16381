"""Times, parameters, poses and ends of trajectories."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import InputError, RPSRobot, helix
from rps_pin.trajectories import SampledPath, circle, spline
from rps_pin.trajectories.path import (
    PathSample,
    checked_parameters,
    checked_poses,
    checked_times,
    end_states,
)


def test_times_within_the_trajectory_pass_unchanged() -> None:
    times = np.linspace(0, 2, 7).reshape(7, 1)
    np.testing.assert_array_equal(checked_times(times, 2.0), times)


def test_integers_and_single_numbers_are_times() -> None:
    assert checked_times(1, 2.0) == 1.0
    assert checked_times(1, 2.0).dtype == np.float64


def test_rounding_beyond_the_ends_is_forgiven() -> None:
    """Such as np.arange's last time; the answer still lies within."""
    found = checked_times([-1e-15, 2 + 4e-16], 2.0)
    np.testing.assert_array_equal(found, [0.0, 2.0])


@pytest.mark.parametrize("bad", [-1e-6, 2 + 1e-6, np.nan, np.inf, -np.inf])
def test_other_times_are_refused_with_the_range(bad: float) -> None:
    with pytest.raises(InputError, match=f"time {bad:.9g} s is outside .* 0 to 2 s"):
        checked_times([[1.0, bad]], 2.0)


@pytest.mark.parametrize("bad", ["soon", "1.0", True, 1j, None, [[1, 2], [3]]])
def test_things_that_are_no_times_are_refused(bad: object) -> None:
    with pytest.raises(InputError, match=r"times = .*: it must be numbers, in seconds"):
        checked_times(bad, 2.0)


def test_rounding_is_of_the_duration() -> None:
    """A microsecond's trajectory has no picosecond to spare."""
    with pytest.raises(InputError, match="outside"):
        checked_times(1e-6 + 1e-13, 1e-6)


def test_parameters_within_the_curve_pass_and_rounding_is_forgiven() -> None:
    within = np.linspace(0, 7, 6).reshape(2, 3)
    np.testing.assert_array_equal(checked_parameters(within, 7.0), within)
    np.testing.assert_array_equal(checked_parameters([-1e-15, 7 + 2e-15], 7.0), [0.0, 7.0])


@pytest.mark.parametrize("bad", [-1e-6, 7 + 1e-6, np.nan, np.inf])
def test_other_parameters_are_refused_with_the_range(bad: float) -> None:
    with pytest.raises(InputError, match=f"u = {bad:.9g} is outside the curve, .* 0 to 7"):
        checked_parameters([1.0, bad], 7.0)


@pytest.mark.parametrize("bad", ["far", "1.0", False, [[1, 2], [3]]])
def test_things_that_are_no_parameters_are_refused(bad: object) -> None:
    with pytest.raises(InputError, match=r"parameters of a curve = .*: it must be numbers"):
        checked_parameters(bad, 7.0)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ([[0.2, 0.1, 0.0]], r"poses has shape \(1, 3\); two poses or more are needed"),
        (
            [[[0.2, 0.1]]],
            r"poses has shape \(1, 1, 2\); it must be \(n, m\): coordinates, as z, ti",
        ),
        ([[], []], r"poses has shape \(2, 0\); poses have a coordinate or more"),
        ([0.2, 0.1, 0.0], r"poses has shape \(3,\)"),
        ([[0.2, 0.1, 0.0], [0.2, 0.1]], "poses = .*: it must be numbers"),
        ([[0.2, 0.1, 0.0], [np.nan, 0.1, 0.0]], r"entry \(1, 0\) is nan"),
    ],
)
def test_values_that_are_not_poses_are_refused(bad: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_poses(bad, "poses")


class Pushed:
    """Starts with a rate of 1 and ends at rest."""

    duration = 2.0

    def sample(self, t: np.ndarray | list[float]) -> PathSample:
        left = 2.0 - np.asarray(t)[..., None] * np.ones(3)
        return PathSample(-(left**2) / 4, left / 2, -np.ones_like(left) / 2)


def test_how_trajectories_start_and_end() -> None:
    robot = RPSRobot.from_preset("sokolov")
    rest = ("at rest", "at rest")
    poses = np.random.default_rng(0).normal(size=(7, 3))
    assert end_states(helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)) == rest
    assert end_states(circle(height=0.2, tilt=0.1, duration=1.0, profile="trapezoidal")) == rest
    assert end_states(spline(poses, duration=2.0)) == rest
    assert end_states(spline(poses, np.arange(7))) == rest
    assert end_states(Pushed()) == ("moving", "at rest")
    fitted = "with the rate of the fitted spline"
    assert end_states(SampledPath(np.arange(7), poses, ends="free")) == (fitted, fitted)
