"""``rps-pin helix``: the inverse dynamics of a 3-RPS along the paper's helix."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.helix_options import (
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
from rps_pin.cli.motion_report import (
    actuator_table,
    print_exceeded,
    print_files,
    run_table,
    sample_progress,
    write_motion,
)
from rps_pin.rps.dynamics.motion_run import MotionSummary, run_motion, summarise
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import PAPER_DURATION, HelixPath


def helix_command(
    robot: RobotOption = "sokolov",
    radius: RadiusOption = DEFAULT_RADIUS,
    pitch: PitchOption = DEFAULT_PITCH,
    height: HeightOption = None,
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

    - `rps-pin helix --robot micro` another robot

    - `rps-pin helix --robot mine.yaml --rate 100 --output results --json`

    Exit status: 0 done; 1 the robot cannot do it (why is said); 2 wrong usage.
    """
    machine = load_robot(robot)
    path = chosen_helix(machine, radius, pitch, height, branch, duration)
    console = Console(quiet=as_json)
    run = run_motion(machine, path, rate, progress=sample_progress(console))
    summary = summarise(run, machine)
    output.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        title = f"3-RPS {machine.parameters.name} along a helix"
        files = write_motion(output, "helix", title, machine, run)
    if as_json:
        typer.echo(json.dumps(_as_json(machine, path, summary, files), indent=2))
    else:
        _print_tables(console, machine, path, summary, files)


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
    console.print(actuator_table(summary.actuators))
    console.print(run_table(summary, path))
    print_exceeded(console, summary)
    print_files(console, files)
