"""The reproduction as a Markdown page: a template, and the computed numbers in it."""

from __future__ import annotations

import math
from importlib.resources import files
from string import Formatter
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.paper import agreement, interpretations, misprints, tables
from rps_pin.paper import paper_data as paper
from rps_pin.paper.comparison import Comparison
from rps_pin.paper.compute import EQUAL_LENGTH, ColumnFits, Reproduction
from rps_pin.paper.interpretations import STANDARD_GRAVITY, PathInterpretation
from rps_pin.rps.parameters import RPSParameters

_QUICK_NOTE = """**This is a quick run**: coarser grids, and a part of the interpretations only.

"""
REPRODUCED, CORRECTED, DEFINITION = "reproduced", "corrected", "a definition"
_EQUATIONS = 29
#: Largest error of an equation that counts as reproduced (what central differences leave).
_LIMIT = 1e-6


def render(found: Reproduction) -> str:
    """Return the page as Markdown; its pictures are looked for in the folder `reproduction`."""
    template = (files(__package__) / "page.md.in").read_text("utf-8")
    return _PageFormatter().vformat(template, (), _values(found))


def closest_interpretation(found: Reproduction) -> Comparison:
    """Return the interpretation that comes closest to Table 2, its columns being any legs."""
    return min(found.comparisons, key=lambda row: row.distance_relabelled)


def equation_status(found: Reproduction) -> dict[int, str]:
    """Return how each equation came out, by its number."""
    errors = {n: value for n, value in found.checks.items() if isinstance(n, int)}
    errors[8] = float(np.max([errors[8], found.checks["8 closed"]]))
    errors[9] = found.balances["Eq. 13 to 21 corrected"]
    errors |= dict.fromkeys((22, 24, 25), found.random.lagrange)
    status = dict.fromkeys(range(1, _EQUATIONS + 1), DEFINITION)
    for n, value in errors.items():
        status[n] = REPRODUCED if value < _LIMIT else f"**not {REPRODUCED}**"
    for n, misprint in found.misprints.items():
        status[n] = CORRECTED if misprint.confirmed else f"**not {CORRECTED}**"
    return status


def verdicts(found: Reproduction) -> dict[str, str]:
    """Return whether what the paper states of itself holds, by what it is about."""
    first, ratio = found.reach[0], _ratio_to_sokolov()
    across, climb = first.x[1] - first.x[0], first.z[1] - first.z[0]
    xx, yy, zz = paper.PLATFORM_INERTIA
    holds = {
        "solutions": len(found.modes.angle) == paper.STATED_SOLUTIONS,
        "cylinder": found.cylinder[1] <= 1 + 1e-12,
        "points": _points() == paper.STATED_POINTS,
        "scale": climb > 5 * across,
        "volume": first.cylinder_volume > 10 * first.volume,
        "inertia": zz <= xx + yy,
        "smaller": ratio.max() < 1,
    }
    return {name: "holds" if so else CORRECTED for name, so in holds.items()}


def summary_lines(found: Reproduction) -> list[tuple[str, str]]:
    """Return the results in a few lines: what, and how it came out."""
    bad = [f"Eq. {n}" for n, one in found.misprints.items() if not one.confirmed]
    lines = {
        "equations": "{reproduced} hold, {corrected} corrected",
        "misprints not confirmed": ", ".join(bad) or "none",
        "three ways to the forces": "{found.random.forces:error} at {found.random.drawn:,} "
        "random states",
        "forces of Table 1 from z_0 = 0.4 m": "{clean_forces} N",
        "interpretations of Table 1": "{interpretation_count:,} on {path_count} paths",
        "closest to Table 2": "{best_path}; distance {best.distance_relabelled:.3f}",
        "the same with the platform's mass fitted": "within "
        "{found.fits[This study].fits[0].distance:.1%} at "
        "{found.fits[This study].fits[0].platform_mass:.1f} kg; Sokolov: "
        "{found.fits[Sokolov].fits[0].distance:.1%} at "
        "{found.fits[Sokolov].fits[0].platform_mass:.1f} kg",
    }
    values, formatter = _values(found), _PageFormatter()
    return [(name, formatter.vformat(text, (), values)) for name, text in lines.items()]


class _PageFormatter(Formatter):
    """Formats fields; ``error`` gives a bound, ``list`` joins, percents have a space."""

    def format_field(self, value: Any, format_spec: str) -> Any:
        if format_spec == "error":
            return tables.error(value)
        if format_spec == "list":
            return ", ".join(value)
        text = super().format_field(value, format_spec)
        return f"{text[:-1]} %" if format_spec.endswith("%") else text


def _values(found: Reproduction) -> dict[str, Any]:
    """Return what the template's fields name."""
    best = closest_interpretation(found)
    return {
        "found": found,
        "paper": paper,
        "choices": interpretations,
        "misprints": misprints,
        "agreement": agreement,
        "masses": tables.masses(),
        "best": best,
        "tables": _tables(found, best),
        **_of_equations(found),
        **_of_statements(found),
        **_of_table_2(found, best),
    }


def _tables(found: Reproduction, best: Comparison) -> dict[str, str]:
    whole = (
        *(tables.reach, tables.helix_ranges, tables.probes, tables.sampled, tables.crossings),
        *(tables.paths, tables.fits, tables.moved),
    )
    return {
        **{table.__name__: table(found) for table in whole},
        "closest": tables.closest(found, relabelled=False),
        "closest_relabelled": tables.closest(found, relabelled=True),
        "differences": tables.differences(best),
    }


def _of_equations(found: Reproduction) -> dict[str, Any]:
    status = equation_status(found)
    corrected = sum(one == CORRECTED for one in status.values())
    return {
        "quick_note": _QUICK_NOTE if found.quick else "",
        "status": status,
        "corrected": corrected,
        "reproduced": len(status) - corrected,
        "solutions": 2 * found.degree,
        "most_solutions": max(found.counts),
    }


def _of_statements(found: Reproduction) -> dict[str, Any]:
    low, high = paper.STROKE_MM
    first, law, ratio = found.reach[0], found.law, _ratio_to_sokolov()
    xx, yy, zz = paper.PLATFORM_INERTIA
    above, modes = int(found.modes.above.sum()), len(found.modes.angle)
    table_1 = RPSParameters.from_preset("sokolov")
    return {
        "verdicts": verdicts(found),
        "solution_counts": ", ".join(f"{times} times {n}" for n, times in found.counts.items()),
        "modes": modes,
        "modes_above": above,
        "modes_below": modes - above,
        "equal_length": 1e3 * EQUAL_LENGTH,
        "points": _points(),
        "step": (high - low) / (paper.STATED_POINTS - 1),
        "greatest_g": 1e3 * found.greatest_base_radius,
        "climb": 1e3 * (first.z[1] - first.z[0]),
        "across": 1e3 * (first.x[1] - first.x[0]),
        "volume_ratio": first.cylinder_volume / first.volume,
        "t_b": law.end - 2 * paper.RAMP_END,
        "turns": law.turn_at_end / math.pi,
        "short_of_a_turn": 2 * math.pi - law.turn_at_printed_end,
        "table_1": table_1,
        "inertia": np.diag(table_1.platform_inertia),
        "inertia_excess": zz - xx - yy,
        "disc_radius": math.sqrt(2 * zz / paper.PLATFORM_MASS),
        "gyration": math.sqrt(paper.LEG_INERTIA / paper.LEG_MASS),
        "longest_leg": max(run.length.max() for run in found.runs.values()),
        "sokolov_ratio_low": ratio.min(),
        "sokolov_ratio_high": ratio.max(),
    }


def _of_table_2(found: Reproduction, best: Comparison) -> dict[str, Any]:
    force = np.concatenate([run.force for run in found.runs.values()])
    largest_printed = paper.THIS_STUDY.largest
    ratio = best.relabelled.numbers() / paper.THIS_STUDY.numbers()
    regular = [probe for probe in found.probes if probe.forces]
    strong = [p.nearest for p in regular if p.forces and p.forces.largest > 100.0]
    # By the largest distance among probes of 100 N or more; if none was tried, by the smallest.
    reached = max(strong) if strong else min(p.nearest for p in regular)
    return {
        "clean_forces": f"{force.min():.2f} to {force.max():.2f}",
        "largest_printed": largest_printed,
        "times_too_small": largest_printed / force.max(),
        "path_count": len(found.paths),
        "interpretation_count": len(found.comparisons),
        "weight": (paper.PLATFORM_MASS + 3 * paper.LEG_MASS) * STANDARD_GRAVITY,
        "crossings": {branch: _crossings(found, branch) for branch in "+-"},
        "probe_distance": 10 ** math.ceil(math.log10(reached)),
        "probe_best": min(p.distance for p in regular if p.branch == "+"),
        "best_path": _words(best.path),
        "best_bodies": tables.bodies_words(best),
        "ratio_low": ratio.min(),
        "ratio_high": ratio.max(),
        "mass_change": _mass_change(found.fits["This study"]),
    }


def _points() -> int:
    """Return how many of the paper's steps span its stroke, ends included."""
    return round((paper.STROKE_MM[1] - paper.STROKE_MM[0]) / paper.STEP_MM) + 1


def _ratio_to_sokolov() -> Array:
    """Return the sizes of Table 2's forces over Sokolov's, shape (6,)."""
    return np.abs(paper.THIS_STUDY.numbers() / paper.SOKOLOV.numbers())


def _crossings(found: Reproduction, branch: str) -> int:
    """Return how often the path exactly as Table 1 prints it crosses singularities."""
    return next(
        len(one.crossings)
        for one in found.paths
        if one.interpretation.as_meant
        and (one.interpretation.height_unit, one.interpretation.helix_unit) == ("mm", "mm")
        and one.interpretation.branch == branch
    )


def _mass_change(fits: ColumnFits) -> float:
    """Return by what share the fitted mass changes if z_0 is a millimetre off."""
    given = fits.fits[0].platform_mass
    return max(
        abs(one.platform_mass / given - 1)
        for one in fits.moved
        if one.moved == "z_0" and abs(one.by) == 1e-3
    )


def _words(path: PathInterpretation) -> str:
    return (
        f"z_0 = {path.height:g} m, r_h = {1e3 * path.helix_radius:g} mm, p_h = "
        f"{1e3 * path.helix_pitch:g} mm, branch {path.branch}, g = {1e3 * path.base_radius:.0f} "
        f"mm, h = {1e3 * path.platform_radius:.0f} mm, Eq. 5 {path.eq_5}, Eq. 29 {path.eq_29}"
    )
