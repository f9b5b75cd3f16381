"""Tables of numbers in CSV files, each row with the line it stands on.

The first line that is neither blank nor a comment (``#``) names the columns. Commas, semicolons or
tabs separate cells, whichever the header uses; numbers are written with a decimal point. Every cell
must hold a finite number.
"""

from __future__ import annotations

import csv
import os
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown

#: Most lines of a file, and most bytes of a line, that are read.
MOST_LINES = 2_000_000
LONGEST_LINE = 100_000

DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class Table:
    """A file's numbers, and where they stand.

    Attributes
    ----------
    values : (rows, columns) array
        Finite.
    lines : (rows,) array
        The line of each row, from 1.
    header_line : int
        That of the header.
    origin : str
        The file as messages name it.
    """

    values: Array
    lines: NDArray[np.int64]
    header_line: int
    origin: str

    def place(self, row: int) -> str:
        """Return ``"FILE, line N"`` of a row."""
        return f"{self.origin}, line {self.lines[row]}"


def read_table(
    path: str | os.PathLike[str], what: str, check: Callable[[Sequence[str]], object]
) -> Table:
    """Read a table of numbers.

    Parameters
    ----------
    path
        The file.
    what
        What the file is, for messages: ``"trajectory file"``.
    check
        Is given the names of the columns, and raises an `InputError` if it does not like them,
        which is told with the file and its line.

    Raises
    ------
    InputError
        If the file cannot be read, is larger than `MOST_LINES` or `LONGEST_LINE`, is not UTF-8, or
        is no such table; with the line where that shows.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a {what} is given by its path, not by {shown(path)}")
    origin = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            return _read(_lines(file, origin), origin, check)
    except OSError as error:
        raise InputError(f"cannot read the {what} {origin}: {error.strerror or error}") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot read the {what} {shown(origin)}: {error}") from None


def _lines(file: BinaryIO, origin: str) -> Iterator[tuple[int, str]]:
    """Give the lines that are neither blank nor comments, with their numbers, from 1."""
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
            raise InputError(
                f"{origin}, line {number}: not a UTF-8 text (byte 0x{raw[error.start]:02x})"
            ) from None
        if line and not line.startswith("#"):
            yield number, line


def _read(
    lines: Iterator[tuple[int, str]], origin: str, check: Callable[[Sequence[str]], object]
) -> Table:
    header_line, header = next(lines, (0, ""))
    if not header_line:
        raise InputError(f"{origin} is empty: its first line must name the columns")
    place = f"{origin}, line {header_line}"
    delimiter = _delimiter(header, place)
    names = [cell.strip() for cell in _cells(header, delimiter, place)]
    if all(_is_number(name) for name in names):
        raise InputError(f"{place}: numbers, where the header must name the columns")
    try:
        check(names)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None
    numbers, rows = array("d"), array("q")
    for line_number, line in lines:
        cells = _cells(line, delimiter, f"{origin}, line {line_number}")
        try:
            if len(cells) != len(names) or "_" in line:
                raise ValueError
            numbers.extend(map(float, cells))
        except ValueError:
            _refuse(cells, names, delimiter, f"{origin}, line {line_number}")
        rows.append(line_number)
    values = np.array(numbers).reshape(-1, len(names))
    table = Table(values, np.array(rows, dtype=np.int64), header_line, origin)
    if not np.isfinite(values).all():
        row, column = (int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise InputError(
            f"{table.place(row)}: {names[column]} = {values[row, column]}: it must be finite"
        )
    return table


def _delimiter(header: str, place: str) -> str:
    """Return what separates the cells: the names of columns hold none of the characters."""
    used = [mark for mark in DELIMITERS if mark in header]
    if len(used) > 1:
        marks = " and ".join(DELIMITERS[mark] for mark in used)
        raise InputError(f"{place}: {marks} in the header; one of them may separate the cells")
    return used[0] if used else ","


def _cells(line: str, delimiter: str, place: str) -> list[str]:
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise InputError(f"{place}: {error}") from None


def _refuse(cells: Sequence[str], names: Sequence[str], delimiter: str, place: str) -> NoReturn:
    """Say what is wrong with a row: how many cells it has, or one of them."""
    if len(cells) != len(names):
        comma = delimiter == "," and len(cells) > len(names) and all(map(_is_number, cells))
        hint = "; numbers are written with a point, 0.5 and not 0,5" if comma else ""
        raise InputError(
            f"{place}: {len(cells)} cell{'s' if cells[1:] else ''}, where the header names "
            f"{len(names)} columns{hint}"
        )
    index = next(i for i, cell in enumerate(cells) if not _is_number(cell))
    cell, name = cells[index].strip(), names[index]
    if not cell:
        raise InputError(f"{place}: {name} is empty: every sample needs all values")
    hint = "; numbers are written with a point, 0.5 and not 0,5" if "," in cell else ""
    raise InputError(f"{place}: {name} = {shown(cell)}: it must be a number{hint}")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # which Python allows between digits
