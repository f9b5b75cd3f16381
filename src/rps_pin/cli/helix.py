"""``rps-pin helix``: the inverse dynamics of a 3-RPS along the paper's helix."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.helix_options import (
    DEFAULT_HEIGHT,
    DEFAULT_PITCH,
    DEFAULT_RADIUS,
    Branch,
    BranchOption,
    DurationOption,
    HeightOption,
    PitchOption,
    RadiusOption,
    chosen_helix,
)
from rps_pin.rps.motion_csv import write_csv
from rps_pin.rps.motion_run import ActuatorSummary, MotionRun, MotionSummary, run_motion, summarise
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import PAPER_DURATION, HelixPath


def helix_command(
    robot: RobotOption = "sokolov",
    radius: RadiusOption = DEFAULT_RADIUS,
    pitch: PitchOption = DEFAULT_PITCH,
    height: HeightOption = DEFAULT_HEIGHT,
    branch: BranchOption = Branch.PLUS,
    duration: DurationOption = PAPER_DURATION,
    rate: Annotated[float, typer.Option(help="Samples a second, Hz.")] = 1000.0,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results; made if need be.")
    ] = Path("helix"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary as JSON, and nothing else.")
    ] = False,
) -> None:
    """Compute the actuator forces of a 3-RPS along the paper's helix.

    The platform's centre climbs one turn of a helix (Eq. 26 to 29; the last branch of Eq. 29 is
    corrected, as it is misprinted). The loops are closed by Pinocchio constraint models and the
    forces solve the constrained RNEA. Written to the output folder: **helix.csv** (every sample),
    figures like the paper's 7, 8 and 9 (PNG and SVG), and **viewer.html**, the motion in 3D, which
    any browser opens from disk.

    The defaults are the paper's Table 1 with z_0 read as 0.4 m: the one reading of it that stays
    clear of the flat, singular pose. At the 0.4 mm it prints the robot lies all but flat in its
    base, and the motion crosses poses that no actuator force could hold.

    Examples:

    - `rps-pin helix` the paper's robot and helix

    - `rps-pin helix --robot micro --height 0.225` another robot

    - `rps-pin helix --robot mine.yaml --rate 100 --output results --json`

    Exit status: 0 done; 1 the robot cannot do it (why is said); 2 wrong usage.
    """
    machine = load_robot(robot)
    path = chosen_helix(machine, radius, pitch, height, branch, duration)
    console = Console(quiet=as_json)
    run = run_motion(
        machine,
        path,
        rate,
        progress=lambda samples: track(
            samples,
            "inverse dynamics",
            console=console,
            transient=True,
            disable=not console.is_terminal,
        ),
    )
    summary = summarise(run, machine)
    output.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        files = write_results(output, machine, run)
    if as_json:
        typer.echo(json.dumps(_as_json(machine, path, summary, files), indent=2))
    else:
        _print_tables(console, machine, path, summary, files)


def write_results(folder: Path, robot: RPSRobot, run: MotionRun) -> list[Path]:
    """Write a motion's table, figures and animation into a folder; return the files."""
    # Only this command draws: the others shall not wait for these to be imported.
    from rps_pin.plots import plot_forces, plot_lengths, plot_path, save_figure
    from rps_pin.viewer import write_html

    table = folder / "helix.csv"
    write_csv(table, run)
    files = [table]
    for name, plot in (
        ("figure_7_path", plot_path),
        ("figure_8_lengths", plot_lengths),
        ("figure_9_forces", plot_forces),
    ):
        files += save_figure(plot(run), folder, name)
    page = folder / "viewer.html"
    write_html(
        page,
        robot.mechanism.model,
        robot.visual_model(),
        run.time,
        run.configuration,
        title=f"3-RPS {robot.parameters.name} along a helix",
    )
    return [*files, page]


def _as_json(
    robot: RPSRobot, path: HelixPath, summary: MotionSummary, files: list[Path]
) -> dict[str, object]:
    return {
        "robot": robot.parameters.name,
        "helix": {
            "radius": path.radius,
            "pitch": path.pitch,
            "height": path.height,
            "branch": path.branch,
            "tilt": path.tilt,
        },
        **summary.as_dict(),
        "files": [str(file) for file in files],
    }


def _print_tables(
    console: Console,
    robot: RPSRobot,
    path: HelixPath,
    summary: MotionSummary,
    files: list[Path],
) -> None:
    console.print(
        f"3-RPS [bold]{robot.parameters.name}[/], helix of radius {1e3 * path.radius:g} mm, "
        f"pitch {1e3 * path.pitch:g} mm, from {path.height:g} m",
        highlight=False,
    )
    console.print(_actuator_table(summary.actuators))
    console.print(_run_table(summary))
    for sentence in summary.exceeded:
        console.print(f"[bold yellow]beyond a limit:[/] {sentence}", highlight=False)
    console.print("Written:")
    for file in files:
        console.print(f"  {file}", highlight=False, soft_wrap=True)


def _actuator_table(actuators: tuple[ActuatorSummary, ...]) -> Table:
    table = Table("", *(f"actuator {one.actuator}" for one in actuators), "unit")
    for column in table.columns[1:-1]:
        column.justify = "right"
    for label, unit, attribute in (
        ("force, minimum", "N", "force_min"),
        ("force, maximum", "N", "force_max"),
        ("force, RMS", "N", "force_rms"),
        ("length, shortest", "m", "length_min"),
        ("length, longest", "m", "length_max"),
        ("speed, peak", "m/s", "speed_peak"),
        ("power, peak", "W", "power_peak"),
        ("power, mean of |F d'|", "W", "power_mean"),
    ):
        table.add_row(label, *(f"{getattr(one, attribute):.6g}" for one in actuators), unit)
    return table


def _run_table(summary: MotionSummary) -> Table:
    z, tilt_x, tilt_y = summary.singularity_pose
    table = Table(show_header=False)
    table.add_row("duration", f"{summary.duration:.6g} s ({summary.samples} samples)")
    table.add_row("largest loop gap", f"{summary.loop_gap_max:.2g} m")
    table.add_row("largest KKT residual", f"{summary.residual_max:.2g} of the largest force")
    table.add_row(
        "smallest distance to a singularity\n(1 / condition number: 0 singular, 1 best)",
        f"{summary.singularity_distance_min:.4g} at t = {summary.singularity_time:.4g} s,\n"
        f"z = {z:.6g} m, tilt = ({tilt_x:.4g}, {tilt_y:.4g}) rad",
    )
    return table
