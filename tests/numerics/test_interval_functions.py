"""Functions of intervals hold those of their members, to 50 digits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from rps_pin.numerics import interval_functions as functions
from rps_pin.numerics.intervals import Enclosure, Interval
from tests.worst import worst

mpmath.mp.dps = 50


def intervals(seed: int, size: float) -> Interval:
    """Intervals of many widths; points, and ends at the extrema of sines."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-size, size, 300)
    low[:40] = np.round(low[:40] / (np.pi / 2)) * np.pi / 2
    width = 10.0 ** rng.uniform(-15, 1, 300)
    width[:60:3] = 0.0
    return Interval(low, low + width)


def members(x: Interval, k: int) -> list[Any]:
    low, high = mpmath.mpf(float(x.lower[k])), mpmath.mpf(float(x.upper[k]))
    return [low + (high - low) * i / 7 for i in range(8)]


@pytest.mark.parametrize(
    ("name", "size", "sharp"),
    [
        ("sin", 9.0, True),
        ("cos", 9.0, True),
        ("tan", 9.0, False),
        ("atan", 50.0, True),
        ("exp", 5.0, False),
    ],
)
def test_values_and_slopes_of_members_are_held(name: str, size: float, sharp: bool) -> None:
    x = intervals(len(name), size)
    exact: Callable[[Any], Any] = getattr(mpmath, name)
    found = getattr(functions, name)(x)
    slopes = getattr(functions, name)(Enclosure(x, Interval(np.ones((1, 300))))).slopes[0]
    for k in range(300):
        for one in members(x, k):
            value = exact(one)
            assert found.lower[k] <= value <= found.upper[k], (name, x[k])
        slope = mpmath.diff(exact, members(x, k)[3])
        slack = 1e-20 * (1 + abs(slope))
        assert slopes.lower[k] - slack <= slope <= slopes.upper[k] + slack
    if sharp:  # as wide as the function's change over the interval, and rounding
        low = [min(float(exact(one)) for one in members(x, k)) for k in range(300)]
        high = [max(float(exact(one)) for one in members(x, k)) for k in range(300)]
        narrow = x.upper - x.lower < 1e-2
        assert worst((low - found.lower)[narrow]) < 1e-4
        assert worst((found.upper - high)[narrow]) < 1e-4


def test_points_give_sines_to_rounding() -> None:
    x = Interval(np.random.default_rng(1).uniform(-20, 20, 500))
    for name in ("sin", "cos", "atan"):
        found = getattr(functions, name)(x)
        assert worst(found.upper - found.lower) < 2e-14


def test_far_angles_have_every_sine() -> None:
    for name in ("sin", "cos"):
        found = getattr(functions, name)(
            Interval(np.array([1e6, np.nan, -np.inf]), np.array([1e6, 1.0, 0.0]))
        )
        assert (found.lower == -1).all()
        assert (found.upper == 1).all()


def test_angles_of_points() -> None:
    rng = np.random.default_rng(2)
    low, width = rng.uniform(-1, 1, (2, 500)), rng.uniform(0, 0.4, (2, 500))
    low[0, :20] = 0.0
    x, y = (Interval(low[i], low[i] + width[i]) for i in range(2))
    found = functions.atan2(y, x)
    for k in range(500):
        for one in members(x, k)[::3]:
            for other in members(y, k)[::3]:
                if one or other:
                    assert found.lower[k] <= mpmath.atan2(other, one) <= found.upper[k]
    whole = found.upper - found.lower > 6
    assert 0 < whole.sum() < 200


def test_sizes_powers_and_extremes() -> None:
    x = intervals(8, 3.0)
    for exponent in (0, 1, 2, 3, 5, 8):
        found = functions.power(x, exponent)
        for k in range(300):
            for one in members(x, k):
                assert found.lower[k] <= one**exponent <= found.upper[k]
    size, y = functions.fabs(x), intervals(9, 3.0)
    less, more = functions.fmin(x, y), functions.fmax(x, y)
    for k in range(300):
        for one, other in zip(members(x, k), members(y, k)[::-1], strict=True):
            assert size.lower[k] <= abs(one) <= size.upper[k]
            assert less.lower[k] <= min(one, other) <= less.upper[k]
            assert more.lower[k] <= max(one, other) <= more.upper[k]
    with pytest.raises(functions.InputError, match="whole numbers"):
        functions.power(x, 0.5)
