"""Wrong derivatives are found, right ones however coarse are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rps_pin.trajectories.derivative_check import disagreement
from rps_pin.trajectories.time_laws import time_law
from tests.each import each

SEEDS = st.integers(0, 2**32 - 1)
T = np.linspace(0, 2, 41)
X, V = np.sin(3 * T), 3 * np.cos(3 * T)


@given(SEEDS, st.floats(4.0, 200.0), st.floats(0, 2 * math.pi), st.floats(1e-9, 1e9))
def test_a_sine_of_four_samples_a_period_is_right(
    seed: int, samples: float, phase: float, size: float
) -> None:
    w = np.random.default_rng(seed).uniform(0.1, 10)
    angle = w * np.arange(300) * (2 * math.pi / w / samples) + phase
    x, v = size * np.sin(angle), size * w * np.cos(angle)
    assert disagreement(angle / w, x, v) is None


@each("profile", ["quintic", "trapezoidal", "s-curve"])
@each("count", [12, 13, 50, 501])
def test_accelerations_that_jump_are_right(profile: str, count: int) -> None:
    law = time_law(0.3, profile, duration=1.7)  # type: ignore[arg-type]
    t = np.linspace(0, law.duration, count)
    u, rate, acceleration = law.at(t)
    assert disagreement(t, u, rate) is None
    assert disagreement(t, rate, acceleration) is None


@given(SEEDS, st.integers(5, 9), st.integers(4, 9))
def test_rounding_of_the_written_numbers_is_allowed_for(
    seed: int, decimals: int, rate_decimals: int
) -> None:
    """At 1 kHz the last place of a millimetre's hundredth is a centimetre a second."""
    rng = np.random.default_rng(seed)
    t = np.arange(2000) / 1000
    w, size = rng.uniform(0.5, 5), 10 ** rng.uniform(-3, 0)
    x = np.round(0.2 + size * np.sin(w * t), decimals)
    v = np.round(size * w * np.cos(w * t), rate_decimals)
    assert disagreement(t, x, v) is None


def test_poses_of_three_digits_are_not_enough() -> None:
    """At 1 kHz their last place is more than three times the rate."""
    t = np.arange(2000) / 1000
    x = np.round(np.sin(3 * t), 2)
    assert disagreement(t, x, 3 * np.cos(3 * t)) is not None


@pytest.mark.parametrize("rest", [0.0, 0.223])
def test_rounding_of_a_rate_that_should_be_zero_is_no_rate(rest: float) -> None:
    still = np.full_like(T, rest)
    for row in (0, 5, -1):
        rate = np.zeros_like(T)
        rate[row] = 1e-16
        assert disagreement(T, still, rate) is None


@pytest.mark.parametrize("rest", [0.0, 0.223])
def test_what_stands_still_has_no_rate(rest: float) -> None:
    still = np.full_like(T, rest)
    assert disagreement(T, still, 0 * T) is None
    found = disagreement(T, still, np.full_like(T, 0.3))
    assert found is not None
    assert found.given == 0.3


@each(
    ("factor", "words"),
    [
        (1e3, "thousandths"),
        (1e-3, "thousandths"),
        (1e6, "millionths"),
        (1e-6, "millionths"),
        (180 / math.pi, "degrees and radians"),
        (math.pi / 180, "degrees and radians"),
        (-1.0, "opposite sign"),
        (3.0, ""),
        (0.25, ""),
        (0.0, ""),
    ],
)
def test_a_wrong_unit_is_found_and_named(factor: float, words: str) -> None:
    found = disagreement(T, X, factor * V)
    assert found is not None
    assert words in found.looks_like
    assert bool(words) == bool(found.looks_like)


@given(st.integers(2, 37), st.sampled_from(["rate", "value"]), st.floats(1.5, 100))
def test_one_wrong_entry_is_found_where_it_is(row: int, what: str, off: float) -> None:
    x, v = X.copy(), V.copy()
    if what == "rate":
        v[row] += 3 * off * 2
    else:
        x[row] += off
    found = disagreement(T, x, v)
    assert found is not None
    assert found.row == row
    assert found.given == v[row]
    slopes = np.diff(x) / np.diff(T)
    assert found.slopes == tuple(slopes[row - 1 : row + 1])
    assert found.looks_like == "" or off > 10


@pytest.mark.parametrize("count", [6, 41])
@pytest.mark.parametrize("row", [0, -1])
def test_a_first_or_last_entry_far_beyond_all_else_is_found(row: int, count: int) -> None:
    t = T[:count]
    x, v = np.sin(3 * t), 3 * np.cos(3 * t)
    largest = max(np.abs(v).max(), np.abs(np.diff(x) / np.diff(t)).max())
    v[row] = 11 * largest
    found = disagreement(t, x, v)
    assert found is not None
    assert found.row == row % count
    assert found.given == v[row]
    assert found.slopes == ((np.diff(x) / np.diff(t))[row],)


@pytest.mark.parametrize("row", [0, -1])
def test_a_push_shorter_than_the_first_step_is_right(row: int) -> None:
    """The acceleration at the end is then seven times the mean of its step."""
    t = np.arange(12) * 1.4
    rate = np.minimum(t / 0.2, 1.0)  # a cruise, but for its first moment
    acceleration = np.where(t < 0.2, 1 / 0.2, 0.0)
    if row == 0:
        assert disagreement(t, rate, acceleration) is None
    else:
        assert disagreement(-t[::-1], rate[::-1], -acceleration[::-1]) is None


def test_two_samples_cannot_be_judged() -> None:
    """From rest to rest, the rates say nothing of the way."""
    rest = np.zeros(2)
    assert disagreement(np.array([0.0, 1.0]), np.array([0.0, 1.0]), rest) is None
