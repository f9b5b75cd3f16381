"""``rps-pin ik``: the leg lengths of a pose."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from rps_pin.arrays import Array
from rps_pin.cli.console import JsonOption, RobotOption, Three, load_robot, print_json
from rps_pin.errors import LimitViolation, UnreachableError
from rps_pin.rps.kinematics.legs import cone_angles
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot


def ik_command(
    pose: Annotated[
        Three, typer.Option(metavar="Z TILT_X TILT_Y", help="The pose: height (m), tilt (rad).")
    ],
    robot: RobotOption = "sokolov",
    as_json: JsonOption = False,
) -> None:
    """Compute the leg lengths and angles of a pose, and check them against the robot's limits.

    Exit status: 0 the pose is within all limits; 1 it is not (the error says which limits it
    exceeds, and by how much).

    Example: `rps-pin ik --robot micro --pose 0.22 0.1 -0.05`
    """
    machine = load_robot(robot)
    legs = machine.inverse_kinematics(pose, errors="mask")
    position, rotation = machine.platform_placement(pose)
    cone = cone_angles(legs.angle, rotation, machine.parameters.spherical_rest_angle)
    if as_json:
        answer = {
            "robot": machine.parameters.name,
            "pose": list(pose),
            "position": position.tolist(),
            "rotation": rotation.tolist(),
            "length": legs.length.tolist(),
            "angle": legs.angle.tolist(),
            "spherical_joint_angle": cone.tolist(),
            "reachable": bool(legs.reachable),
            "violations": [one._asdict() for one in _violations(machine, pose)],
        }
        print_json(answer)
    else:
        console = Console()
        x, y, z = 1e3 * position + 0.0  # no negative zeros
        console.print(f"centre at ({x:.6g}, {y:.6g}, {z:.6g}) mm", highlight=False)
        console.print(_table(machine.parameters, legs.length, legs.angle, cone))
    if not legs.reachable:
        if as_json:
            raise typer.Exit(1)
        machine.inverse_kinematics(pose)  # raises, and says what is broken


def _violations(robot: RPSRobot, pose: Three) -> tuple[LimitViolation, ...]:
    try:
        robot.inverse_kinematics(pose)
    except UnreachableError as error:
        return error.violations
    return ()


def _table(
    parameters: RPSParameters,
    length: Array,
    angle: Array,
    cone: Array,
) -> Table:
    table = Table("", "leg 1", "leg 2", "leg 3", "limits", "unit")
    for column in table.columns[1:4]:
        column.justify = "right"
    for label, unit, values, (lower, upper) in (
        ("length", "m", length, parameters.leg_length_limits),
        ("angle", "rad", angle, parameters.leg_angle_limits),
        ("spherical joint", "rad", cone, (0.0, parameters.spherical_cone_limit)),
    ):
        limits = f"{lower:.4g} to {upper:.4g}"
        table.add_row(label, *(f"{value:.6g}" for value in values), limits, unit)
    return table
