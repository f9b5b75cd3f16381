"""``rps-pin fk``: the poses with given leg lengths."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array, Bools
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli import task_options as tasks
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import refuse
from rps_pin.cli.printing import say
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.kinematics.legs import cone_angles, within_limits
from rps_pin.rps.parameters import RPSParameters

_MECHANISMS = ("at", "ignore_limits", "accuracy")
#: In place of the tilts of an assembly mode without a pose.
_HALF_TURN = ("half", "turn")


def fk_command(
    context: typer.Context,
    lengths: Annotated[
        common.Three | None,
        typer.Option(metavar="D1 D2 D3", help="The three leg lengths of a 3-RPS, m."),
    ] = None,
    near: Annotated[
        common.Three | None,
        common.pose_option("Only the pose that is reached from this one (m, rad, rad)."),
    ] = None,
    robot: common.RobotOption = "sokolov",
    mechanism: tasks.MechanismOption = None,
    at: Annotated[
        options.JointValues,
        options.joint_values("An actuator's position, m or rad; default: the home's."),
    ] = None,
    degrees: DegreesOption = False,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the poses of given leg lengths: every assembly mode, or the one near a known pose.

    Leg lengths have up to 16 assembly modes, in pairs mirrored in the base plane (Eq. 8). All are
    listed; those within the robot's limits are marked. With **--near**, the lengths are followed
    from those of that pose: the result is the pose that a moving robot reaches. A path that meets a
    singularity is an error.

    With **--mechanism**, compute the coordinates of the mechanism's task at positions of its
    actuators, continued from its home; `rps-pin assembly-modes` searches all modes.

    Exit status: 0 found; 1 not found (the error says why); 2 wrong usage.

    Examples:

    - `rps-pin fk --lengths 0.46 0.46 0.46` all solutions

    - `rps-pin fk --lengths 0.45 0.47 0.46 --near 0.4 0 0` the one near the level pose

    - `rps-pin fk --mechanism delta --at arm_1_joint=0.4`
    """
    if mechanism is not None:
        refuse(context, "a mechanism's actuators are given by --at", "lengths", "near")
        refuse(context, "it does not go with a mechanism", "robot")
        _of_task(mechanism, at, degrees, as_json, ignore_limits, accuracy)
        return
    refuse(context, "these options need a --mechanism", *_MECHANISMS)
    if lengths is None:
        raise typer.BadParameter("give leg lengths, or a --mechanism", param_hint="--lengths")
    machine = common.load_robot(robot)
    common.doubt_lengths("--lengths", "leg lengths", lengths)
    low, high = machine.parameters.leg_length_limits
    if not all(low <= length <= high for length in lengths):
        say(f"note: the legs' limits are {low:g} to {high:g} m", err=True)
    answer: dict[str, Any] = {
        "robot": machine.parameters.name,
        "length": lengths,
        "units": tasks.units(degrees),
    }
    angle_of = partial(tasks.in_unit, angular=True, degrees=degrees)
    if near is None:
        modes = machine.assembly_modes(lengths)
        within = _within_limits(machine.parameters, np.array(lengths), modes)
        if as_json:
            common.print_json(answer | {"modes": _plain(modes, within, angle_of)})
        else:
            _print_modes(modes, within, degrees)
        raise typer.Exit(not len(modes.angle))
    tilts = [math.radians(tilt) if degrees else tilt for tilt in near[1:]]
    common.doubt_pose("--near", near, degrees)
    pose = machine.forward_kinematics(lengths, near=[near[0], *tilts])
    position, _ = machine.platform_placement(pose)
    if as_json:
        shown = [float(pose[0]), *map(angle_of, pose[1:])]
        common.print_json(answer | {"pose": shown, "position": position.tolist()})
        return
    z, tilt_x, tilt_y = pose[0], *map(angle_of, pose[1:])
    x, y, _ = 1e3 * position + 0.0  # no negative zeros
    common.text_console(soft_wrap=True).print(
        f"z = {z:.9g} m, tilt = ({tilt_x:.9g}, {tilt_y:.9g}) "
        f"{tasks.unit_of(True, degrees)}; "
        f"centre at x = {x:.6g} mm, y = {y:.6g} mm"
    )


def _of_task(
    file: Path,
    at: list[str] | None,
    degrees: bool,
    as_json: bool,
    ignore_limits: bool,
    accuracy: float | None,
) -> None:
    task = tasks.load_task(file, ignore_limits, accuracy)
    names, angular = tasks.of_actuators(task)
    home = task.mechanism.home
    a = tasks.given(at, "--at", names, angular, task.to_actuators(task.home, home), degrees)
    q = task.mechanism.complete(a)
    x = task.at(q)
    tasks.print_answer(task, x, a, q, first="task", degrees=degrees, as_json=as_json)


def _within_limits(parameters: RPSParameters, length: Array, modes: AssemblyModes) -> Bools:
    """Return which assembly modes keep the limits of lengths, leg angles and spherical joints."""
    cone = cone_angles(modes.angle, modes.rotation, parameters.spherical_rest_angle)
    lengths = np.broadcast_to(length, modes.angle.shape)
    return within_limits(parameters, lengths, modes.angle, cone)


def _plain(
    modes: AssemblyModes, within: Bools, angle_of: Callable[[float], float]
) -> list[dict[str, Any]]:
    """Return a dictionary for each assembly mode, for JSON; without a pose at half a turn."""
    shown = ("position", "rotation", "above", "mirror", "double", "residual")
    return [
        {name: getattr(modes, name)[k].tolist() for name in shown}
        | {
            "angle": [*map(angle_of, modes.angle[k])],
            "within_limits": bool(within[k]),
            "pose": [float(modes.pose[k, 0]), *map(angle_of, modes.pose[k, 1:])]
            if modes.has_pose[k]
            else None,
        }
        for k in range(len(modes.angle))
    ]


def _print_modes(modes: AssemblyModes, within: Bools, degrees: bool) -> None:
    console = common.text_console()
    count = len(modes.angle)
    if not count:
        console.print("no assembly mode has these lengths")
        return
    unit, digits = tasks.unit_of(True, degrees), 2 if degrees else 3

    def shown(angle: float, more: int = 0) -> str:
        return f"{tasks.in_unit(angle, True, degrees):.{digits + more}f}"

    rows = (
        (
            f"{k + 1}{'*' if modes.double[k] else ''}",
            f"{modes.position[k, 2]:.6g}",
            *([shown(t, 2) for t in modes.pose[k, 1:]] if modes.has_pose[k] else _HALF_TURN),
            " ".join(map(shown, modes.angle[k])),
            str(int(modes.mirror[k]) + 1),
            "yes" if within[k] else "no",
        )
        for k in range(count)
    )
    headers = ("z\n(m)", *(f"{name}\n({unit})" for name in ("tilt_x", "tilt_y", "leg angles")))
    last = ("mirror", "within\nlimits")
    console.print(common.table_of(rows, "", *headers, *last, right=slice(5)))
    notes = [
        f"{count} real solutions, {np.count_nonzero(within)} within the robot's limits, largest "
        f"residual {modes.residual.max():.1g} m"
    ]
    if not modes.has_pose.all():
        notes.append("half turn: of the other operation mode, about an axis outside the base plane")
    if modes.double.any():
        notes.append("*: solutions coincide here, a parallel singularity")
    console.print("; ".join(notes))
