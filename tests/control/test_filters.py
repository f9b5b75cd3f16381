"""The filters against the closed form of a first-order low pass."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rps_pin.control.loop.filters import SetpointRateFilter, SpeedFilter

Triple = tuple[float, float, float]


def fed(lengths: list[Triple], periods: list[float], cut_off: float) -> list[Triple]:
    speeds = SpeedFilter(cut_off)
    answers = []
    for length, period in zip(lengths, periods, strict=True):
        speed = speeds.after(length, period)
        speeds.update(length, speed)
        answers.append(speed)
    return answers


def test_constant_speed_is_reached_as_by_the_continuous_filter_at_any_ticks() -> None:
    """The step response, v (1 - exp(-2 pi f t)), exactly, whatever the ticks' lengths."""
    rng = np.random.default_rng(0)
    periods = rng.uniform(1e-4, 5e-3, 200)
    speed, cut_off = np.array([0.3, -0.1, 0.02]), 20.0
    t = np.concatenate([[0.0], np.cumsum(periods[1:])])
    lengths = [tuple(0.4 + speed * time) for time in t]
    found = fed(lengths, list(periods), cut_off)
    expected = speed * -np.expm1(-2 * math.pi * cut_off * t)[:, None]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
    assert found[0] == (0.0, 0.0, 0.0)


def test_speed_ramp_is_followed_with_the_lag_stated() -> None:
    period, cut_off, acceleration = 1e-3, 50.0, 2.0
    t = period * np.arange(500)
    found = fed([(d, d, d) for d in 0.3 + acceleration * t**2 / 2], [period] * 500, cut_off)
    share = -math.expm1(-2 * math.pi * cut_off * period)
    # Backward differences lag by T / 2; the recursion by (1 - share) / share ticks.
    lag = period / 2 + period * (1 - share) / share
    assert found[-1][0] == pytest.approx(acceleration * (t[-1] - lag), rel=1e-9)
    assert lag == pytest.approx(1 / (2 * math.pi * cut_off), rel=0.02)


def test_slow_sine_is_that_of_the_differential_equation() -> None:
    """s' = 2 pi f (d' - s), integrated by SciPy: the same to the order of the tick."""
    cut_off, period = 10.0, 1e-5
    t = period * np.arange(20_000)
    found = fed([(d, d, d) for d in 0.3 + 0.01 * np.sin(30 * t)], [period] * t.size, cut_off)
    gain = 2 * math.pi * cut_off
    exact = solve_ivp(
        lambda time, s: gain * (0.3 * np.cos(30 * time) - s), (0, t[-1]), [0.0], rtol=1e-9
    )
    assert found[-1][1] == pytest.approx(exact.y[0, -1], abs=0.3 * 30 * period)


def test_infinite_cut_off_gives_the_bare_difference() -> None:
    found = fed([(0.1, 0.2, 0.3), (0.11, 0.19, 0.3)], [0.01, 0.01], math.inf)
    np.testing.assert_allclose(found[1], [1.0, -1.0, 0.0], atol=1e-14)


@pytest.mark.parametrize("cut_off", [5.0, 50.0, np.inf])
def test_filtered_rate_of_a_parabola_is_that_of_its_positions(
    cut_off: float,
) -> None:
    """The mean of two rates is the difference of positions, exactly while rates are straight."""
    rng = np.random.default_rng(0)
    pull = rng.normal(size=3)
    rates, positions = SetpointRateFilter(cut_off), SpeedFilter(cut_off)
    t = 0.0
    rates.after((0.0, 0.0, 0.0), 1e-3)
    positions.update((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for step in rng.uniform(2e-4, 2e-3, 300):
        t += step
        x1, x2, x3 = (pull * t**2 / 2).tolist()
        v1, v2, v3 = (pull * t).tolist()
        found = rates.after((v1, v2, v3), step)
        expected = positions.after((x1, x2, x3), step)
        positions.update((x1, x2, x3), expected)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(pull).max())
    assert np.abs(found).max() > 0
    rates.reset()
    assert rates.after((0.0, 0.0, 0.0), 1e-3) == (0.0, 0.0, 0.0)
