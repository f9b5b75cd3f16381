"""Least effort against the KKT system of the weighted problem and against stacked least squares."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import SingularityError
from rps_pin.closed_loop.dynamics.least_effort import (
    least_effort,
    refuse_nearly_singular,
    residual_force,
)

Array = NDArray[np.float64]


@pytest.mark.parametrize("seed", range(10))
def test_of_all_solutions_that_of_least_weighted_norm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 5))
    na = m + int(rng.integers(0, 5))
    own, reduced, weights = rng.normal(size=(na, m)), rng.normal(size=m), rng.uniform(0.2, 5, na)
    kkt = np.block([[np.diag(weights**2), own], [own.T, np.zeros((m, m))]])
    expected = np.linalg.solve(kkt, np.concatenate([np.zeros(na), reduced]))[:na]
    found = least_effort(own, reduced, weights)
    np.testing.assert_allclose(found.tau, expected, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(found.missing, 0, atol=1e-12)
    assert found.free.shape == (na, na - m)
    np.testing.assert_allclose(own.T @ found.free, 0, atol=1e-12)
    weighted = weights[:, None] * found.free
    np.testing.assert_allclose(weighted.T @ weighted, np.eye(na - m), atol=1e-12)


@pytest.mark.parametrize(("nv", "nc", "na"), [(6, 2, 2), (7, 3, 3), (5, 0, 2), (6, 4, 1)])
def test_too_few_actuators_leave_the_residual_of_scaled_least_squares(
    nv: int, nc: int, na: int
) -> None:
    rng = np.random.default_rng(nv + nc)
    jacobian, force = rng.normal(size=(nc, nv)), rng.normal(size=nv)
    scale = rng.uniform(0.3, 3, size=nv)
    actuated = rng.permutation(nv)[:na]
    selection = np.eye(nv)[actuated]
    stacked = scale[:, None] * np.hstack([selection.T, jacobian.T])
    both, *_ = np.linalg.lstsq(stacked, scale * force, rcond=None)
    expected = force - np.hstack([selection.T, jacobian.T]) @ both

    directions = np.linalg.svd(jacobian * scale)[2][nc:] if nc else np.eye(nv)
    motions = scale[:, None] * directions.T
    found = least_effort(motions[actuated], motions.T @ force)
    remaining = residual_force(motions, found.missing, scale)
    np.testing.assert_allclose(found.tau, both[:na], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(remaining, expected, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(remaining[actuated], 0, atol=1e-12)
    np.testing.assert_allclose(motions.T @ remaining, found.missing, rtol=1e-9, atol=1e-12)


def test_actuators_that_all_move_by_the_same_motion_share_its_force() -> None:
    own = np.array([[1.0, 0.0], [2.0, 0.0]])  # rank 1: the second motion is nobody's
    found = least_effort(own, np.array([5.0, 7.0]))
    np.testing.assert_allclose(found.tau, [1.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(found.missing, [0.0, 7.0], atol=1e-14)


def test_without_a_motion_there_is_no_effort() -> None:
    found = least_effort(np.zeros((2, 0)), np.zeros(0))
    np.testing.assert_array_equal(found.tau, [0, 0])
    assert found.free.shape == (2, 2)


def test_motions_hardly_moved_are_refused_and_motions_not_moved_are_not() -> None:
    refuse_nearly_singular(np.array([1.0, 0.1, 1e-14]), 100)
    refuse_nearly_singular(np.zeros(0), 100)
    with pytest.raises(SingularityError, match="hardly move") as caught:
        refuse_nearly_singular(np.array([1.0, 1e-4, 0.0]), 100)
    assert caught.value.condition == pytest.approx(1e4)
