"""Time of each operation for the 3-RPS, the Delta and the Stewart platform, and of the peers.

Run with ``make bench``. The Delta is the one whose rods have mass, since Pinocchio's
`constraintDynamics` and MuJoCo need it. MuJoCo's forward dynamics solves a different problem: its
closures are soft.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.peers import (
    URDF,
    ConstraintDynamics,
    LoopConstrainedABA,
    Mujoco,
    PlainPinocchio,
)
from rps_pin import ClosedLoopModel

Array = NDArray[np.float64]

MECHANISMS = {"3-RPS": "rps", "Delta": "delta_rods", "Stewart": "stewart"}


class Case:
    """A mechanism in a state away from home."""

    def __init__(self, name: str) -> None:
        file = URDF / f"{MECHANISMS[name]}.yaml"
        self.mechanism = mechanism = ClosedLoopModel.load(file)
        tree = "rps_sokolov" if name == "3-RPS" else MECHANISMS[name]
        self.urdf = Path(URDF / f"{tree}.urdf").read_text("utf-8")
        count = len(mechanism.actuated)
        rng = np.random.default_rng(1)
        self.q = mechanism.home
        for _ in range(3):
            v = mechanism.velocity(self.q, 0.02 * rng.normal(size=count))
            self.q = mechanism.close(pin.integrate(mechanism.model, self.q, v))
        self.v = mechanism.velocity(self.q, rng.normal(size=count))
        self.a = mechanism.acceleration(self.q, self.v, rng.normal(size=count))
        self.tau = mechanism.inverse_dynamics(self.q, self.v, self.a).tau
        self.guess = pin.integrate(
            mechanism.model, self.q, 0.01 * rng.normal(size=mechanism.model.nv)
        )

    def mujoco(self) -> Mujoco:
        return Mujoco(self.mechanism, self.urdf, self.q, self.v)


@pytest.fixture(scope="module", params=list(MECHANISMS))
def case(request: pytest.FixtureRequest) -> Case:
    return Case(request.param)


def measured(
    benchmark: BenchmarkFixture, group: str, role: str, call: Callable[[], object]
) -> None:
    benchmark.group = group
    benchmark.extra_info["role"] = role
    benchmark(call)


def name_of(case: Case) -> str:
    return case.mechanism.name


@pytest.mark.benchmark(warmup=True, min_rounds=200, max_time=0.4, warmup_iterations=200)
@pytest.mark.parametrize("role", ["ours", "plain Pinocchio and NumPy", "MuJoCo and NumPy"])
def bench_inverse(benchmark: BenchmarkFixture, case: Case, role: str) -> None:
    q, v, a = case.q, case.v, case.a
    plain = PlainPinocchio(case.mechanism)
    calls = {
        "ours": lambda: case.mechanism.inverse_dynamics(q, v, a).tau,
        "plain Pinocchio and NumPy": lambda: plain.inverse_dynamics(q, v, a),
        "MuJoCo and NumPy": case.mujoco().inverse_dynamics,
    }
    if role == "plain Pinocchio and NumPy":
        np.testing.assert_allclose(calls[role](), case.tau, rtol=1e-8)
    measured(benchmark, f"{name_of(case)}, inverse dynamics", role, calls[role])


@pytest.mark.benchmark(warmup=True, min_rounds=200, max_time=0.4, warmup_iterations=200)
@pytest.mark.parametrize(
    "role",
    ["ours", "plain Pinocchio and NumPy", "pin.constraintDynamics", "pin.lcaba", "mj_forward"],
)
def bench_forward(benchmark: BenchmarkFixture, case: Case, role: str) -> None:
    q, v, tau = case.q, case.v, case.tau
    peers = {
        "plain Pinocchio and NumPy": PlainPinocchio,
        "pin.constraintDynamics": ConstraintDynamics,
        "pin.lcaba": LoopConstrainedABA,
    }
    if role in peers:
        peer = peers[role](case.mechanism)
        found = peer.forward_dynamics(q, v, tau)
        if not np.isfinite(found).all():
            pytest.skip(f"{role} returns NaN where links are massless")
        np.testing.assert_allclose(found, case.a, rtol=1e-6, atol=1e-6)
    calls = {
        "ours": lambda: case.mechanism.forward_dynamics(q, v, tau),
        "plain Pinocchio and NumPy": lambda: peer.forward_dynamics(q, v, tau),
        "pin.constraintDynamics": lambda: peer.forward_dynamics(q, v, tau),
        "pin.lcaba": lambda: peer.forward_dynamics(q, v, tau),
        "mj_forward": case.mujoco().forward_dynamics,
    }
    measured(benchmark, f"{name_of(case)}, forward dynamics", role, calls[role])


OPERATIONS: dict[str, Callable[[Case], object]] = {
    "close, 1 cm and 10 mrad off": lambda c: c.mechanism.close(c.guess),
    "velocity": lambda c: c.mechanism.velocity(c.q, c.v[c.mechanism.actuated_indices]),
    "acceleration": lambda c: c.mechanism.acceleration(c.q, c.v, c.a[c.mechanism.actuated_indices]),
    "motion_basis": lambda c: c.mechanism.motion_basis(c.q),
    "derivatives of inverse dynamics": lambda c: c.mechanism.inverse_dynamics_derivatives(
        c.q, c.v, c.a
    ),
    "derivatives of forward dynamics": lambda c: c.mechanism.forward_dynamics_derivatives(
        c.q, c.v, c.tau
    ),
}


@pytest.mark.benchmark(warmup=True, min_rounds=20, max_time=0.4, warmup_iterations=50)
@pytest.mark.parametrize("operation", list(OPERATIONS))
@pytest.mark.parametrize("role", ["ours", "one plain inverse dynamics"])
def bench_others(benchmark: BenchmarkFixture, case: Case, operation: str, role: str) -> None:
    """Operations without a peer are compared with one inverse dynamics in plain Pinocchio."""
    plain = PlainPinocchio(case.mechanism)
    calls = {
        "ours": lambda: OPERATIONS[operation](case),
        "one plain inverse dynamics": lambda: plain.inverse_dynamics(case.q, case.v, case.a),
    }
    measured(benchmark, f"{name_of(case)}, {operation}", role, calls[role])
