"""Trajectories from CSV files.

The header names quantities with their units, as `rps_pin.rps.dynamics.motion_csv` writes them:

    time_s,z_m,tilt_x_deg,tilt_y_deg
    0.00,0.223,0.0,5.0
    0.01,0.223,0.1,5.0

Lines that are blank or begin with ``#`` are skipped. Times may begin anywhere (the first counts as
0) and steps may differ.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.trajectories.csv_columns import ACCELERATIONS, COORDINATES, RATES, Column, columns_of
from rps_pin.trajectories.csv_table import Table, read_table
from rps_pin.trajectories.derivative_check import disagreement
from rps_pin.trajectories.poses import real
from rps_pin.trajectories.sampled_path import FEWEST_POSES, SampledPath

#: A step longer than this many times the median step is a gap.
GAP = 10.0
#: No pose is beyond: two turns of tilt are one too many, and no robot of this kind is so high (m).
_LARGEST = {"z": 100.0, "tilt_x": 2 * math.pi, "tilt_y": 2 * math.pi}
_INSTEAD = {"z": "millimetres? Then name the column z_mm", "tilt": "degrees? Then name it {}_deg"}


def read_csv(path: str | os.PathLike[str], *, max_step: float | None = None) -> SampledPath:
    """Read a trajectory from a CSV file.

    Columns: ``time_s``, ``z_m``, ``tilt_x_rad``, ``tilt_y_rad``; optional the rates
    (``z_rate_m_per_s``, ``tilt_x_rate_rad_per_s``, ...), and beside them the accelerations
    (``z_acceleration_m_per_s2``, ...). Other units by their names: s, ms, us; m, mm, um; rad, mrad,
    urad, deg. What else `rps-pin` writes beside a motion (``length_1_m``, ``force_1_N``, ...) is
    not used; any other column is refused, as it may be one that is misspelt.

    With rates and accelerations, the motion in each step is the quintic that has those of both its
    ends; otherwise it is the quintic spline through the poses, and rates are only compared with
    them. See `SampledPath`.

    Parameters
    ----------
    path
        The file: UTF-8, a header, cells separated by commas, semicolons or tabs (whichever the
        header uses), numbers with a decimal point.
    max_step
        Longest step that is no gap, s; ten times the median step if left out.

    Raises
    ------
    InputError
        With the file and the line: if a cell is empty, missing, too many, or no finite number; if
        times do not increase or leave a gap; if a value cannot be in its unit (a tilt beyond 2 pi
        rad, a height beyond 100 m); if rates or accelerations are not, even roughly, the
        derivatives of the poses; if a column is unknown, without unit, twice there or missing; if
        rows are too few (6; with accelerations 2); or if it is no such file.
    """
    if max_step is not None and not real(max_step) > 0:
        raise InputError(f"max_step = {shown(max_step)}: it must be a positive number of seconds")
    columns: dict[str, Column] = {}

    def check(header: Sequence[str]) -> None:
        columns.update(columns_of(header))

    table = read_table(path, "trajectory file", check)
    si = {name: table.values[:, c.position] * c.factor for name, c in columns.items()}
    _refuse_few(table, len(si))
    _refuse_times(table, columns["time"], si["time"], max_step)
    _refuse_implausible(table, columns, si)
    _refuse_wrong_derivatives(table, columns, si)
    given = [_stack(si, names) for names in (COORDINATES, RATES, ACCELERATIONS) if names[0] in si]
    poses, *more = given
    try:
        return SampledPath(si["time"], poses, *(more if len(more) == 2 else ()))
    except InputError as error:
        raise InputError(f"{table.origin}: {error}") from None


def _stack(si: Mapping[str, Array], names: Sequence[str]) -> Array:
    return np.stack([si[name] for name in names], axis=-1)


def _refuse_few(table: Table, columns: int) -> None:
    needed = 2 if columns == 1 + 3 * 3 else FEWEST_POSES
    rows = len(table.values)
    if rows < needed:
        where = table.place(rows - 1) if rows else f"{table.origin}, line {table.header_line}"
        raise InputError(
            f"{where}: the file ends after {rows or 'no'} sample{'s' if rows != 1 else ''}; "
            f"{needed} or more are needed (without rates and accelerations {FEWEST_POSES}, with "
            "them 2)"
        )


def _refuse_times(table: Table, column: Column, times: Array, max_step: float | None) -> None:
    """Refuse times that do not increase, and gaps."""
    with np.errstate(over="ignore"):
        steps = np.diff(times)
    name, written = column.name, table.values[:, column.position]
    if not (steps > 0).all():
        i = int(np.argmin(steps > 0))
        raise InputError(
            f"{table.place(i + 1)}: {name} = {float(written[i + 1])} after {float(written[i])}: "
            "times must increase"
        )
    median = float(np.median(steps))
    if max_step is None:
        longest = GAP * median
        rule = f"more than {GAP:g} times the median step, {median:.6g} s; max_step allows it"
    else:
        longest, rule = max_step, f"max_step is {max_step:.6g} s"
    if not (steps <= longest).all():
        i = int(np.argmin(steps <= longest))
        raise InputError(
            f"{table.place(i + 1)}: a gap of {steps[i]:.6g} s, from {name} = {written[i]:.9g} to "
            f"{written[i + 1]:.9g}: {rule}"
        )


def _refuse_implausible(
    table: Table, columns: Mapping[str, Column], si: Mapping[str, Array]
) -> None:
    """Refuse values that are so large that their unit must be another."""
    for quantity, largest in _LARGEST.items():
        beyond = np.abs(si[quantity]) > largest
        if beyond.any():
            row, column = int(np.argmax(beyond)), columns[quantity]
            unit = "m" if quantity == "z" else "rad"
            hint = ""
            if column.factor == 1.0:
                hint = f"; is it in {_INSTEAD[quantity[:4]].format(quantity)}"
            raise InputError(
                f"{table.place(row)}: {column.name} = {table.values[row, column.position]:.9g}: it "
                f"cannot be beyond {largest:.4g} {unit}{hint}"
            )


def _refuse_wrong_derivatives(
    table: Table, columns: Mapping[str, Column], si: Mapping[str, Array]
) -> None:
    """Refuse rates that are not the poses' derivatives, and accelerations not the rates'."""
    for quantities, derivatives in ((COORDINATES, RATES), (RATES, ACCELERATIONS)):
        for quantity, derivative in zip(quantities, derivatives, strict=True):
            if derivative not in columns:
                continue
            found = disagreement(si["time"], si[quantity], si[derivative])
            if found is None:
                continue
            column = columns[derivative]
            slopes = " and ".join(f"{slope / column.factor:.6g}" for slope in found.slopes)
            like = f" (over the whole file: {found.looks_like})" if found.looks_like else ""
            raise InputError(
                f"{table.place(found.row)}: {column.name} = {found.given / column.factor:.6g}, but "
                f"beside it {columns[quantity].name} changes at {slopes} in the same unit{like}. "
                "Correct it, sample more densely, write more digits, or leave out rates and "
                "accelerations"
            )
