"""Forces of every interpretation of Table 1, compared with Table 2.

A path that is out of reach, or crosses a singularity, has no least and greatest force: it is
refused, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import permutations
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.paper import paper_data as paper
from rps_pin.paper.force_parts import ForceParts, UnitRobot, combined, force_parts
from rps_pin.paper.interpretations import (
    BodyInterpretation,
    PathInterpretation,
    body_interpretations,
    path_interpretations,
)
from rps_pin.paper.paper_data import ForceRange
from rps_pin.paper.paper_helix import smooth_parts
from rps_pin.rps.singularity.path_check import check_path

Progress = Callable[[Iterable[PathInterpretation]], Iterable[PathInterpretation]]

OUT_OF_REACH, SINGULAR = "out of reach", "crosses a singularity"


@dataclass(frozen=True)
class PathResult:
    """A path and what it meets; its forces by cause if it meets nothing."""

    interpretation: PathInterpretation
    refused: str
    """`OUT_OF_REACH`, `SINGULAR`, or empty."""
    crossings: tuple[float, ...]
    """When it crosses a singularity, s."""
    nearest: float
    """Smallest distance to any singularity (`SingularityMeasures`), 0 to 1; 0 if it crosses, not a
    number if it is out of reach."""
    times: Array
    """When the forces are computed, shape (n,), s; none if it is refused."""
    parts: ForceParts | None


class Labels(NamedTuple):
    """What our legs and the sense of their forces are called in Table 2."""

    order: tuple[int, int, int]
    """Which of our legs, 0 to 2, is the table's d_1, d_2, d_3."""
    sign: int
    """1, or -1 if a force that pushes the leg out counts as negative."""

    def __str__(self) -> str:
        legs = ", ".join(str(leg + 1) for leg in self.order)
        return f"legs {legs}" + (", signs changed" if self.sign < 0 else "")


class Comparison(NamedTuple):
    """Forces of an interpretation, compared with Table 2."""

    path: PathInterpretation
    body: BodyInterpretation
    nearest: float
    forces: ForceRange
    distance: float
    """`distance` to Table 2's "This study"."""
    labels: Labels
    """The order of legs and sign of forces that come closest."""
    relabelled: ForceRange
    """The forces by those labels."""
    distance_relabelled: float
    """Their distance."""


def compute_paths(
    *, samples: int = 1000, quick: bool = False, progress: Progress = iter
) -> list[PathResult]:
    """Return every path interpretation with what it meets, and its forces by cause.

    Parameters
    ----------
    samples
        Of each smooth part of a path, from end to end.
    quick
        A part of the grid only.
    progress
        Wraps the loop over the interpretations, for a progress bar.
    """
    return [
        path_result(each, samples) for each in progress(list(path_interpretations(quick=quick)))
    ]


def path_result(interpretation: PathInterpretation, samples: int) -> PathResult:
    """Return what a path meets, and its forces by cause if there are."""
    nothing = np.empty(0)
    try:
        path = interpretation.path()
    except InputError:
        return PathResult(interpretation, OUT_OF_REACH, (), math.nan, nothing, None)
    robot = UnitRobot(interpretation.base_radius, interpretation.platform_radius)
    pieces = smooth_parts(path)
    checks = [check_path(robot, piece, tolerance=1e-6, least_steps=500) for piece in pieces]
    crossings = tuple(
        event.time + piece.start
        for piece, check in zip(pieces, checks, strict=True)
        for event in check.singularities
        if event.kind != "grazes"
    )
    if crossings:
        return PathResult(interpretation, SINGULAR, crossings, 0.0, nothing, None)
    times, parts = [], []
    for piece, check in zip(pieces, checks, strict=True):
        at = dense_times(piece.duration, check.minimum_time, samples, piece.start)
        times.append(at + piece.start)
        parts.append(force_parts(robot, piece.sample(at)))
    joined = ForceParts(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    nearest = min(check.minimum_distance for check in checks)
    return PathResult(interpretation, "", (), nearest, np.concatenate(times), joined)


def dense_times(duration: float, near: float, samples: int, start: float = 0.0) -> Array:
    """Return equal steps from end to end, ever finer ones around the nearest approach, and knots.

    Parameters
    ----------
    duration
        Of the path, s.
    near
        When it is nearest to a singularity, s: there its forces peak.
    samples
        Of equal steps.
    start
        When in Eq. 29's time the path begins, s: where phi'' jumps, both sides are sampled.
    """
    around = np.geomspace(1e-7, 0.1, 61) * duration
    jumps = np.array([paper.RAMP_END, paper.BRAKE_START]) - start
    steps = np.linspace(0.0, duration, samples)
    times = np.concatenate(
        [steps, near - around, [near], near + around, jumps - 1e-12, jumps + 1e-12]
    )
    return np.unique(times[(times >= 0) & (times <= duration)])


def force_range(force: Array) -> ForceRange:
    """Return the least and greatest forces of legs 1 to 3, of forces (n, 3)."""
    (a, b, c), (d, e, f) = force.min(axis=0).tolist(), force.max(axis=0).tolist()
    return ForceRange((a, b, c), (d, e, f))


def distance(found: ForceRange, printed: ForceRange = paper.THIS_STUDY) -> float:
    """Return the root mean square of the six differences over that of the six printed numbers.

    0 is agreement; 1 is what no forces at all would have.
    """
    wanted = printed.numbers()
    difference = found.numbers() - wanted
    return float(np.linalg.norm(difference) / np.linalg.norm(wanted))


def relabelled(found: ForceRange) -> Iterator[tuple[Labels, ForceRange]]:
    """Yield the ranges with the legs in every order, and with forces of either sign."""
    least, greatest = np.array(found.least), np.array(found.greatest)
    for a, b, c in permutations(range(3)):
        ends = np.stack([least[[a, b, c]], greatest[[a, b, c]]])
        yield Labels((a, b, c), 1), force_range(ends)
        yield Labels((a, b, c), -1), force_range(-ends)


def closest_labels(
    found: ForceRange, printed: ForceRange = paper.THIS_STUDY
) -> tuple[Labels, ForceRange, float]:
    """Return the labels of legs that come closest, the ranges by those, and their distance."""
    tried = [(labels, ranges, distance(ranges, printed)) for labels, ranges in relabelled(found)]
    return min(tried, key=lambda one: one[2])


def compare(paths: Iterable[PathResult]) -> list[Comparison]:
    """Return every interpretation that has forces, the closest to Table 2 first."""
    rows = []
    for result in paths:
        if result.parts is None:
            continue
        for body in body_interpretations():
            forces = force_range(combined(result.parts, body))
            rows.append(
                Comparison(
                    result.interpretation,
                    body,
                    result.nearest,
                    forces,
                    distance(forces),
                    *closest_labels(forces),
                )
            )
    return sorted(rows, key=lambda row: round(row.distance, 9))
