"""Results of the whole reproduction."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rps_pin.paper import formula_checks, mass_fit
from rps_pin.paper import near_singularity as near
from rps_pin.paper import paper_data as paper
from rps_pin.paper import workspace_comparison as comparison
from rps_pin.paper.agreement import Agreement, helix_agreement, random_agreement
from rps_pin.paper.comparison import Comparison, PathResult, compare, compute_paths
from rps_pin.paper.interpretations import BRANCHES, PathInterpretation
from rps_pin.paper.misprints import Misprint, formula_misprints
from rps_pin.paper.paper_helix import HelixLaw, helix_law, regular_helix
from rps_pin.paper.power_balance import power_balances
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.workspace import Workspace, leg_grid, workspace
from rps_pin.trajectories.helix import Branch

#: Wraps a loop, for a progress bar: (what is looped over, what is being done).
Track = Callable[[Iterable[Any], str], Iterable[Any]]

#: The legs of Fig. 2, all equal: the middle of the stroke, m.
EQUAL_LENGTH = 0.225


#: The columns of Table 2.
COLUMNS = {"This study": paper.THIS_STUDY, "Sokolov": paper.SOKOLOV}


class ColumnFits(NamedTuple):
    """What a free mass does for a column of Table 2."""

    fits: list[mass_fit.MassFit]
    """Every path's, the nearest first."""
    both: mass_fit.MassFit
    """The nearest path's, with the legs' mass free, too."""
    moved: list[mass_fit.MovedFit]
    """The nearest path's, with one of its numbers moved; empty if its Eq. 29 is as printed."""


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """All results; what depends on no option is computed where it is left out."""

    quick: bool
    checks: dict[int | str, float] = field(default_factory=formula_checks.formula_checks)
    degree: int = field(default_factory=formula_checks.degree_of_eq_8)
    counts: dict[int, int]
    misprints: dict[int, Misprint] = field(default_factory=formula_misprints)
    law: HelixLaw = field(default_factory=helix_law)
    balances: dict[str, float] = field(default_factory=power_balances)
    modes: AssemblyModes
    workspace: Workspace
    coarse_workspace: Workspace
    """For drawing surfaces."""
    cylinder: tuple[float, float] = field(default_factory=comparison.theoretical_reach)
    """See `theoretical_reach`."""
    greatest_base_radius: float = field(default_factory=comparison.greatest_base_radius)
    reach: tuple[comparison.PaperComparison, ...]
    """By base radius; the first is g = h."""
    runs: dict[Branch, MotionRun]
    """Along Table 1's helix from z_0 = 0.4 m, by branch."""
    paths: list[PathResult]
    comparisons: list[Comparison]
    """Every interpretation that has forces, the closest to Table 2 first."""
    fits: dict[str, ColumnFits]
    """By column of Table 2."""
    approach: near.Approach = field(default_factory=near.approach)
    sampled: list[near.Sampled] = field(default_factory=near.sampled_across)
    probes: list[near.Probe]
    random: Agreement
    helix: dict[str, Agreement] = field(default_factory=helix_agreement)


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
        comparison.paper_comparison(micro.parameters, [radius], points=points)[0]
        for radius in track(radii, "workspaces")
    )
    sokolov = RPSRobot.from_preset("sokolov")
    runs = {
        branch: run_motion(sokolov, regular_helix(sokolov, branch), 100.0 if quick else 1000.0)
        for branch in track(BRANCHES, "helix")
    }
    heights = {b: h[::8] for b, h in near.PROBED_HEIGHTS.items()} if quick else near.PROBED_HEIGHTS
    limits_of_length = comparison.with_length_limits_only(micro.parameters)
    return Reproduction(
        quick=quick,
        counts=formula_checks.solution_counts(200 if quick else 2000),
        modes=micro.assembly_modes([EQUAL_LENGTH] * 3),
        workspace=workspace(limits_of_length, leg_grid(micro.parameters, points)),
        coarse_workspace=workspace(limits_of_length, leg_grid(micro.parameters, min(points, 18))),
        reach=reach,
        runs=runs,
        paths=paths,
        comparisons=compare(paths),
        fits=_fits(paths, quick, track),
        probes=near.height_probes(heights, progress=lambda each: track(each, "near a singularity")),
        random=random_agreement(
            5 if quick else 100, progress=lambda each: track(each, "three ways to the forces")
        ),
    )


def _fits(paths: list[PathResult], quick: bool, track: Track) -> dict[str, ColumnFits]:
    found: dict[str, ColumnFits] = {}
    moved: dict[PathInterpretation, list[mass_fit.MovedPath]] = {}
    for column, printed in track(list(COLUMNS.items()), "free masses"):
        fits = mass_fit.mass_fits(paths, printed)
        path = fits[0].path
        if path not in moved:
            moved[path] = (
                mass_fit.moved_paths(path, quick=quick) if path.eq_29 == "corrected" else []
            )
        parts = next(result.parts for result in paths if result.interpretation == path)
        assert parts is not None  # it was fitted
        both = mass_fit.fit_both_masses(fits[0], parts, printed)
        found[column] = ColumnFits(fits, both, mass_fit.moved_fits(path, moved[path], printed))
    return found
