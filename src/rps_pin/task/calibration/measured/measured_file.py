"""Readings of sensors from a CSV file, for a calibration.

The header names sensors with their units, and their standard deviations where these differ by pose:

    left_joint_deg,right_joint_deg,x_mm,z_mm,x_deviation_um
    126.05,51.57,-10.0,512.3,30
    124.90,,12.1,,30

A row is a pose. A cell that is empty says that nothing was read. Columns ``pose`` and ``time_s``
are not used, nor are those of a plan, ``planned_x_mm`` (`write_plan`). Blank lines, lines that
begin with ``#`` and the marks between cells are as in `rps_pin.trajectories.csv_file`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, did_you_mean, few, shown
from rps_pin.task.calibration.sensors import Readings, possible_sensors, readings
from rps_pin.task.task import Task
from rps_pin.trajectories.csv_columns import ANGLES, LENGTHS, TIMES, is_number
from rps_pin.trajectories.csv_file import POINT, NumberTable, cells_of, read_numbers

#: Columns that are known and not used.
_UNUSED = ("pose", *(f"time_{unit}" for unit in TIMES))
#: What names of columns begin with that say where a pose was planned; not used.
PLANNED = "planned_"
#: A length beyond this many characteristic lengths, or an angle beyond, rad, is in another unit.
_FAR, _TURNED = 30.0, 8 * math.pi


class _Column(NamedTuple):
    sensor: str
    unit: float
    deviation: bool


def read_readings(
    path: str | os.PathLike[str],
    task: Task,
    deviations: Mapping[str, ArrayLike] | None = None,
    more: Mapping[str, bool] | None = None,
) -> Readings:
    """Return the readings in a CSV file; see the module's text.

    Parameters
    ----------
    path
        The file.
    task
        The task of the mechanism that was measured.
    deviations
        Standard deviations of sensors that have no column of them, by sensor, m or rad.
    more
        Sensors besides joints and coordinates, those of instruments, and whether each reads an
        angle.

    Raises
    ------
    InputError
        With the file and the line: if a column is unknown, without unit or there twice; if a cell
        is no finite number, or cannot be in its unit; if a pose has no reading, or a sensor no
        deviation or two.
    """
    known = possible_sensors(task) | dict(more or {})
    table = read_numbers(path, "file of readings", partial(_columns, known=known), _row)
    if not len(table.rows):
        raise InputError(f"{path}: there are no poses after the header")
    _refuse_far(table, known, task)
    try:
        return _readings(task, table.rows, table.positions, dict(deviations or {}), known)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def measured_sensors(
    path: str | os.PathLike[str], task: Task, more: Mapping[str, bool] | None = None
) -> tuple[str, ...]:
    """Return the sensors that have a column in a file of readings; see `read_readings`."""
    known = possible_sensors(task) | dict(more or {})
    table = read_numbers(path, "file of readings", partial(_columns, known=known), _row)
    return tuple(one.sensor for one in table.positions.values() if not one.deviation)


def _readings(
    task: Task,
    table: Array,
    columns: Mapping[int, _Column],
    deviations: dict[str, ArrayLike],
    known: Mapping[str, bool],
) -> Readings:
    values = {one.sensor: table[:, k] for k, one in columns.items() if not one.deviation}
    for k, one in columns.items():
        if not one.deviation:
            continue
        if one.sensor in deviations:
            raise InputError(f"the deviation of {one.sensor} is given twice: leave one out")
        unread = np.isnan(values[one.sensor])
        column = np.where(unread & np.isnan(table[:, k]), 1.0, table[:, k])  # of what is not read
        if np.isnan(column).any():
            raise InputError(f"pose {int(np.argmax(np.isnan(column)))} of {one.sensor} has none")
        deviations[one.sensor] = column
    missing = [name for name in values if name not in deviations]
    if missing:
        unit = "rad" if known[missing[0]] else "m"
        raise InputError(
            f"the standard deviation of {few(missing)} is missing: add a column such as "
            f"{missing[0]}_deviation_{unit}, or give it: --deviation {missing[0]}=..., in {unit}"
        )
    return readings(task, values, deviations, known)


def _columns(names: Sequence[str], known: Mapping[str, bool]) -> dict[int, _Column]:
    """Return what is in each column that is used, by its number."""
    if all(is_number(name) for name in names):
        raise InputError("numbers, where the header must name the columns")
    possible = {
        f"{sensor}{part}_{unit}": _Column(sensor, size, bool(part))
        for sensor, turns in known.items()
        for unit, size in (ANGLES if turns else LENGTHS).items()
        for part in ("", "_deviation")
    }
    found: dict[int, _Column] = {}
    for k, name in enumerate(names):
        if name in _UNUSED:
            continue
        if name not in possible and name.removeprefix(PLANNED) in possible:
            continue
        if name not in possible:
            raise InputError(_unknown(name, known, possible))
        one = possible[name]
        if (one.sensor, one.deviation) in [(c.sensor, c.deviation) for c in found.values()]:
            raise InputError(f"two columns hold the same as {name!r}; one may")
        found[k] = one
    read = [one.sensor for one in found.values() if not one.deviation]
    for one in found.values():
        if one.deviation and one.sensor not in read:
            raise InputError(f"there is a deviation of {one.sensor}, and no column of its readings")
    if not read:
        raise InputError("no column holds readings")
    return found


def _unknown(name: str, known: Mapping[str, bool], possible: Mapping[str, _Column]) -> str:
    for sensor in sorted(known, key=len, reverse=True):
        if name == sensor or name.startswith(f"{sensor}_"):
            units = ", ".join(ANGLES if known[sensor] else LENGTHS)
            return (
                f"column {shown(name)} is not known: columns of {sensor} are {sensor}_UNIT and "
                f"{sensor}_deviation_UNIT, with one of the units {units}"
            )
    return (
        f"column {shown(name)} is not known{did_you_mean(name, possible)}: columns are SENSOR_UNIT "
        f"and SENSOR_deviation_UNIT; the sensors are {few(list(known))}"
    )


def _row(line: str, mark: str, names: Sequence[str], columns: Mapping[int, _Column]) -> list[float]:
    """Return the numbers of a line in SI units, NaN of empty cells and of columns not used."""
    cells = cells_of(line, mark)
    if len(cells) != len(names):
        raise InputError(f"{len(cells)} cells, where the header names {len(names)} columns{POINT}")
    found = [math.nan] * len(names)
    for k, column in columns.items():
        cell = cells[k].strip()
        if not cell:
            continue
        if not is_number(cell) or not math.isfinite(float(cell)):
            raise InputError(
                f"{names[k]} = {shown(cell)}: it must be a finite number, or empty where nothing "
                f"was read{POINT if ',' in cell else ''}"
            )
        found[k] = float(cell) * column.unit
        if column.deviation and found[k] <= 0:
            raise InputError(f"{names[k]} = {cell}: a standard deviation is positive")
    if not any(math.isfinite(found[k]) for k, one in columns.items() if not one.deviation):
        raise InputError("nothing was read at this pose: leave the line out")
    return found


def _refuse_far(
    table: NumberTable[dict[int, _Column]], known: Mapping[str, bool], task: Task
) -> None:
    """Refuse columns of which most numbers are so large that their unit must be another.

    A single one is an outlier, which the calibration finds.
    """
    for k, one in table.positions.items():
        turns = known[one.sensor]
        limit = _TURNED if turns else _FAR * task.characteristic_length
        column = table.rows[:, k]
        given = column[np.isfinite(column)]
        if given.size and np.median(np.abs(given)) > limit:
            unit = "rad" if turns else "m"
            instead = f"{one.sensor}_{'deg' if turns else 'mm'}"
            row = int(np.nanargmax(np.abs(column) > limit))
            raise InputError(
                f"{table.place(row)}: {table.names[k]} = {column[row] / one.unit:.9g}, as most of "
                f"its column, is beyond {limit:.4g} {unit}; if it is in another unit, name it so: "
                f"{instead}"
            )
