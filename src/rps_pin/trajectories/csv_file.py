"""Trajectories from CSV files.

The header names quantities with their units, as `rps_pin.rps.dynamics.motion_csv` writes them:

    time_s,z_m,tilt_x_deg,tilt_y_deg
    0.00,0.223,0.0,5.0
    0.01,0.223,0.1,5.0

and of a task its coordinates, as ``x_mm,z_mm,ry_deg`` or ``ankle_pitch_deg``; see `csv_columns`.

Lines that are blank or begin with ``#`` are skipped. Commas, semicolons or tabs separate cells,
whichever the header uses; numbers are written with a decimal point. Times may begin anywhere (the
first counts as 0) and steps may differ.
"""

from __future__ import annotations

import csv
import math
import os
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import BinaryIO, Generic, TypeVar

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.files import opened
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.csv_columns import OF_RPS, Columns, HasCoordinates, is_number
from rps_pin.trajectories.derivative_check import disagreement
from rps_pin.trajectories.sampled_path import FEWEST_POSES, Ends, SampledPath
from rps_pin.validation import positive_number

#: A step longer than this many times the median step is a gap.
GAP = 10.0
#: Longest usual step of a file of some rows, s: one that is longer is doubted.
SLOWEST, SOME_ROWS = 1.0, 10
#: Most lines of a file, and most bytes of a line, that are read.
MOST_LINES = 2_000_000
LONGEST_LINE = 100_000

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs"}
#: What is said of a comma in a number.
POINT = "; numbers are written with a point, 0.5 and not 0,5"


#: What the columns of a header hold.
Header = TypeVar("Header")


@refuses_other_kinds
def read_csv(
    path: str | os.PathLike[str],
    task: HasCoordinates | None = None,
    *,
    max_step: float | None = None,
    ends: Ends | None = None,
) -> SampledPath:
    """Read a trajectory from a CSV file.

    Columns: ``time_s``, ``z_m``, ``tilt_x_rad``, ``tilt_y_rad``; optional the rates
    (``z_rate_m_per_s``, ``tilt_x_rate_rad_per_s``, ...), and with them the accelerations
    (``z_acceleration_m_per_s2``, ...). Other units by their names: s, ms, us; m, mm, um; rad, mrad,
    urad, deg. The other columns that `rps-pin` writes with a motion (``length_1_m``, ``force_1_N``,
    ...) are not used; any other column is refused, as it may be misspelt.

    With a task, its coordinates take the place of ``z``, ``tilt_x`` and ``tilt_y``, in any order in
    the file: ``x_m``, ``rx_rad``, ``ankle_pitch_deg``. The poses have the task's order.

    With poses alone the motion starts and ends at rest, unless `ends` says otherwise. With rates it
    has the first and the last rate at its ends; the others are only compared with the poses. With
    rates and accelerations, the motion in each step is the quintic that has those of both its ends.
    See `SampledPath`.

    Parameters
    ----------
    path
        The file: UTF-8, a header, cells separated by commas, semicolons or tabs (whichever the
        header uses), numbers with a decimal point.
    task
        Whose coordinates the columns are: a `Task`, or anything with ``coordinates`` and
        ``angular``. Left out: the 3-RPS, with z, tilt_x and tilt_y.
    max_step
        Longest step that is not a gap, s; ten times the median step if left out.
    ends
        ``"at rest"``, ``"measured"`` or ``"free"``, as for `SampledPath`.

    Raises
    ------
    InputError
        With the file and the line: if a cell is empty, missing, too many, or not a finite number;
        if times do not increase, leave a gap, or seem to be in milliseconds (without rates,
        `SOME_ROWS` or more in steps of `SLOWEST` or more; `max_step` allows them); if a value
        cannot be in its unit (a tilt or a rotation vector beyond 2 pi rad, a length beyond 100 m);
        if rates or accelerations are not, even roughly, the derivatives of the poses; if a column
        is unknown, without unit, there twice or missing; if there are fewer rows than 2 (with free
        ends 6); or if it is not such a file.
    """
    if max_step is not None:
        positive_number(max_step, "max_step", "seconds")
    columns = OF_RPS if task is None else Columns.of_task(task)
    read = read_numbers(path, "trajectory file", columns.positions, _row)
    table = _Table(read.names, read.positions, read.rows, read.lines, read.origin, columns)
    _refuse_few(table, FEWEST_POSES if ends == "free" else 2)
    _refuse_times(table, max_step)
    _refuse_implausible(table)
    _refuse_wrong_derivatives(table)
    if max_step is None and columns.rates[0] not in table.positions:
        _refuse_slow_times(table)
    series = [
        np.stack([table.si(name) for name in names], axis=-1)
        for names in (columns.coordinates, columns.rates, columns.accelerations)
        if names[0] in table.positions
    ]
    try:
        return SampledPath(table.si("time"), *series, ends=ends)
    except InputError as error:
        raise InputError(f"{table.origin}: {error}") from None


# The table ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NumberTable(Generic[Header]):
    """The numbers of a file, and their lines."""

    names: Sequence[str]
    """Of the columns, as in the header."""
    positions: Header
    """Which columns are read, and what they hold."""
    rows: Array
    """What was made of each line, shape (rows, numbers)."""
    lines: Sequence[int]
    """The line of the header, and of each row, from 1."""
    origin: str
    """The file, for messages."""

    def place(self, row: int) -> str:
        """Return ``"FILE, line N"`` of a row; of the header for -1."""
        return f"{self.origin}, line {self.lines[row + 1]}"


@dataclass(frozen=True)
class _Table(NumberTable[Mapping[str, int]]):
    """Of a trajectory, in the units of the file; finite."""

    columns: Columns
    """What is read."""

    def name(self, quantity: str) -> str:
        """Return the name of a quantity's column."""
        return self.names[self.positions[quantity]]

    def factor(self, quantity: str) -> float:
        """Return the value of a quantity's unit in SI."""
        return self.columns.units[quantity][self.columns.read[self.name(quantity)][1]]

    def written(self, quantity: str) -> Array:
        """Return the values of a quantity in its unit in the file."""
        return self.rows[:, self.positions[quantity]]

    def si(self, quantity: str) -> Array:
        """Return the values of a quantity in SI units."""
        return self.written(quantity) * self.factor(quantity)


def lines_of(file: BinaryIO, origin: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither blank nor comments, with their numbers, from 1."""
    number = 0
    while raw := file.readline(LONGEST_LINE + 1):
        number += 1
        if number > MOST_LINES:
            raise InputError(f"{origin} has more than {MOST_LINES} lines, the most that is read")
        if len(raw) > LONGEST_LINE:
            raise InputError(
                f"{origin}, line {number}: more than {LONGEST_LINE} bytes, the most that is read"
            )
        try:
            line = raw.decode("utf-8-sig" if number == 1 else "utf-8").strip(" \r\n")
        except UnicodeDecodeError as error:
            byte = f"byte 0x{raw[error.start]:02x}"
            raise InputError(f"{origin}, line {number}: not a UTF-8 text ({byte})") from None
        if line and not line.startswith("#"):
            yield number, line


def read_numbers(
    path: str | os.PathLike[str],
    what: str,
    positions_of: Callable[[Sequence[str]], Header],
    row_of: Callable[[str, str, Sequence[str], Header], Sequence[float]],
) -> NumberTable[Header]:
    """Return the numbers of a CSV file.

    Parameters
    ----------
    path
        The file.
    what
        What it is, for messages.
    positions_of
        What the columns of the header's names hold.
    row_of
        The numbers of a line: of the line, what separates its cells, the names and what they hold;
        as many for each line.

    Raises
    ------
    InputError
        With the file, and the line where these functions raise it.
    """
    with opened(path, what) as file:
        origin = os.fspath(path)
        lines = lines_of(file, origin)
        number, header = next(lines, (0, ""))
        if not number:
            raise InputError(f"{origin} is empty: its first line must name the columns")
        try:
            mark = delimiter_of(header)
            names = [cell.strip() for cell in cells_of(header, mark)]
            positions = positions_of(names)
        except InputError as error:
            raise InputError(f"{origin}, line {number}: {error}") from None
        numbers, values = array("q", [number]), array("d")
        for number, line in lines:
            try:
                values.extend(row_of(line, mark, names, positions))
            except InputError as error:
                raise InputError(f"{origin}, line {number}: {error}") from None
            numbers.append(number)
    count = len(numbers) - 1
    rows = np.array(values).reshape(count, -1 if count else len(names))
    return NumberTable(names, positions, rows, numbers, origin)


def delimiter_of(header: str) -> str:
    """Return what separates the cells of a header.

    Raises
    ------
    InputError
        If there are two such marks.
    """
    used = [mark for mark in _DELIMITERS if mark in header] or [","]
    if len(used) > 1:
        marks = " and ".join(_DELIMITERS[mark] for mark in used)
        raise InputError(f"{marks} in the header; one of them may separate the cells")
    return used[0]


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, quoted or not."""
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise InputError(str(error)) from None


def _row(line: str, delimiter: str, names: Sequence[str], _: object) -> list[float]:
    """Return the numbers of a line."""
    cells = cells_of(line, delimiter)
    if len(cells) != len(names):
        comma = delimiter == "," and len(cells) > len(names) and all(map(is_number, cells))
        raise InputError(
            f"{len(cells)} cell{'s' if cells[1:] else ''}, where the header names {len(names)} "
            f"columns{POINT if comma else ''}"
        )
    try:
        found = [float(cell) for cell in cells]
    except ValueError:
        found = [math.nan]
    if "_" in line or not (line.isascii() and all(map(math.isfinite, found))):  # float("1_0") is 10
        raise InputError(next(filter(None, map(_fault, names, cells))))
    return found


def _fault(name: str, cell: str) -> str:
    """Return what is wrong with a cell; empty if it is a finite number."""
    if not cell.strip():
        return f"{name} is empty: every sample needs all values"
    if not is_number(cell):
        point = POINT if "," in cell else ""
        return f"{name} = {shown(cell.strip())}: it must be a number{point}"
    return "" if math.isfinite(float(cell)) else f"{name} = {float(cell)}: it must be finite"


# The motion ---------------------------------------------------------------------------------------


def _refuse_few(table: _Table, needed: int) -> None:
    rows = len(table.rows)
    if rows < needed:
        raise InputError(
            f"{table.place(rows - 1)}: the file ends after {rows or 'no'} "
            f"sample{'s' if rows != 1 else ''}; {needed} or more are needed"
        )


def _refuse_times(table: _Table, max_step: float | None) -> None:
    """Refuse times that do not increase, and gaps."""
    with np.errstate(over="ignore"):
        steps = np.diff(table.si("time"))
    name, written = table.name("time"), table.written("time")
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


def _refuse_slow_times(table: _Table) -> None:
    """Refuse many long steps without rates, which would tell whether times are in seconds."""
    step = float(np.median(np.diff(table.si("time"))))
    if step >= SLOWEST and len(table.rows) >= SOME_ROWS:
        raise InputError(
            f"{table.place(-1)}: {table.name('time')} has steps of {step:.6g} s; is it in "
            "milliseconds? Then name the column time_ms. If such steps are meant, allow them: "
            "max_step (of read_csv, or of a YAML trajectory of kind csv)"
        )


def _refuse_implausible(table: _Table) -> None:
    """Refuse values that are so large that their unit must be another."""
    for quantity, (largest, unit, instead) in table.columns.largest.items():
        beyond = np.abs(table.si(quantity)) > largest
        if beyond.any():
            row = int(np.argmax(beyond))
            hint = f"; is it in {instead}"
            raise InputError(
                f"{table.place(row)}: {table.name(quantity)} = {table.written(quantity)[row]:.9g}: "
                f"it cannot be beyond {largest:.4g} {unit}"
                f"{hint if table.factor(quantity) == 1.0 else ''}"
            )


def _refuse_wrong_derivatives(table: _Table) -> None:
    """Refuse rates that are not the poses' derivatives, and accelerations not the rates'."""
    x, rates, accelerations = (
        table.columns.coordinates,
        table.columns.rates,
        table.columns.accelerations,
    )
    for quantity, derivative in zip(x + rates, rates + accelerations, strict=True):
        if derivative not in table.positions:
            continue
        found = disagreement(table.si("time"), table.si(quantity), table.si(derivative))
        if found is None:
            continue
        unit = table.factor(derivative)
        slopes = " and ".join(f"{slope / unit:.6g}" for slope in found.slopes)
        like = f" (over the whole file: {found.looks_like})" if found.looks_like else ""
        raise InputError(
            f"{table.place(found.row)}: {table.name(derivative)} = {found.given / unit:.6g}, but "
            f"next to it {table.name(quantity)} changes at {slopes} in the same "
            f"unit{like}. Correct it, sample more densely, write more digits, or leave out rates "
            "and accelerations"
        )
