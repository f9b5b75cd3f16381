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
from functools import partial
from pathlib import Path

import numpy as np

from rps_pin.config import YamlFile, read_yaml
from rps_pin.errors import InputError, shown
from rps_pin.rps.motion.trajectory_schema import Fastest, validated
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.helix import helix
from rps_pin.trajectories.path import Trajectory
from rps_pin.trajectories.point_to_point import point_to_point
from rps_pin.trajectories.spline import spline
from rps_pin.trajectories.tilt_figures import circle, lissajous


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
    keys = described.model_dump(exclude={"kind", "fastest"}, exclude_none=True)
    makers: dict[str, Callable[..., Trajectory]] = {
        "helix": partial(helix, robot),
        "point_to_point": point_to_point,
        "spline": spline,
        "circle": circle,
        "lissajous": lissajous,
        "csv": lambda file, **more: read_csv(folder / file, **more),
    }
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            trajectory = makers[described.kind](**keys)
            trajectory.sample([0.0, trajectory.duration / 3, trajectory.duration])
    except InputError as error:
        word = re.match(r"\w*", str(error))
        key = word.group() if word and word.group() in file.values else "kind"
        key = "file" if described.kind == "csv" else key
        raise InputError(f"{file.place((key,))}: {error}") from None
    except ArithmeticError as error:
        raise InputError(f"{file.place(('kind',))}: numbers too large or small: {error}") from None
    if described.fastest is None:
        return trajectory
    return _fastest(file, robot, trajectory, described.fastest)


def _fastest(
    file: YamlFile, robot: RPSRobot, trajectory: Trajectory, limits: Fastest
) -> Trajectory:
    from rps_pin.rps.motion.time_optimal import time_optimal  # noqa: PLC0415 (slow to import)

    given = limits.model_dump(exclude_none=True)
    allowed = replace(ActuatorLimits.of(robot.parameters), **given)
    with file.at("fastest"):
        return time_optimal(robot, trajectory, limits=allowed)
