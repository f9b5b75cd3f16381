"""Stiffness and frequencies over a grid: what ``rps-pin stiffness --over`` does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rps_pin.cli import console as common
from rps_pin.cli.outputs import check_outputs, figures_in
from rps_pin.errors import InputError
from rps_pin.task.stiffness import StiffnessMap, StiffnessModel, stiffness_map, write_map
from rps_pin.task.workspace.grids import TaskGrid

#: What is drawn over two axes: names of the figures.
_DRAWN: tuple[Any, ...] = ("stiffness", "frequency")


class MapAsked(NamedTuple):
    """What a map is made of."""

    model: StiffnessModel
    grid: TaskGrid
    wrench: Sequence[float] | None
    output: Path
    inputs: Sequence[Path]


def write_maps(asked: MapAsked, overwrite: bool, as_json: bool) -> None:
    """Compute, write and print maps; see `rps_pin.cli.stiffness`."""
    drawn = _DRAWN if len(asked.grid.over) == 2 else ()
    files = [asked.output / "map.csv"]
    figures = figures_in(asked.output, *drawn)
    check_outputs([*files, *figures], overwrite, inputs=asked.inputs)
    console = common.text_console(as_json)
    bar = common.progress_bar(console, "stiffness at the poses")
    found = stiffness_map(asked.model, asked.grid.points(), asked.wrench, progress=bar)
    if not found.reached.any():
        raise InputError(
            f"none of the {found.reached.size} poses of the grid is reached and has a stable "
            "equilibrium"
        )
    asked.output.mkdir(parents=True, exist_ok=True)
    write_map(found, files[0])
    if drawn:
        with console.status("drawing"):
            files += _figures(found, asked.output)
    if as_json:
        common.print_json(_summary(found) | {"files": files})
        return
    console.print(found.summary(), soft_wrap=True)
    common.print_files(console, files)


def _figures(found: StiffnessMap, folder: Path) -> list[Path]:
    # Slow to import: only for commands that draw.
    from rps_pin import plots

    files = []
    for what in _DRAWN:
        files += plots.save_figure(plots.plot_stiffness_map(found, what), folder, what)
    return files


def _summary(found: StiffnessMap) -> dict[str, Any]:
    some = found.reached
    answer: dict[str, Any] = {"points": int(some.size), "reached": int(some.sum())}
    for one in found.spans():
        answer[one.name.replace(" ", "_")] = {
            "unit": one.unit,
            "least": _number(one.least),
            "most": _number(one.most),
            "least_at": dict(zip(found.coordinates, one.at.tolist(), strict=True)),
        }
    return answer


def _number(value: float) -> float | None:
    """Return a number for JSON, which has no infinity."""
    return value if math.isfinite(value) else None
