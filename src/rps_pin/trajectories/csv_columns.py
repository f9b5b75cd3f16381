"""Columns of trajectories' CSV files: quantities with their units, ``quantity_unit``.

Quantities are the time, the coordinates, and their derivatives ``COORDINATE_rate`` and
``COORDINATE_acceleration``. Coordinates are those of the 3-RPS (`OF_RPS`) or of a task.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": math.pi / 180}
_OVER = {"": "", "_rate": "_per_s", "_acceleration": "_per_s2"}
#: Coordinates that are rotation vectors, which are less than a whole turn long.
_ROTATIONS = ("tilt_x", "tilt_y", "rx", "ry", "rz")


class HasCoordinates(Protocol):
    """A task, as far as a file of its coordinates goes."""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    @property
    def angular(self) -> tuple[bool, ...]:
        """Which of them are angles."""
        ...


class Largest(NamedTuple):
    """The largest value of a coordinate; beyond, its unit must be another."""

    value: float
    unit: str
    instead: str
    """Question after the likely unit."""


@dataclass(frozen=True)
class Columns:
    """The columns that a file of some coordinates may have.

    Raises
    ------
    InputError
        If two quantities would have columns of one name.
    """

    coordinates: tuple[str, ...]
    angular: tuple[bool, ...]
    ignored: frozenset[str] = field(default=frozenset())
    """Columns that are known and not used."""

    @classmethod
    def of_task(cls, task: HasCoordinates) -> Columns:
        """Return those of a task's coordinates."""
        others = frozenset(getattr(task, "actuator_columns", ()))
        others |= {in_degrees(name) for name in others}
        columns = cls(tuple(task.coordinates), tuple(map(bool, task.angular)), others)
        counts = [len(TIMES)]
        counts += [3 * len(ANGLES if one else LENGTHS) for one in columns.angular]
        if len(columns.read) < sum(counts):
            raise InputError(
                f"coordinates {', '.join(columns.coordinates)}: a column's name would mean two of "
                "them, or the time; rename a joint"
            )
        return columns

    @cached_property
    def rates(self) -> tuple[str, ...]:
        """Quantities, in the order of the coordinates."""
        return tuple(f"{name}_rate" for name in self.coordinates)

    @cached_property
    def accelerations(self) -> tuple[str, ...]:
        """Likewise."""
        return tuple(f"{name}_acceleration" for name in self.coordinates)

    @cached_property
    def units(self) -> Mapping[str, Mapping[str, float]]:
        """The units of each quantity, and their values in SI."""
        known = dict(zip(self.coordinates, self.angular, strict=True))
        return {"time": TIMES} | {
            name + suffix: {u + over: si for u, si in (ANGLES if turns else LENGTHS).items()}
            for suffix, over in _OVER.items()
            for name, turns in known.items()
        }

    @cached_property
    def read(self) -> Mapping[str, tuple[str, str]]:
        """Quantity and unit of every column that is read, by its name."""
        return {
            f"{quantity}_{unit}": (quantity, unit)
            for quantity, units in self.units.items()
            for unit in units
        }

    @cached_property
    def largest(self) -> Mapping[str, Largest]:
        """The largest value of lengths and of rotation vectors, by coordinate."""
        found = {}
        for name, turns in zip(self.coordinates, self.angular, strict=True):
            if not turns:
                question = f"millimetres? Then name the column {name}_mm"
                found[name] = Largest(100.0, "m", question)
            elif name in _ROTATIONS:
                found[name] = Largest(2 * math.pi, "rad", f"degrees? Then name it {name}_deg")
        return found

    def positions(self, header: Sequence[str]) -> dict[str, int]:
        """Return the positions of the columns that are read, by quantity.

        Raises
        ------
        InputError
            If a column is unknown, without unit, there twice or missing.
        """
        if all(is_number(name) for name in header):
            raise InputError("numbers, where the header must name the columns")
        found: dict[str, int] = {}
        for position, name in enumerate(header):
            if name in header[:position]:
                raise InputError(f"column {name!r} is there twice")
            if name in self.ignored:
                continue
            if name not in self.read:
                raise InputError(self._unknown(name, position))
            quantity, _ = self.read[name]
            if quantity in found:
                raise InputError(
                    f"columns {header[found[quantity]]!r} and {name!r} both hold {quantity}; one "
                    "may"
                )
            found[quantity] = position
        self._refuse_missing(header, found)
        return found

    def _refuse_missing(self, header: Sequence[str], found: Mapping[str, int]) -> None:
        needed = ["time", *self.coordinates]
        if any(quantity in found for quantity in self.accelerations):
            needed += [*self.accelerations, *self.rates]
        elif any(quantity in found for quantity in self.rates):
            needed += self.rates
        absent = [self._names(quantity) for quantity in needed if quantity not in found]
        missing = [f"{first} (or {', '.join(others)})" for first, *others in absent]
        if missing:
            *before, last = self.coordinates
            each = f"{', '.join(before)} and {last}" if before else last
            raise InputError(
                f"column{'s' if missing[1:] else ''} {', '.join(missing)} missing; the header has "
                f"{', '.join(header)}. Cells are separated by commas, semicolons or tabs; rates "
                "and accelerations are optional, accelerations only with rates, and each for "
                f"{each}"
            )

    def _unknown(self, name: str, position: int) -> str:
        """Return what is wrong with a name, and what it could be."""
        if not name:
            return f"column {position + 1} has no name"
        if name in self.units:
            return f"column {name!r} has no unit: it can be {', '.join(self._names(name))}"
        # Of the same unit: z_cm is not a misspelt z_m.
        like = [one for one, (_, unit) in self.read.items() if name.lower().endswith(f"_{unit}")]
        near = get_close_matches(name.lower(), like, n=1, cutoff=0.85)
        if near:
            return f"column {shown(name)} is not known; did you mean {near[0]!r}?"
        for quantity in sorted(self.units, key=len, reverse=True):
            if name.startswith(f"{quantity}_"):
                unit = name.removeprefix(f"{quantity}_")
                return (
                    f"column {shown(name)}: {shown(unit)} is not a unit of {quantity}; it can be "
                    f"{', '.join(self._names(quantity))}"
                )
        length = self.coordinates[0]
        turn = self.coordinates[min(1, len(self.coordinates) - 1)]
        return (
            f"column {shown(name)} is not known. Those that are read are quantity_unit, with the "
            f"quantities {', '.join(self.units)}: time_s, {self._names(length)[1]}, "
            f"{self._names(f'{turn}_rate')[-1]} and the like"
        )

    def _names(self, quantity: str) -> list[str]:
        return [f"{quantity}_{unit}" for unit in self.units[quantity]]


#: Those of the 3-RPS; other columns that `rps_pin.rps.dynamics.motion_csv` writes follow from the
#: motion.
OF_RPS = Columns(
    ("z", "tilt_x", "tilt_y"),
    (False, True, True),
    frozenset({"x_m", "y_m"})
    | {
        name.format(leg)
        for name in (
            *("length_{}_m", "speed_{}_m_per_s", "leg_acceleration_{}_m_per_s2"),
            "force_{}_N",
        )
        for leg in (1, 2, 3)
    },
)


def in_degrees(column: str) -> str:
    """Return the name of a column with its angles in degrees; of others, the same."""
    return re.sub(r"_rad((_per_s2?)?)$", r"_deg\1", column)


def table_in_degrees(names: Sequence[str], rows: Array) -> tuple[list[str], Array]:
    """Return names of columns and rows (n, columns) of a table with its angles in degrees."""
    turned = [in_degrees(name) for name in names]
    angles = [old != new for old, new in zip(names, turned, strict=True)]
    return turned, np.where(angles, np.degrees(rows), rows)


def is_number(cell: str) -> bool:
    """Return whether a cell holds a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell and cell.isascii()
