"""The search for a closed configuration, on gaps that are plain functions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin.closed_loop.assembly.closing import close_gaps
from rps_pin.closed_loop.constraints.rank_rule import EXACT

Array = NDArray[np.float64]


def toy(gaps, jacobian, size: int, limits: Square | None = None) -> SimpleNamespace:
    """A system of gaps and slopes on a flat space, where a step is a sum."""
    model = pin.Model()
    for index in range(size):
        model.addJoint(index, pin.JointModelPX(), pin.SE3.Identity(), f"x{index}")
    return SimpleNamespace(
        model=model,
        equations=SimpleNamespace(gaps=gaps, jacobian=jacobian, length=1.0),
        limits=limits,
        row_scale=1.0,
        column_scale=1.0,
        scaled=lambda matrix: matrix,
        rule=EXACT,
    )


def solve(gaps, jacobian, guess, held=None, box: Square | None = None, **options: object) -> Array:
    size = len(guess)
    held = np.zeros(size, dtype=bool) if held is None else held
    system = toy(gaps, jacobian, size, box)
    return close_gaps(system, np.array(guess), held, box is not None, **options)


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
    close_gaps(toy(circle, circle_slope, 2), guess, np.zeros(2, dtype=bool), False)
    np.testing.assert_array_equal(guess, [3, 4])


# Limits and held coordinates ----------------------------------------------------------------------


class Square:
    """All coordinates between -limit and limit."""

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def clip(self, q: Array) -> Array:
        return np.clip(q, -self.limit, self.limit)

    def blocked(self, q: Array, step: Array) -> NDArray[np.bool_]:
        return (np.abs(q) >= self.limit) & (q * step > 0)


def plane(q: Array) -> Array:
    """x + 2 y = 5."""
    return np.array([q[0] + 2 * q[1] - 5])


def plane_slope(q: Array) -> Array:
    return np.array([[1.0, 2.0]])


def test_held_coordinates_stay_as_they_are() -> None:
    held = np.array([False, True])
    found = solve(plane, plane_slope, [0.0, 0.7], held=held)
    np.testing.assert_allclose(found, [3.6, 0.7], rtol=0, atol=1e-14)
    assert found[1] == 0.7
    np.testing.assert_array_equal(held, [False, True])


def test_nothing_moves_where_all_is_held() -> None:
    found = solve(plane, plane_slope, [1.0, 1.0], held=np.ones(2, dtype=bool))
    np.testing.assert_array_equal(found, [1.0, 1.0])


def test_limits_are_kept_and_the_rest_does_the_work() -> None:
    """The nearest solution (1, 2) is outside; y stops at 1.8 and x goes on to 1.4."""
    found = solve(plane, plane_slope, [0.0, 0.0], box=Square(1.8))
    np.testing.assert_allclose(found, [1.4, 1.8], rtol=0, atol=1e-12)
    assert found[1] == 1.8


def test_limits_without_a_solution_end_at_the_least_gap() -> None:
    """In [-1, 1]^2 the sum is 3 at most: 2 stay open, at the corner."""
    found = solve(plane, plane_slope, [0.2, -0.4], box=Square(1.0))
    np.testing.assert_allclose(found, [1.0, 1.0], rtol=0, atol=1e-6)


def test_limits_bind_only_while_the_steps_press_against_them() -> None:
    """From the limit inwards: (2, 0) to the circle's (1, 0)."""
    found = solve(circle, circle_slope, [2.0, 0.0], box=Square(2.0))
    np.testing.assert_allclose(found, [1.0, 0.0], rtol=0, atol=1e-14)


def test_held_coordinates_within_limits() -> None:
    """x held at its limit, y free: the circle of radius 1 where x = 0.6 is at y = 0.8."""
    found = solve(circle, circle_slope, [0.6, 0.5], held=np.array([True, False]), box=Square(0.9))
    np.testing.assert_allclose(found, [0.6, 0.8], rtol=0, atol=1e-14)
    assert found[0] == 0.6


def test_every_configuration_tried_is_within_the_limits() -> None:
    tried: list[Array] = []

    def gaps(q: Array) -> Array:
        tried.append(q)
        return plane(q)

    solve(gaps, plane_slope, [0.0, 0.0], box=Square(1.8))
    assert len(tried) > 1
    assert np.abs(tried).max() <= 1.8


def test_slopes_of_rounding_errors_move_nothing() -> None:
    """A second row that is the first but for rounding: no step of 1e12."""
    nearly = np.array([[1.0, 2.0], [1.0, 2.0 + 1e-15]])
    found = solve(lambda q: nearly @ q - [5, 5 + 1e-13], lambda q: nearly, [0.0, 0.0])
    np.testing.assert_allclose(found, [1, 2], rtol=0, atol=1e-6)
