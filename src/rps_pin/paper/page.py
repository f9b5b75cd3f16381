"""The reproduction as a page of Markdown: a template, and every number in it from computation."""

from __future__ import annotations

import math
from importlib.resources import files
from string import Template

import numpy as np

from rps_pin.arrays import Array
from rps_pin.paper import paper_data as paper
from rps_pin.paper import reading_tables, tables
from rps_pin.paper.agreement import NEAREST
from rps_pin.paper.comparison import Comparison
from rps_pin.paper.compute import EQUAL_LENGTH, ColumnFits, Reproduction
from rps_pin.paper.equations import CORRECTED, equation_lines
from rps_pin.paper.printing import error
from rps_pin.paper.readings import DISC_MASS, STANDARD_GRAVITY, PathReading
from rps_pin.paper.statements import greatest_base_radius

_QUICK_NOTE = """**This is a quick run**: coarser grids, and a part of the readings only.

"""


def render(found: Reproduction) -> str:
    """Return the page as Markdown; its pictures are looked for in the folder `reproduction`."""
    template = Template((files(__package__) / "page.md.in").read_text("utf-8"))
    return template.substitute(
        **_summary(found), **_figures(found), **_tables(found), **_table_2(found)
    )


def closest_reading(found: Reproduction) -> Comparison:
    """Return the reading that comes closest to Table 2, its columns being any of our legs."""
    return min(found.comparisons, key=lambda row: row.distance_relabelled)


def summary_lines(found: Reproduction) -> list[tuple[str, str]]:
    """Return the results in a few lines: what, and how it came out."""
    text = _summary(found) | _table_2(found)
    bad = [one.where for one in found.misprints if not one.confirmed]
    return [
        ("equations", f"{text['equations_held']} hold, {text['equations_corrected']} corrected"),
        ("misprints not confirmed", ", ".join(bad) or "none"),
        ("three ways to the forces", f"{text['agreement']} at {text['states']} random states"),
        ("forces of Table 1 from z_0 = 0.4 m", f"{text['clean_forces']} N"),
        ("readings of Table 1", f"{text['reading_count']} on {text['path_count']} paths"),
        ("closest to Table 2", f"{text['best_path']}; distance {text['best_distance']}"),
        (
            "the same with the platform's mass fitted",
            f"within {text['fit_this_percent']} % at {text['fit_this_mass']} kg; Sokolov: "
            f"{text['fit_sokolov_percent']} % at {text['fit_sokolov_mass']} kg",
        ),
    ]


def _tables(found: Reproduction) -> dict[str, str]:
    return {
        "equations": tables.equations(found),
        "misprints": tables.misprints(found),
        "balances": tables.balances(found),
        "statements": tables.statements(found),
        "reach": tables.reach(found),
        "table_1": tables.table_1(),
        "helix_ranges": tables.helix_ranges(found),
        "agreement_table": tables.agreement(found),
        "table_2": tables.table_2(),
        "probes": reading_tables.probes(found),
        "sampled": reading_tables.sampled(found),
        "crossings": reading_tables.crossings(found),
        "grid": reading_tables.grid(),
        "paths": reading_tables.paths(found),
        "closest": reading_tables.closest(found, relabelled=False),
        "closest_relabelled": reading_tables.closest(found, relabelled=True),
        "differences": reading_tables.differences(closest_reading(found)),
        "fits": reading_tables.fits(found),
        "moved": reading_tables.moved(found),
    }


def _summary(found: Reproduction) -> dict[str, str]:
    status = [line.status for line in equation_lines(found)]
    mended = sum(CORRECTED in one and "number" not in one for one in status)
    clean = [run.force for run in found.runs.values()]
    low, high = min(f.min() for f in clean), max(f.max() for f in clean)
    ways = found.random
    return {
        "quick_note": _QUICK_NOTE if found.quick else "",
        "equations_held": str(len(status) - mended),
        "equations_corrected": str(mended),
        "agreement": error(max(ways.lagrange, ways.virtual_work, ways.lagrange_virtual_work)),
        "states": f"{ways.states + ways.left_out:,}",
        "left_out": str(ways.left_out),
        "nearest_limit": f"{NEAREST:g}",
        "clean_forces": f"{low:.2f} to {high:.2f}",
        "largest_printed": f"{_largest(paper.THIS_STUDY.numbers()):.0f}",
        "times_too_small": f"{_largest(paper.THIS_STUDY.numbers()) / high:.0f}",
        "path_count": str(len(found.paths)),
        "reading_count": f"{len(found.comparisons):,}",
        "t_t": f"{found.law.end:.5f}",
        "t_b": f"{found.law.end - 2 * paper.RAMP_END:.5f}",
    }


def _figures(found: Reproduction) -> dict[str, str]:
    low, high = paper.STROKE_MM
    return {
        "modes": str(len(found.modes.angle)),
        "modes_above": str(int(found.modes.above.sum())),
        "equal_length": f"{1e3 * EQUAL_LENGTH:g}",
        "workspace_h": f"{paper.WORKSPACE_PLATFORM_RADIUS_MM:g}",
        "stroke": f"{low:g} to {high:g}",
        "greatest_g": f"{1e3 * greatest_base_radius():.2f}",
    }


def _table_2(found: Reproduction) -> dict[str, str]:
    best = closest_reading(found)
    this, sokolov = found.fits["This study"], found.fits["Sokolov"]
    ratio = best.relabelled.numbers() / paper.THIS_STUDY.numbers()
    strong = [
        p.nearest
        for p in found.probes
        if p.forces is not None and _largest(p.forces.numbers()) > 100.0
    ]
    # By the largest distance among probes of 100 N or more; if none was tried, by the smallest.
    reached = max(strong) if strong else min(p.nearest for p in found.probes if p.nearest)
    upper = [p.distance for p in found.probes if p.branch == "+" and p.forces is not None]
    weight = (paper.PLATFORM_MASS + 3 * paper.LEG_MASS) * STANDARD_GRAVITY
    jump = next(one.error_printed for one in found.misprints if one.where == "Eq. 29")
    return {
        "slope": f"{found.approach.slope:.3f}",
        "crossing_time": f"{found.approach.crossing:.4f}",
        "weight": f"{weight:.1f}",
        "printed_crossings_plus": str(_crossings(found, "+")),
        "printed_crossings_minus": str(_crossings(found, "-")),
        "probe_distance": f"{10 ** math.ceil(math.log10(reached)):g}",
        "probe_best": f"{min(upper):.2f}",
        "jump": f"{jump:.0f}",
        "spin": f"{found.law.printed_end_rate:.0f}",
        "best_path": _words(best.path),
        "best_labels": str(best.labels),
        "best_bodies": reading_tables.bodies_words(best),
        "best_near": f"{best.nearest:.4f}",
        "best_distance": f"{best.distance_relabelled:.3f}",
        "ratio_low": f"{ratio.min():.2f}",
        "ratio_high": f"{ratio.max():.2f}",
        "fit_this_percent": f"{100 * this.fits[0].distance:.1f}",
        "fit_sokolov_percent": f"{100 * sokolov.fits[0].distance:.1f}",
        "fit_this_mass": f"{this.fits[0].platform_mass:.1f}",
        "fit_sokolov_mass": f"{sokolov.fits[0].platform_mass:.1f}",
        "second_this_percent": f"{100 * this.fits[1].distance:.0f}",
        "second_sokolov_percent": f"{100 * sokolov.fits[1].distance:.0f}",
        "both_this_mass": f"{this.both.platform_mass:.1f}",
        "both_this_leg": f"{this.both.leg_mass:.1f}",
        "mass_change": f"{100 * _mass_change(this):.0f}",
        "printed_mass": f"{paper.PLATFORM_MASS:g}",
        "disc_mass": f"{DISC_MASS:.1f}",
        "gyration": f"{math.sqrt(paper.LEG_INERTIA / paper.LEG_MASS):.2f}",
    }


def _crossings(found: Reproduction, branch: str) -> int:
    """Return how often the path exactly as Table 1 prints it crosses singularities."""
    return next(
        len(one.crossings)
        for one in found.paths
        if one.reading.as_meant
        and (one.reading.height_unit, one.reading.helix_unit) == ("mm", "mm")
        and one.reading.branch == branch
    )


def _mass_change(fits: ColumnFits) -> float:
    """Return by what share the fitted mass changes if z_0 is a millimetre off."""
    given = fits.fits[0].platform_mass
    return max(
        abs(one.platform_mass / given - 1)
        for one in fits.moved
        if one.moved == "z_0" and abs(one.by) == 1e-3
    )


def _words(path: PathReading) -> str:
    return (
        f"z_0 = {path.height:g} m, r_h = {1e3 * path.helix_radius:g} mm, p_h = "
        f"{1e3 * path.helix_pitch:g} mm, branch {path.branch}, g = {1e3 * path.base_radius:.0f} "
        f"mm, h = {1e3 * path.platform_radius:.0f} mm, Eq. 5 {path.eq_5}, Eq. 29 {path.eq_29}"
    )


def _largest(values: Array) -> float:
    return float(np.abs(values).max())
