"""``rps-pin workspace``: the workspace of a 3-RPS, as in the paper's Section 3."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from rps_pin.cli.console import (
    FolderOption,
    JsonOption,
    RobotOption,
    load_robot,
    print_files,
    print_json,
    progress_bar,
)
from rps_pin.errors import InputError
from rps_pin.paper import PaperComparison, paper_comparison
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.workspace import (
    Reason,
    Workspace,
    boundary,
    largest_tilt_range,
    leg_grid,
    save_mesh,
    save_workspace,
    volume,
    workspace,
)

#: Lengths per leg of the surfaces in the figures.
_DRAWN_POINTS = 18


def workspace_command(
    robot: RobotOption = "micro",
    points: Annotated[
        int, typer.Option(help="Lengths per leg; 51 are the paper's 1 mm steps over 50 mm.")
    ] = 51,
    output: FolderOption = Path("workspace"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace existing results.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Compute the workspace of a 3-RPS by discretised leg lengths, as the paper does.

    Every triple of leg lengths on the grid is solved by direct kinematics, in the assembly mode
    above the base, and checked against the robot's limits. Output: the points with their fields
    (**workspace.h5**), the boundary as a mesh (**boundary.stl**), and figures like the paper's 2 to
    6. For the paper's robot, **micro**, the paper's statements are compared with the results for
    several base radii g, which the paper does not give.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Example: `rps-pin workspace --points 101 -o results`
    """
    machine = load_robot(robot)
    folder = _prepared(output, overwrite=overwrite)
    console = Console(quiet=as_json)
    grid = leg_grid(machine.parameters, points)
    found = workspace(machine, grid, progress=progress_bar(console, "direct kinematics"))
    rows = paper_comparison() if machine.parameters.name == "micro" else ()
    summary = _summary(machine, found, rows)
    with console.status("writing the results"):
        files = _write(folder, machine, found, rows, overwrite=overwrite)
    if as_json:
        print_json(summary | {"files": files})
        return
    console.print(_table(summary))
    if rows:
        console.print(_comparison_table(rows))
    print_files(console, files)


def _prepared(folder: Path, *, overwrite: bool) -> Path:
    """Make the folder; refuse one that has results."""
    if not overwrite and (folder / "workspace.h5").exists():
        raise InputError(f"{folder / 'workspace.h5'} exists; --overwrite replaces it")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _write(
    folder: Path,
    robot: RPSRobot,
    found: Workspace,
    rows: tuple[PaperComparison, ...],
    *,
    overwrite: bool,
) -> list[Path]:
    # Slow to import: only for commands that draw.
    from rps_pin.plots import save_figure
    from rps_pin.plots.workspace import (
        plot_assembly_modes,
        plot_comparison,
        plot_effective,
        plot_space,
        plot_theoretical,
        plot_views,
    )

    data, mesh = folder / "workspace.h5", folder / "boundary.stl"
    save_workspace(found, data, overwrite=overwrite)
    save_mesh(boundary(found), mesh, overwrite=overwrite)
    parameters = robot.parameters
    # Matplotlib draws surfaces triangle by triangle: a coarser grid shows the same shape.
    coarse = workspace(robot, leg_grid(parameters, min(_DRAWN_POINTS, found.grid.shape[0])))
    middle = sum(parameters.leg_length_limits) / 2
    figures = {
        "figure_2_assembly_modes": plot_assembly_modes(
            parameters, robot.assembly_modes([middle] * 3)
        ),
        "figure_3_theoretical": plot_theoretical(parameters),
        "figure_4_effective": plot_effective(coarse),
        "figure_5_space": plot_space(coarse),
        "figure_6_views": plot_views(found),
    }
    if rows:
        figures["base_radius"] = plot_comparison(rows)
    files = [data, mesh]
    for name, figure in figures.items():
        files += save_figure(figure, folder, name)
    return files


def _summary(
    robot: RPSRobot, found: Workspace, rows: tuple[PaperComparison, ...]
) -> dict[str, Any]:
    inside = found.position[found.inside]
    if not len(inside):
        raise InputError("no point of the grid is inside the workspace")
    size = volume(found)
    tilts = largest_tilt_range(robot)
    low, high = inside.min(axis=0), inside.max(axis=0)
    height = high[2] - low[2]
    return {
        "robot": robot.parameters.name,
        "points": found.grid.size,
        "inside": len(inside),
        "x": [float(low[0]), float(high[0])],
        "y": [float(low[1]), float(high[1])],
        "z": [float(low[2]), float(high[2])],
        "volume": size.position,
        "cylinder_volume": math.pi * robot.parameters.platform_radius**2 * float(height),
        "pose_volume": size.pose,
        "full_tilt": tilts._asdict(),
        "out": {
            reason.text: count
            for reason, count in found.counts().items()
            if reason is not Reason.INSIDE and count
        },
        "paper": [row._asdict() for row in rows],
    }


def _table(summary: dict[str, Any]) -> Table:
    table = Table(show_header=False)
    table.add_row("points", f"{summary['points']}, of which inside: {summary['inside']}")
    for axis in "xyz":
        low, high = (1e3 * value for value in summary[axis])
        table.add_row(f"p_{axis}", f"{low:.4g} to {high:.4g} mm")
    table.add_row(
        "volume of the centre's positions",
        f"{1e9 * summary['volume']:.5g} mm^3; theoretical cylinder of radius h: "
        f"{1e9 * summary['cylinder_volume']:.5g} mm^3",
    )
    tilts = summary["full_tilt"]
    table.add_row(
        "largest cylinder of full tilt",
        f"every tilt up to {math.degrees(tilts['tilt']):.3g} degrees, "
        f"for z from {1e3 * tilts['lower']:.4g} to {1e3 * tilts['upper']:.4g} mm",
    )
    for reason, count in summary["out"].items():
        table.add_row("out", f"{count}: {reason}")
    return table


def _comparison_table(rows: tuple[PaperComparison, ...]) -> Table:
    table = Table("g (mm)", "p_x (mm)", "p_y (mm)", "within the paper's 2.5 mm")
    for row in rows:
        (x_low, x_high), (y_low, y_high) = row.x, row.y
        table.add_row(
            f"{1e3 * row.base_radius:g}",
            f"{1e3 * x_low:.2f} to {1e3 * x_high:.2f}",
            f"{1e3 * y_low:.2f} to {1e3 * y_high:.2f}",
            "yes" if row.holds else f"no: {1e3 * row.reach:.2f} mm",
        )
    return table
