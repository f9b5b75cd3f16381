"""``rps-pin dynamics``: the inverse dynamics along any trajectory, and the actuators."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rps_pin.cli import console as common
from rps_pin.cli import motion_options as motions
from rps_pin.cli import task_options as tasks
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import refuse
from rps_pin.cli.mechanism_options import AccuracyOption, IgnoreLimitsOption
from rps_pin.cli.motion_report import motion_files, print_motion, write_motion
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.cli.task_dynamics import dynamics_of_task
from rps_pin.files import write_text
from rps_pin.rps.dynamics.force_causes import force_causes
from rps_pin.rps.dynamics.motion_csv import COLUMNS
from rps_pin.rps.dynamics.motion_run import run_motion, summarise
from rps_pin.rps.dynamics.sizing import size_actuators
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.path import end_states

_FIGURES = ("forces_by_cause", "force_over_speed")


def dynamics_command(
    context: typer.Context,
    trajectory: Annotated[
        Path,
        typer.Argument(metavar="TRAJECTORY", help="A CSV file of poses, or a YAML file."),
    ],
    robot: common.RobotOption = "sokolov",
    fastest: motions.FastestOption = False,
    payload: motions.PayloadOption = None,
    payload_centre: motions.PayloadCentreOption = (0.0, 0.0, 0.0),
    wrench: motions.WrenchOption = None,
    gravity: Annotated[
        common.Three | None,
        typer.Option(metavar="X Y Z", help="Gravity in base axes, m/s^2; default: the robot's."),
    ] = None,
    power: Annotated[
        float | None, typer.Option(metavar="W", help="Power limit of an actuator, W.")
    ] = None,
    rate: common.RateOption = 1000.0,
    mechanism: tasks.MechanismOption = None,
    ignore_limits: IgnoreLimitsOption = False,
    accuracy: AccuracyOption = None,
    degrees: DegreesOption = False,
    output: common.NamedFolderOption = None,
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the actuator forces along a trajectory, and size the actuators.

    The trajectory is checked first: if it leaves a limit of the robot or crosses a singularity, the
    error says when and why. Output: **dynamics.csv** (every sample, readable as a trajectory),
    figures of path, lengths, forces, forces by cause and forces over speeds, the sizing sheet
    (**sizing.json**), and **viewer.html**, the motion in 3D. With **--mechanism** the trajectory is
    one of its task's coordinates, payload and wrench are those of its output frame, and the loads
    of all joints are printed; **--degrees** says and writes all its angles in degrees.

    Exit status: 0 done; 1 the robot cannot follow it (the error says why); 2 wrong usage.

    Examples:

    - `rps-pin dynamics path.csv --robot mine.yaml` columns time_s, z_m, tilt_x_rad, tilt_y_rad

    - `rps-pin dynamics circle.yaml --robot micro --payload 0.5 --gravity 9.81 0 0` on a wall

    - `rps-pin dynamics circle.yaml --robot micro --fastest`

    - `rps-pin dynamics path.yaml --mechanism delta --payload 0.2`
    """
    load = motions.payload_of(payload, payload_centre, wrench)
    if mechanism is not None:
        refuse(context, "it does not go with a mechanism", "robot")
        dynamics_of_task(
            mechanism,
            trajectory,
            output,
            rate=rate,
            fastest=fastest,
            overwrite=overwrite,
            as_json=as_json,
            ignore_limits=ignore_limits,
            accuracy=accuracy,
            degrees=degrees,
            gravity=gravity,
            power=power,
            payload=load,
            wrench=wrench,
        )
        return
    refuse(context, "it is an option of a mechanism", "ignore_limits", "accuracy")
    machine = common.load_robot(robot)
    if gravity is not None:
        machine = RPSRobot(machine.parameters.replace(gravity=gravity))
    if load is not None:
        machine = machine.with_payload(load)
    name = machine.parameters.name
    path = load_trajectory(trajectory, machine)
    folder = output or Path(f"{trajectory.stem}-dynamics")
    figures = figures_in(folder, *_FIGURES)
    results = [*motion_files(folder, "dynamics"), *figures, folder / "sizing.json"]
    check_outputs(results, overwrite, inputs=[trajectory], renewed=True)
    console = common.text_console(as_json)
    limits = ActuatorLimits.of(machine.parameters, power=math.inf if power is None else power)
    if fastest:
        path = motions.fastest_of_robot(console, machine, path, limits, wrench)
    progress = common.progress_bar(console, "inverse dynamics")
    common.tell_size("dynamics.csv", path.duration * rate, COLUMNS)
    run = run_motion(machine, path, rate, wrench=wrench, progress=progress)
    sheet = size_actuators(run.time, run.force, run.speed, run.length, limits)
    summary = summarise(run, machine)
    if degrees:
        summary = summary.in_degrees()
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        from rps_pin.plots import save_figure
        from rps_pin.plots.dynamics import plot_force_causes, plot_sizing

        title = f"3-RPS {name} along {trajectory.name}"
        files = write_motion(folder, "dynamics", title, machine, run, degrees)
        motion = run.pose, run.rate, run.acceleration
        causes = force_causes(machine, *motion, wrench=wrench, legs=run.legs)
        drawn = plot_force_causes(run.time, causes, limit=limits.force), plot_sizing(sheet)
        for figure, name_of_figure in zip(drawn, _FIGURES, strict=True):
            files += save_figure(figure, folder, name_of_figure)
        files.append(folder / "sizing.json")
        write_text(files[-1], json.dumps(sheet.as_dict(), indent=2) + "\n")
    if as_json:
        answer = {"robot": name, "trajectory": trajectory}
        answer |= dict(zip(("starts", "ends"), end_states(path), strict=True))
        answer["units"] = tasks.units(degrees)
        common.print_json(answer | summary.as_dict() | {"sizing": sheet.as_dict(), "files": files})
        return
    console.print(f"3-RPS [bold]{escape(name)}[/], {escape(str(trajectory))}", markup=True)
    print_motion(console, sheet.table(), summary, path, files, degrees)
