"""Time of a force distribution with warm start, and of other methods.

A five-bar with four actuators, one of them at its limit. The peers solve for tau and lambda
together, from the same Jacobian and generalised force: ProxQP with a problem built at each call, as
one would write it plainly, and SciPy's bounded least squares on the tau that no motion feels.
Run with ``make bench``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import proxsuite
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import lsq_linear

from rps_pin import ClosedLoopModel
from rps_pin.closed_loop.dynamics.force_distribution import ForceDistribution
from tests.closed_loop import mechanisms

Array = NDArray[np.float64]
Solver = Callable[[Array, Array, Array], Array]

LIMITS = np.array([4.0, 0.6, 9.0, 9.0])
ACTUATED = ["left_joint", "left_arm_joint", "right_joint", "right_arm_joint"]


def ours(mechanism: ClosedLoopModel) -> Solver:
    distribution = ForceDistribution(mechanism, torque_limits=LIMITS)
    return lambda q, v, a: distribution.solve(q, v, a).tau


def solver_each_time(mechanism: ClosedLoopModel) -> Solver:
    """Force distribution without warm start."""
    distribution = ForceDistribution(mechanism, torque_limits=LIMITS)

    def solve(q: Array, v: Array, a: Array) -> Array:
        distribution.reset()
        return distribution.solve(q, v, a).tau

    return solve


def proxqp_built_each_time(mechanism: ClosedLoopModel) -> Solver:
    na, nc = len(ACTUATED), mechanism.constraint_size
    selection = np.eye(mechanism.model.nv)[mechanism.actuated_indices]
    hessian = np.diag(np.concatenate([np.ones(na), np.full(nc, 1e-8)]))
    upper = np.concatenate([LIMITS, np.full(nc, 1e20)])

    def solve(q: Array, v: Array, a: Array) -> Array:
        force, jacobian = mechanism.generalised_force(q, v, a), mechanism.jacobian(q)
        equations = np.hstack([selection.T, jacobian.T])
        problem = proxsuite.proxqp.dense.QP(na + nc, len(force), 0, True)
        problem.settings.eps_abs = 1e-9
        problem.init(hessian, np.zeros(na + nc), equations, force, None, None, None, -upper, upper)
        problem.solve()
        return np.array(problem.results.x[:na])

    return solve


def bounded_least_squares(mechanism: ClosedLoopModel) -> Solver:
    """min |tau| with the equations of motion weighted so heavily that they hold to 1e-6."""
    actuated = mechanism.actuated_indices

    def solve(q: Array, v: Array, a: Array) -> Array:
        force, motions = mechanism.generalised_force(q, v, a), mechanism.allowed_motions(q)
        heavy = 1e4
        matrix = np.vstack([np.eye(len(ACTUATED)), heavy * motions[actuated].T])
        right = np.concatenate([np.zeros(len(ACTUATED)), heavy * motions.T @ force])
        tau: Array = lsq_linear(matrix, right, (-LIMITS, LIMITS), method="bvls", tol=1e-12).x
        return tau

    return solve


ROLES = {
    "ours": ours,
    "ours without memory": solver_each_time,
    "ProxQP built at each call": proxqp_built_each_time,
    "scipy lsq_linear": bounded_least_squares,
}


@pytest.mark.benchmark(group="five-bar force distribution, one call", warmup=True, min_rounds=500)
@pytest.mark.parametrize("role", ROLES)
def bench_force_distribution(benchmark: BenchmarkFixture, role: str) -> None:
    state = mechanisms.state(mechanisms.five_bar())
    mechanism = mechanisms.five_bar(actuated=ACTUATED)
    solve = ROLES[role](mechanism)
    np.testing.assert_allclose(solve(*state), ours(mechanism)(*state), rtol=1e-5)
    benchmark.extra_info["role"] = role
    benchmark(solve, *state)
