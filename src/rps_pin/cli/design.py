"""``rps-pin design``: the dimensions of a robot for a task, from a file of requirements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rps_pin.cli import console as common
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.plain_text import short
from rps_pin.task import design as of_tasks
from rps_pin.task.design.requirements import objectives_of
from rps_pin.task.design.result import possible_names

#: Robots of the front that are written, and columns of the printed table, at most.
_ROBOTS = 5


def design_command(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="What may vary, must hold and is to be best: YAML."),
    ],
    candidates: Annotated[
        int | None, typer.Option(min=1, help="How many are measured; default: as the file says.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of the random numbers; default: as the file says.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; default: one for each core.")
    ] = None,
    output: common.FolderOption = Path("design"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Choose the dimensions of a robot: the front of those that meet requirements.

    The file names a robot, the dimensions that may vary, what must hold (a region of the task with
    a margin from singularities and limits, forces and speeds of motions, stiffness) and one to
    three objectives. Output: the front (**front.csv**) and its plot, up to five robots of it as
    files that every other command takes, and **sheet.txt**, which says of each which requirement
    binds. Angles in the file are in radians.

    Ctrl-C keeps the generations that are done: the same command goes on with them.

    Exit status: 0 done; 1 an error, or no candidate meets all requirements; 2 wrong usage.

    Examples:

    - `rps-pin design design.yaml --candidates 100 -o chosen`
    """
    described = of_tasks.load_design(file)
    names = possible_names(objectives_of(described.objectives), _ROBOTS)
    robots = [one for name in names for one in described.space.files(output, name)]
    check_outputs(
        [output / "front.csv", output / "sheet.txt", *robots, *figures_in(output, "front")],
        overwrite,
        inputs=[file, *described.files],
    )
    output.mkdir(parents=True, exist_ok=True)
    store = output / "candidates"
    console = common.text_console(as_json)
    found = of_tasks.design(
        described.space,
        described.requirements,
        described.objectives,
        candidates=described.candidates if candidates is None else candidates,
        seed=described.seed if seed is None else seed,
        population=described.population,
        workers=workers,
        store=store,
        progress=common.progress_bar(console, "generations"),
    )
    chosen = found.chosen(_ROBOTS)
    files = found.write(output, chosen)
    # Slow to import: only for commands that draw.
    from rps_pin import plots

    if len(found.objectives) > 1:
        files += plots.save_figure(plots.plot_front(found), output, "front")
    if as_json:
        common.print_json(_summary(found, chosen) | {"files": files})
        return
    console.print(str(found))
    console.print(_table(found, chosen))
    common.print_files(console, files)


def _summary(found: of_tasks.DesignResult, chosen: list[of_tasks.Chosen]) -> dict[str, Any]:
    columns, rows = found.table()
    robots = {one.name: one.row for one in chosen}
    return {
        "candidates": len(found.values),
        "feasible": int(found.feasible.sum()),
        "seed": found.seed,
        "objectives": [{"name": one.name, "largest": one.maximised} for one in found.objectives],
        "front": [dict(zip(columns, row, strict=True)) for row in rows],
        "robots": robots,
    }


def _table(found: of_tasks.DesignResult, chosen: list[of_tasks.Chosen]) -> Any:
    """Return a table with a column for each chosen robot."""
    columns, rows = found.table([one.row for one in chosen])
    cells = [[short(c) if isinstance(c, float) else str(c) for c in row] for row in rows]
    told = [(name, *parts) for name, parts in zip(columns, zip(*cells, strict=True), strict=True)]
    names = [one.name.replace("_", " ") for one in chosen]
    return common.table_of(told, "", *names)
