"""``rps-pin ik``: the leg lengths of a pose, or the actuators' positions of any task's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli import task_options as tasks
from rps_pin.rps.kinematics.legs import cone_angles, violations

_TASK_ONLY = "--at, --degrees, --ignore-limits, --accuracy"


def ik_command(
    pose: Annotated[
        common.Three | None, common.pose_option("The pose of a 3-RPS: height (m), tilt (rad).")
    ] = None,
    robot: common.RobotOption = "sokolov",
    mechanism: tasks.MechanismOption = None,
    at: Annotated[
        options.JointValues,
        typer.Option(
            metavar="COORDINATE=VALUE",
            help="A coordinate of the mechanism's task, m or rad; default: the home's.",
        ),
    ] = None,
    degrees: tasks.DegreesOption = False,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the leg lengths and angles of a pose, and check them against the robot's limits.

    Exit status: 0 the pose is within all limits; 1 it is not (the error says which limits it
    exceeds, and by how much).

    With **--mechanism**, compute the actuators' positions at coordinates of the mechanism's task,
    continued from its home; those that are not given are the home's.

    Examples:

    - `rps-pin ik --robot micro --pose 0.22 0.1 -0.05`

    - `rps-pin ik --mechanism stewart --at z=0.64 --at rx=5 --degrees`
    """
    if mechanism is not None:
        if pose is not None:
            raise typer.BadParameter(
                "a mechanism's coordinates are given by --at", param_hint="--pose"
            )
        _of_task(mechanism, at, degrees, as_json, ignore_limits, accuracy)
        return
    if at or degrees or ignore_limits or accuracy is not None:
        raise typer.BadParameter("these options need a --mechanism", param_hint=_TASK_ONLY)
    if pose is None:
        raise typer.BadParameter("give a pose, or a --mechanism", param_hint="--pose")
    machine = common.load_robot(robot)
    common.doubt_pose("--pose", pose)
    parameters = machine.parameters
    legs = machine.inverse_kinematics(pose, errors="mask")
    position, rotation = machine.platform_placement(pose)
    cone = cone_angles(legs.angle, rotation, parameters.spherical_rest_angle)
    if as_json:
        broken = violations(parameters, legs.length, legs.angle, cone)
        answer = {
            "robot": parameters.name,
            "pose": list(pose),
            "position": position.tolist(),
            "rotation": rotation.tolist(),
            "length": legs.length.tolist(),
            "angle": legs.angle.tolist(),
            "spherical_joint_angle": cone.tolist(),
            "reachable": bool(legs.reachable),
            "violations": [one._asdict() for one in broken],
        }
        common.print_json(answer)
        raise typer.Exit(not legs.reachable)
    x, y, z = 1e3 * position + 0.0  # no negative zeros
    console = common.text_console()
    console.print(f"centre at ({x:.6g}, {y:.6g}, {z:.6g}) mm")
    quantities = (
        ("length", legs.length, parameters.leg_length_limits, "m"),
        ("angle", legs.angle, parameters.leg_angle_limits, "rad"),
        ("spherical joint", cone, (0.0, parameters.spherical_cone_limit), "rad"),
    )
    rows = (
        (label, *(f"{value:.6g}" for value in values), f"{low:.4g} to {high:.4g}", unit)
        for label, values, (low, high), unit in quantities
    )
    legs_named = ("leg 1", "leg 2", "leg 3")
    console.print(common.table_of(rows, "", *legs_named, "limits", "unit", right=slice(1, 4)))
    machine.inverse_kinematics(pose)  # raises if a limit is exceeded, and says which


def _of_task(
    file: Path,
    at: list[str] | None,
    degrees: bool,
    as_json: bool,
    ignore_limits: bool,
    accuracy: float | None,
) -> None:
    task = tasks.load_task(file, ignore_limits, accuracy)
    x = tasks.given(at, "--at", task.coordinates, task.angular, np.array(task.home), degrees)
    q = task.configuration(x)
    a = task.to_actuators(x, q)
    tasks.print_answer(task, x, a, q, first="actuators", degrees=degrees, as_json=as_json)
