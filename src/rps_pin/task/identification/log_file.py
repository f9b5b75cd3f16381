"""Logs from CSV files, for an identification.

    time_s,left_joint_position_rad,right_joint_position_rad,left_joint_force_Nm,right_joint_force_Nm
    0.000,2.2012,0.9401,-0.312,0.287

Columns are ``time_UNIT``, ``ACTUATOR_position_UNIT`` (or ``reading_ACTUATOR_UNIT``, as
``rps-pin control`` writes them) and ``ACTUATOR_force_UNIT`` (or ``applied_ACTUATOR_UNIT``), or
``ACTUATOR_current_UNIT`` with constants. Other columns are not used, and named in the log's notes.
Blank lines, lines that begin with ``#`` and the marks between cells are as in
`rps_pin.trajectories.csv_file`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, few, shown
from rps_pin.task.identification.log import Log, force_log
from rps_pin.task.identification.model import DynamicsModel
from rps_pin.trajectories.csv_columns import ANGLES, LENGTHS, TIMES, is_number
from rps_pin.trajectories.csv_file import POINT, cells_of, read_numbers

_FORCES = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
_MOMENTS = {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3}
_CURRENTS = {"A": 1.0, "mA": 1e-3}


def read_log(
    path: str | os.PathLike[str],
    model: DynamicsModel,
    *,
    constants: Mapping[str, float] | None = None,
    held: bool = False,
) -> Log:
    """Return the log in a CSV file; see the module's text.

    Parameters
    ----------
    path
        The file.
    model
        The mechanism.
    constants, held
        As for `force_log`.

    Raises
    ------
    InputError
        With the file and the line: if the time, or an actuator's position or force, has no column
        or two; if a cell is no finite number; if times do not increase.
    """
    possible = _possible(model)
    table = read_numbers(path, "log", partial(_columns, possible=possible, model=model), _row)
    names, columns, rows = table.names, table.positions, table.rows
    at = {what: k for k, what in enumerate(columns)}
    time = rows[:, at["time", ""]]
    if not (np.diff(time) > 0).all():
        k = int(np.argmin(np.diff(time) > 0)) + 1
        raise InputError(
            f"{table.place(k)}: times must increase, but {time[k]:.9g} s comes after "
            f"{time[k - 1]:.9g} s"
        )

    def of(kind: str) -> Array:
        return rows[:, [at[kind, name] for name in model.actuators]]

    current = ("current", model.actuators[0]) in at
    used = {k for k, _ in columns.values()}
    unused = [name for k, name in enumerate(names) if k not in used]
    log = force_log(
        model,
        time,
        of("position"),
        None if current else of("force"),
        current=of("current") if current else None,
        constants=constants,
        held=held,
        name=os.fspath(path),
    )
    if unused:
        log = log._replace(notes=(*log.notes, f"{path}: columns that are not used: {few(unused)}"))
    return log


_What = tuple[str, str]


def _possible(model: DynamicsModel) -> dict[str, tuple[_What, float]]:
    """Return what each column holds, and its unit in SI, by its name."""
    found: dict[str, tuple[_What, float]] = {
        f"time_{unit}": (("time", ""), size) for unit, size in TIMES.items()
    }
    mechanism = model.mechanism
    angular = mechanism.angular_velocities[mechanism.actuated_indices]
    for name, turns in zip(model.actuators, angular, strict=True):
        for kind, units, other in (
            ("position", ANGLES if turns else LENGTHS, "reading"),
            ("force", _MOMENTS if turns else _FORCES, "applied"),
            ("current", _CURRENTS, ""),
        ):
            for unit, size in units.items():
                found[f"{name}_{kind}_{unit}"] = (kind, name), size
                if other:
                    found[f"{other}_{name}_{unit}"] = (kind, name), size
    return found


def _columns(
    names: Sequence[str], possible: Mapping[str, tuple[_What, float]], model: DynamicsModel
) -> dict[_What, tuple[int, float]]:
    if all(is_number(name) for name in names):
        raise InputError("numbers, where the header must name the columns")
    found: dict[_What, tuple[int, float]] = {}
    for k, name in enumerate(names):
        if name in possible:
            what, size = possible[name]
            if what in found:
                raise InputError(f"two columns hold the same as {name!r}; one may")
            found[what] = (k, size)
    currents = any(kind == "current" for kind, _ in found)
    forces = any(kind == "force" for kind, _ in found)
    if currents and forces:
        raise InputError("there are columns of forces and of currents: leave one kind out")
    kinds = ("position", "current" if currents else "force")
    wanted = [("time", ""), *((kind, name) for kind in kinds for name in model.actuators)]
    missing = [what for what in wanted if what not in found]
    if missing:
        like = [next(name for name, (one, _) in possible.items() if one == m) for m in missing]
        raise InputError(
            f"column {few(like)} (or in another unit) missing; the header has {few(list(names))}"
        )
    return {what: found[what] for what in wanted}


def _row(
    line: str, mark: str, names: Sequence[str], columns: Mapping[_What, tuple[int, float]]
) -> list[float]:
    """Return the numbers of a line in SI units, in the order of the columns."""
    cells = cells_of(line, mark)
    if len(cells) != len(names):
        raise InputError(f"{len(cells)} cells, where the header names {len(names)} columns{POINT}")
    found = []
    for k, size in columns.values():
        cell = cells[k].strip()
        if not is_number(cell) or not math.isfinite(float(cell)):
            raise InputError(
                f"{names[k]} = {shown(cell)}: every sample needs a finite number"
                f"{POINT if ',' in cell else ''}; leave the line out, and the gap is seen"
            )
        found.append(float(cell) * size)
    return found
