"""``rps-pin tolerance``: errors of a mechanism's pose from tolerances of its drawing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from rps_pin.cli import console as common
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.cli.task_options import load_path, load_task_and_file, needed_mechanism
from rps_pin.cli.task_workspace import HeldOption, OverOption, grid_of
from rps_pin.errors import InputError
from rps_pin.rps.task import RPSTask
from rps_pin.task import Task
from rps_pin.task import tolerances as of_tasks
from rps_pin.task import workspace as space
from rps_pin.task.tolerances.compute import opening_told

#: Rows of the printed table, at most; all are in the file.
_ROWS = 20


def tolerance_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.yaml", help="Tolerances by name or pattern: YAML.")
    ],
    mechanism: Annotated[Path, needed_mechanism(", as it is drawn")],
    path: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A trajectory, at 101 poses of which errors are looked at; default: home.",
            show_default=False,
        ),
    ] = None,
    over: OverOption = None,
    held: HeldOption = None,
    whole_pose: Annotated[
        bool,
        typer.Option(
            "--whole-pose",
            help="Look at all six coordinates of the output frame, not at the task's alone.",
        ),
    ] = False,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-out",
            help="Leave out, and name, errors that open loops whose closures are redundant; they "
            "are refused otherwise.",
        ),
    ] = False,
    machines: Annotated[
        int, typer.Option(min=0, help="Machines at random that are closed exactly; 0: none.")
    ] = 1000,
    sobol: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            help="Sobol indices from N (p + 2) machines, N a power of 2, p numbers; 0: none.",
        ),
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the random numbers.")] = 0,
    output: common.FolderOption = Path("tolerances"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compute errors of a mechanism's pose from tolerances of lengths, placements and encoders.

    The file has **tolerances**, by name or pattern (`placement:leg_*.x: 0.05 mm`, `offset:*:
    0.1 mrad`), **distribution** (normal or uniform) and **sigmas** (a normal tolerance is so many
    standard deviations; 3). With --over, errors over the workspace; with two axes a map. Angles are
    in radians.

    Output: which number the error comes from, and what halving its tolerance gains
    (**tolerances.csv**, **shares.png**), errors at the poses (**poses.csv**, **map.png**), and
    **sobol.csv** if asked for. Machines at random tell whether first order is enough.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Examples:

    - `rps-pin tolerance drawing.yaml --mechanism five_bar --over x=0:0.4:41 --over z=0.3:0.7:41`
    """
    task, described = load_task_and_file(mechanism)
    if path is not None and over:
        raise InputError("give either --path or --over")
    if held and not over:
        raise InputError("--held is of a grid: give --over, too")
    grid = grid_of(task, over, held or (), False) if over else None
    names = ["shares", *(["map"] if grid is not None and len(grid.over) == 2 else [])]
    tables = ["tolerances.csv", "poses.csv", *(["sobol.csv"] if sobol else [])]
    files = [output / name for name in tables]
    inputs = [file, described, *([path] if path is not None else [])]
    check_outputs([*files, *figures_in(output, *names)], overwrite, inputs=inputs)
    console = common.text_console(as_json)
    with console.status("computing"):
        poses: Any = None if path is None else load_path(path, task)
        if grid is not None:
            task = _compiled(task)
            poses = space.workspace(task, grid)
        whole = "pose" if whole_pose else None
        found = of_tasks.tolerance(task, file, poses, coordinates=whole, opening="leave out")
    if found.left_out and not leave_out:
        raise InputError(opening_told(found.left_out, "--leave-out does without them"))
    exact = indices = None
    if machines:
        bar = common.progress_bar(console, "machines at random")
        exact = of_tasks.monte_carlo(found, machines, seed=seed, progress=bar)
    if sobol:
        bar = common.progress_bar(console, "machines for Sobol indices")
        indices = of_tasks.sobol(found, samples=sobol, seed=seed, progress=bar)
    output.mkdir(parents=True, exist_ok=True)
    of_tasks.write_table(found, files[0])
    of_tasks.write_poses(found, files[1])
    if indices is not None:
        of_tasks.write_indices(indices, files[2])
    with console.status("writing the results"):
        files += _figures(found, names, output)
    if as_json:
        common.print_json(_summary(found, exact) | {"files": files})
        return
    console.print(of_tasks.table_text(found, _ROWS), soft_wrap=True)
    for line in _told(found, exact):
        console.print(line)
    common.print_files(console, files)


def _compiled(task: Task) -> Task:
    """Return the task in generated code, which the analysis needs in any case."""
    plain = Task(task.mechanism, **task.options) if isinstance(task, RPSTask) else task
    return plain.compile()


def _figures(found: of_tasks.ToleranceAnalysis, names: Sequence[str], folder: Path) -> list[Path]:
    # Slow to import: only for commands that draw.
    from rps_pin import plots

    files = plots.save_figure(plots.plot_tolerance_shares(found), folder, "shares")
    if "map" in names:
        files += plots.save_figure(plots.plot_tolerance_map(found), folder, "map")
    return files


def _told(found: of_tasks.ToleranceAnalysis, exact: of_tasks.MonteCarlo | None) -> list[str]:
    """Return what machines at random tell, in sentences."""
    if exact is None:
        return []
    lines = [
        f"{len(exact.numbers)} machines at random, {part.name}: {exact.ratio(part.name):.3f} "
        f"+- {exact.spread(part.name):.3f} times the error of first order, which leaves "
        f"{exact.remainder(part.name):.2%} of it"
        for part in found.parts
    ]
    return [*lines, *(f"note: {one}" for one in exact.doubts)]


def _summary(
    found: of_tasks.ToleranceAnalysis, exact: of_tasks.MonteCarlo | None
) -> dict[str, Any]:
    return {
        "poses": len(found.poses.x),
        "coordinates": list(found.coordinates),
        "parts": {
            part.name: {
                "unit": part.unit,
                "three_sigma": 3 * found.rms(part.name),
                "worst": float(found.worst[:, part.columns].max()),
                "shares": dict(zip(found.labels, found.shares(part.name).tolist(), strict=True)),
                **_of_machines(exact, part.name),
            }
            for part in found.parts
        },
        "left_out": list(found.left_out),
        "unseen": list(found.unseen),
        "machines": 0 if exact is None else len(exact.numbers),
        "not_closed": 0 if exact is None else exact.failures,
    }


def _of_machines(exact: of_tasks.MonteCarlo | None, part: str) -> dict[str, float]:
    if exact is None:
        return {}
    return {
        "machines_over_first_order": exact.ratio(part),
        "left_by_first_order": exact.remainder(part),
    }
