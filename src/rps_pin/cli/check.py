"""``rps-pin check``: a helix, or a path of any task, against singularities and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli import helix_options as helix
from rps_pin.cli import mechanism_options as options
from rps_pin.cli import motion_options as motions
from rps_pin.cli import task_options as tasks
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import refuse
from rps_pin.errors import InputError
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.task.path_check import check_path as check_task_path
from rps_pin.task.paths.events import LimitEvent, PathCheck, pose_of_robot_in_words
from rps_pin.task.paths.findings import GRAZE
from rps_pin.task.paths.signals import pose_in_words
from rps_pin.trajectories.path import Trajectory

if TYPE_CHECKING:
    from rps_pin.task import Task


class Interference(StrEnum):
    """Whether it is checked."""

    AUTO = "auto"
    YES = "yes"
    NO = "no"


ClearanceOption = Annotated[
    float,
    typer.Option(min=0.0, help="Least distance of two links of a mechanism, m."),
]
IgnoreOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LINK,LINK",
        help="Two links of a mechanism that may overlap; can be given several times.",
        show_default=False,
    ),
]
InterferenceOption = Annotated[
    Interference,
    typer.Option(
        help="Whether links of a mechanism are checked for interference: **auto**, where it has "
        "collision shapes and all can be read; **yes**, or else it is an error; **no**.",
    ),
]


#: Options of the helix.
_CURVE = ("radius", "pitch", "height", "branch", "duration")


def check_command(
    context: typer.Context,
    trajectory: Annotated[
        Path | None,
        typer.Argument(
            metavar="TRAJECTORY",
            help="A CSV or YAML file, in place of the helix.",
            show_default=False,
        ),
    ] = None,
    robot: common.RobotOption = "sokolov",
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    threshold: Annotated[
        float,
        typer.Option(help="Distance to a singularity (0 to 1) below which a path grazes it."),
    ] = GRAZE,
    fastest: motions.FastestOption = False,
    payload: motions.PayloadOption = None,
    payload_centre: motions.PayloadCentreOption = (0.0, 0.0, 0.0),
    wrench: motions.WrenchOption = None,
    mechanism: tasks.MechanismOption = None,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    degrees: DegreesOption = False,
    clearance: ClearanceOption = 0.0,
    ignore: IgnoreOption = None,
    interference: InterferenceOption = Interference.AUTO,
    package_path: options.PackagePathOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Check a path for singularities that it crosses or grazes, and limits that it leaves.

    That is a helix of a 3-RPS, or a trajectory file; with **--mechanism**, a trajectory of the
    coordinates of its task. Each event is located to a nanosecond, or to 1e-10 of the duration. Of
    a mechanism, and of a 3-RPS with a payload or a wrench, speeds and forces of the actuators are
    checked too; where a description has collision shapes, the interference of its links.

    Exit status: 0 the path is clear; 1 it is not; 2 wrong usage.

    Examples:

    - `rps-pin check` the paper's helix: clear

    - `rps-pin check --radius 0.075 --pitch 0.05` crosses two singularities

    - `rps-pin check --radius 0.075 --pitch 0.05 --branch -` crosses none

    - `rps-pin check stewart.csv --mechanism stewart` columns time_s, x_m, ..., rz_rad

    - `rps-pin check stewart.csv -m stewart --clearance 0.005`
    """
    load = motions.payload_of(payload, payload_centre, wrench)
    loads: dict[str, Any] = {"payload": load, "wrench": wrench}
    if mechanism is not None:
        refuse(context, "it does not go with a mechanism", "robot", *_CURVE)
        if trajectory is None:
            told = "a mechanism has no helix: give a trajectory file"
            raise typer.BadParameter(told, param_hint="TRAJECTORY")
        task = _task(mechanism, package_path, ignore_limits, accuracy)
        choice = {Interference.YES: True, Interference.NO: False}.get(interference)
        pairs = _pairs(ignore or ())
        asked = {"interference": choice, "clearance": clearance, "ignore": pairs}
        asked |= {"threshold": threshold}
        _of_task(task, trajectory, asked, loads, fastest, degrees, as_json)
        return
    if trajectory is not None:
        refuse(context, "it does not go with a trajectory", *_CURVE)
    if clearance or ignore or interference != Interference.AUTO or package_path:
        told = "interference is checked of a mechanism: give its file, --mechanism FILE"
        raise typer.BadParameter(told, param_hint="--interference")
    refuse(context, "it is an option of a mechanism", "ignore_limits", "accuracy")
    machine = common.load_robot(robot)
    path: Trajectory
    if trajectory is None:
        path = helix.chosen_helix(machine, radius, pitch, height, branch, duration)
    else:
        path = load_trajectory(trajectory, machine)
    if fastest:
        loaded = machine if load is None else machine.with_payload(load)
        console = common.text_console(as_json)
        path = motions.fastest_of_robot(console, loaded, path, wrench=wrench)
    if load is None and wrench is None:
        found = check_path(machine, path, threshold=threshold)
    else:
        machine.parameters.require_bodies()
        found = check_task_path(machine.task, path, threshold=threshold, **loads)
    _tell(found, {"robot": machine.parameters.name}, machine.task, degrees, as_json)


def _task(
    mechanism: Path,
    package_path: Sequence[Path] | None,
    ignore_limits: bool,
    accuracy: float | None,
) -> Task:
    task = tasks.load_task(mechanism, ignore_limits, accuracy)
    if not package_path:
        return task
    one = task.mechanism
    return task.with_mechanism(one.with_collision(one.collision_shapes.in_packages(package_path)))


def _pairs(given: Sequence[str]) -> list[list[str]]:
    """Return pairs of names of options like ``--ignore arm,cover``."""
    pairs = [words.split(",") for words in given]
    for words, pair in zip(given, pairs, strict=True):
        if len(pair) != 2 or not all(pair):
            raise InputError(f"--ignore {words!r}: it must be LINK,LINK, such as arm,cover")
    return pairs


def _of_task(
    task: Task,
    trajectory: Path,
    asked: Mapping[str, Any],
    loads: Mapping[str, Any],
    fastest: bool,
    degrees: bool,
    as_json: bool,
) -> None:
    path = tasks.load_path(trajectory, task, **loads)
    if fastest:
        path = motions.fastest_of_task(common.text_console(as_json), task, path, **loads)
    found = check_task_path(task, path, **asked, **loads)
    _tell(found, {"mechanism": task.mechanism.name}, task, degrees, as_json)


def _tell(found: PathCheck, of: dict[str, Any], task: Task, degrees: bool, as_json: bool) -> None:
    if degrees:
        found = _in_degrees(found, task)
    if as_json:
        units = {"units": tasks.units(degrees)}
        common.print_json(_plain(found) | of | units | {"ok": found.ok})
    else:
        common.text_console(soft_wrap=True).print(str(found))
    raise typer.Exit(not found.ok)


def _in_degrees(found: PathCheck, task: Task) -> PathCheck:
    """Return findings along a path of a task with angles of poses and limits in degrees."""
    factors = np.where(task.angular, math.degrees(1.0), 1.0)

    def turned(event: Any) -> Any:
        pose = event.pose * factors
        changed = event._replace(pose=pose)
        if not isinstance(event, LimitEvent):
            of_task = bool(event.where)
            words = (
                pose_in_words(task, pose, "deg") if of_task else pose_of_robot_in_words(pose, "deg")
            )
            return changed._replace(where=words)
        if not event.unit.startswith("rad"):
            return changed
        limit, unit = math.degrees(event.limit), event.unit.replace("rad", "deg")
        return changed._replace(limit=limit, unit=unit)

    links = found.interference
    if links is not None:
        links = links._replace(events=tuple(map(turned, links.events)))
    return found._replace(
        singularities=tuple(map(turned, found.singularities)),
        limits=tuple(map(turned, found.limits)),
        minimum_pose=found.minimum_pose * factors,
        interference=links,
    )


def _plain(value: Any) -> Any:
    """Return named tuples as dictionaries, arrays as lists, and infinity as none, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.tolist() if isinstance(value, np.ndarray) else value
