"""Straight motions between poses, for a duration or within limits of each coordinate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import InputError
from rps_pin.trajectories import (
    LineCurve,
    QuinticLaw,
    SCurveLaw,
    TimedCurve,
    TrapezoidalLaw,
    point_to_point,
)
from tests.each import each
from tests.trajectories.differences import difference
from tests.trajectories.law_checks import inside, peaks, uncertainty

Array = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
PROFILES: dict[Any, Any] = {
    "quintic": QuinticLaw,
    "trapezoidal": TrapezoidalLaw,
    "s-curve": SCurveLaw,
}
NAMES = st.sampled_from(sorted(PROFILES))
START, END = np.array([0.20, 0.1, -0.05]), np.array([0.23, -0.1, -0.05])


def ends(seed: int) -> tuple[Array, Array, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3), rng


@given(SEEDS, NAMES, st.floats(1e-2, 1e2))
def test_it_goes_straight_from_rest_to_rest(seed: int, profile: Any, duration: float) -> None:
    start, end, rng = ends(seed)
    path = point_to_point(start, end, profile=profile, duration=duration)
    assert isinstance(path, TimedCurve)
    assert path.duration == pytest.approx(duration, rel=1e-14)
    found = path.sample([0.0, path.duration])
    np.testing.assert_allclose(found.pose, [start, end], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.rate, 0, atol=1e-14 / duration)
    poses = path.sample(rng.uniform(0, path.duration, (4, 5))).pose
    assert poses.shape == (4, 5, 3)
    way = end - start
    along = (poses - start) @ way / (way @ way)
    assert ((along >= 0) & (along <= 1 + 1e-15)).all()
    np.testing.assert_allclose(poses, start + along[..., None] * way, rtol=0, atol=1e-15)


@given(SEEDS, NAMES)
def test_rate_and_acceleration_are_the_derivatives(seed: int, profile: Any) -> None:
    start, end, _ = ends(seed)
    path = point_to_point(start, end, profile=profile, duration=1.0)
    t, step = inside(path.law)  # type: ignore[arg-type]
    found = path.sample(t)
    rate = difference(lambda x: path.sample(x).pose, t, step)
    acceleration = difference(lambda x: path.sample(x).rate, t, step)
    np.testing.assert_allclose(found.rate, rate, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, acceleration, rtol=0, atol=1e-11)


@given(SEEDS, NAMES)
def test_limits_of_each_coordinate_are_kept_and_one_is_reached(seed: int, profile: Any) -> None:
    start, end, rng = ends(seed)
    limits: dict[str, Any] = {
        "max_rate": 10 ** rng.uniform(-2, 1, 3),
        "max_acceleration": 10 ** rng.uniform(-2, 1, 3),
        "max_jerk": 10 ** rng.uniform(-2, 2, 3),
    }
    if profile == "trapezoidal":
        del limits["max_jerk"]
    path = point_to_point(start, end, profile=profile, **limits)
    assert type(path.law) is PROFILES[profile]
    top = peaks(path.law)
    way = np.abs(end - start)
    used = [(way * one / limit).max() for one, limit in zip(top, limits.values(), strict=False)]
    uncertain = uncertainty(path.law)  # type: ignore[arg-type]
    assert max(used) == pytest.approx(1.0, rel=uncertain)


def test_limits_of_one_coordinate_rule_and_those_of_still_ones_do_not() -> None:
    """tilt_y does not move; z moves 0.03, tilt_x 0.2."""
    z = point_to_point(START, END, max_rate=[0.01, np.inf, 1e-9])
    assert z.duration == pytest.approx(15 / 8 * 0.03 / 0.01)
    tilt = point_to_point(START, END, max_rate=[0.01, 0.01, 1e-9])
    assert tilt.duration == pytest.approx(15 / 8 * 0.2 / 0.01)
    hardly = point_to_point([0.2, 0, 0], [0.2, 0.1, 1e-320], max_rate=[1, 1, 1])
    assert hardly.duration == pytest.approx(15 / 8 * 0.1)
    for_all = point_to_point(START, END, max_rate=0.01)
    assert for_all.duration == tilt.duration
    with pytest.raises(InputError, match="neither is given"):
        point_to_point(START, END, max_rate=[np.inf, np.inf, 1.0])


def test_profile_is_quintic_if_left_out() -> None:
    assert isinstance(point_to_point(START, END, duration=1.0).law, QuinticLaw)


def test_the_curve_is_the_line_and_keeps_its_own_read_only_poses() -> None:
    start = START.copy()
    curve = point_to_point(start, END, duration=1.0).curve
    start[:] = 9
    assert isinstance(curve, LineCurve)
    np.testing.assert_array_equal(curve.start, START)
    for pose in (curve.start, curve.end):
        with pytest.raises(ValueError, match="read-only"):
            pose[0] = 1
    found = curve.at([[0.0, 0.25, 1.0]])
    expected = [[START, 0.75 * START + 0.25 * END, END]]
    np.testing.assert_allclose(found.pose, expected, rtol=1e-15, atol=1e-17)
    np.testing.assert_array_equal(found.first, np.tile(END - START, (1, 3, 1)))
    np.testing.assert_array_equal(found.second, np.zeros((1, 3, 3)))


@pytest.mark.parametrize("bad", [-1e-6, 1.001, np.nan, "a"])
def test_parameters_outside_the_line_are_refused(bad: Any) -> None:
    with pytest.raises(InputError, match=r"parameters of a curve|outside the curve"):
        LineCurve(START, END).at(bad)


def test_repr_tells_the_ends_and_the_law() -> None:
    path = point_to_point([0.2, 0, 0], [0.3, 0, 0.1], duration=2.0)
    assert repr(path) == (
        "TimedCurve(LineCurve([0.2, 0.0, 0.0], [0.3, 0.0, 0.1]), "
        "QuinticLaw(distance=1, duration=2))"
    )


@each(
    ("change", "message"),
    [
        ({"end": START}, "start and end are the same pose"),
        ({"start": [0.2, 0.1]}, r"end has shape \(3,\); it must be \(2,\)"),
        ({"start": [[0.2, 0.1]]}, r"start has shape \(1, 2\)"),
        ({"end": [0.2, np.nan, 0.1]}, "end is not finite"),
        ({"end": [START, END]}, "end has shape"),
        ({"profile": "cubic"}, "must be 'quintic' or 'trapezoidal' or 's-curve'"),
        ({"duration": None}, "give a duration, or limits .*: neither is given"),
        ({"max_rate": 1.0}, "give a duration, or limits .*: both are given"),
        ({"duration": 0.0}, "duration = 0.0"),
        ({"duration": -1.0}, "duration = -1.0"),
        ({"duration": np.nan}, "duration = nan"),
        ({"duration": None, "max_rate": [1.0, 0.0, 1.0]}, "max_rate = .*: it must be positive"),
        ({"duration": None, "max_rate": -1.0}, "max_rate = -1.0: it must be positive"),
        ({"duration": None, "max_acceleration": [1.0, np.nan, 1.0]}, "max_acceleration = "),
        ({"duration": None, "max_jerk": [1.0, 2.0]}, "max_jerk = .*: it must be a number, or thr"),
        ({"duration": None, "max_rate": "1.0"}, "max_rate = '1.0': it must be a number, or thr"),
        ({"duration": None, "max_rate": True}, "max_rate = True"),
        ({"duration": None, "max_rate": [1.0, [2.0], 3.0]}, "max_rate = "),
        ({"duration": None, "max_rate": [1.0]}, "max_rate = .*: it must be a number, or three"),
        ({"profile": ["quintic"]}, "must be 'quintic' or 'trapezoidal' or 's-curve'"),
        ({"duration": None, "max_jerk": "much"}, "max_jerk = 'much'"),
        ({"duration": None, "max_jerk": np.ones((2, 3))}, "max_jerk = "),
        ({"duration": None, "max_rate": 1.0, "profile": "s-curve"}, "needs a limit of jerk"),
        (
            {"duration": None, "max_rate": 1.0, "profile": "trapezoidal"},
            "needs a limit of acceleration",
        ),
        (
            {"duration": None, "max_jerk": 1.0, "profile": "trapezoidal"},
            "trapezoidal speed cannot limit the jerk",
        ),
    ],
)
def test_what_makes_no_motion_is_refused(change: dict[str, Any], message: str) -> None:
    arguments = {"start": START, "end": END, "duration": 1.0} | change
    with pytest.raises(InputError, match=message):
        point_to_point(arguments.pop("start"), arguments.pop("end"), **arguments)


def test_a_limit_of_acceleration_alone_makes_a_triangle_of_speed() -> None:
    """0.2 rad at 1 rad/s^2 and no limit of speed: 2 sqrt(D / a)."""
    path = point_to_point(START, END, profile="trapezoidal", max_acceleration=1.0)
    assert path.duration == pytest.approx(2 * math.sqrt(0.2))
