"""Time of the 3-RPS's forward kinematics, and of a loop of SciPy's ``fsolve``, in one run.

Run with ``make bench``. The goals: 125,000 solutions in well under 0.1 s and 200 times faster a
solution than the loop; all modes of a triple in 100 us; a tracker's call in 30 us; poses that are
followed, with the proof of each step, at most 0.1 us each in generated code.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import fsolve

from rps_pin import RPSRobot
from rps_pin.rps.kinematics.assembly_modes import assembly_modes
from rps_pin.rps.kinematics.forward_kinematics import EncoderTracker, forward_kinematics
from rps_pin.rps.kinematics.leg_equations import solve_angles

Array = NDArray[np.float64]
Job = Callable[[], Array]

G = H = 0.12
SIDE = np.linspace(0.2, 0.25, 50)
GRID = np.stack(np.meshgrid(SIDE, SIDE, SIDE, indexing="ij"), axis=-1).reshape(-1, 3)
FEW = 200


def left_sides(phi: Array, d: Array) -> list[float]:
    """Eq. 8 as printed."""
    c, s = np.cos(phi), np.sin(phi)
    return [
        d[i] ** 2
        + d[j] ** 2
        + 3 * G**2
        - 3 * H**2
        + d[i] * d[j] * (c[i] * c[j] - 2 * s[i] * s[j])
        - 3 * G * (d[i] * c[i] + d[j] * c[j])
        for i, j in ((0, 1), (1, 2), (2, 0))
    ]


def loop_of_fsolve(lengths: Array) -> Array:
    start = np.full(3, math.pi / 2)
    return np.array([fsolve(left_sides, start, args=(d,), xtol=1e-12) for d in lengths])


@pytest.mark.benchmark(group="3-RPS direct kinematics, 125,000 triples, one mode", min_rounds=9)
def bench_one_mode(benchmark: BenchmarkFixture) -> None:
    some = GRID[:: len(GRID) // FEW][:FEW]
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        peer = loop_of_fsolve(some)
        times.append((time.perf_counter() - begin) / FEW)
    ours = benchmark(solve_angles, GRID, math.pi / 2, G, H)
    assert ours.converged.all()
    np.testing.assert_allclose(ours.angle[:: len(GRID) // FEW][:FEW], peer, rtol=0, atol=1e-9)
    if benchmark.stats is not None:  # None where benchmarks only run as tests
        ratio = min(times) / (benchmark.stats.stats.min / len(GRID))
        benchmark.extra_info["times faster a solution than fsolve"] = ratio
        print(f"{ratio:.0f} times faster a solution than a loop of fsolve")


@pytest.mark.benchmark(group="3-RPS direct kinematics, all modes of 2,000 triples")
def bench_all_modes(benchmark: BenchmarkFixture) -> None:
    lengths = np.random.default_rng(0).uniform(0.2, 0.25, (2000, 3))
    modes = benchmark(assembly_modes, lengths, G, H)
    assert (modes.exists.sum(axis=-1) >= 8).all()


GENERATED, PYTHON = "ours", "Python"


@pytest.fixture(scope="module")
def generated() -> RPSRobot:
    """The robot in generated code; its numbers are those of G and H."""
    robot = RPSRobot.from_preset("micro").compile()
    assert (robot.parameters.base_radius, robot.parameters.platform_radius) == (G, H)
    return robot


def jobs(robot: RPSRobot, lengths: Array, near: Array) -> dict[str, Job]:
    """Return calls of both engines, whose poses are equal."""
    work: dict[str, Job] = {
        GENERATED: lambda: robot.forward_kinematics(lengths, near),
        PYTHON: lambda: forward_kinematics(lengths, near, G, H).pose,
    }
    np.testing.assert_allclose(work[GENERATED](), work[PYTHON](), rtol=0, atol=1e-12)
    return work


@pytest.mark.parametrize("role", [GENERATED, PYTHON])
@pytest.mark.parametrize("count", [1, 2000, 100_000])
@pytest.mark.parametrize("start", ["one pose", "poses nearby"])
def bench_followed(
    benchmark: BenchmarkFixture, generated: RPSRobot, start: str, count: int, role: str
) -> None:
    rng = np.random.default_rng(0)
    lengths = rng.uniform(0.2, 0.25, (count, 3))
    middle = np.array([0.22, 0.0, 0.0])
    near = middle
    if start == "poses nearby":
        near = forward_kinematics(lengths, middle, G, H).pose
        near = near + rng.uniform(-1.0, 1.0, near.shape) * [0.003, 0.02, 0.02]
    if count == 1:
        lengths, near = lengths[0], near.reshape(3)
    work = jobs(generated, lengths, near)
    benchmark.group = f"3-RPS direct kinematics, {count} followed from {start}"
    benchmark.extra_info["role"] = role
    benchmark.pedantic(work[role], rounds=2000 if count == 1 else 15, warmup_rounds=1)
    if benchmark.stats is not None:
        benchmark.extra_info["us a pose"] = 1e6 * benchmark.stats.stats.median / count


@pytest.mark.benchmark(group="3-RPS direct kinematics, a tracker's call", min_rounds=200)
def bench_tracker(benchmark: BenchmarkFixture) -> None:
    tracker = EncoderTracker([0.22, 0.0, 0.0], G, H)
    readings = np.array([[0.22, 0.2201, 0.2199], [0.2201, 0.22, 0.22]])
    out = np.empty(3)

    def two() -> None:
        tracker.update(readings[0], out)
        tracker.update(readings[1], out)

    benchmark(two)
