"""The search for a closed configuration, on gaps that are plain functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rps_pin.closed_loop.closing import close_gaps

Array = NDArray[np.float64]


def solve(gaps, jacobian, guess: list[float], **options: int) -> Array:
    """On a flat space, where a step is a sum."""
    return close_gaps(np.array(guess), gaps, jacobian, np.add, tolerance=1e-12, **options)


def circle(q: Array) -> Array:
    return np.array([q @ q - 1.0])


def circle_slope(q: Array) -> Array:
    return 2 * q[None]


def test_no_gaps_leave_the_guess() -> None:
    found = solve(lambda q: np.zeros(0), lambda q: np.zeros((0, 2)), [1.0, 2.0])
    np.testing.assert_array_equal(found, [1.0, 2.0])


def test_linear_gaps_end_in_the_nearest_solution() -> None:
    """x + 2 y = 5, from 0: the foot of the perpendicular, (1, 2)."""
    matrix = np.array([[1.0, 2.0]])
    found = solve(lambda q: matrix @ q - 5, lambda q: matrix, [0.0, 0.0])
    np.testing.assert_allclose(found, [1, 2], rtol=0, atol=1e-14)


def test_steps_towards_a_circle_are_radial() -> None:
    found = solve(circle, circle_slope, [3.0, 4.0])
    np.testing.assert_allclose(found, [0.6, 0.8], rtol=0, atol=1e-15)


def test_redundant_gaps_do_no_harm() -> None:
    found = solve(
        lambda q: np.tile(circle(q), 3), lambda q: np.tile(circle_slope(q), (3, 1)), [3.0, 4.0]
    )
    np.testing.assert_allclose(found, [0.6, 0.8], rtol=0, atol=1e-15)


def test_gap_never_grows() -> None:
    """Newton's step for atan(x) from x = 3 leads ever further away."""
    found = solve(np.arctan, lambda q: np.array([[1 / (1 + q[0] ** 2)]]), [3.0])
    assert abs(found[0]) < 1e-15


def test_gap_that_cannot_close_ends_near_its_least() -> None:
    """x^2 + 1 from 2: no root; at least 1."""
    found = solve(lambda q: q**2 + 1, lambda q: np.array([[2 * q[0]]]), [2.0])
    assert found[0] ** 2 < 1e-3


def test_steps_are_few_and_limited() -> None:
    calls: list[Array] = []

    def gaps(q: Array) -> Array:
        calls.append(q)
        return circle(q)

    solve(gaps, circle_slope, [3.0, 4.0])
    assert len(calls) < 25  # quadratic convergence
    once = solve(circle, circle_slope, [3.0, 4.0], iterations=1)
    assert 1e-3 < abs(circle(once)[0]) < abs(circle(np.array([3.0, 4.0]))[0])


def test_guess_is_not_changed() -> None:
    guess = np.array([3.0, 4.0])
    close_gaps(guess, circle, circle_slope, np.add, tolerance=1e-12)
    np.testing.assert_array_equal(guess, [3, 4])
