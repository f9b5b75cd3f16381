"""``rps-pin fk``: the poses that leg lengths allow."""

from __future__ import annotations

import json
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.robot import RPSRobot

Triple = tuple[float, float, float]


def fk_command(
    lengths: Annotated[Triple, typer.Option(metavar="D1 D2 D3", help="The three leg lengths, m.")],
    near: Annotated[
        Triple | None,
        typer.Option(
            metavar="Z TILT_X TILT_Y",
            help="Only the pose that continues this one (m, rad, rad), if it can be followed.",
        ),
    ] = None,
    robot: RobotOption = "sokolov",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the answer as JSON, and nothing else.")
    ] = False,
) -> None:
    """Compute the poses of given leg lengths: every assembly mode, or the one near a known pose.

    Lengths alone leave up to 16 ways to assemble the robot, in pairs mirrored in the base plane
    (Eq. 8). All of them are listed, whatever the robot's limits. With **--near**, the lengths are
    followed from those of that pose: the answer is the one a moving robot would be in. A way that
    meets a singularity is refused.

    Exit status: 0 found; 1 not (why is said); 2 wrong usage.

    Examples:

    - `rps-pin fk --lengths 0.46 0.46 0.46` all solutions

    - `rps-pin fk --lengths 0.45 0.47 0.46 --near 0.4 0 0` the one near the level pose
    """
    machine = load_robot(robot)
    low, high = machine.parameters.leg_length_limits
    if not all(low <= length <= high for length in lengths):
        typer.echo(f"note: the legs' limits are {low:g} to {high:g} m", err=True)
    if near is None:
        _show_all(machine, machine.assembly_modes(lengths), lengths, as_json=as_json)
    else:
        _show_one(machine, lengths, near, as_json=as_json)


def _show_one(robot: RPSRobot, lengths: Triple, near: Triple, *, as_json: bool) -> None:
    pose = robot.forward_kinematics(lengths, near=near)
    position, _ = robot.platform_placement(pose)
    if as_json:
        answer = {
            "robot": robot.parameters.name,
            "length": list(lengths),
            "pose": pose.tolist(),
            "position": position.tolist(),
        }
        typer.echo(json.dumps(answer, indent=2))
        return
    z, tilt_x, tilt_y = pose
    x, y, _ = 1e3 * position + 0.0
    console = Console(soft_wrap=True)
    console.print(
        f"z = {z:.9g} m, tilt = ({tilt_x:.9g}, {tilt_y:.9g}) rad; "
        f"the centre is ({x:.6g}, {y:.6g}) mm off the middle",
        highlight=False,
    )


def _show_all(robot: RPSRobot, modes: AssemblyModes, lengths: Triple, *, as_json: bool) -> None:
    if as_json:
        solutions = [
            {
                "pose": modes.pose[k].tolist() if modes.has_pose[k] else None,
                "position": modes.position[k].tolist(),
                "rotation": modes.rotation[k].tolist(),
                "angle": modes.angle[k].tolist(),
                "above": bool(modes.above[k]),
                "mirror": int(modes.mirror[k]),
                "double": bool(modes.double[k]),
                "residual": float(modes.residual[k]),
            }
            for k in range(len(modes.angle))
        ]
        answer = {"robot": robot.parameters.name, "length": list(lengths), "modes": solutions}
        typer.echo(json.dumps(answer, indent=2))
    else:
        _print_modes(modes)
    if not len(modes.angle):
        raise typer.Exit(1)


def _print_modes(modes: AssemblyModes) -> None:
    console = Console()
    count = len(modes.angle)
    if not count:
        console.print("no way was found to assemble the robot with these lengths", highlight=False)
        return
    table = Table("", "z (m)", "tilt_x (rad)", "tilt_y (rad)", "leg angles (degrees)", "mirror")
    for column in table.columns[:5]:
        column.justify = "right"
    for k in range(count):
        tilt = modes.pose[k, 1:] if modes.has_pose[k] else None
        angles = " ".join(f"{angle:.2f}" for angle in np.degrees(modes.angle[k]))
        table.add_row(
            f"{k + 1}{'*' if modes.double[k] else ''}",
            f"{modes.position[k, 2]:.6g}",
            *(["half", "turn"] if tilt is None else [f"{value:.6g}" for value in tilt]),
            angles,
            str(int(modes.mirror[k]) + 1),
        )
    console.print(table)
    notes = [f"{count} real solutions, largest residual {modes.residual.max():.1g} m"]
    if not modes.has_pose.all():
        notes.append("half turn: of the other operation mode, about an axis outside the base plane")
    if modes.double.any():
        notes.append("*: solutions coincide here, a parallel singularity")
    console.print("; ".join(notes), highlight=False)
