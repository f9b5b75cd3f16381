"""Time of the actuator forces of 100,000 samples: closed form, and Pinocchio's RNEA.

Run with ``make bench``. The goals: the closed form at most 0.5 us a sample on one core in NumPy, at
most 0.05 us in generated code, and less than ``pin.rneaInParallel`` takes on one thread for the
open chains alone, with nothing closed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from rps_pin import RPSRobot
from rps_pin.rps.dynamics.actuator_forces import actuator_forces

Array = NDArray[np.float64]
Job = Callable[[], Array]

SAMPLES = 100_000
NUMPY = "closed form in NumPy"
OPEN_CHAINS = "pin.rneaInParallel, open chains"
CONSTRAINTS = "constraint models, sample by sample"


def motion(name: str) -> tuple[Array, Array, Array]:
    """Return smooth, fast motions within the workspace."""
    rng = np.random.default_rng(1)
    low, high, tilt = {"sokolov": (0.35, 0.6, 0.4), "micro": (0.22, 0.23, 0.05)}[name]
    pose = np.stack(
        [rng.uniform(low, high, SAMPLES), *rng.uniform(-tilt, tilt, (2, SAMPLES))], axis=-1
    )
    return pose, rng.normal(size=(SAMPLES, 3)), rng.normal(scale=10.0, size=(SAMPLES, 3))


def jobs(robot: RPSRobot, name: str) -> dict[str, Job]:
    """Return calls of the closed form in both engines, of RNEA, and of the constraint models."""
    samples = motion(name)
    q, v, a = robot.state(*samples)
    model = robot.mechanism.model
    pool = pin.ModelPool(model, 1)
    columns = [np.asfortranarray(x.T) for x in (q, v, a)]
    force = np.zeros((model.nv, SAMPLES), order="F")

    def open_chains() -> Array:
        pin.rneaInParallel(1, pool, *columns, force)
        return force

    def constraints() -> Array:
        return np.array([robot.inverse_dynamics(*x).tau for x in zip(q, v, a, strict=True)])

    generated = RPSRobot.from_preset(name).compile()
    limit = robot.mechanism.max_condition
    return {
        "ours": lambda: generated.actuator_forces(*samples),
        NUMPY: lambda: actuator_forces(robot.parameters, robot.force_terms, limit, samples),
        OPEN_CHAINS: open_chains,
        CONSTRAINTS: constraints,
    }


@pytest.fixture(scope="module", params=["sokolov", "micro"])
def setting(request: pytest.FixtureRequest) -> tuple[str, dict[str, Job]]:
    """A preset without limits and rods, and one with both."""
    name: str = request.param
    work = jobs(RPSRobot.from_preset(name), name)
    found, expected = work["ours"](), work[CONSTRAINTS]()
    error = np.abs(found - expected).max(axis=-1) / np.abs(expected).max(axis=-1)
    assert error.max() < 1e-10
    return name, work


@pytest.mark.benchmark(warmup=False)
@pytest.mark.parametrize("role", ["ours", NUMPY, OPEN_CHAINS, CONSTRAINTS])
def bench_actuator_forces(
    benchmark: BenchmarkFixture, setting: tuple[str, dict[str, Job]], role: str
) -> None:
    name, work = setting
    benchmark.group = f"3-RPS {name}, actuator forces of {SAMPLES} samples"
    benchmark.extra_info["role"] = role
    benchmark.pedantic(work[role], rounds=3 if role == CONSTRAINTS else 30, warmup_rounds=1)
    benchmark.extra_info["us a sample"] = 1e6 * benchmark.stats.stats.median / SAMPLES
