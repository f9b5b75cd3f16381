"""Trajectories that cannot be followed are refused: when, why, and by how much."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq, minimize_scalar

from rps_pin import RPSRobot, SingularityError, UnreachableError, helix
from rps_pin.rps.singularity.path_refusal import require_clear
from rps_pin.trajectories import circle, point_to_point


def told_time(error: Exception) -> float:
    """Return the time that a message begins with, s."""
    return float(str(error).removeprefix("at t = ").split(" s", 1)[0])


@pytest.fixture(scope="module")
def micro() -> RPSRobot:
    return RPSRobot.from_preset("micro")


def test_a_clear_trajectory_passes_with_what_was_found(micro: RPSRobot) -> None:
    found = require_clear(micro, circle(height=0.223, tilt=0.1, duration=2.0))
    assert found.ok
    assert found.minimum_distance > 0.5


def test_when_and_by_how_much_a_limit_is_left(micro: RPSRobot) -> None:
    """Held against the leg lengths of the trajectory itself, by root finding and maximisation."""
    path = circle(height=0.227, tilt=0.2, duration=2.0)

    def excess(time: float) -> float:
        """Of the longest leg beyond 0.25 m."""
        pose = path.sample(time).pose
        length: float = micro.inverse_kinematics(pose, errors="mask").length.max()
        return length - 0.25

    times = np.linspace(0, 2, 2001)
    outside = np.array([excess(time) > 0 for time in times])
    first = int(np.argmax(outside))
    assert first > 0
    leaves = brentq(excess, times[first - 1], times[first], xtol=1e-12)
    with pytest.raises(UnreachableError, match="limits are left") as caught:
        require_clear(micro, path)
    assert_allclose(told_time(caught.value), leaves, atol=1e-5)  # six digits are printed
    (violation,) = [v for v in caught.value.violations if v.quantity == "length"][:1]
    assert violation.upper == 0.25
    leg = violation.leg - 1
    back = times[first + int(np.argmin(outside[first:]))]
    worst = minimize_scalar(
        lambda t: -micro.inverse_kinematics(path.sample(t).pose, errors="mask").length[leg],
        bounds=(leaves, back),
        method="bounded",
    )
    assert_allclose(violation.value, -worst.fun, atol=1e-5)  # a hundred looks
    assert f"leg {violation.leg}: length would be" in str(caught.value)


def test_a_start_outside_is_refused_at_zero(micro: RPSRobot) -> None:
    path = point_to_point([0.26, 0, 0], [0.23, 0, 0], duration=1.0)
    with pytest.raises(UnreachableError) as caught:
        require_clear(micro, path)
    assert told_time(caught.value) == 0.0
    assert {v.leg for v in caught.value.violations} == {1, 2, 3}
    assert_allclose([v.value for v in caught.value.violations], 0.26)


def test_every_crossing_of_a_singularity_is_told() -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=75e-3, pitch=50e-3, height=0.4)
    with pytest.raises(SingularityError, match=r"crosses a type II singularity.*again at") as err:
        require_clear(robot, path)
    assert_allclose(told_time(err.value), 4.0752, atol=1e-4)
    assert err.value.condition == math.inf


def test_falling_through_the_base_is_a_crossing() -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = point_to_point([0.3, 0, 0], [-0.3, 0, 0], profile="trapezoidal", duration=2.0)
    with pytest.raises(SingularityError, match="crosses a type II") as caught:
        require_clear(robot, path)
    assert_allclose(told_time(caught.value), 1.0, atol=1e-8)


def test_lying_flat_is_staying_in_a_singularity() -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.0, pitch=0.0, height=0.0)
    with pytest.raises(SingularityError, match=r"stays for 5\.23884 s in a type II"):
        require_clear(robot, path)
