"""Forces of Table 1's robot near a parallel singularity.

Three computations: the forces on the way into a crossing; the forces that a program reports if it
samples a path without checking for crossings; and helices at decreasing distances to a singularity.
The last are probes, not interpretations of Table 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.paper import paper_data as paper
from rps_pin.paper.comparison import dense_times, distance, force_range
from rps_pin.paper.interpretations import BRANCHES
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.paper_data import ForceRange
from rps_pin.paper.paper_helix import PaperHelix
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.trajectories.helix import Branch

Progress = Callable[[Iterable[tuple[Branch, float]]], Iterable[tuple[Branch, float]]]

#: Largest gain of the equations that is still computed with: what rounding leaves.
_MAX_GAIN = 1e15

_COARSE = tuple(round(0.36 + 0.005 * i, 4) for i in range(17))
#: Heights z_0 of `height_probes`, m: every 5 mm, and closer where crossings begin.
PROBED_HEIGHTS: dict[Branch, tuple[float, ...]] = {
    "+": tuple(sorted({*_COARSE, 0.386, 0.38605, 0.38608, 0.38609, 0.3862, 0.387})),
    "-": tuple(sorted({*_COARSE, 0.401, 0.402, 0.4025, 0.4027, 0.4028, 0.403})),
}

#: Sample rates of `sampled_across`, Hz.
RATES = (50, 100, 200, 500, 1000, 2000)


class Approach(NamedTuple):
    """The forces on the way into the first crossing of z_0 = 0.4 mm, n samples."""

    crossing: float
    """When the path crosses, s."""
    before: Array
    """How long before, shape (n,), s."""
    distance: Array
    """To the singularity (type II of `SingularityMeasures`), shape (n,)."""
    force: Array
    """Largest size of an actuator force, shape (n,), N."""
    slope: float
    """Of log(force) over log(distance), by least squares over distances below 1e-3."""


class Sampled(NamedTuple):
    """Force ranges of a path that is sampled without checking for crossings."""

    path: str
    crossings: int
    rate: float
    """Samples a second, Hz."""
    forces: ForceRange
    distance: float
    """To Table 2."""


class Probe(NamedTuple):
    """A helix of r_h = 75 mm and p_h = 50 mm from a height."""

    height: float
    """The height z_0, m."""
    branch: Branch
    crossings: tuple[float, ...]
    """When it crosses a singularity, s."""
    nearest: float
    """Smallest distance to a singularity; 0 if it crosses."""
    forces: ForceRange | None
    """None if it crosses."""
    distance: float
    """To Table 2; not a number if it crosses."""


def table_1_helix(height: float, helix_unit: float = 1e-3, branch: Branch = "+") -> PaperHelix:
    """Return the helix of Table 1 from a height (m), with r_h and p_h in a unit (m)."""
    return PaperHelix(
        paper.PLATFORM_RADIUS_MM * 1e-3,
        paper.HELIX_RADIUS * helix_unit,
        paper.HELIX_PITCH * helix_unit,
        height,
        branch=branch,
    )


def approach(points: int = 60) -> Approach:
    """Return the forces on the way into the first crossing of the path as Table 1 prints it."""
    robot = RPSRobot.from_preset("sokolov")
    path = table_1_helix(paper.HELIX_HEIGHT * 1e-3)
    crossing = check_path(robot, path, tolerance=1e-12).singularities[0].time
    before = np.geomspace(1e-1, 1e-7, points)
    motion = path.sample(crossing - before)
    near = np.asarray(singularity_measures(robot.parameters, motion.pose).type_ii)
    force = np.abs(lagrange_forces(robot.parameters, *motion, max_gain=_MAX_GAIN).force).max(
        axis=-1
    )
    close = near < 1e-3
    slope = np.polynomial.polynomial.polyfit(np.log(near[close]), np.log(force[close]), 1)[1]
    return Approach(crossing, before, near, force, float(slope))


def sampled_across() -> list[Sampled]:
    """Return least and greatest forces, by sample rate, of paths that cross singularities.

    The forces are infinite at a crossing: the values depend on how near to it a sample lies.
    """
    robot = RPSRobot.from_preset("sokolov")
    paths: list[tuple[str, PaperHelix]] = [
        ("as printed: z_0 = 0.4 mm, branch +", table_1_helix(0.4e-3)),
        ("as printed: z_0 = 0.4 mm, branch -", table_1_helix(0.4e-3, branch="-")),
        ("z_0 = 0.4 m, r_h = 75 mm, p_h = 50 mm, branch +", table_1_helix(0.4, 0.1)),
    ]
    rows = []
    for name, path in paths:
        crossings = len(check_path(robot, path, tolerance=1e-6).singularities)
        for rate in RATES:
            times = np.arange(0.0, path.duration, 1 / rate)
            force = lagrange_forces(robot.parameters, *path.sample(times), max_gain=_MAX_GAIN).force
            found = force_range(force)
            rows.append(Sampled(name, crossings, rate, found, distance(found)))
    return rows


def height_probes(
    heights: Mapping[Branch, Sequence[float]] = PROBED_HEIGHTS,
    samples: int = 1000,
    *,
    progress: Progress = iter,
) -> list[Probe]:
    """Return helices of r_h = 75 mm, p_h = 50 mm from several heights z_0 (m), by branch.

    Parameters
    ----------
    heights
        By branch, m.
    samples
        Of a path, besides those around its nearest approach.
    progress
        Wraps the loop over the helices, for a progress bar.
    """
    helices = [(branch, height) for branch in BRANCHES for height in heights[branch]]
    return [_probe(height, branch, samples) for branch, height in progress(helices)]


def _probe(height: float, branch: Branch, samples: int) -> Probe:
    robot = RPSRobot.from_preset("sokolov")
    path = table_1_helix(height, 0.1, branch)
    found = check_path(robot, path, tolerance=1e-6, least_steps=500)
    crossings = tuple(e.time for e in found.singularities if e.kind != "grazes")
    if crossings:
        return Probe(height, branch, crossings, 0.0, None, math.nan)
    times = dense_times(path.duration, found.minimum_time, samples)
    force = lagrange_forces(robot.parameters, *path.sample(times)).force
    ranges = force_range(force)
    return Probe(height, branch, (), found.minimum_distance, ranges, distance(ranges))
