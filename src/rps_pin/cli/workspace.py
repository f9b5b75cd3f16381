"""``rps-pin workspace``: that of a 3-RPS, as in the paper's Section 3, or of any task."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from rps_pin.cli import certified_boxes as boxes
from rps_pin.cli import console as common
from rps_pin.cli import motion_options as motions
from rps_pin.cli import task_workspace as of_tasks
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import refuse
from rps_pin.cli.mechanism_options import AccuracyOption, IgnoreLimitsOption
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.cli.region_options import ConeOption, RoundOption, cones_of
from rps_pin.cli.task_options import MechanismOption, in_unit, unit_of, units
from rps_pin.errors import InputError
from rps_pin.paper import PaperComparison, paper_comparison
from rps_pin.rps import workspace as space
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING

#: Lengths per leg of the surfaces in the figures.
_DRAWN_POINTS = 18
_OF_MECHANISMS = (
    *("over", "held", "min_conditioning", "holding", "ignore_limits", "accuracy"),
    *("payload", "payload_centre", "wrench", "force", "moment"),
    *("speed", "turning_speed", "workers", "resume", "cone"),
)
_FIGURES = (
    "assembly_modes",
    "theoretical_workspace",
    "effective_workspace",
    "workspace_surface",
    "workspace_outlines",
)
#: Options of a mechanism's workspace that are of certified boxes, too.
_CERTIFIED = ("over", "held", "ignore_limits", "accuracy", "cone")
_NOT_CERTIFIED = tuple(name for name in _OF_MECHANISMS if name not in _CERTIFIED)


def workspace_command(
    context: typer.Context,
    robot: common.RobotOption = "micro",
    points: Annotated[
        int, typer.Option(help="Lengths per leg; 51 are the paper's 1 mm steps over 50 mm.")
    ] = 51,
    degrees: DegreesOption = False,
    mechanism: MechanismOption = None,
    over: of_tasks.OverOption = None,
    held: of_tasks.HeldOption = None,
    min_conditioning: of_tasks.MinConditioningOption = MIN_CONDITIONING,
    holding: of_tasks.HoldingOption = False,
    workers: of_tasks.WorkersOption = None,
    resume: of_tasks.ResumeOption = False,
    payload: motions.PayloadOption = None,
    payload_centre: motions.PayloadCentreOption = (0.0, 0.0, 0.0),
    wrench: motions.WrenchOption = None,
    force: of_tasks.ForceOption = None,
    moment: of_tasks.MomentOption = None,
    speed: of_tasks.SpeedOption = None,
    turning_speed: of_tasks.TurningSpeedOption = None,
    cone: ConeOption = None,
    certify: boxes.CertifyOption = False,
    undecided: boxes.UndecidedOption = 0.01,
    most_boxes: boxes.MostBoxesOption = 100_000,
    round: RoundOption = None,
    ignore_limits: IgnoreLimitsOption = False,
    accuracy: AccuracyOption = None,
    output: common.FolderOption = Path("workspace"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the workspace of a 3-RPS by discretised leg lengths, or of a mechanism's task.

    Every triple of leg lengths on the grid is solved by direct kinematics, in the assembly mode
    above the base, and checked against the robot's limits. Output: the points with their fields
    (**workspace.h5**), the boundary as a mesh (**boundary.stl**), and figures like the paper's 2 to
    6. For the paper's robot, **micro**, the paper's statements are compared with the results for
    several base radii g, which the paper does not give.

    With **--mechanism**, the workspace of a mechanism's task over a grid of its coordinates, in the
    assembly mode of home: how many points each limit, singularity or end of the mode puts out, its
    volume with an estimate of the error, **workspace.h5**, a map or slices, and over three
    coordinates the boundary as a mesh (**boundary.stl**). With a payload, wrenches or speeds also
    the points where an actuator's force or speed would be beyond its limit are out.

    With **--certify**, which parts of the box that **--over** spans are proven to be inside, and
    which outside and why, by intervals: **boxes.csv**. The numbers of points do not count.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Examples:

    - `rps-pin workspace --points 101 -o results`

    - `rps-pin workspace -m delta --over x=-0.5:0.5:41 --over z=-0.8:-0.2:41 -o map`

    - `rps-pin workspace -m delta --over x=-0.5:0.5:41 --over z=-0.8:-0.2:41 --payload 2 --speed 3`

    - `rps-pin workspace -m five_bar --certify --over x=0.1:0.3:2 --over z=0.4:0.7:2 -o proven`

    - `rps-pin workspace --certify --over z=0.21:0.23:2 --over rx=-0.2:0.2:2 --over ry=-0.2:0.2:2
      --round rx,ry=0.2 -o tilts`
    """
    if mechanism is not None:
        refuse(context, "it does not go with a mechanism", "robot", "points")
    if certify:
        refuse(context, "it does not go with --certify", "points", *_NOT_CERTIFIED)
        if mechanism is None:
            refuse(context, "this option needs a --mechanism", "ignore_limits", "accuracy", "cone")
        boxes.certify_boxes(
            robot,
            mechanism,
            over or (),
            held or (),
            degrees,
            output,
            overwrite,
            as_json,
            cones=cone or (),
            round=round or (),
            undecided=undecided,
            most_boxes=most_boxes,
            ignore_limits=ignore_limits,
            accuracy=accuracy,
        )
        return
    refuse(context, "this option needs --certify", "undecided", "most_boxes", "round")
    if mechanism is not None:
        load = motions.payload_of(payload, payload_centre, wrench)
        of_tasks.workspace_of_task(
            mechanism,
            over or (),
            held or (),
            min_conditioning,
            holding,
            degrees,
            output,
            overwrite,
            as_json,
            ignore_limits=ignore_limits,
            accuracy=accuracy,
            payload=load,
            wrench=wrench,
            force=force,
            moment=moment,
            speed=speed,
            turning_speed=turning_speed,
            cones=cones_of(cone or (), degrees),
            workers=workers,
            resume=resume,
        )
        return
    refuse(context, "this option needs a --mechanism", *_OF_MECHANISMS)
    machine = common.load_robot(robot)
    parameters = machine.parameters
    drawn = _FIGURES + ("base_radius",) * (parameters.name == "micro")
    files = [output / "workspace.h5", output / "boundary.stl"]
    check_outputs([*files, *figures_in(output, *drawn)], overwrite)
    output.mkdir(parents=True, exist_ok=True)
    console = common.text_console(as_json)
    grid = space.leg_grid(parameters, points)
    progress = common.progress_bar(console, "direct kinematics")
    found = space.workspace(machine, grid, progress=progress)
    rows = paper_comparison() if parameters.name == "micro" else ()
    summary = _summary(machine, found, rows, degrees)
    with console.status("writing the results"):
        # Slow to import: only for commands that draw.
        from rps_pin import plots

        space.save_workspace(found, files[0], overwrite=True)
        space.save_mesh(space.boundary(found), files[1], overwrite=True)
        # Matplotlib draws surfaces triangle by triangle: a coarser grid shows the same shape.
        coarse = space.leg_grid(parameters, min(_DRAWN_POINTS, found.grid.shape[0]))
        surface = space.workspace(machine, coarse)
        modes = machine.assembly_modes([sum(parameters.leg_length_limits) / 2] * 3)
        figures = [
            plots.plot_assembly_modes(parameters, modes),
            plots.plot_theoretical(parameters),
            plots.plot_effective(surface),
            plots.plot_space(surface),
            plots.plot_views(found),
            *([plots.plot_comparison(rows)] if rows else []),
        ]
        for name, figure in zip(drawn, figures, strict=True):
            files += plots.save_figure(figure, output, name)
    if as_json:
        common.print_json(summary | {"files": files})
        return
    console.print(_table(summary, unit_of(True, degrees)))
    if rows:
        texts = (
            (
                f"{1e3 * row.base_radius:g}",
                *(f"{1e3 * low:.2f} to {1e3 * high:.2f}" for low, high in (row.x, row.y)),
                "yes" if row.holds else f"no: {1e3 * row.reach:.2f} mm",
            )
            for row in rows
        )
        headers = ("g (mm)", "p_x (mm)", "p_y (mm)", "within the paper's 2.5 mm")
        console.print(common.table_of(texts, *headers))
    common.print_files(console, files)


def _summary(
    robot: RPSRobot,
    found: space.Workspace,
    rows: tuple[PaperComparison, ...],
    degrees: bool,
) -> dict[str, Any]:
    inside = found.position[found.inside]
    if not len(inside):
        raise InputError("no point of the grid is inside the workspace")
    size = space.volume(found)
    sides = np.stack([inside.min(axis=0), inside.max(axis=0)], axis=1).tolist()
    height = sides[2][1] - sides[2][0]
    full = space.largest_tilt_range(robot)
    return {
        "robot": robot.parameters.name,
        "points": found.grid.size,
        "inside": len(inside),
        **dict(zip("xyz", sides, strict=True)),
        "volume": size.position,
        "cylinder_volume": math.pi * robot.parameters.platform_radius**2 * height,
        "pose_volume": size.pose,
        "full_tilt": full._asdict() | {"tilt": in_unit(full.tilt, True, degrees)},
        "units": units(degrees),
        "out": {
            reason.text: count
            for reason, count in found.counts().items()
            if reason is not space.Reason.INSIDE and count
        },
        "paper": [row._asdict() for row in rows],
    }


def _table(summary: dict[str, Any], angle: str) -> Table:
    tilts = summary["full_tilt"]
    sides = {f"p_{axis}": [1e3 * value for value in summary[axis]] for axis in "xyz"}
    rows = [
        ("points", f"{summary['points']}, of which inside: {summary['inside']}"),
        *((name, f"{low:.4g} to {high:.4g} mm") for name, (low, high) in sides.items()),
        (
            "volume of the centre's positions",
            f"{1e9 * summary['volume']:.5g} mm^3; theoretical cylinder of radius h: "
            f"{1e9 * summary['cylinder_volume']:.5g} mm^3",
        ),
        (
            "largest cylinder of full tilt",
            f"every tilt up to {tilts['tilt']:.3g} {angle}, "
            f"for z from {1e3 * tilts['lower']:.4g} to {1e3 * tilts['upper']:.4g} mm",
        ),
        *(("out", f"{count}: {reason}") for reason, count in summary["out"].items()),
    ]
    return common.table_of(rows)
