"""Time of the workspace's forward kinematics, and of a loop of SciPy's solver; time per point.

Run with ``make bench``. The goals: 125,000 triples of leg lengths in less than 0.1 s on one core
and 200 times faster than the loop; a cost per point that does not depend on how many there are.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import fsolve

from rps_pin import RPSParameters
from rps_pin.rps.kinematics.legs import geometry_of_pose
from rps_pin.rps.workspace import leg_grid, workspace, workspace_to_file
from rps_pin.rps.workspace.compute import GridJob

Array = NDArray[np.float64]

#: Triples that the loop of fsolve is timed on; its time grows with their number.
FEW = 500


def fsolve_loop(length: Array, start: Array, g: float, h: float) -> Array:
    """Solve Eq. 8 for one set of leg lengths after the other with SciPy."""

    def equations(phi: Array, d: Array) -> Array:
        rho, z = g - d * np.cos(phi), d * np.sin(phi)
        rho_, z_ = np.roll(rho, -1), np.roll(z, -1)
        return rho**2 + rho_**2 + rho * rho_ + (z - z_) ** 2 - 3 * h**2

    return np.array([fsolve(equations, start, args=(d,)) for d in length])


@pytest.fixture(scope="module")
def micro() -> RPSParameters:
    return RPSParameters.from_preset("micro")


@pytest.mark.benchmark(group="direct kinematics, 50^3", min_rounds=7)
def bench_direct_kinematics(benchmark: BenchmarkFixture, micro: RPSParameters) -> None:
    """Time the poses of the whole grid, and a loop over the angles of some points."""
    job = GridJob(micro, leg_grid(micro, 50))
    mode = job.assembly_mode
    assert mode is not None
    points = job.grid.points()
    some = np.linspace(0, job.grid.size - 1, FEW).astype(int)

    pose, found = benchmark(mode.poses, points)
    ours = benchmark.stats.stats.median / job.grid.size

    begin = time.perf_counter()
    start = np.full(3, np.pi / 2)
    few = points.reshape(-1, 3)[some]
    peers = fsolve_loop(few, start, micro.base_radius, micro.platform_radius)
    theirs = (time.perf_counter() - begin) / FEW

    assert found.all()
    legs = geometry_of_pose(pose.reshape(-1, 3)[some], micro.base_radius, micro.platform_radius)
    np.testing.assert_allclose(legs.angle, peers, atol=1e-7)
    benchmark.extra_info["times as fast as a loop of fsolve"] = theirs / ours
    print(f"\n50^3 direct kinematics: {ours * job.grid.size:.4f} s; {1e9 * ours:.0f} ns a triple,")
    print(f"a loop of fsolve {1e6 * theirs:.0f} us: {theirs / ours:.0f} times as fast")
    assert theirs / ours >= 200


@pytest.mark.benchmark(group="workspace, cost per point")
@pytest.mark.parametrize("points", [22, 47, 100])  # 10^4, 10^5, 10^6
def bench_cost_per_point(
    benchmark: BenchmarkFixture, micro: RPSParameters, tmp_path: Path, points: int
) -> None:
    grid = leg_grid(micro, points)

    def run() -> None:
        workspace_to_file(micro, tmp_path / "space.h5", grid, workers=1, overwrite=True)

    benchmark.pedantic(run, rounds=2, warmup_rounds=0)
    each = 1e6 * benchmark.stats.stats.min / grid.size
    benchmark.extra_info["microseconds per point"] = each
    print(f"\n{grid.size} points into a file: {each:.2f} us a point, one thread")


def bench_all_in_memory(benchmark: BenchmarkFixture, micro: RPSParameters) -> None:
    """Time the paper's 51^3 points with all fields."""
    space = benchmark.pedantic(workspace, (micro,), rounds=3)
    assert space.inside.all()
