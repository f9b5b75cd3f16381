"""Curves that no law of time can make a motion of: what is refused, and with what words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from rps_pin.errors import InfeasibleError, InputError, SingularityError, UnreachableError
from rps_pin.rps import ActuatorLimits, RPSRobot
from rps_pin.rps.motion.curve_refusal import ends_at_rest
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.trajectories.curve import CurveSample
from rps_pin.trajectories.point_to_point import LineCurve

Array = NDArray[np.float64]
Shape = Callable[[Array], tuple[Array, Array, Array]]

MICRO = RPSRobot.from_preset("micro")
LIFT = LineCurve([0.215, 0, 0], [0.235, 0, 0])


@dataclass(frozen=True)
class Along:
    """A line from 0.215 m, gone along by any function of u."""

    shape: Shape
    length: float = 1.0

    def at(self, u: ArrayLike) -> CurveSample:
        way = np.array([0.02, 0.05, 0.0])
        value, first, second = (part[..., None] * way for part in self.shape(np.asarray(u)))
        return CurveSample(np.array([0.215, 0, 0]) + value, first, second)


def quintic(u: Array) -> tuple[Array, Array, Array]:
    return 10 * u**3 - 15 * u**4 + 6 * u**5, 30 * (u * (1 - u)) ** 2, 60 * u * (1 - u) * (1 - 2 * u)


def dwelling(u: Array) -> tuple[Array, Array, Array]:
    s = 2 * u - 1  # a cubic's turning point, off any grid
    return (s - 0.1234) ** 3 / 4 + 0.4, 1.5 * (s - 0.1234) ** 2, 6 * (s - 0.1234)


def smooth(u: Array) -> tuple[Array, Array, Array]:
    return u * u * (3 - 2 * u), 6 * u - 6 * u * u, 6 - 12 * u


def late(u: Array) -> tuple[Array, Array, Array]:
    return u**2, 2 * u, 2 + 0 * u


def test_where_a_curve_has_no_tangent_its_rate_is_free() -> None:
    assert ends_at_rest(MICRO, LIFT) == (True, True)
    assert ends_at_rest(MICRO, Along(smooth)) == (False, False)
    assert ends_at_rest(MICRO, Along(late)) == (False, True)


@pytest.mark.parametrize(("shape", "where"), [(quintic, "u = 0 of 1"), (dwelling, "u = 0.56")])
def test_standing_still_is_refused(shape: Shape, where: str) -> None:
    with pytest.raises(InputError, match=f"stands still at {where}.*give the curve"):
        time_optimal(MICRO, Along(shape))


def test_a_point_is_refused() -> None:
    with pytest.raises(InputError, match="nothing moves"):
        time_optimal(MICRO, Along(lambda u: (0 * u, 0 * u, 0 * u)))


def test_leaving_the_workspace_is_refused() -> None:
    with pytest.raises(UnreachableError, match=r"at u = 0\.7 of 1 .* leg 1: length") as caught:
        time_optimal(MICRO, LineCurve([0.215, 0, 0], [0.265, 0, 0]))
    assert {violation.leg for violation in caught.value.violations} == {1, 2, 3}
    assert all(violation.value > 0.25 for violation in caught.value.violations)


def test_limits_of_length_count_beside_the_robots() -> None:
    tighter = ActuatorLimits(100.0, length=(0.0, 0.225))
    with pytest.raises(UnreachableError, match=r"at u = 0\.5 of 1"):
        time_optimal(MICRO, LIFT, limits=tighter)
    with pytest.raises(InputError, match="no length is within both"):
        time_optimal(MICRO, LIFT, limits=ActuatorLimits(100.0, length=(0.0, 0.1)))


def test_a_singularity_is_refused() -> None:
    robot = RPSRobot.from_preset("sokolov")  # flat in its base, it is singular
    down = LineCurve([0.1, 0, 0], [-0.1, 0, 0])
    with pytest.raises(SingularityError, match=r"at u = 0\.5 of 1 .*type II") as caught:
        time_optimal(robot, down, limits=ActuatorLimits(100.0))
    assert math.isinf(caught.value.condition)


def test_what_cannot_be_held_is_infeasible() -> None:
    # Level on upright legs: a third of the platform and a rod on each.
    weight = (1.2 / 3 + 0.1) * 9.81
    with pytest.raises(InfeasibleError, match=r"u = .*z = .*actuator \d needs 4\.905 N") as caught:
        time_optimal(MICRO, LIFT, limits=ActuatorLimits(4.5))
    (excess,) = caught.value.violations
    assert excess.value == pytest.approx(weight, rel=1e-12)
    assert excess.limit == 4.5
    found = time_optimal(MICRO, LIFT, limits=ActuatorLimits(weight * 1.001))
    assert found.use(np.linspace(0, found.duration, 100)).most.max() <= 1 + 1e-6


def test_where_it_cannot_be_held_is_said() -> None:
    # The lower it is, the more its leaning legs must push.
    robot = RPSRobot.from_preset("sokolov")
    low, high = 0.15, 0.4
    forces = robot.actuator_forces([[low, 0, 0], [high, 0, 0]], np.zeros(3), np.zeros(3))
    limit = float(forces[:, 0].mean())
    with pytest.raises(InfeasibleError, match=rf"u = 1 of 1 \(z = {low} m.*needs") as caught:
        time_optimal(robot, LineCurve([high, 0, 0], [low, 0, 0]), limits=ActuatorLimits(limit))
    assert caught.value.violations[0].value == pytest.approx(forces[0, 0], rel=1e-9)
