"""Trajectories of a task from files: CSV with the coordinates' names, and YAML.

    kind: point_to_point        # or spline, with poses and times or a duration; or csv, with a file
    start: {z: 0.62}            # coordinates that are not named are those of home
    end: {z: 0.66, rx: 0.1}     # or numbers in the task's order
    duration: 1.0               # or max_rate, max_acceleration, max_jerk
    fastest: {force: 40, jerk: {arm_1_joint: 300}}      # or {} for the model's own limits

With ``fastest`` the same path takes the shortest time within limits (`rps_pin.task.time_optimal`);
a duration is not needed. Its keys are those of `MotionLimits`: ``force``, ``speed``,
``acceleration`` and ``jerk`` of the actuators, ``coordinate_speed``, ``coordinate_acceleration``
and ``coordinate_jerk``; each one number, numbers by name or in order, or two lists, the least and
the largest. Numbers are in m, rad, N and N m.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.config import Entry, Finite, Positive, Text, YamlFile, read_yaml
from rps_pin.errors import InputError, shown
from rps_pin.task.loads import Payload
from rps_pin.task.motion.described_limits import LimitsEntry, limits_of, numbers_by_name
from rps_pin.task.task import Task
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.path import Trajectory
from rps_pin.trajectories.point_to_point import point_to_point
from rps_pin.trajectories.sampled_path import Ends
from rps_pin.trajectories.spline import spline
from rps_pin.trajectories.time_laws import Profile

Pose = dict[Text, Finite] | list[Finite]
Limit = Positive | dict[Text, Positive] | list[Positive]


class _Described(Entry):
    kind: str
    fastest: LimitsEntry | None = None


class _PointToPoint(_Described):
    kind: Literal["point_to_point"]
    start: Pose | None = None
    end: Pose
    profile: Profile | None = None
    duration: Positive | None = None
    max_rate: Limit | None = None
    max_acceleration: Limit | None = None
    max_jerk: Limit | None = None


class _Spline(_Described):
    kind: Literal["spline"]
    poses: list[Pose]
    times: list[Finite] | None = None
    duration: Positive | None = None
    profile: Profile | None = None


class _Csv(_Described):
    kind: Literal["csv"]
    file: Text
    max_step: Positive | None = None
    ends: Ends | None = None


_KINDS: dict[str, type[_Described]] = {
    "point_to_point": _PointToPoint,
    "spline": _Spline,
    "csv": _Csv,
}


def load_task_trajectory(
    path: str | os.PathLike[str],
    task: Task,
    *,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
) -> Trajectory:
    """Read a trajectory of a task's coordinates from a file, ``.csv``, ``.yaml`` or ``.yml``.

    Parameters
    ----------
    path
        The file. CSV: see `rps_pin.trajectories.read_csv`; YAML: see the module's text.
    task
        The task.
    payload, wrench
        That the shortest time is for, where it is asked for: see `time_optimal`.

    Raises
    ------
    InputError
        If the file cannot be read, its name has another ending, or it does not describe a
        trajectory of these coordinates; with file and line.
    RPSPinError
        If the shortest time is asked for, and there is none.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a trajectory file is given by its path, not by {shown(path)}")
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return read_csv(path, task)
    if suffix not in (".yaml", ".yml"):
        raise InputError(f"trajectory file {path}: its name must end in .csv, .yaml or .yml")
    file = read_yaml(path, "trajectory file")
    return described_task_trajectory(file, Path(path).parent, task, payload=payload, wrench=wrench)


def described_task_trajectory(file: YamlFile, folder: Path, task: Task, **loads: Any) -> Trajectory:
    """Return the trajectory that a YAML file, or a part of one, describes.

    Parameters
    ----------
    file
        The file.
    folder
        The folder that file names in it are relative to.
    task
        The task.
    loads
        As `load_task_trajectory` takes them.

    Raises
    ------
    RPSPinError
        As `load_task_trajectory`.
    """
    described = validated_task_trajectory(file)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            trajectory = _made(file, described, folder, task)
    except ArithmeticError as error:
        raise InputError(f"{file.place(('kind',))}: numbers too large or small: {error}") from None
    if described.fastest is None:
        return trajectory
    return _fastest(file, task, trajectory, described.fastest, loads)


def validated_task_trajectory(file: YamlFile) -> Any:
    """Return what a YAML file, or a part of one, holds, as far as no task is needed.

    Raises
    ------
    InputError
        If the kind is unknown, a key is unknown or missing, or a value is none of its key.
    """
    kind = file.values.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        given = "is missing" if kind is None else f"{shown(kind)} is not one"
        raise InputError(
            f"{file.place(('kind',))}: kind: {given}; of a task there are: {', '.join(_KINDS)}"
        )
    return file.validated(_KINDS[kind], f"a {kind} trajectory")


def _fastest(
    file: YamlFile, task: Task, trajectory: Trajectory, given: LimitsEntry, loads: dict[str, Any]
) -> Trajectory:
    from rps_pin.task.motion.time_optimal import time_optimal  # noqa: PLC0415 (slow to import)

    limits = limits_of(file, given, task)
    with file.at("fastest"):
        return time_optimal(task, trajectory, limits=limits, **loads)


def _made(file: YamlFile, described: Any, folder: Path, task: Task) -> Trajectory:
    given = described.model_dump(exclude={"kind", "fastest"}, exclude_none=True)
    timed = {"times", "duration", "max_rate", "max_acceleration", "max_jerk"} & given.keys()
    if described.fastest is not None and described.kind != "csv" and not timed:
        given["duration"] = 1.0  # of which only the curve is used
    if described.kind == "csv":
        with file.at("file"):
            return read_csv(folder / given.pop("file"), task, **given)
    if described.kind == "spline":
        poses = [_pose(file, ("poses", i), one, task) for i, one in enumerate(described.poses)]
        lengths = np.where(task.angular, task.characteristic_length, 1.0)
        with file.at("kind"):
            del given["poses"]
            scale = None if described.times is not None else lengths
            return spline(np.array(poses), scale=scale, **given)
    for end in ("start", "end"):
        given[end] = _pose(file, (end,), given.get(end, {}), task)
    for limit in ("max_rate", "max_acceleration", "max_jerk"):
        if isinstance(given.get(limit), (dict, list)):
            given[limit] = numbers_by_name(
                file, (limit,), given[limit], task.coordinates, np.full(task.size, np.inf)
            )
    with file.at("kind"):
        return point_to_point(**given)


def _pose(file: YamlFile, place: tuple[str | int, ...], given: Pose, task: Task) -> Array:
    return numbers_by_name(file, place, given, task.coordinates, task.home)
