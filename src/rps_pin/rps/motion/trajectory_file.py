"""Trajectories from files: samples in a CSV file, or the arguments of a motion in a YAML file.

    kind: circle          # helix, point_to_point, spline, circle, lissajous or csv
    height: 0.223
    tilt: 0.1
    duration: 2.0

The other keys are the arguments of the function of that name; units are SI. With
``fastest: {force: 80, speed: 0.2}`` (or ``{}`` for the robot's own limits) the same path takes the
shortest time that the actuators allow.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rps_pin.config import YamlFile, read_yaml
from rps_pin.errors import InputError, shown
from rps_pin.rps.dynamics.sizing_sheet import ActuatorLimits
from rps_pin.rps.motion.trajectory_schema import Csv, Described, Fastest, Helix, validated
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.helix import helix
from rps_pin.trajectories.path import Trajectory
from rps_pin.trajectories.point_to_point import point_to_point
from rps_pin.trajectories.spline import spline
from rps_pin.trajectories.tilt_figures import circle, lissajous

_MAKERS: dict[str, Callable[..., Trajectory]] = {
    "point_to_point": point_to_point,
    "spline": spline,
    "circle": circle,
    "lissajous": lissajous,
}


def load_trajectory(path: str | os.PathLike[str], robot: RPSRobot) -> Trajectory:
    """Read a trajectory from a file: ``.csv`` as `read_csv` does, ``.yaml`` or ``.yml`` by kind.

    Parameters
    ----------
    path
        The file.
    robot
        The robot: a helix depends on its size, the shortest time on its actuators.

    Raises
    ------
    InputError
        If the file cannot be read, its name has another ending, or it does not describe a
        trajectory; with the file and the line.
    RPSPinError
        If the shortest time is asked for, and the robot cannot follow the curve.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a trajectory file is given by its path, not by {shown(path)}")
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return read_csv(path)
    if suffix not in (".yaml", ".yml"):
        raise InputError(f"trajectory file {path}: its name must end in .csv, .yaml or .yml")
    return described_trajectory(read_yaml(path, "trajectory file"), Path(path).parent, robot)


def described_trajectory(file: YamlFile, folder: Path, robot: RPSRobot) -> Trajectory:
    """Return the trajectory that a YAML file, or a part of one, describes.

    Parameters
    ----------
    file
        The file.
    folder
        The folder that file names in it are relative to.
    robot
        As for `load_trajectory`.

    Raises
    ------
    RPSPinError
        As `load_trajectory`.
    """
    described = validated(file)
    trajectory = _made(file, described, folder, robot)
    if described.fastest is None:
        return trajectory
    return _fastest(file, robot, trajectory, described.fastest)


def _made(file: YamlFile, described: Described, folder: Path, robot: RPSRobot) -> Trajectory:
    """Return the trajectory with its own time law."""
    keys = described.model_dump(exclude={"kind", "fastest"}, exclude_none=True)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            trajectory = _called(described, keys, folder, robot)
            trajectory.sample([0.0, trajectory.duration / 3, trajectory.duration])
    except InputError as error:
        key = "file" if isinstance(described, Csv) else _key(file, str(error))
        raise InputError(f"{file.place((key,))}: {error}") from None
    except ArithmeticError as error:
        raise InputError(f"{file.place(('kind',))}: numbers too large or small: {error}") from None
    return trajectory


def _called(
    described: Described, keys: dict[str, Any], folder: Path, robot: RPSRobot
) -> Trajectory:
    if isinstance(described, Csv):
        return read_csv(folder / keys.pop("file"), **keys)
    if isinstance(described, Helix):
        return helix(robot, **keys)
    return _MAKERS[described.kind](**keys)


def _key(file: YamlFile, message: str) -> str:
    """Return the key that a message begins with, else the kind."""
    word = re.match(r"\w*", message)
    return word.group() if word and word.group() in file.values else "kind"


def _fastest(
    file: YamlFile, robot: RPSRobot, trajectory: Trajectory, limits: Fastest
) -> Trajectory:
    from rps_pin.rps.motion.time_optimal import time_optimal  # noqa: PLC0415 (slow to import)

    given = limits.model_dump(exclude_none=True)
    with file.at("fastest"):
        found: Trajectory = time_optimal(
            robot, trajectory, limits=replace(ActuatorLimits.of(robot.parameters), **given)
        )
    return found
