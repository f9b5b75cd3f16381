"""Forces within limits: optimal by SciPy's own solver, exact at the limits, and in no doubt."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from rps_pin import RPSRobot
from rps_pin.control.estimator.effective_inertia import TaskSpaceInertia
from rps_pin.control.estimator.leg_geometry import leg_geometry
from rps_pin.control.estimator.leg_jacobian import LegJacobian, leg_jacobian
from rps_pin.control.loop.force_limits import ForceLimits
from tests import strategies

Array = NDArray[np.float64]


def cases(count: int, seed: int) -> list[tuple[Array, LegJacobian]]:
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        p = strategies.random_parameters(rng)
        reduced = TaskSpaceInertia(RPSRobot(p))
        for x, y, z in strategies.random_motions(rng, p, 20)[0].tolist():
            geometry = leg_geometry((x, y, z), p.base_radius, p.platform_radius)
            assert geometry is not None
            jacobian = leg_jacobian(geometry, p.platform_radius)
            if abs(jacobian.determinant) > 0.05:
                found.append((reduced.of(geometry), jacobian))
    return found


def cost_matrix(mass: Array, jacobian: LegJacobian) -> Array:
    """A matrix whose squared norm is what is to be least: M^(1/2) times the acceleration missed."""
    root = np.linalg.cholesky(mass).T
    return root @ np.linalg.inv(mass) @ np.array(jacobian.K).T


@pytest.mark.parametrize("size", [1.01, 3.0, 100.0, 1e6])
def test_forces_are_the_optimum(size: float) -> None:
    rng = np.random.default_rng(1)
    moved = 0
    for mass, jacobian in cases(300, 2):
        limit = rng.uniform(1.0, 50.0, 3)
        wanted = limit * rng.uniform(-size, size, 3)
        path = rng.normal(size=3) * rng.integers(0, 2)
        l1, l2, l3 = limit.tolist()
        f1, f2, f3 = wanted.tolist()
        x1, x2, x3 = path.tolist()
        limits = ForceLimits((l1, l2, l3))
        found = limits.nearest((f1, f2, f3), mass, jacobian, (x1, x2, x3))
        assert found.solved
        force = np.array(found.force)
        assert (np.abs(force) <= limit).all()
        matrix = cost_matrix(mass, jacobian)
        best = lsq_linear(
            matrix * limit, matrix @ wanted, (-np.ones(3), np.ones(3)), method="bvls", tol=1e-14
        )
        cost = float(np.sum((matrix @ (force - wanted)) ** 2)) / 2
        scale = max(best.cost, float(np.sum((matrix * limit) ** 2)))
        assert cost - best.cost <= 1e-7 * scale
        missing = np.linalg.solve(mass, np.array(jacobian.K).T @ (force - wanted))
        np.testing.assert_allclose(
            found.acceleration_error, missing, rtol=0, atol=1e-9 * np.abs(missing).max()
        )
        # Of the target's rate s x the best second derivative, in the same norm, by least squares.
        root = np.linalg.cholesky(mass).T
        hurry = np.linalg.lstsq((root @ path)[:, None], root @ missing, rcond=None)[0][0]
        assert found.pace_rate == pytest.approx(hurry, rel=1e-7, abs=1e-7 * abs(hurry) + 1e-12)
        cut = np.clip(wanted, -limit, limit)
        moved += not np.allclose(force, cut, rtol=0, atol=1e-3 * limit.max())
    assert moved > 30 or size < 2  # cutting off one by one is another thing


def test_one_problem_for_many_ticks_gives_what_a_new_one_gives() -> None:
    """Warm starts, among them good ones that are not the solution, change nothing."""
    rng = np.random.default_rng(3)
    kept = ForceLimits((10.0, 10.0, 10.0))
    for mass, jacobian in cases(200, 4):
        f1, f2, f3 = rng.uniform(-40, 40, 3).tolist()
        found = kept.nearest((f1, f2, f3), mass, jacobian, (0.1, 0.0, 0.2))
        new = ForceLimits((10.0, 10.0, 10.0)).nearest((f1, f2, f3), mass, jacobian, (0.1, 0.0, 0.2))
        matrix = cost_matrix(mass, jacobian)
        gap = matrix @ (np.array(found.force) - np.array(new.force))
        assert np.abs(gap).max() <= 1e-5 * np.abs(matrix).max() * 10


def test_within_and_cut_know_unlimited_actuators() -> None:
    limits = ForceLimits((1.0, math.inf, 2.0))
    assert limits.within((1.0, 1e300, -2.0))
    assert not limits.within((1.0, 0.0, -2.0000001))
    assert limits.clipped((3.0, -1e9, -5.0)) == (1.0, -1e9, -2.0)
