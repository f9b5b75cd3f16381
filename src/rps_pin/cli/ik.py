"""``rps-pin ik``: the leg lengths of a pose."""

from __future__ import annotations

from typing import Annotated

import typer

from rps_pin.cli import console as common
from rps_pin.rps.kinematics.legs import cone_angles, violations


def ik_command(
    pose: Annotated[common.Three, common.pose_option("The pose: height (m), tilt (rad).")],
    robot: common.RobotOption = "sokolov",
    as_json: common.JsonOption = False,
) -> None:
    """Compute the leg lengths and angles of a pose, and check them against the robot's limits.

    Exit status: 0 the pose is within all limits; 1 it is not (the error says which limits it
    exceeds, and by how much).

    Example: `rps-pin ik --robot micro --pose 0.22 0.1 -0.05`
    """
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
