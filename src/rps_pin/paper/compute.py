"""Everything the reproduction page shows, computed in one go."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from rps_pin.paper import paper_data as paper
from rps_pin.paper.agreement import Agreement, helix_agreement, random_agreement
from rps_pin.paper.comparison import Comparison, PathResult, compare, compute_paths
from rps_pin.paper.formula_checks import degree_of_eq_8, formula_checks, solution_counts
from rps_pin.paper.interpretations import BRANCHES, PathInterpretation
from rps_pin.paper.mass_fit import (
    MassFit,
    MovedFit,
    MovedPath,
    fit_both_masses,
    mass_fits,
    moved_fits,
    moved_paths,
)
from rps_pin.paper.misprints import Misprint, formula_misprints
from rps_pin.paper.near_singularity import (
    PROBED_HEIGHTS,
    Approach,
    Probe,
    Sampled,
    approach,
    height_probes,
    sampled_across,
)
from rps_pin.paper.paper_helix import HelixLaw, helix_law
from rps_pin.paper.power_balance import power_balances
from rps_pin.paper.workspace_comparison import (
    PaperComparison,
    greatest_base_radius,
    paper_comparison,
    theoretical_reach,
)
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.workspace import Workspace, leg_grid, workspace
from rps_pin.trajectories.helix import Branch, helix

#: Wraps a loop, for a progress bar: (what is looped over, what is being done).
Track = Callable[[Iterable[Any], str], Iterable[Any]]

#: The legs of Fig. 2, all equal: the middle of the stroke, m.
EQUAL_LENGTH = 0.225


#: The columns of Table 2.
COLUMNS = {"This study": paper.THIS_STUDY, "Sokolov": paper.SOKOLOV}


class ColumnFits(NamedTuple):
    """What a free mass does for a column of Table 2."""

    fits: list[MassFit]
    """Every path's, the nearest first."""
    both: MassFit
    """The nearest path's, with the legs' mass free, too."""
    moved: list[MovedFit]
    """The nearest path's, with one of its numbers moved; empty if its Eq. 29 is as printed."""


@dataclass(frozen=True)
class Reproduction:
    """All results; see the functions that compute them."""

    quick: bool
    checks: dict[int | str, float]
    degree: int
    counts: dict[int, int]
    misprints: dict[int, Misprint]
    law: HelixLaw
    balances: dict[str, float]
    modes: AssemblyModes
    workspace: Workspace
    coarse_workspace: Workspace
    """For drawing surfaces."""
    cylinder: tuple[float, float]
    """See `theoretical_reach`."""
    greatest_base_radius: float
    reach: tuple[PaperComparison, ...]
    """By base radius; the first is g = h."""
    runs: dict[Branch, MotionRun]
    """Along Table 1's helix from z_0 = 0.4 m, by branch."""
    paths: list[PathResult]
    comparisons: list[Comparison]
    """Every interpretation that has forces, the closest to Table 2 first."""
    fits: dict[str, ColumnFits]
    """By column of Table 2."""
    approach: Approach
    sampled: list[Sampled]
    probes: list[Probe]
    random: Agreement
    helix: dict[str, Agreement]


def compute(*, quick: bool = False, track: Track = lambda items, _: items) -> Reproduction:
    """Compute the reproduction of the paper.

    Parameters
    ----------
    quick
        Coarser grids and fewer interpretations, in a few seconds; the page says so.
    track
        Wraps the longer loops, for a progress bar.
    """
    paths = compute_paths(
        samples=300 if quick else 1000,
        quick=quick,
        progress=lambda each: track(each, "interpretations of Table 1"),
    )
    micro = RPSRobot.from_preset("micro")
    points = 13 if quick else 51
    radii = (0.12, 0.18) if quick else (0.12, 0.15, 0.18, 0.21, 0.24)
    reach = tuple(
        paper_comparison(micro.parameters, [radius], points=points)[0]
        for radius in track(radii, "workspaces")
    )
    runs = {
        branch: _helix_run(branch, 100 if quick else 1000) for branch in track(BRANCHES, "helix")
    }
    heights = {b: h[::8] for b, h in PROBED_HEIGHTS.items()} if quick else PROBED_HEIGHTS
    limits_of_length = _without_angle_limits(micro)
    return Reproduction(
        quick=quick,
        checks=formula_checks(),
        degree=degree_of_eq_8(),
        counts=solution_counts(200 if quick else 2000),
        misprints=formula_misprints(),
        law=helix_law(),
        balances=power_balances(),
        modes=micro.assembly_modes([EQUAL_LENGTH] * 3),
        workspace=workspace(limits_of_length, leg_grid(micro.parameters, points)),
        coarse_workspace=workspace(limits_of_length, leg_grid(micro.parameters, min(points, 18))),
        cylinder=theoretical_reach(),
        greatest_base_radius=greatest_base_radius(),
        reach=reach,
        runs=runs,
        paths=paths,
        comparisons=compare(paths),
        fits=_fits(paths, quick, track),
        approach=approach(),
        sampled=sampled_across(),
        probes=height_probes(heights, progress=lambda each: track(each, "near a singularity")),
        random=random_agreement(
            5 if quick else 100, progress=lambda each: track(each, "three ways to the forces")
        ),
        helix=helix_agreement(),
    )


def _fits(paths: list[PathResult], quick: bool, track: Track) -> dict[str, ColumnFits]:
    found: dict[str, ColumnFits] = {}
    moved: dict[PathInterpretation, list[MovedPath]] = {}
    for column, printed in track(list(COLUMNS.items()), "free masses"):
        fits = mass_fits(paths, printed)
        path = fits[0].path
        if path not in moved:
            moved[path] = moved_paths(path, quick=quick) if path.eq_29 == "corrected" else []
        parts = next(result.parts for result in paths if result.interpretation == path)
        assert parts is not None  # it was fitted
        both = fit_both_masses(fits[0], parts, printed)
        found[column] = ColumnFits(fits, both, moved_fits(path, moved[path], printed))
    return found


def _without_angle_limits(robot: RPSRobot) -> RPSParameters:
    """Return the robot's parameters as Section 3 has them: with limits of length only."""
    return robot.parameters.replace(
        leg_angle_limits=(-math.pi, math.pi), spherical_cone_limit=math.pi
    )


def _helix_run(branch: Branch, rate: float) -> MotionRun:
    robot = RPSRobot.from_preset("sokolov")
    unit = 1e-3
    path = helix(
        robot,
        radius=paper.HELIX_RADIUS * unit,
        pitch=paper.HELIX_PITCH * unit,
        height=paper.HELIX_HEIGHT,
        branch=branch,
    )
    return run_motion(robot, path, rate)
