"""``rps-pin fk``: the poses with given leg lengths."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from rps_pin.cli.console import JsonOption, RobotOption, Three, load_robot, print_json
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.robot import RPSRobot


def fk_command(
    lengths: Annotated[Three, typer.Option(metavar="D1 D2 D3", help="The three leg lengths, m.")],
    near: Annotated[
        Three | None,
        typer.Option(
            metavar="Z TILT_X TILT_Y",
            help="Only the pose that is reached from this one (m, rad, rad).",
        ),
    ] = None,
    robot: RobotOption = "sokolov",
    as_json: JsonOption = False,
) -> None:
    """Compute the poses of given leg lengths: every assembly mode, or the one near a known pose.

    Leg lengths have up to 16 assembly modes, in pairs mirrored in the base plane (Eq. 8). All are
    listed, also outside the robot's limits. With **--near**, the lengths are followed from those of
    that pose: the result is the pose that a moving robot reaches. A path that meets a singularity
    is an error.

    Exit status: 0 found; 1 not found (the error says why); 2 wrong usage.

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


def _show_one(robot: RPSRobot, lengths: Three, near: Three, *, as_json: bool) -> None:
    pose = robot.forward_kinematics(lengths, near=near)
    position, _ = robot.platform_placement(pose)
    if as_json:
        answer = {"pose": pose.tolist(), "position": position.tolist()}
        print_json({"robot": robot.parameters.name, "length": lengths} | answer)
        return
    z, tilt_x, tilt_y = pose
    x, y, _ = 1e3 * position + 0.0  # no negative zeros
    Console(soft_wrap=True).print(
        f"z = {z:.9g} m, tilt = ({tilt_x:.9g}, {tilt_y:.9g}) rad; "
        f"centre at x = {x:.6g} mm, y = {y:.6g} mm",
        highlight=False,
    )


def _show_all(robot: RPSRobot, modes: AssemblyModes, lengths: Three, *, as_json: bool) -> None:
    if as_json:
        solutions = [
            {name: getattr(modes, name)[k].tolist() for name in _SHOWN}
            | {"pose": modes.pose[k].tolist() if modes.has_pose[k] else None}
            for k in range(len(modes.angle))
        ]
        print_json({"robot": robot.parameters.name, "length": lengths, "modes": solutions})
    else:
        _print_modes(modes)
    if not len(modes.angle):
        raise typer.Exit(1)


#: What the JSON has of each assembly mode, besides its pose.
_SHOWN = ("position", "rotation", "angle", "above", "mirror", "double", "residual")


def _print_modes(modes: AssemblyModes) -> None:
    console = Console()
    count = len(modes.angle)
    if not count:
        console.print("no assembly mode has these lengths", highlight=False)
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
