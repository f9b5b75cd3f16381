"""Splines through poses: at given times, and along chords.

A quintic spline is what pieces of fifth degree are, that have the values, rates and accelerations
sampled at the knots, and whose third and fourth derivatives do not jump: SciPy's Hermite pieces
show both. Likewise for the cubic one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicHermiteSpline

from rps_pin import InputError
from rps_pin.trajectories import (
    ChordSpline,
    QuinticLaw,
    SCurveLaw,
    TimedCurve,
    TimedSpline,
    TrapezoidalLaw,
    spline,
)
from tests.each import each
from tests.trajectories.differences import difference

Array = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
POSES = np.array([[0.20, 0.0, 0.0], [0.22, 0.1, 0.0], [0.22, 0.1, 0.15], [0.21, -0.1, 0.05]])


def random_points(seed: int) -> tuple[Array, Array]:
    """Times with steps of 0.3 to 1, beginning anywhere, and poses."""
    rng = np.random.default_rng(seed)
    count = rng.integers(2, 12)
    return rng.uniform(-5, 5) + np.cumsum(rng.uniform(0.3, 1, count)), rng.uniform(
        -0.3, 0.3, (count, 3)
    )


def between(knots: Array, seed: int) -> tuple[Array, Array]:
    """Parameters within the pieces, and steps of which three stay within."""
    h = np.diff(knots)
    fraction = np.random.default_rng(seed).uniform(0.31, 0.69, (6, len(h)))
    return knots[:-1] + fraction * h, np.broadcast_to(h / 10, fraction.shape)


# At given times -----------------------------------------------------------------------------------


@given(SEEDS)
def test_poses_are_met_at_their_times_and_ends_are_at_rest(seed: int) -> None:
    times, poses = random_points(seed)
    path = spline(poses, times)
    assert isinstance(path, TimedSpline)
    assert path.duration == pytest.approx(times[-1] - times[0], rel=1e-15)
    found = path.sample(times - times[0])
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.rate[[0, -1]], 0, atol=1e-13)
    np.testing.assert_allclose(found.acceleration[[0, -1]], 0, atol=1e-12)


@given(SEEDS)
def test_it_is_of_fifth_degree_with_four_continuous_derivatives(seed: int) -> None:
    path = TimedSpline(*random_points(seed))
    knots = path.times
    x = path.sample(knots)
    pieces = BPoly.from_derivatives(knots, np.stack(x, axis=1))
    t, _ = between(knots, seed)
    found = path.sample(t)
    for order, one in enumerate(found):
        np.testing.assert_allclose(one, pieces(t, order), rtol=0, atol=1e-10)
    for order in (3, 4):
        derivative = pieces.derivative(order)
        if len(knots) > 2:
            before, after = derivative(knots[1:-1] * (1 - 1e-14)), derivative(knots[1:-1])
            scale = np.abs(derivative(np.linspace(0, path.duration, 300))).max()
            np.testing.assert_allclose(before, after, rtol=0, atol=1e-8 * scale)


@given(SEEDS)
def test_rate_and_acceleration_are_the_derivatives(seed: int) -> None:
    path = TimedSpline(*random_points(seed))
    t, step = between(path.times, seed)
    found = path.sample(t)
    rate = difference(lambda x: path.sample(x).pose, t, step)
    acceleration = difference(lambda x: path.sample(x).rate, t, step)
    np.testing.assert_allclose(found.rate, rate, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.acceleration, acceleration, rtol=0, atol=1e-10)


def test_through_two_poses_it_is_the_quintic_law() -> None:
    path = TimedSpline([1.0, 4.0], POSES[:2])
    t = np.linspace(0, 3, 60)
    way = POSES[1] - POSES[0]
    found, (u, du, ddu) = path.sample(t), QuinticLaw(1.0, 3.0).at(t)
    np.testing.assert_allclose(found.pose, POSES[0] + u[:, None] * way, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.rate, du[:, None] * way, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.acceleration, ddu[:, None] * way, rtol=0, atol=1e-15)


@given(SEEDS)
def test_poses_that_are_all_the_same_are_stood_at(seed: int) -> None:
    times, poses = random_points(seed)
    path = TimedSpline(times, np.tile(poses[0], (len(times), 1)))
    found = path.sample(np.linspace(0, path.duration, 50))
    np.testing.assert_allclose(found.pose, np.tile(poses[0], (50, 1)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.rate, 0, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, 0, atol=1e-11)


@given(SEEDS)
def test_backwards_through_the_poses_it_is_the_same_backwards(seed: int) -> None:
    times, poses = random_points(seed)
    forth, back = TimedSpline(times, poses), TimedSpline(-times[::-1], poses[::-1])
    t = np.linspace(0, forth.duration, 50)
    one, other = forth.sample(t), back.sample(forth.duration - t)
    for sign, a, b in zip((1, -1, 1), one, other, strict=True):
        np.testing.assert_allclose(a, sign * b, rtol=0, atol=1e-11)


def test_steps_as_unequal_as_1_to_1000_are_met() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        times = np.cumsum(10 ** rng.uniform(-3, 0, 12))
        poses = rng.uniform(-0.3, 0.3, (12, 3))
        path = TimedSpline(times, poses)
        np.testing.assert_allclose(path.sample(path.times).pose, poses, rtol=0, atol=1e-10)


@pytest.mark.parametrize("step", [1e-12, 1e-60, 1e-300])
def test_steps_too_unequal_for_rounding_are_refused(step: float) -> None:
    with pytest.raises(InputError, match=r"times: steps of .* s to 1 s are too unequal"):
        TimedSpline([0.0, step, 1.0, 2.0], POSES)


@each(
    ("times", "message"),
    [
        ([0, 1, 2], "3 times for 4 poses: one each is needed"),
        ([0, 1, 1, 2], "times must increase: 1 s, then 1 s"),
        ([0, 2, 1, 3], "times must increase: 2 s, then 1 s"),
        ([-1e30, 0, 1, 2], "times must increase: 0 s, then 1 s"),  # lost in the shift to 0
        ([0, 1, np.nan, 3], r"times is not finite: entry 2 is nan"),
        ([0, 1, 2, np.inf], "times is not finite"),
        (2.0, r"times has shape \(\)"),
        ([[0, 1, 2, 3]], "times has shape"),
        ("0123", "times = '0123'"),
    ],
)
def test_bad_times_are_refused(times: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        spline(POSES, times)


# Along chords -------------------------------------------------------------------------------------


@given(SEEDS, st.floats(0.01, 1.0))
def test_knots_are_the_chords_and_poses_are_met_there(seed: int, scale: float) -> None:
    _, poses = random_points(seed)
    curve = ChordSpline(poses, tilt_scale=scale)
    length = 0.0
    for i, (z, x, y) in enumerate(np.diff(poses, axis=0), 1):
        length += np.sqrt(z**2 + scale**2 * (x**2 + y**2))
        assert curve.knots[i] == pytest.approx(length, rel=1e-14)
    assert curve.knots[0] == 0
    assert curve.length == curve.knots[-1]
    np.testing.assert_allclose(curve.at(curve.knots).pose, poses, rtol=0, atol=1e-14)


@given(SEEDS)
def test_it_is_the_natural_cubic_spline(seed: int) -> None:
    _, poses = random_points(seed)
    curve = ChordSpline(poses)
    knots = curve.knots
    found = curve.at(knots)
    size = np.abs(found.second).max() + 1e-3 / knots[-1] ** 2
    pieces = CubicHermiteSpline(knots, found.pose, found.first)
    u, _ = between(knots, seed)
    np.testing.assert_allclose(curve.at(u).pose, pieces(u), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.second[[0, -1]], 0, atol=1e-9 * size)
    # The second derivative at both ends of each piece, from the pieces alone.
    c2, c3, h = 2 * pieces.c[1], 6 * pieces.c[0], np.diff(knots)[:, None]
    np.testing.assert_allclose(c2 + c3 * h, found.second[1:], rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(c2, found.second[:-1], rtol=0, atol=1e-8 * size)


@given(SEEDS)
def test_derivatives_of_the_curve_are_its_derivatives(seed: int) -> None:
    _, poses = random_points(seed)
    curve = ChordSpline(poses)
    u, step = between(curve.knots, seed)
    found = curve.at(u)
    first = difference(lambda x: curve.at(x).pose, u, step)
    second = difference(lambda x: curve.at(x).first, u, step)
    tolerance = 1e-13 / step[..., None]
    assert (np.abs(found.first - first) <= tolerance).all()
    size = np.abs(found.first).max()
    assert (np.abs(found.second - second) <= 10 * size * tolerance).all()


@given(SEEDS, st.integers(2, 6), st.floats(0.01, 1.0))
def test_a_straight_row_of_poses_stays_straight(seed: int, count: int, scale: float) -> None:
    """The chords make up the whole length: the curve is the line, u over the length of it."""
    rng = np.random.default_rng(seed)
    start, way = rng.uniform(-0.3, 0.3, (2, 3))
    fraction = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, count - 1))])
    curve = ChordSpline(start + fraction[:, None] * way, tilt_scale=scale)
    u = np.linspace(0, curve.length, 30)
    slope = way * fraction[-1] / curve.length
    found = curve.at(u)
    size = np.abs(slope).max()
    np.testing.assert_allclose(found.pose, start + u[:, None] * slope, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.first, np.tile(slope, (30, 1)), rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(found.second, 0, atol=1e-10 * size / curve.length)


@given(SEEDS, st.floats(1e-3, 1e3))
def test_tilt_scale_only_weighs_tilts_against_heights(seed: int, factor: float) -> None:
    """Heights alone do not feel it; of tilts alone it is the unit of u. The motion stays."""
    _, poses = random_points(seed)
    t = np.linspace(0, 2.0, 20)
    for moving in ([1, 0, 0], [0, 1, 1]):
        one, other = (
            spline(poses * moving, duration=2.0, tilt_scale=scale) for scale in (0.1, 0.1 * factor)
        )
        lengths = [path.curve.length for path in (one, other)]  # type: ignore[attr-defined]
        longer = 1.0 if moving[0] else factor
        assert lengths[1] == pytest.approx(longer * lengths[0], rel=1e-13)
        for a, b in zip(one.sample(t), other.sample(t), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * np.abs(a).max())


def test_tilt_scale_bends_a_curve_of_both() -> None:
    one, other = (ChordSpline(POSES, tilt_scale=scale) for scale in (0.1, 1.0))
    middles = [curve.at(curve.knots[:-1] + np.diff(curve.knots) / 2).pose for curve in (one, other)]
    assert np.abs(middles[0] - middles[1]).max() > 1e-3


@pytest.mark.parametrize(
    ("profile", "kind"),
    [("quintic", QuinticLaw), ("trapezoidal", TrapezoidalLaw), ("s-curve", SCurveLaw)],
)
def test_a_law_of_time_runs_along_it_from_rest_to_rest(profile: Any, kind: type) -> None:
    path = spline(POSES, duration=2.0, profile=profile)
    assert isinstance(path, TimedCurve)
    assert isinstance(path.curve, ChordSpline)
    assert type(path.law) is kind
    assert path.duration == 2.0
    found = path.sample([0.0, 2.0])
    np.testing.assert_allclose(found.pose, POSES[[0, -1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.rate, 0, atol=1e-14)


def test_profile_and_tilt_scale_if_left_out_are_those_documented() -> None:
    path = spline(POSES, duration=2.0)
    assert isinstance(path, TimedCurve)
    assert isinstance(path.law, SCurveLaw)
    assert path.curve.length == ChordSpline(POSES, tilt_scale=0.1).length
    other = spline(POSES, duration=2.0, tilt_scale=0.2)
    assert isinstance(other, TimedCurve)
    assert other.curve.length > path.curve.length


@each(
    ("change", "message"),
    [
        ({"poses": POSES[[0, 1, 1, 2]]}, "poses 1 and 2 are the same: the chord has no length"),
        ({"poses": [[0, 0, 0], [1, 0, 0], [1, 1e-200, 0]]}, "poses 1 and 2 are the same"),
        ({"poses": [[0, 0, 0], [1, 0, 0], [1, 1e-20, 0]]}, "poses 1 and 2 are the same"),
        ({"poses": POSES[:1]}, r"poses has shape \(1, 3\)"),
        ({"poses": POSES[:, 0]}, r"poses has shape \(4,\)"),
        ({"scale": [1.0, 1.0]}, r"scale has shape \(2,\); it must be \(3,\)"),
        ({"scale": [1.0, 0.0, 1.0]}, "scale = .*: it must be positive"),
        ({"poses": [[0.2, 0, 0], [0.2, np.nan, 0]]}, "poses is not finite"),
        ({"tilt_scale": 0.0}, "tilt_scale = 0.0"),
        ({"tilt_scale": np.nan}, "tilt_scale = nan"),
        ({"profile": "cubic"}, "must be 'quintic' or 'trapezoidal' or 's-curve'"),
        ({"duration": -1.0}, "duration = -1.0"),
        ({"duration": None}, "give the poses' times, or a duration .*: neither is given"),
        ({"times": [0, 1, 2, 3]}, "give the poses' times, or a duration .*: both are given"),
    ],
)
def test_what_makes_no_spline_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        spline(**({"poses": POSES, "duration": 2.0} | change))


# Both ---------------------------------------------------------------------------------------------


def test_given_arrays_are_copied_and_kept_read_only() -> None:
    times, poses = np.arange(4.0), POSES.copy()
    timed, chords = TimedSpline(times, poses), ChordSpline(poses)
    before = timed.sample(1.5), chords.at(0.01)
    times[:], poses[:] = 7, 7
    for kept in (timed.times, timed.poses, chords.knots, chords.poses):
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = 1
    np.testing.assert_array_equal(timed.sample(1.5), before[0])
    np.testing.assert_array_equal(chords.at(0.01), before[1])


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_values_have_the_shape_of_the_times(shape: tuple[int, ...]) -> None:
    for path in (spline(POSES, [0, 1, 2, 3]), spline(POSES, duration=3.0)):
        assert [x.shape for x in path.sample(np.ones(shape))] == [(*shape, 3)] * 3


@pytest.mark.parametrize("bad", [-1e-3, 3.001, np.nan])
def test_times_and_parameters_outside_are_refused(bad: float) -> None:
    for path in (spline(POSES, [0, 1, 2, 3]), spline(POSES, duration=3.0)):
        with pytest.raises(InputError, match="outside the trajectory"):
            path.sample(bad)
    with pytest.raises(InputError, match="outside the curve"):
        ChordSpline(POSES).at(bad)


def test_repr_tells_how_many_poses_and_how_long() -> None:
    assert repr(spline(POSES, [0, 1, 2, 3])) == "TimedSpline(<4 samples>, duration=3)"
    text = repr(spline(POSES, duration=3.0))
    assert text.startswith("TimedCurve(ChordSpline(<4 poses>, length=0.0")
    assert "SCurveLaw" in text
