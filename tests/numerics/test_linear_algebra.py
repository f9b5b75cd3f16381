"""Linear algebra: the rule of rank, null spaces, condition numbers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin.numerics.linear_algebra import (
    Decomposition,
    condition_number,
    full_svd,
    many_singular_values,
    null_space,
    rank,
    singular_values,
)

Array = NDArray[np.float64]


def matrix(rank: int, rows: int, columns: int, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))


@pytest.mark.parametrize(("rank", "rows", "columns"), [(3, 3, 5), (2, 6, 5), (5, 6, 5), (1, 1, 1)])
def test_null_space_is_an_orthonormal_basis(rank: int, rows: int, columns: int) -> None:
    jacobian = matrix(rank, rows, columns)
    motions = null_space(jacobian)
    assert motions.shape == (columns, columns - rank)
    np.testing.assert_allclose(jacobian @ motions, 0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(motions.T @ motions, np.eye(columns - rank), rtol=0, atol=1e-14)


def test_without_closures_every_motion_is_allowed() -> None:
    assert null_space(np.zeros((0, 4))).shape == (4, 4)


def test_condition_number_is_the_ratio_of_singular_values() -> None:
    rotation = np.linalg.qr(matrix(3, 3, 3))[0]
    assert condition_number(rotation @ np.diag([4.0, 2.0, 0.5])) == pytest.approx(8, rel=1e-14)
    assert condition_number(rotation) == pytest.approx(1, rel=1e-14)
    assert condition_number(matrix(2, 6, 2)) == pytest.approx(np.linalg.cond(matrix(2, 6, 2)))


def test_condition_number_without_an_answer_is_infinite() -> None:
    assert condition_number(np.ones((2, 3))) == np.inf
    assert condition_number(np.zeros((3, 3))) == np.inf
    assert condition_number(np.diag([1.0, 0.0])) == np.inf
    assert condition_number(matrix(2, 3, 3)) > 1e14


def test_condition_number_without_passive_joints_is_1() -> None:
    assert condition_number(np.zeros((0, 0))) == condition_number(np.zeros((6, 0))) == 1


# The rule of rank ---------------------------------------------------------------------------------


def test_rank_counts_what_is_more_than_rounding() -> None:
    assert rank(np.array([3.0, 1.0, 1e-9])) == 3
    assert rank(np.array([3.0, 1.0, 1e-11])) == 2
    assert rank(np.array([3.0, 1.0, 1e-9]), tolerance=1e-6) == 2
    assert rank(np.zeros(0)) == 0


def test_a_matrix_of_rounding_errors_has_no_rank() -> None:
    """In one unit. Of matrices of another size, that size tells."""
    assert rank(np.array([1e-12, 1e-23])) == 0
    assert rank(np.array([1e-12, 1e-23]), size=1e-12) == 1
    assert rank(np.array([1e6, 1.0, 1e-5])) == 2
    assert null_space(np.full((2, 3), 1e-15)).shape == (3, 3)
    assert condition_number(np.full((2, 1), 1e-15)) == np.inf
    nothing = Decomposition(np.full((2, 3), 1e-15))
    np.testing.assert_array_equal(nothing.least_norm(np.eye(2)), np.zeros((3, 2)))


@pytest.mark.parametrize(("r", "rows", "columns"), [(3, 3, 5), (2, 6, 5), (5, 6, 5), (1, 1, 1)])
def test_least_norm_solution_is_numpy_s(r: int, rows: int, columns: int) -> None:
    a, b = matrix(r, rows, columns), np.random.default_rng(1).normal(size=(rows, 2))
    expected, *_ = np.linalg.lstsq(a, b, rcond=1e-9)
    np.testing.assert_allclose(Decomposition(a).least_norm(b), expected, rtol=0, atol=1e-12)
    inverse = np.linalg.pinv(a, 1e-9)
    found = Decomposition(a)
    np.testing.assert_allclose(found.least_norm(np.eye(len(a))), inverse, rtol=0, atol=1e-12)
    transposed = found.transposed_least_norm(np.eye(a.shape[1]))
    np.testing.assert_allclose(transposed, inverse.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a @ found.null_space(), 0, rtol=0, atol=1e-12)
    assert found.null_space().shape == (a.shape[1], a.shape[1] - np.linalg.matrix_rank(a, 1e-9))


@pytest.mark.parametrize("shape", [(3, 5), (5, 3), (4, 4), (0, 3), (3, 0)])
def test_full_svd_is_one(shape: tuple[int, int]) -> None:
    a = np.random.default_rng(2).normal(size=shape)
    left, values, right = full_svd(a)
    middle = np.zeros(shape)
    np.fill_diagonal(middle, values)
    np.testing.assert_allclose(left @ middle @ right, a, rtol=0, atol=1e-13)
    np.testing.assert_allclose(left @ left.T, np.eye(shape[0]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(values, singular_values(a), rtol=1e-13)


@pytest.mark.parametrize("shape", [(2, 2), (3, 3), (6, 6), (8, 6), (4, 1)])
def test_singular_values_of_many_are_those_they_were_made_of(shape: tuple[int, int]) -> None:
    """To 1e-12 of each but for the SVD's own error, at any conditioning; zero matrices too."""
    rows, columns = shape
    rng, n = np.random.default_rng(1), 400
    left = np.linalg.qr(rng.normal(size=(n, rows, rows)))[0][:, :, :columns]
    right = np.linalg.qr(rng.normal(size=(n, columns, columns)))[0]
    ratio = 10 ** rng.uniform(-9, 0, size=n)  # of the least to the largest
    share = np.sort(rng.uniform(size=(n, columns)))[:, ::-1]
    share[:, 0], share[:, -1] = 1.0, 0.0 if columns > 1 else 1.0
    wanted = 10 ** rng.uniform(-3, 3, size=(n, 1)) * ratio[:, None] ** (1 - share)
    found = many_singular_values(left * wanted[:, None, :] @ right)
    error = np.abs(found - wanted)
    assert (error <= 1e-12 * wanted + 2e-14 * wanted[:, :1]).all()
    regular = ratio > 0.04
    assert regular.any()
    assert (error[regular] <= 1e-12 * wanted[regular]).all()
    assert not many_singular_values(np.zeros((2, *shape))).any()
    assert many_singular_values(np.zeros((0, *shape))).shape == (0, columns)
