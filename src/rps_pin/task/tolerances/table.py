"""The table of an analysis for a workshop: tolerances, errors, and what halving one gains."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.files import write_rows
from rps_pin.plain_text import plain
from rps_pin.task.tolerances.analysis import SHOWN_PART, Part, ToleranceAnalysis
from rps_pin.task.tolerances.sobol import SobolIndices

#: Units of a workshop, by kind: name and factor from SI.
_SHOWN = {"length": ("mm", 1e3), "angle": ("mrad", 1e3), "ratio": ("ppm", 1e6)}


def rows(found: ToleranceAnalysis) -> tuple[tuple[str, ...], list[tuple[str | float, ...]]]:
    """Return column names and a row for each number, the largest share of the error first.

    Of position, and of angle: the share of the variance over all poses in per cent; the largest
    error that the number makes alone, and three root mean squares of it; and three root mean
    squares of the whole error if this tolerance alone were half as large.
    """
    columns = ["number", "tolerance", "unit", "distribution"]
    parts = []
    for part in found.parts:
        unit = SHOWN_PART[part.name]
        columns += [
            f"{part.name}_share_percent",
            f"{part.name}_worst_{unit}",
            f"{part.name}_three_sigma_{unit}",
            f"{part.name}_three_sigma_if_halved_{unit}",
        ]
        parts.append(_of_part(found, part))
    kinds = found.model.output.kinds
    table: list[tuple[str | float, ...]] = []
    for k in order(found):
        unit, factor = _SHOWN[kinds[found.labels[k]]]
        normal = "normal" if found.tolerances.normal[k] else "uniform"
        values = [float(value) for columns_ in parts for value in columns_[:, k]]
        size = float(found.tolerances.limits[k] * factor)
        table.append((found.labels[k], size, unit, normal, *values))
    return tuple(columns), table


def order(found: ToleranceAnalysis) -> list[int]:
    """Return the numbers, that with the largest share first: of position if there is any."""
    shares = found.shares(found.parts[0].name)
    return [int(k) for k in np.argsort(-shares, kind="stable")]


def _of_part(found: ToleranceAnalysis, part: Part) -> Array:
    """Return share, worst error, three sigma, and the whole with half the tolerance, (4, p)."""
    slopes = np.linalg.norm(found.slopes[:, part.columns], axis=1).max(axis=0)
    return np.stack(
        [
            100 * found.shares(part.name),
            1e3 * slopes * found.tolerances.limits,
            3e3 * found.own(part.name),
            3e3 * found.halved(part.name),
        ]
    )


def table_text(found: ToleranceAnalysis, most: int | None = None) -> str:
    """Return the table as text, with the whole error above it and doubts below.

    Parameters
    ----------
    found
        The analysis.
    most
        Rows; all if left out. What is left out is counted.
    """
    columns, table = rows(found)
    lines = [str(found)]
    heads = [_head(name) for name in columns]
    cells = [[_cell(value) for value in row] for row in table[:most]]
    wide = [max(len(row[k]) for row in [*heads_as_rows(heads), *cells]) for k in range(len(heads))]
    for row in [*heads_as_rows(heads), *cells]:
        told = [
            word.ljust(wide[k]) if k in (0, 2, 3) else word.rjust(wide[k])
            for k, word in enumerate(row)
        ]
        lines.append("  ".join(told).rstrip())
    if most is not None and len(table) > most:
        lines.append(f"and {len(table) - most} more")
    return "\n".join([*lines, *(f"note: {one}" for one in found.doubts)])


def heads_as_rows(heads: Sequence[tuple[str, str]]) -> list[list[str]]:
    """Return the two lines of a head."""
    return [[head[k] for head in heads] for k in range(2)]


def write_table(found: ToleranceAnalysis, path: str | os.PathLike[str]) -> None:
    """Write the table as CSV, units in the names of the columns."""
    columns, table = rows(found)
    _write(path, columns, table)


def write_poses(found: ToleranceAnalysis, path: str | os.PathLike[str]) -> None:
    """Write the poses with the errors of each coordinate as CSV: 3 sigma, and the largest ones."""
    task, units = found.model.task, ("m", "rad")
    columns = [
        f"{n}_{units[turns]}" for n, turns in zip(task.coordinates, task.angular, strict=True)
    ]
    for what in ("three_sigma", "worst"):
        each = zip(found.coordinates, found.model.angular, strict=True)
        columns += [f"{name}_{what}_{units[int(turns)]}" for name, turns in each]
    values = np.hstack([found.poses.x, 3 * found.deviations, found.worst])
    _write(path, columns, values.tolist())


def write_indices(found: SobolIndices, path: str | os.PathLike[str]) -> None:
    """Write Sobol indices as CSV, the largest total first."""
    columns = ("number", "first", "first_half_width", "total", "total_half_width")
    values = np.stack([found.first, found.first_bounds, found.total, found.total_bounds], axis=1)
    order = np.argsort(-found.total, kind="stable")
    _write(path, columns, [(found.labels[k], *values[k].tolist()) for k in order])


def _write(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    table: Sequence[Sequence[str | float]],
) -> None:
    cells = [
        [f"{value:.9g}" if isinstance(value, float) else value for value in row] for row in table
    ]
    write_rows(path, [columns, *cells])


def _head(name: str) -> tuple[str, str]:
    """Return a column's name in two lines: ``("position", "share %")``."""
    for part in SHOWN_PART:
        if name.startswith(f"{part}_"):
            words = name.removeprefix(f"{part}_").replace("three_sigma", "3 sigma")
            return part, words.replace("percent", "%").replace("_", " ")
    return "", name


def _cell(value: str | float) -> str:
    return plain(value) if isinstance(value, str) else f"{value:.4g}" if abs(value) > 1e-9 else "0"
