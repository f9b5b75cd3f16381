"""The reproduction page's tables in Markdown, and every interpretation as CSV."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import chain

from rps_pin.files import csv_of
from rps_pin.paper.comparison import OUT_OF_REACH, SINGULAR, Comparison, PathResult, distance
from rps_pin.paper.compute import COLUMNS, Reproduction
from rps_pin.paper.interpretations import BODIES, PathInterpretation
from rps_pin.paper.mass_fit import MassFit, MovedFit
from rps_pin.paper.paper_data import ForceRange

#: Head of the columns that `forces` fills.
FORCES = tuple(f"F_{leg} {which}" for which in ("min", "max") for leg in (1, 2, 3))
#: Interpretations in each list on the page, each path once.
_SHOWN = 6
#: Fits shown of each column.
_FITS = 3


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def error(value: float) -> str:
    """Return an error; small ones as a power of ten that bounds them with room for another machine.

    Rounding errors differ between machines; the printed page does not.
    """
    if value > 1e-3 or math.isnan(value):
        return f"{value:.3g}"
    return f"< 1e{max(-12, math.ceil(math.log10(3 * value)))}" if value > 0 else "< 1e-12"


def forces(ranges: ForceRange) -> list[str]:
    """Return six forces, N, to three digits, or whole newtons."""
    return [f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}" for x in ranges.numbers()]


def between(values: Iterable[float], unit: float = 1e-3, digits: int = 3) -> str:
    """Return the least and the greatest of values, in a unit."""
    numbers = list(values)
    return f"{min(numbers) / unit:.{digits}f} to {max(numbers) / unit:.{digits}f}"


def reach(found: Reproduction) -> str:
    """Return the workspace of several base radii, compared with the paper's statement."""
    return markdown(
        ["g (mm)", "p_x (mm)", "p_y (mm)", "p_z (mm)", "within the paper's 2.5 mm"],
        [
            [
                f"{1e3 * row.base_radius:.0f}",
                between(row.x),
                between(row.y),
                between(row.z),
                "yes" if row.holds else f"no: {1e3 * row.reach:.2f} mm",
            ]
            for row in found.reach
        ],
    )


def helix_ranges(found: Reproduction) -> str:
    """Return lengths and forces of Table 1's helix from 0.4 m, both branches."""
    return markdown(
        ["branch", "leg", "force (N)", "length (mm)"],
        [
            [branch, str(leg + 1), between(run.force[:, leg], 1.0), between(run.length[:, leg])]
            for branch, run in found.runs.items()
            for leg in range(3)
        ],
    )


def masses() -> str:
    """Return the masses of each choice of the bodies."""
    return "; ".join(
        f"{name} (m = {one.platform_mass:.2f} kg, m_leg = {one.leg_mass:.2f} kg)"
        for name, one in BODIES.items()
    )


def paths(found: Reproduction) -> str:
    """Return what becomes of the path interpretations, by the units of z_0 and of r_h and p_h."""
    groups: dict[tuple[str, str, str], list[PathResult]] = {}
    for result in found.paths:
        groups.setdefault(_group(result.interpretation), []).append(result)
    rows = []
    for (height, helix, law), results in groups.items():
        fate = Counter(result.refused for result in results)
        mine = [r for r in found.comparisons if _group(r.path) == (height, helix, law)]
        peaks = [r.forces.largest for r in mine]
        rows.append(
            [
                f"0.4 {height}",
                f"0.75, 0.5 {helix}",
                law,
                str(len(results)),
                str(fate[OUT_OF_REACH]),
                str(fate[SINGULAR]),
                f"{min(peaks):.3g} to {max(peaks):.3g}" if peaks else "-",
                f"{min(r.distance for r in mine):.3f}" if mine else "-",
                f"{min(r.distance_relabelled for r in mine):.3f}" if mine else "-",
            ]
        )
    head = ["z_0", "r_h, p_h", "Eq. 29", "paths", "out of reach", "singular"]
    last = ["largest force of the rest (N)", "least distance", "legs in any order"]
    return markdown([*head, *last], rows)


def closest(found: Reproduction, *, relabelled: bool) -> str:
    """Return the closest interpretations, each path once, with their forces."""

    def key(row: Comparison) -> float:
        return row.distance_relabelled if relabelled else row.distance

    seen: dict[PathInterpretation, Comparison] = {}
    for row in sorted(found.comparisons, key=lambda r: round(key(r), 9)):
        seen.setdefault(row.path, row)
    return markdown(
        ["distance", "path", "bodies", "Table 2's d_1, d_2, d_3", *FORCES],
        [
            [
                f"{key(row):.3f}",
                path_words(row.path),
                bodies_words(row),
                str(row.labels) if relabelled else "legs 1, 2, 3",
                *forces(row.relabelled if relabelled else row.forces),
            ]
            for row in list(seen.values())[:_SHOWN]
        ],
    )


def differences(row: Comparison) -> str:
    """Return the differences of the closest interpretation to both columns of Table 2, N."""
    lines = [["the interpretation", *forces(row.relabelled), ""]]
    for name, ranges in COLUMNS.items():
        gap = row.relabelled.numbers() - ranges.numbers()
        share = distance(row.relabelled, ranges)
        lines.append([f"less {name}", *(f"{x:+.1f}" for x in gap), f"{share:.3f}"])
    return markdown(["", *FORCES, "distance"], lines)


def fits(found: Reproduction) -> str:
    """Return the paths that come closest with a free mass, and the nearest with two."""
    rows = []
    for column, one in found.fits.items():
        both = ("platform and legs", one.both)
        for free, fit in [*(("platform", fit) for fit in one.fits[:_FITS]), both]:
            masses = [f"{fit.platform_mass:.2f}", f"{fit.leg_mass:.2f}"]
            fitted = (column, path_words(fit.path), free, *masses, str(fit.labels))
            rows.append([*fitted, *forces(fit.forces), f"{fit.distance:.3f}"])
    head = ["column", "path", "free masses", "m (kg)", "m_leg (kg)", "Table 2's d_1, d_2, d_3"]
    return markdown([*head, *FORCES, "distance"], rows)


def moved(found: Reproduction) -> str:
    """Return the nearest path's fits with one of its numbers moved."""
    fits = found.fits.values()
    rows = [["as it is", *chain(*(_mass_and_distance(one.fits[0]) for one in fits))]]
    for each in zip(*(one.moved for one in fits), strict=True):
        name = f"{each[0].moved} {1e3 * each[0].by:+g} mm"
        rows.append([name, *chain(*map(_mass_and_distance, each))])
    head = [text for column in found.fits for text in (f"{column}: m (kg)", "distance")]
    return markdown(["path", *head], rows)


def crossings(found: Reproduction) -> str:
    """Return when the paths with Table 1's radii, Eq. 5 and 29 corrected, cross singularities."""
    rows = []
    for result in found.paths:
        path = result.interpretation
        if path.as_meant and result.crossings:
            times = ", ".join(f"{time:.4f}" for time in result.crossings)
            rows.append([f"0.4 {path.height_unit}", path.helix_unit, path.branch, times])
    return markdown(["z_0", "r_h, p_h in", "branch", "crosses a singularity at (s)"], rows)


def sampled(found: Reproduction) -> str:
    """Return what sampling across crossings reports."""
    return markdown(
        ["path", "crossings", "samples a second", *FORCES, "distance"],
        [
            [
                *(row.path, str(row.crossings), f"{row.rate:.0f}"),
                *forces(row.forces),
                f"{row.distance:.3g}",
            ]
            for row in found.sampled
        ],
    )


def probes(found: Reproduction) -> str:
    """Return the helices of several heights."""
    rows = []
    for probe in found.probes:
        name = [f"{1e3 * probe.height:.5g}", probe.branch]
        if probe.forces is None:
            times = ", ".join(f"{time:.3f}" for time in probe.crossings)
            rows.append([*name, f"crosses at {times} s", *["-"] * 7])
        else:
            near = f"{probe.nearest:.1e}"
            rows.append([*name, near, *forces(probe.forces), f"{probe.distance:.3f}"])
    return markdown(["z_0 (mm)", "branch", "nearest", *FORCES, "distance"], rows)


def interpretations_csv(found: Reproduction) -> str:
    """Return every interpretation as CSV, the closest to Table 2 first and those refused last."""
    path = ["z_0", "r_h_p_h", "g_h", "branch", "eq_5", "eq_29"]
    columns = [f"F{leg}_{which}_N" for which in ("min", "max") for leg in (1, 2, 3)]
    last = ["distance", "distance_any_labels", "labels", "refused", "singular_at_s"]
    rows = [[*path, "bodies", "gravity", "eq_14", "nearest", *columns, *last]]
    for row in found.comparisons:
        numbers = [f"{x:.4g}" for x in row.forces.numbers()]
        ends = [f"{row.distance:.4f}", f"{row.distance_relabelled:.4f}", str(row.labels), "", ""]
        rows.append([*_fields(row.path), *row.body, f"{row.nearest:.3g}", *numbers, *ends])
    for result in found.paths:
        if result.refused:
            times = " ".join(f"{time:.4f}" for time in result.crossings)
            rows.append([*_fields(result.interpretation), *[""] * 13, result.refused, times])
    return csv_of(rows)


def path_words(path: PathInterpretation) -> str:
    """Return what a path reads Table 1 as."""
    return (
        f"z_0 in {path.height_unit}; r_h, p_h in {path.helix_unit}; {path.radii}; branch "
        f"{path.branch}; Eq. 5 {path.eq_5}, Eq. 29 {path.eq_29}"
    )


def bodies_words(row: Comparison) -> str:
    """Return what an interpretation takes the bodies to be."""
    return f"{row.body.bodies}; {row.body.gravity}; {row.body.eq_14}"


# Inner workings -----------------------------------------------------------------------------------


def _mass_and_distance(fit: MassFit | MovedFit) -> tuple[str, str]:
    if math.isnan(fit.distance):
        return "crosses", "-"
    return f"{fit.platform_mass:.1f}", f"{fit.distance:.3f}"


def _fields(path: PathInterpretation) -> list[str]:
    choice = [path.height_unit, path.helix_unit, path.radii, path.branch]
    return [*choice, path.eq_5, path.eq_29]


def _group(path: PathInterpretation) -> tuple[str, str, str]:
    return path.height_unit, path.helix_unit, path.eq_29
