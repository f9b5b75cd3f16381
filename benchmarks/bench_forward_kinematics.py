"""Time of the 3-RPS's forward kinematics, and of a loop of SciPy's ``fsolve``, in one run.

Run with ``make bench``. The goals: 125,000 solutions in well under 0.1 s and 200 times faster a
solution than the loop; all modes of a triple in 100 us; a tracker's call in 30 us.
"""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import fsolve

from rps_pin.rps.kinematics.assembly_modes import assembly_modes
from rps_pin.rps.kinematics.forward_kinematics import EncoderTracker, forward_kinematics
from rps_pin.rps.kinematics.leg_equations import solve_angles

Array = NDArray[np.float64]

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


@pytest.mark.benchmark(group="3-RPS direct kinematics, 2,000 poses followed")
def bench_followed(benchmark: BenchmarkFixture) -> None:
    lengths = np.random.default_rng(0).uniform(0.2, 0.25, (2000, 3))
    assert benchmark(forward_kinematics, lengths, [0.22, 0, 0], G, H).reached.all()


@pytest.mark.benchmark(group="3-RPS direct kinematics, a tracker's call", min_rounds=200)
def bench_tracker(benchmark: BenchmarkFixture) -> None:
    tracker = EncoderTracker([0.22, 0.0, 0.0], G, H)
    readings = np.array([[0.22, 0.2201, 0.2199], [0.2201, 0.22, 0.22]])
    out = np.empty(3)

    def two() -> None:
        tracker.update(readings[0], out)
        tracker.update(readings[1], out)

    benchmark(two)
