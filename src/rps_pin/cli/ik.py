"""``rps-pin ik``: the leg lengths of a pose, or the actuators' positions of any task's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli import task_options as tasks
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import refuse
from rps_pin.rps.kinematics.legs import cone_angles, violations
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures

_MECHANISMS = ("at", "ignore_limits", "accuracy")


def ik_command(
    context: typer.Context,
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
    forces: Annotated[
        bool, typer.Option("--forces", help="The actuators' forces too, at rest there.")
    ] = False,
    degrees: DegreesOption = False,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the leg lengths and angles of a pose, and check them against the robot's limits.

    Exit status: 0 the pose is within all limits; 1 it is not (the error says which limits it
    exceeds, and by how much).

    With **--mechanism**, compute the actuators' positions at coordinates of the mechanism's task,
    continued from its home; those that are not given are the home's. A singular pose is told.

    Examples:

    - `rps-pin ik --robot micro --pose 0.22 0.1 -0.05`

    - `rps-pin ik --robot mine.yaml --pose 0.22 5 0 --degrees --forces`

    - `rps-pin ik --mechanism stewart --at z=0.64 --at rx=5 --degrees`
    """
    if mechanism is not None:
        refuse(context, "a mechanism's coordinates are given by --at", "pose")
        refuse(context, "it does not go with a mechanism", "robot")
        _of_task(mechanism, at, forces, degrees, as_json, ignore_limits, accuracy)
        return
    refuse(context, "these options need a --mechanism", *_MECHANISMS)
    if pose is None:
        raise typer.BadParameter("give a pose, or a --mechanism", param_hint="--pose")
    machine = common.load_robot(robot)
    z, *tilts = pose
    x = z, *(math.radians(tilt) if degrees else tilt for tilt in tilts)
    common.doubt_pose("--pose", pose, degrees)
    _of_robot(machine, np.array(x), forces, degrees, as_json)


def _of_robot(machine: RPSRobot, pose: Array, forces: bool, degrees: bool, as_json: bool) -> None:
    parameters = machine.parameters
    legs = machine.inverse_kinematics(pose, errors="mask")
    position, rotation = machine.platform_placement(pose)
    cone = cone_angles(legs.angle, rotation, parameters.spherical_rest_angle)
    found = tasks.plain_measures(singularity_measures(parameters, pose, errors="mask"))
    force: Array | None = None
    if forces and legs.reachable:
        force = machine.actuator_forces(pose, np.zeros(3), np.zeros(3))
    angle_of = partial(tasks.in_unit, angular=True, degrees=degrees)
    if as_json:
        broken = violations(parameters, legs.length, legs.angle, cone)
        if degrees:
            broken = [one.in_degrees() for one in broken]
        answer: dict[str, Any] = {
            "robot": parameters.name,
            "pose": [float(pose[0]), *map(angle_of, pose[1:])],
            "position": position.tolist(),
            "rotation": rotation.tolist(),
            "length": legs.length.tolist(),
            "angle": [*map(angle_of, legs.angle)],
            "spherical_joint_angle": [*map(angle_of, cone)],
            "reachable": bool(legs.reachable),
            "violations": [one._asdict() for one in broken],
            "singularities": found,
            "units": tasks.units(degrees),
        }
        common.print_json(answer | ({} if force is None else {"force": force.tolist()}))
        raise typer.Exit(not legs.reachable)
    x, y, z = 1e3 * position + 0.0  # no negative zeros
    console = common.text_console(soft_wrap=True)
    console.print(f"centre at ({x:.6g}, {y:.6g}, {z:.6g}) mm")
    unit = tasks.unit_of(True, degrees)
    largest = parameters.actuator_force_limit
    angles, cones = ([*map(angle_of, values)] for values in (legs.angle, cone))
    limits = [*map(angle_of, (*parameters.leg_angle_limits, parameters.spherical_cone_limit))]
    quantities: list[tuple[str, Sequence[float], Sequence[float], str]] = [
        ("length", legs.length.tolist(), parameters.leg_length_limits, "m"),
        ("angle", angles, limits[:2], unit),
        ("spherical joint", cones, (0.0, limits[2]), unit),
    ]
    if force is not None:
        quantities.append(("force", force.tolist(), (-largest, largest), "N"))
    rows = (
        (label, *(f"{value:.6g}" for value in values), f"{low:.4g} to {high:.4g}", unit)
        for label, values, (low, high), unit in quantities
    )
    legs_named = ("leg 1", "leg 2", "leg 3")
    console.print(common.table_of(rows, "", *legs_named, "limits", "unit", right=slice(1, 4)))
    for words in tasks.singular(found):
        console.print(words)
    machine.inverse_kinematics(pose)  # raises if a limit is exceeded, and says which


def _of_task(
    file: Path,
    at: list[str] | None,
    forces: bool,
    degrees: bool,
    as_json: bool,
    ignore_limits: bool,
    accuracy: float | None,
) -> None:
    task = tasks.load_task(file, ignore_limits, accuracy)
    x = tasks.given(at, "--at", task.coordinates, task.angular, np.array(task.home), degrees)
    q = task.configuration(x)
    a = task.to_actuators(x, q)
    force = None
    if forces:
        options.require_masses(task.mechanism)
        still = np.zeros(task.mechanism.model.nv)
        force = task.mechanism.inverse_dynamics(q, still, still).tau
    tasks.print_answer(
        task, x, a, q, first="actuators", degrees=degrees, as_json=as_json, forces=force
    )
