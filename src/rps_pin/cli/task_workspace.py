"""The workspace of any mechanism with a task: what ``rps-pin workspace --mechanism`` does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array
from rps_pin.bounds import POINTS, check_size
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.decimal_numbers import decimal
from rps_pin.cli.degrees import as_asked
from rps_pin.cli.outputs import check_outputs, figures_in
from rps_pin.cli.printing import say
from rps_pin.cli.task_options import in_unit, unit_of
from rps_pin.errors import CompileError, InputError
from rps_pin.rps.robot_file import kind_of_file
from rps_pin.task import Task
from rps_pin.task import workspace as space
from rps_pin.task.workspace.grids import TaskGrid

_RANGE = "NAME=FROM:TO:POINTS"

OverOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar=_RANGE,
        help="A coordinate of a mechanism's task that varies: **z=0.5:0.8:31**; two to six times.",
        show_default=False,
    ),
]
HeldOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="A coordinate that is held; those that are not named are held at home.",
        show_default=False,
    ),
]
MinConditioningOption = Annotated[
    float,
    typer.Option(help="Conditioning (0 to 1) of a mechanism below which a point is singular."),
]
ForceOption = Annotated[
    float | None,
    typer.Option(
        metavar="N",
        help="Force on a mechanism's output frame in any direction, with the wrench: the actuators "
        "hold it at every point within their limits.",
    ),
]
MomentOption = Annotated[
    float | None, typer.Option(metavar="NM", help="The same of a moment, at the same time, N m.")
]
SpeedOption = Annotated[
    float | None,
    typer.Option(
        metavar="M/S",
        help="Speed in any direction that the actuators reach at every point within their limits.",
    ),
]
TurningSpeedOption = Annotated[
    float | None,
    typer.Option(metavar="RAD/S", help="The same of angles, at the same time; see --degrees."),
]
HoldingOption = Annotated[
    bool, typer.Option("--holding", help="Compute the actuators' forces at rest, too.")
]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Processes that compute blocks of a mechanism's grid, which goes to the file as it is "
        "computed. Grids of more than two million points do so in any case, by default with a "
        "thread for each core.",
    ),
]
ResumeOption = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Keep the blocks that are computed in the output folder until all are, so that the "
        "same command goes on after Ctrl-C or a full disk.",
    ),
]

#: Points from which a grid goes to the file block by block.
_LARGE = 2_000_000
#: Points of a large grid, evenly spaced, of which volume, boundary and figures are made.
_DRAWN = 1_000_000


def workspace_of_task(
    mechanism: Path,
    over: Sequence[str],
    held: Sequence[str],
    min_conditioning: float,
    holding: bool,
    degrees: bool,
    output: Path,
    overwrite: bool,
    as_json: bool,
    *,
    ignore_limits: bool = False,
    accuracy: float | None = None,
    turning_speed: float | None = None,
    workers: int | None = None,
    resume: bool = False,
    **demands: Any,
) -> None:
    """Compute, write and print a workspace; see `rps_pin.cli.workspace`."""
    model, file = options.load_mechanism(mechanism, ignore_limits, accuracy)
    if kind_of_file(file) == "parameters":
        raise InputError(f"{file} is a 3-RPS, which has a workspace of its own: --robot {file}")
    task: Task = model.task
    if holding:
        options.require_masses(model)
    if turning_speed is not None:
        demands["turning_speed"] = math.radians(turning_speed) if degrees else turning_speed
    grid = grid_of(task, over, held, degrees)
    drawn = "slices" if len(grid.over) == 3 else "map"
    files = [output / "workspace.h5"]
    if len(grid.over) == 3:
        files.append(output / "boundary.stl")
    check_outputs([*files, *figures_in(output, drawn)], overwrite, inputs=[file])
    output.mkdir(parents=True, exist_ok=True)
    console = common.text_console(as_json)
    description = file.read_text("utf-8", "replace")
    demands |= {"min_conditioning": min_conditioning, "holding": holding}
    demands["progress"] = common.progress_bar(console, "following the assembly mode")
    if resume or workers is not None or grid.size > _LARGE:
        demands |= {"workers": workers, "resume": resume, "description": description}
        found, summary = _to_file(task, grid, files[0], degrees, demands)
    else:
        found = space.workspace(_compiled(task), grid, **demands)
        _refuse_none_inside(found.counts())
        space.save_workspace(found, files[0], description=description, overwrite=True)
        summary = _summary(found, degrees)
    with console.status("writing the results"):
        files += _write(found, files, drawn, output)
    if as_json:
        common.print_json(summary | {"files": files})
        return
    console.print(common.table_of(_rows(summary)))
    common.print_files(console, files)


def _refuse_none_inside(counts: dict[str, int]) -> None:
    if not counts["inside"]:
        told = ", ".join(f"{count}: {name}" for name, count in counts.items() if count)
        raise InputError(f"no point of the grid is inside the workspace ({told})")


def _to_file(
    task: Task, grid: TaskGrid, path: Path, degrees: bool, given: dict[str, Any]
) -> tuple[space.TaskWorkspace, dict[str, Any]]:
    """Compute a workspace block by block; return what is drawn of it, and the summary."""
    counts = space.workspace_to_file(_compiled(task), path, grid, overwrite=True, **given)
    _refuse_none_inside(counts.counts)
    every = math.ceil((grid.size / _DRAWN) ** (1 / len(grid.over)))
    found = space.load_workspace(path, [slice(None, None, every)] * len(grid.over))
    if not found.inside.any():
        raise InputError(
            f"{counts.inside} points are inside, but none of one in {every} along each axis, which "
            f"volume and figures are made of: give a narrower grid; {path} has all points"
        )
    return found, _summary(found, degrees) | _of_counts(counts, found, degrees, every)


def _of_counts(
    counts: space.TaskCounts, found: space.TaskWorkspace, degrees: bool, every: int
) -> dict[str, Any]:
    """Return the part of the summary that is of all points of a large grid."""
    grid = found.grid
    angular = dict(zip(grid.coordinates, grid.angular, strict=True))
    return {
        "points": counts.points,
        "inside": counts.inside,
        "extents": {
            name: [in_unit(value, angular[name], degrees) for value in ends]
            for name, ends in counts.extents.items()
        },
        "out": {as_asked(n): k for n, k in counts.counts.items() if k and n != "inside"},
        "drawn_every": every,
    }


def grid_of(task: Task, over: Sequence[str], held: Sequence[str], degrees: bool) -> TaskGrid:
    """Return the grid that ``--over`` and ``--held`` ask for; in degrees if `degrees`."""
    axes: dict[str, Array] = {}
    for text in over:
        name, _, rest = text.partition("=")
        parts = rest.split(":")
        if len(parts) != 3:
            raise InputError(f"--over {text}: it must be {_RANGE}, such as z=0.5:0.8:31")
        if name in axes:
            raise InputError(f"--over: {name} is given twice")
        try:
            first, last, points = decimal(parts[0]), decimal(parts[1]), int(parts[2])
        except ValueError:
            raise InputError(f"--over {text}: it must be {_RANGE}, such as z=0.5:0.8:31") from None
        if not (math.isfinite(first) and math.isfinite(last) and first < last and points >= 2):
            raise InputError(f"--over {text}: FROM must be below TO, both finite, POINTS 2 or more")
        scale = _unit(task, name, degrees)
        check_size(points, POINTS, f"--over {text}")
        axes[name] = scale * np.linspace(first, last, points)
    values = options.by_joint(held, "--held")
    return space.task_grid(
        task, axes, {name: _unit(task, name, degrees) * value for name, value in values.items()}
    )


def _unit(task: Task, name: str, degrees: bool) -> float:
    angles = dict(zip(task.coordinates, task.angular, strict=True))
    return math.radians(1.0) if degrees and angles.get(name, False) else 1.0


def _compiled(task: Task) -> Task:
    """Return the task in generated code, if there is a compiler."""
    try:
        return task.compile()
    except (CompileError, ImportError) as error:
        say(f"note: without generated code, a point takes some milliseconds: {error}", err=True)
        return task


def _summary(found: space.TaskWorkspace, degrees: bool) -> dict[str, Any]:
    grid, size = found.grid, space.volume(found)
    angular = [unit == "rad" for unit in grid.units]
    per_angle = math.degrees(1.0) ** sum(angular) if degrees else 1.0

    def shown(value: float, name: str) -> float:
        return in_unit(value, grid.angular[grid.coordinates.index(name)], degrees)

    box = space.largest_box(found) if len(grid.over) == 3 and _fits(found) else None
    return {
        "mechanism": found.mechanism,
        "points": grid.size,
        "inside": int(np.count_nonzero(found.inside)),
        "extents": {n: [shown(v, n) for v in ends] for n, ends in found.extents().items()},
        "held": {name: shown(value, name) for name, value in grid.held.items()},
        "units": {
            name: unit_of(turns, degrees)
            for name, turns in zip(grid.coordinates, grid.angular, strict=True)
        },
        "volume": per_angle * size.value,
        "volume_error": per_angle * size.error,
        "volume_bounds": [per_angle * size.least, per_angle * size.most],
        "volume_unit": size.unit.replace("rad", "deg") if degrees else size.unit,
        "cut": list(size.cut),
        "least_conditioning": float(found.conditioning[found.inside].min()),
        **_left(found),
        "largest_box": None
        if box is None
        else {
            name: [shown(float(low), name), shown(float(high), name)]
            for name, low, high in zip(grid.over, box.lower, box.upper, strict=True)
        },
        "out": {as_asked(n): k for n, k in found.counts().items() if k and n != "inside"},
    }


def _left(found: space.TaskWorkspace) -> dict[str, float]:
    """Return the least shares of the limits of force and speed that are left inside, if asked."""
    shares = {
        "least_force_left": (found.force_share, found.force_left),
        "least_speed_left": (found.speed_share, found.speed_left),
    }
    return {
        name: float(left[found.inside].min())
        for name, (asked, left) in shares.items()
        if asked.size
    }


def _fits(found: space.TaskWorkspace) -> bool:
    """Return whether a cell is inside."""
    return space.volume(found).least > 0


def _write(
    found: space.TaskWorkspace, files: Sequence[Path], drawn: str, folder: Path
) -> list[Path]:
    """Write boundary and figure; return the files of the figure."""
    # Slow to import: only for commands that draw.
    from rps_pin import plots

    if len(files) > 1:
        space.save_mesh(space.boundary(found), files[1], overwrite=True)
    if drawn == "slices":
        figure = plots.plot_slices(found)
    else:
        for name, column in zip(found.grid.over[2:], found.grid.columns[2:], strict=True):
            axis = found.grid.axes[found.grid.axis(name)]
            found = found.plane(name, float(np.clip(found.start[column], axis[0], axis[-1])))
        figure = plots.plot_map(found)
    return plots.save_figure(figure, folder, drawn)


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    units, low_high = summary["units"], summary["extents"].items()
    low, high = summary["volume_bounds"]
    held = ", ".join(f"{n} = {value:.6g} {units[n]}" for n, value in summary["held"].items())
    rows = [
        ("points", f"{summary['points']}, of which inside: {summary['inside']}"),
        *((name, f"{a:.6g} to {b:.6g} {units[name]}") for name, (a, b) in low_high),
        *([("held", held)] if held else []),
        (
            "area" if len(summary["extents"]) == 2 else "volume",
            f"{summary['volume']:.5g} +- {summary['volume_error']:.2g} {summary['volume_unit']} "
            f"(cells wholly inside: {low:.5g}, partly: {high:.5g})",
        ),
    ]
    if summary.get("drawn_every", 1) > 1:
        rows.append(
            (
                "volume and figures",
                f"of one point in {summary['drawn_every']} along each axis; the file has all",
            )
        )
    if summary["cut"]:
        rows.append(("ends of the grid", f"reached at {', '.join(summary['cut'])}: it may go on"))
    rows.append(("least conditioning inside", f"{summary['least_conditioning']:.4g}"))
    for quantity in ("force", "speed"):
        if (left := summary.get(f"least_{quantity}_left")) is not None:
            rows.append((f"{quantity} left inside", f"at least {left:.1%} of the limits"))
    if summary["largest_box"]:
        sides = summary["largest_box"].items()
        told = ", ".join(f"{name} {a:.6g} to {b:.6g} {units[name]}" for name, (a, b) in sides)
        rows.append(("largest box", told))
    return [*rows, *(("out", f"{count}: {name}") for name, count in summary["out"].items())]
