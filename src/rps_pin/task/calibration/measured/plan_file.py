"""Planned poses as a CSV file in which readings are filled in.

    pose,planned_x_mm,planned_left_joint_deg,left_joint_deg,x_mm,x_deviation_um
    0,211.5,116.158,,,30

Columns that begin with ``planned_`` say where to go; `read_readings` does not use them. Those of
the sensors are empty.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.files import write_rows
from rps_pin.task.calibration.measured.measured_file import PLANNED
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.sensors import possible_sensors, sensor_columns
from rps_pin.validation import positive_number, real_array

#: Units of readings and of deviations, and factors from SI: of lengths, and of angles.
_READ = ("mm", 1e3), ("deg", math.degrees(1.0))
_DEVIATION = ("um", 1e6), ("urad", 1e6)
#: Digits after the point of planned positions: beyond, there is rounding.
_DIGITS = 9


def write_plan(
    path: str | os.PathLike[str],
    model: CalibrationModel,
    x: ArrayLike,
    deviations: Mapping[str, float],
) -> None:
    """Write poses, in the order in which they are given, as a CSV file to fill in.

    Parameters
    ----------
    path
        The file, whose folder exists; it is replaced.
    model
        The mechanism and its sensors.
    x
        Task coordinates of the poses, shape (n, m): `Plan.x`.
    deviations
        By sensor, the standard deviation of its noise, m or rad.

    Raises
    ------
    InputError
        If a deviation is missing or not positive.
    ClosureError, UnreachableError
        If a pose is not reached from home.
    """
    at = real_array(x, "x", (model.task.size,))
    spread = {}
    for name in model.sensors:
        if name not in deviations:
            raise InputError(f"deviations: there is none of {name!r}")
        spread[name] = positive_number(deviations[name], f"deviation of {name}")
    planned = _planned(model, at)
    kinds = dict(zip(model.sensors, model.angular, strict=True))
    header = ["pose", *planned]
    header += [f"{name}_{_READ[turns][0]}" for name, turns in kinds.items()]
    header += [f"{name}_deviation_{_DEVIATION[turns][0]}" for name, turns in kinds.items()]
    given = [f"{_DEVIATION[kinds[name]][1] * spread[name]:.9g}" for name in kinds]
    rows = [
        [str(k), *(f"{column[k]:.9g}" for column in planned.values()), *[""] * len(kinds), *given]
        for k in range(len(at))
    ]
    write_rows(path, [header, *rows])


def _planned(model: CalibrationModel, x: Array) -> dict[str, Array]:
    """Return columns, by name, of the task's coordinates and of the actuators' positions."""
    task, kinds = model.task, possible_sensors(model.task)
    names = [*task.coordinates, *(one for one in task.mechanism.actuated if one in kinds)]
    q = model.home(x, model.nominal)[:, sensor_columns(task, names).q]
    found = {}
    for name, values in zip(names, q.T, strict=True):
        unit, factor = _READ[kinds[name]]
        found[f"{PLANNED}{name}_{unit}"] = np.round(factor * values, _DIGITS) + 0.0  # no -0
    return found
