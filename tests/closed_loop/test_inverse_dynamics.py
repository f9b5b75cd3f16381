"""Constrained inverse dynamics: the null-space solution, and its agreement with factorisations."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop.dynamics.inverse_dynamics import NullSpaceSolution, null_space_solution
from rps_pin.numerics.linear_algebra import Decomposition, null_space
from tests import strategies
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import loop_jacobian

Array = NDArray[np.float64]


def matrix(rank: int, rows: int, columns: int, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))


def solution(jacobian: Array, actuated: Array, force: Array, scale: Array) -> NullSpaceSolution:
    return null_space_solution(Decomposition(jacobian * scale), actuated, force, scale)


@pytest.mark.parametrize("rank", [3, 2])
def test_answer_satisfies_the_kkt_equations(rank: int) -> None:
    """With more rows than rank, too."""
    jacobian, force = matrix(rank, 4, 5), np.arange(1.0, 6)
    actuated = np.arange(5 - rank)
    scale = np.array([1, 2, 0.5, 1, 3.0])
    tau, multipliers, remaining = solution(jacobian, actuated, force, scale)
    assert remaining is None
    total = jacobian.T @ multipliers
    total[actuated] += tau
    np.testing.assert_allclose(total, force, rtol=0, atol=1e-12)
    # Of least norm: no part of lambda that the rows do not feel.
    np.testing.assert_allclose(null_space(jacobian.T).T @ multipliers, 0, rtol=0, atol=1e-12)


def test_answer_does_not_depend_on_the_scale() -> None:
    jacobian, force = matrix(3, 4, 5), np.arange(1.0, 6)
    answers = [
        solution(jacobian, np.arange(2), force, scale)[0]
        for scale in (np.ones(5), np.array([1, 1e3, 1e-2, 1, 5.0]))
    ]
    np.testing.assert_allclose(*answers, rtol=1e-11)


def test_more_actuators_than_mobility_share_with_least_norm() -> None:
    jacobian, force = matrix(3, 3, 5), np.arange(1.0, 6)
    scale = np.array([1, 2, 0.5, 1, 3.0])
    tau, multipliers, remaining = solution(jacobian, np.arange(4), force, scale)
    assert remaining is None
    total = jacobian.T @ multipliers
    total[:4] += tau
    np.testing.assert_allclose(total, force, rtol=0, atol=1e-11)
    # Any other solution tau + y, N' S' y = 0, is no shorter: scale * tau is orthogonal to all y.
    others = null_space(null_space(jacobian)[:4].T)
    np.testing.assert_allclose((scale[:4] ** 2 * tau) @ others, 0, rtol=0, atol=1e-10)


def test_what_too_few_actuators_leave_is_told() -> None:
    """It is zero where actuators act, and the smallest such force."""
    jacobian, force = matrix(3, 3, 5), np.arange(1.0, 6)
    scale = np.array([1, 2, 0.5, 1, 3.0])
    tau, multipliers, remaining = solution(jacobian, np.arange(1), force, scale)
    assert remaining is not None
    total = jacobian.T @ multipliers + remaining
    total[:1] += tau
    np.testing.assert_allclose(total, force, rtol=0, atol=1e-11)
    # Least in the scaled norm: orthogonal to all that the actuator and the closures produce.
    products = np.vstack([np.eye(5)[:1], jacobian])
    np.testing.assert_allclose(products @ (scale**2 * remaining), 0, rtol=0, atol=1e-11)
    assert np.linalg.norm(remaining) > 0.1


def test_actuators_that_cannot_move_the_mechanism_leave_a_residual_force() -> None:
    """One coordinate, held by the closure, is driven; the free one is not."""
    jacobian, force = np.array([[1.0, 0.0]]), np.array([2.0, 3.0])
    tau, multipliers, remaining = solution(jacobian, np.array([0]), force, np.ones(2))
    assert tau == 0.0  # which the closure carries in any case
    np.testing.assert_allclose(multipliers, [2.0], rtol=1e-15)
    np.testing.assert_allclose(remaining, [0.0, 3.0], rtol=1e-15)


# The solutions agree ------------------------------------------------------------------------------


def three_rps() -> tuple[ClosedLoopModel, list[tuple[Array, Array, Array]]]:
    rng = np.random.default_rng(3)
    parameters = strategies.random_parameters(rng, tilted_gravity=True)
    robot = RPSRobot(parameters)
    motions = robot.state(*strategies.random_motions(rng, parameters, 50))
    return robot.mechanism, list(zip(*motions, strict=True))


def spatial() -> tuple[ClosedLoopModel, list[tuple[Array, Array, Array]]]:
    mechanism = mechanisms.spatial_four_bar()
    states, q = [], mechanisms.guess(mechanism)
    for _ in range(10):
        q = mechanism.close(q + 0.03)
        v = mechanism.velocity(q, [2.0])
        states.append((q, v, mechanism.acceleration(q, v, [-3.0])))
    return mechanism, states


@pytest.mark.parametrize("make", [three_rps, spatial])
def test_factorisation_and_null_space_agree(make) -> None:
    mechanism, states = make()
    model = mechanism.model
    data = model.createData()
    passive = np.setdiff1d(np.arange(model.nv), mechanism.actuated_indices)
    assert mechanism.constraint_size == passive.size
    for q, v, a in states:
        if mechanism.condition(q) > 1e4:
            continue
        found = mechanism.inverse_dynamics(q, v, a)
        tau, multipliers, _ = solution(
            loop_jacobian(mechanism, q),
            mechanism.actuated_indices,
            pin.rnea(model, data, q, v, a),
            np.ones(model.nv),
        )
        size = np.abs(multipliers).max()
        np.testing.assert_allclose(found.tau, tau, rtol=0, atol=1e-10 * size)
        np.testing.assert_allclose(found.constraint_forces, multipliers, rtol=0, atol=1e-10 * size)


def test_answers_print_their_numbers() -> None:
    mechanism, states = spatial()
    found = mechanism.inverse_dynamics(*states[0])
    assert repr(found).startswith(f"InverseDynamics(tau={found.tau}, constraint_forces=")
