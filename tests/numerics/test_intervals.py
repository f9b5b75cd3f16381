"""Intervals hold the exact results, and enclosures the functions over their boxes."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.rps.kernels.tilt_functions import tilt_functions

RANDOM = np.random.default_rng(21)
COUNT = 400


def numbers(size: int = COUNT) -> np.ndarray:
    """Return floats of many sizes, both signs, round ones and zero among them."""
    found = RANDOM.normal(size=size) * 10.0 ** RANDOM.integers(-12, 12, size)
    found[:20] = RANDOM.integers(-3, 4, 20)
    return found


def intervals() -> Interval:
    ends = np.sort([numbers(), numbers()], axis=0)
    ends[1, 20:60] = ends[0, 20:60]  # points
    return Interval(*ends)


def members(x: Interval) -> list[list[Fraction]]:
    """Return exact numbers of each interval: its ends, and one within."""
    found = []
    for low, high in zip(x.lower, x.upper, strict=True):
        one, two = Fraction(low), Fraction(high)
        found.append([one, two, one + (two - one) / 3])
    return found


@pytest.mark.parametrize("name", ["+", "-", "*", "/"])
def test_the_exact_result_of_numbers_is_in_the_interval(name: str) -> None:
    exact = {
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
        "*": lambda a, b: a * b,
        "/": lambda a, b: a / b,
    }[name]
    x, y = intervals(), intervals()
    with np.errstate(invalid="ignore", over="ignore"):
        found = exact(x, y)
    held = 0
    for i, (several, others) in enumerate(zip(members(x), members(y), strict=True)):
        for a in several:
            for b in others:
                if name == "/" and b == 0:
                    continue
                result = exact(a, b)
                low, high = float(found.lower[i]), float(found.upper[i])
                if name == "/" and not math.isfinite(low):
                    assert y.lower[i] <= 0 <= y.upper[i]
                    continue
                assert Fraction(low) <= result <= Fraction(high), (x, y, i)
                held += 1
    assert held > COUNT


def test_a_product_of_points_is_four_units_wide_at_most() -> None:
    x, y = Interval(numbers()), Interval(numbers())
    for found in (x * y, x + y, x - y, x.square()):
        middle = np.spacing(np.abs(found.lower))
        assert (found.upper - found.lower <= 4 * np.maximum(middle, np.spacing(0.0))).all()


def test_squares_and_roots() -> None:
    x = intervals()
    for i, several in enumerate(members(x)):
        square = x.square()[i]
        for a in several:
            assert Fraction(float(square.lower)) <= a * a <= Fraction(float(square.upper))
    assert (x * x).lower.min() >= 0.0  # the same number, not two of an interval
    root = Interval(np.abs(x.lower)).sqrt()
    for low, high, given in zip(root.lower, root.upper, np.abs(x.lower), strict=True):
        assert Fraction(float(low)) ** 2 <= Fraction(float(given)) <= Fraction(float(high)) ** 2


def test_what_is_not_known_proves_nothing() -> None:
    whole = 1.0 / Interval([-1.0, 0.0], [1.0, 2.0])
    assert np.isneginf(whole.lower).all()
    assert np.isposinf(whole.upper).all()
    with np.errstate(invalid="ignore"):
        nothing = whole * Interval([0.0, 0.0])
    assert not (nothing.lower > 0).any()
    assert not (nothing.upper < 0).any()


def test_tilt_functions_over_intervals() -> None:
    """Against 40 digits of their power series, at the ends and inside."""
    low = np.concatenate([[0.0, 1e-300, 1e-9], RANDOM.uniform(0.0, 3.9, 40)])
    s = Interval(low, np.minimum(low + RANDOM.uniform(0.0, 0.5, low.size), 3.999))
    found = tilt_functions(s)
    mpmath.mp.dps = 40

    def c(n: int, at: mpmath.mpf) -> mpmath.mpf:
        terms = ((-at) ** k / mpmath.factorial(2 * k + n) for k in range(30))
        return mpmath.fsum(terms)

    def slope(n: int, at: mpmath.mpf) -> mpmath.mpf:
        return (n * c(n + 2, at) - c(n + 1, at)) / 2

    def bend(n: int, at: mpmath.mpf) -> mpmath.mpf:
        return (n * slope(n + 2, at) - slope(n + 1, at)) / 2

    for i in range(low.size):
        for share in (0.0, 0.37, 1.0):
            at = mpmath.mpf(s.lower[i]) * (1 - share) + mpmath.mpf(s.upper[i]) * share
            exact = [c(1, at), c(2, at), c(0, at), c(3, at)]
            exact += [slope(n, at) for n in (1, 2, 3)] + [bend(n, at) for n in (1, 2)]
            for one, value in zip(found, exact, strict=True):
                assert mpmath.mpf(one.lower[i]) <= value <= mpmath.mpf(one.upper[i])
    beyond = tilt_functions(Interval([3.9], [4.1]))
    assert all(np.isinf(one.lower).all() for one in beyond)


def _function(x: Enclosure, y: Enclosure) -> Enclosure:
    return (x * y - 2.0 * y * y / (3.0 + x)) + (1.0 + x * x).sqrt() - 1.5


def test_mean_values_and_shares_of_enclosures() -> None:
    """Random points of random boxes keep both bounds, and the shares are no larger than counted."""
    size, many = 60, 4000
    middle = RANDOM.uniform(-1.0, 1.0, (2, size))
    half = 10.0 ** RANDOM.uniform(-3.0, -0.5, (2, size))
    box = Interval(middle - half, middle + half)
    at = Interval(middle)
    x, y = Enclosure.coordinates(box)
    over, centre = _function(x, y), _function(at[0], at[1])  # type: ignore[arg-type]
    offsets = box - at
    bounds = over.about(centre, offsets)  # type: ignore[arg-type]
    share = over.share_above(centre, offsets)  # type: ignore[arg-type]
    points = box.lower + (box.upper - box.lower) * RANDOM.random((many, 2, size))
    p, q = points[:, 0], points[:, 1]
    values = p * q - 2.0 * q * q / (3.0 + p) + np.sqrt(1.0 + p * p) - 1.5
    slack = 1e-14
    assert (values >= bounds.lower - slack).all()
    assert (values <= bounds.upper + slack).all()
    natural = over.values.upper - over.values.lower
    assert (bounds.upper - bounds.lower <= natural).all()
    assert ((bounds.upper - bounds.lower) < 0.7 * natural).any()
    counted = (values > 0).mean(axis=0)
    assert (share <= counted + 5 * np.sqrt(0.25 / many)).all()
    small = half.max(axis=0) < 0.02
    assert small.sum() > 10
    assert (counted - share)[small].max() < 0.1  # and they are sharp
    assert ((share > 0.05) & (share < 0.95)).any()
