"""Trajectories of a task from files: CSV with the coordinates' names, and YAML.

    kind: point_to_point        # or spline, with poses and times or a duration; or csv, with a file
    start: {z: 0.62}            # coordinates that are not named are those of home
    end: {z: 0.66, rx: 0.1}     # or numbers in the task's order
    duration: 1.0               # or max_rate, max_acceleration, max_jerk

Numbers are in m and rad.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rps_pin.arrays import Array
from rps_pin.config import Entry, Finite, Positive, Text, YamlFile, read_yaml
from rps_pin.errors import InputError, shown
from rps_pin.task.task import Task
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.path import Trajectory
from rps_pin.trajectories.point_to_point import point_to_point
from rps_pin.trajectories.sampled_path import Ends
from rps_pin.trajectories.spline import spline
from rps_pin.trajectories.time_laws import Profile

Pose = dict[Text, Finite] | list[Finite]
Limit = Positive | dict[Text, Positive] | list[Positive]


class _PointToPoint(Entry):
    kind: Literal["point_to_point"]
    start: Pose | None = None
    end: Pose
    profile: Profile | None = None
    duration: Positive | None = None
    max_rate: Limit | None = None
    max_acceleration: Limit | None = None
    max_jerk: Limit | None = None


class _Spline(Entry):
    kind: Literal["spline"]
    poses: list[Pose]
    times: list[Finite] | None = None
    duration: Positive | None = None
    profile: Profile | None = None


class _Csv(Entry):
    kind: Literal["csv"]
    file: Text
    max_step: Positive | None = None
    ends: Ends | None = None


_KINDS: dict[str, type[Entry]] = {"point_to_point": _PointToPoint, "spline": _Spline, "csv": _Csv}


def load_task_trajectory(path: str | os.PathLike[str], task: Task) -> Trajectory:
    """Read a trajectory of a task's coordinates from a file, ``.csv``, ``.yaml`` or ``.yml``.

    Parameters
    ----------
    path
        The file. CSV: see `rps_pin.trajectories.read_csv`; YAML: see the module's text.
    task
        The task.

    Raises
    ------
    InputError
        If the file cannot be read, its name has another ending, or it does not describe a
        trajectory of these coordinates; with file and line.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a trajectory file is given by its path, not by {shown(path)}")
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return read_csv(path, task)
    if suffix not in (".yaml", ".yml"):
        raise InputError(f"trajectory file {path}: its name must end in .csv, .yaml or .yml")
    return described_task_trajectory(read_yaml(path, "trajectory file"), Path(path).parent, task)


def described_task_trajectory(file: YamlFile, folder: Path, task: Task) -> Trajectory:
    """Return the trajectory that a YAML file, or a part of one, describes.

    Parameters
    ----------
    file
        The file.
    folder
        The folder that file names in it are relative to.
    task
        The task.

    Raises
    ------
    InputError
        As `load_task_trajectory`.
    """
    kind = file.values.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        given = "is missing" if kind is None else f"{shown(kind)} is not one"
        raise InputError(
            f"{file.place(('kind',))}: kind: {given}; of a task there are: {', '.join(_KINDS)}"
        )
    described = file.validated(_KINDS[kind], f"a {kind} trajectory")
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return _made(file, described, folder, task)
    except ArithmeticError as error:
        raise InputError(f"{file.place(('kind',))}: numbers too large or small: {error}") from None


def _made(file: YamlFile, described: Any, folder: Path, task: Task) -> Trajectory:
    given = described.model_dump(exclude={"kind"}, exclude_none=True)
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
            given[limit] = _values(file, (limit,), given[limit], task, np.full(task.size, np.inf))
    with file.at("kind"):
        return point_to_point(**given)


def _pose(file: YamlFile, place: tuple[str | int, ...], given: Pose, task: Task) -> Array:
    return _values(file, place, given, task, task.home)


def _values(
    file: YamlFile, place: tuple[str | int, ...], given: Any, task: Task, otherwise: Array
) -> Array:
    """Return numbers in the task's order; those that are not named are others."""
    names = ", ".join(task.coordinates)
    if isinstance(given, list):
        if len(given) != task.size:
            raise InputError(
                f"{file.place(place)}: {len(given)} numbers for the {task.size} coordinates {names}"
            )
        return np.array(given, dtype=np.float64)
    values = otherwise.copy()
    for name, value in given.items():
        if name not in task.coordinates:
            raise InputError(
                f"{file.place((*place, name))}: the task has no {name!r}; it has: {names}"
            )
        values[task.coordinates.index(name)] = value
    return values
