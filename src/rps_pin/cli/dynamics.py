"""``rps-pin dynamics``: the inverse dynamics of a 3-RPS along any trajectory, and its actuators."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.motion_report import (
    print_exceeded,
    print_files,
    run_table,
    sample_progress,
    write_motion,
)
from rps_pin.errors import InputError
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion, summarise
from rps_pin.rps.dynamics.sizing import size_actuators
from rps_pin.rps.dynamics.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.path import Trajectory, end_states

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]


def dynamics_command(
    trajectory: Annotated[
        Path,
        typer.Argument(metavar="TRAJECTORY", help="A CSV of poses, or a YAML that describes one."),
    ],
    robot: RobotOption = "sokolov",
    fastest: Annotated[
        bool,
        typer.Option(
            "--fastest", help="Follow the same curve in the shortest time the actuators allow."
        ),
    ] = False,
    payload: Annotated[
        float | None, typer.Option(metavar="KG", help="Mass that the platform carries, kg.")
    ] = None,
    payload_centre: Annotated[
        Three,
        typer.Option(metavar="X Y Z", help="Where its centre of mass is, platform axes, m."),
    ] = (0.0, 0.0, 0.0),
    wrench: Annotated[
        Six | None,
        typer.Option(
            metavar="FX FY FZ MX MY MZ",
            help="On the platform, N and N m, base axes, about the platform's centre.",
        ),
    ] = None,
    gravity: Annotated[
        Three | None,
        typer.Option(
            metavar="X Y Z", help="Gravity in base axes, m/s^2, instead of the robot's own."
        ),
    ] = None,
    power: Annotated[
        float | None, typer.Option(metavar="W", help="Power limit of an actuator, W.")
    ] = None,
    rate: Annotated[float, typer.Option(help="Samples a second, Hz.")] = 1000.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the results; named after TRAJECTORY."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary as JSON, and nothing else.")
    ] = False,
) -> None:
    """Compute the actuator forces of a 3-RPS along a trajectory, and size its actuators.

    The trajectory is checked first: where it leaves a limit of the robot or crosses a singularity,
    it is refused, and when and why is said. Written to the output folder: **dynamics.csv** (every
    sample, readable as a trajectory again), figures of path, lengths, forces, forces by cause and
    of forces over speeds, the sizing sheet as **sizing.json**, and **viewer.html**, the motion in
    3D.

    Exit status: 0 done; 1 the robot cannot do it (why is said); 2 wrong usage.

    Examples:

    - `rps-pin dynamics path.csv --robot mine.yaml` columns time_s, z_m, tilt_x_rad, tilt_y_rad

    - `rps-pin dynamics circle.yaml --robot micro --payload 0.5 --gravity 9.81 0 0` on a wall

    - `rps-pin dynamics circle.yaml --robot micro --fastest`
    """
    machine = _loaded(load_robot(robot), payload, payload_centre, gravity)
    path = load_trajectory(trajectory, machine)
    console = Console(quiet=as_json)
    limits = _limits(machine, power)
    if fastest:
        path = _fastest(console, machine, path, limits, wrench)
    run = run_motion(machine, path, rate, wrench=wrench, progress=sample_progress(console))
    sheet = size_actuators(run.time, run.force, run.speed, run.length, limits)
    summary = summarise(run, machine)
    folder = output or Path(f"{trajectory.stem}-dynamics")
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        files = _write(folder, trajectory, machine, run, sheet, wrench)
    if as_json:
        answer = {
            "robot": machine.parameters.name,
            "trajectory": str(trajectory),
            **dict(zip(("starts", "ends"), end_states(path), strict=True)),
            **summary.as_dict(),
            "sizing": sheet.as_dict(),
            "files": [str(file) for file in files],
        }
        typer.echo(json.dumps(answer, indent=2))
    else:
        console.print(f"3-RPS [bold]{machine.parameters.name}[/], {trajectory}", highlight=False)
        console.print(sheet.table())
        console.print(run_table(summary, path))
        print_exceeded(console, summary)
        print_files(console, files)


# Inner workings -----------------------------------------------------------------------------------


def _loaded(robot: RPSRobot, mass: float | None, centre: Three, gravity: Three | None) -> RPSRobot:
    """Return the robot with its payload, in its gravity."""
    if mass is None and any(centre):
        raise InputError("--payload-centre says where a payload is: give its mass with --payload")
    if gravity is not None:
        robot = RPSRobot(robot.parameters.replace(gravity=gravity))
    return robot if mass is None else robot.with_payload(Payload(mass, centre))


def _limits(robot: RPSRobot, power: float | None) -> ActuatorLimits:
    if power is None:
        return ActuatorLimits.of(robot.parameters)
    return ActuatorLimits.of(robot.parameters, power=power)


def _fastest(
    console: Console,
    robot: RPSRobot,
    path: Trajectory,
    limits: ActuatorLimits,
    wrench: Six | None,
) -> Trajectory:
    from rps_pin.rps.motion.time_optimal import time_optimal

    with console.status("finding the shortest time"):
        found = time_optimal(robot, path, limits=limits, wrench=wrench)
    console.print(
        f"shortest time {found.duration:.6g} s (as given: {path.duration:.6g} s)", highlight=False
    )
    return found


def _write(
    folder: Path,
    trajectory: Path,
    robot: RPSRobot,
    run: MotionRun,
    sheet: SizingSheet,
    wrench: Six | None,
) -> list[Path]:
    """Write the motion, its forces by cause and the sizing sheet; return the files."""
    from rps_pin.files import whole_file
    from rps_pin.plots import save_figure
    from rps_pin.plots.dynamics import plot_force_causes, plot_sizing
    from rps_pin.rps.dynamics.force_causes import force_causes

    title = f"3-RPS {robot.parameters.name} along {trajectory.name}"
    files = write_motion(folder, "dynamics", title, robot, run)
    causes = force_causes(robot, run.pose, run.rate, run.acceleration, wrench=wrench)
    files += save_figure(plot_force_causes(run.time, causes), folder, "forces_by_cause")
    files += save_figure(plot_sizing(sheet), folder, "force_over_speed")
    sizing = folder / "sizing.json"
    with whole_file(sizing) as scratch:
        scratch.write_text(json.dumps(sheet.as_dict(), indent=2) + "\n", "utf-8")
    return [*files, sizing]
