"""Circles and Lissajous figures of the tilt, against their formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import InputError
from rps_pin.trajectories import HarmonicCurve, SCurveLaw, TimedCurve, circle, lissajous
from tests.each import each
from tests.trajectories.differences import difference

Array = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
NAMES = st.sampled_from(["quintic", "trapezoidal", "s-curve"])


def turning(path: TimedCurve, seed: int) -> tuple[Array, Array, Array, Array]:
    """Random times, and u with its derivatives."""
    t = np.random.default_rng(seed).uniform(0, path.duration, (5, 8))
    return (t, *path.law.at(t))


@given(SEEDS, NAMES, st.floats(0.3, 3.0), st.floats(-7, 7), st.floats(0.1, 10))
def test_circle_is_its_formula(
    seed: int, profile: Any, turns: float, start: float, duration: float
) -> None:
    """w = beta e(u), e = (cos, sin)(start + u): w' = beta u' e', w'' = beta (u'' e' - u'^2 e)."""
    path = circle(
        height=0.3, tilt=0.2, turns=turns, start=start, duration=duration, profile=profile
    )
    t, u, du, ddu = turning(path, seed)
    found = path.sample(t)
    out = np.stack([np.cos(start + u), np.sin(start + u)], axis=-1)
    along = np.stack([-np.sin(start + u), np.cos(start + u)], axis=-1)
    du, ddu = du[..., None], ddu[..., None]
    fast = 2 * np.pi * turns / duration
    np.testing.assert_allclose(found.pose[..., 1:], 0.2 * out, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.rate[..., 1:], 0.2 * du * along, rtol=0, atol=1e-14 * fast)
    np.testing.assert_allclose(
        found.acceleration[..., 1:],
        0.2 * (ddu * along - du**2 * out),
        rtol=0,
        atol=2e-13 * fast**2,
    )
    np.testing.assert_array_equal(found.pose[..., 0], 0.3)
    np.testing.assert_array_equal(found.rate[..., 0], 0)
    np.testing.assert_array_equal(found.acceleration[..., 0], 0)


@given(SEEDS, NAMES, st.integers(1, 5), st.integers(1, 5), st.integers(1, 4))
def test_lissajous_is_its_formula(seed: int, profile: Any, m: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    ax, ay, az = rng.uniform(-0.3, 0.3, 3)
    px, py = rng.uniform(-4, 4, 2)
    path = lissajous(
        height=0.3,
        amplitude=(ax, ay),
        frequency=(m, n),
        phase=(px, py),
        lift=(az, k),
        turns=1.5,
        duration=2.0,
        profile=profile,
    )
    t, u, du, ddu = turning(path, seed)
    found = path.sample(t)
    swings = ((0.3, az, k, 0.0), (0.0, ax, m, px), (0.0, ay, n, py))
    for i, (middle, size, f, phase) in enumerate(swings):
        sine, cosine = np.sin(f * u + phase), np.cos(f * u + phase)
        np.testing.assert_allclose(found.pose[..., i], middle + size * sine, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found.rate[..., i], size * f * du * cosine, rtol=0, atol=1e-12)
        np.testing.assert_allclose(
            found.acceleration[..., i],
            size * f * ddu * cosine - size * f**2 * du**2 * sine,
            rtol=0,
            atol=1e-11,
        )


@given(SEEDS)
def test_derivatives_of_the_curve_are_its_derivatives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curve = HarmonicCurve(*rng.uniform(-2, 2, (4, 3)), 5.0)
    u = rng.uniform(0.1, 4.9, 20)
    found = curve.at(u)
    first = difference(lambda x: curve.at(x).pose, u, 1e-2)
    second = difference(lambda x: curve.at(x).first, u, 1e-2)
    np.testing.assert_allclose(found.first, first, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.second, second, rtol=0, atol=1e-11)


@pytest.mark.parametrize("turns", [0.25, 1.0, 2.0])
def test_figures_start_and_end_at_rest_where_they_should(turns: float) -> None:
    around = circle(height=0.3, tilt=0.2, turns=turns, start=0.5, duration=3.0)
    eight = lissajous(height=0.3, amplitude=(0.1, 0.2), frequency=(1, 2), turns=turns, duration=3.0)
    last = 2 * np.pi * turns
    for path, expected in (
        (around, [[0.3, 0.2 * np.cos(a), 0.2 * np.sin(a)] for a in (0.5, 0.5 + last)]),
        (eight, [[0.3, 0.1 * np.sin(a), 0.2 * np.sin(2 * a)] for a in (0.0, last)]),
    ):
        assert isinstance(path.law, SCurveLaw)
        assert path.duration == 3.0
        assert path.curve.length == pytest.approx(last, rel=1e-15)
        found = path.sample([0.0, 3.0])
        np.testing.assert_allclose(found.pose, expected, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found.rate, 0, atol=1e-13)
        np.testing.assert_allclose(found.acceleration, 0, atol=1e-12)


def test_a_lissajous_figure_of_equal_swings_is_the_circle() -> None:
    """cos(u) = sin(u + pi/2)."""
    one = circle(height=0.3, tilt=0.2, duration=3.0, profile="quintic")
    other = lissajous(
        height=0.3,
        amplitude=np.array([0.2, 0.2]),  # type: ignore[arg-type]
        frequency=np.array([1, 1]),  # type: ignore[arg-type]
        phase=[np.pi / 2, 0],
        duration=3.0,
        profile="quintic",
    )
    t = np.linspace(0, 3, 50)
    for a, b in zip(one.sample(t), other.sample(t), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-14)


def test_the_height_alone_may_swing() -> None:
    path = lissajous(height=0.3, amplitude=(0, 0), frequency=(1, 1), lift=(0.01, 2), duration=1.0)
    pose = path.sample(np.linspace(0, 1, 201)).pose
    np.testing.assert_array_equal(pose[:, 1:], 0)
    assert np.ptp(pose[:, 0]) == pytest.approx(0.02, rel=1e-2)


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_samples_have_the_shape_of_the_times(shape: tuple[int, ...]) -> None:
    path = circle(height=0.3, tilt=0.2, duration=3.0)
    assert [x.shape for x in path.sample(np.ones(shape))] == [(*shape, 3)] * 3


def test_the_curve_keeps_copies() -> None:
    given_ = [np.ones(3) for _ in range(4)]
    curve = HarmonicCurve(*given_, 5.0)  # type: ignore[call-arg]
    before = curve.at(2.0)
    for array in given_:
        array[:] = 9
    np.testing.assert_array_equal(curve.at(2.0), before)


def test_repr_tells_what_it_is() -> None:
    text = repr(circle(height=0.3, tilt=0.2, duration=3.0))
    for part in ("HarmonicCurve(middle=[0.3, 0.0, 0.0]", "size=[0.0, 0.2, 0.2]", "length=6.28319",
                 "SCurveLaw(distance=6.28319, duration=3)"):  # fmt: skip
        assert part in text


def test_times_and_parameters_outside_are_refused() -> None:
    path = circle(height=0.3, tilt=0.2, duration=3.0)
    with pytest.raises(InputError, match=r"time 3\.1 s is outside"):
        path.sample(3.1)
    with pytest.raises(InputError, match=r"u = 6\.3 is outside the curve"):
        path.curve.at(6.3)


NUMBERS = [np.nan, np.inf, "wide", None, True]


@each(
    ("name", "bad"),
    [
        *(("height", bad) for bad in NUMBERS),
        *(("start", bad) for bad in NUMBERS),
        *(("tilt", bad) for bad in [*NUMBERS, 0.0, -0.1]),
        *(("turns", bad) for bad in [*NUMBERS, 0.0, -1]),
        *(("duration", bad) for bad in [np.nan, np.inf, "long", True, 0.0, -1]),
        *(("profile", bad) for bad in ["cubic", None]),
    ],
)
def test_bad_circles_are_refused_by_name(name: str, bad: Any) -> None:
    arguments: dict[str, Any] = {"height": 0.3, "tilt": 0.2, "duration": 3.0} | {name: bad}
    with pytest.raises(InputError, match=f"^{name} = "):
        circle(**arguments)


def test_a_figure_needs_a_duration() -> None:
    with pytest.raises(InputError, match="give a duration"):
        circle(height=0.3, tilt=0.2, duration=None)  # type: ignore[arg-type]


@each(
    ("change", "message"),
    [
        ({"amplitude": (0.0, 0.0)}, "amplitude and lift are zero: nothing moves"),
        ({"amplitude": 0.1}, "amplitude = 0.1: it must be two numbers"),
        ({"amplitude": np.array(0.1)}, "amplitude = .*: it must be two numbers"),
        ({"amplitude": "ab"}, "amplitude = 'ab': it must be two numbers"),
        ({"amplitude": (0.1, 0.2, 0.3)}, "it must be two numbers"),
        ({"amplitude": (0.1, np.nan)}, "amplitude = nan: it must be a finite number"),
        ({"amplitude": ([0.1, 0.2], 0.3)}, "amplitude = "),
        ({"frequency": (1, 0)}, "frequency = 0: it must be a whole number, at least 1"),
        ({"frequency": (1, 1.5)}, "frequency = 1.5"),
        ({"frequency": (1, True)}, "frequency = True"),
        ({"frequency": {1, 2}}, "frequency = .*: it must be two numbers"),
        ({"phase": (0.0, np.inf)}, "phase = inf"),
        ({"phase": None}, "phase = None"),
        ({"lift": 0.01}, "lift = 0.01: it must be two numbers"),
        ({"lift": (np.nan, 1)}, "lift's amplitude = nan"),
        ({"lift": (0.01, 0.5)}, "lift's frequency = 0.5"),
        ({"turns": -1.0}, "turns = -1.0"),
        ({"height": np.nan}, "height = nan"),
        ({"duration": 0.0}, "duration = 0.0"),
        ({"profile": "cubic"}, "must be 'quintic' or 'trapezoidal' or 's-curve'"),
    ],
)
def test_bad_figures_are_refused(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {
        "height": 0.3,
        "amplitude": (0.1, 0.2),
        "frequency": (1, 2),
        "duration": 3.0,
    }
    with pytest.raises(InputError, match=message):
        lissajous(**(arguments | change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"middle": [1.0, 2.0]}, r"size has shape \(3,\); it must be \(2,\)"),
        ({"size": [1.0, np.nan, 1.0]}, "size is not finite"),
        ({"frequency": "abc"}, "frequency = 'abc'"),
        ({"phase": 1.0}, r"phase has shape \(\)"),
        ({"length": 0.0}, "length = 0.0"),
    ],
)
def test_bad_harmonic_curves_are_refused(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = dict.fromkeys(("middle", "size", "frequency", "phase"), np.ones(3))
    with pytest.raises(InputError, match=message):
        HarmonicCurve(**(arguments | {"length": 1.0} | change))
