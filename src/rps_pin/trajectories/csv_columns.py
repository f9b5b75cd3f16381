"""The columns of a trajectory's CSV file: quantity_unit, such as ``tilt_x_rate_deg_per_s``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from difflib import get_close_matches
from typing import NamedTuple

from rps_pin.errors import InputError, shown

_LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": math.pi / 180}

COORDINATES = ("z", "tilt_x", "tilt_y")
RATES = tuple(f"{name}_rate" for name in COORDINATES)
ACCELERATIONS = tuple(f"{name}_acceleration" for name in COORDINATES)


def _units() -> dict[str, dict[str, float]]:
    """Return the units of each quantity, and what they are in SI."""
    units = {"time": {"s": 1.0, "ms": 1e-3, "us": 1e-6}}
    for suffix, over in (("", ""), ("_rate", "_per_s"), ("_acceleration", "_per_s2")):
        for coordinate in COORDINATES:
            plain = _LENGTHS if coordinate == "z" else _ANGLES
            units[coordinate + suffix] = {unit + over: si for unit, si in plain.items()}
    return units


class Meaning(NamedTuple):
    """What a column holds."""

    quantity: str
    """``"time"``, ``"z"``, ``"tilt_x_rate"``, ..."""
    factor: float
    """What its unit is in SI."""


UNITS = _units()
#: Every column that is read.
READ = {
    f"{quantity}_{unit}": Meaning(quantity, si)
    for quantity, units in UNITS.items()
    for unit, si in units.items()
}
#: What `rps_pin.rps.dynamics.motion_csv` writes besides: it follows from the motion and is not
#: read.
IGNORED = frozenset(
    ["x_m", "y_m"]
    + [
        f"{quantity}_{leg}_{unit}"
        for quantity, unit in (
            ("length", "m"),
            ("speed", "m_per_s"),
            ("leg_acceleration", "m_per_s2"),
            ("force", "N"),
        )
        for leg in (1, 2, 3)
    ]
)


class Column(NamedTuple):
    """One column of a file that is read."""

    name: str
    """As the header has it."""
    position: int
    """In a row, from 0."""
    factor: float
    """What its unit is in SI."""


def columns_of(header: Sequence[str]) -> dict[str, Column]:
    """Return the columns that are read, by quantity.

    Raises
    ------
    InputError
        If a name is not known, a quantity is named twice, or one that is needed is missing: the
        time, the three coordinates; of rates all three or none, of accelerations likewise, and
        those only beside rates.
    """
    found: dict[str, Column] = {}
    for position, name in enumerate(header):
        if name in header[:position]:
            raise InputError(f"column {name!r} is there twice")
        if name in IGNORED:
            continue
        if name not in READ:
            raise InputError(_unknown(name, position))
        quantity, factor = READ[name]
        if quantity in found:
            raise InputError(
                f"columns {found[quantity].name!r} and {name!r} both hold {quantity}; one may"
            )
        found[quantity] = Column(name, position, factor)
    needed = ["time", *COORDINATES]
    for more in (ACCELERATIONS, RATES):
        if len(needed) > 4 or any(quantity in found for quantity in more):
            needed.extend(more)
    missing = [_choice(quantity) for quantity in needed if quantity not in found]
    if missing:
        raise InputError(
            f"column{'s' if missing[1:] else ''} {', '.join(missing)} missing; the header has "
            f"{', '.join(header)}. {_RULE}"
        )
    return found


_RULE = (
    "Cells are separated by commas, semicolons or tabs; rates and accelerations are optional, "
    "accelerations only beside rates, and each for z, tilt_x and tilt_y"
)


def _choice(quantity: str) -> str:
    first, *others = (f"{quantity}_{unit}" for unit in UNITS[quantity])
    return f"{first} (or {', '.join(others)})"


def _unknown(name: str, position: int) -> str:
    """Say what is wrong with a name, and what it could be."""
    if not name:
        return f"column {position + 1} has no name"
    # Of the same unit: who wrote z_cm does not mean z_m.
    like = [known for known in READ if name.lower().endswith(f"_{_unit(known)}")]
    near = get_close_matches(name.lower(), like, n=1, cutoff=0.85)
    if name in UNITS:
        return f"column {name!r} has no unit: it can be {', '.join(_names(name))}"
    if near:
        return f"column {shown(name)} is not known; did you mean {near[0]!r}?"
    for quantity in sorted(UNITS, key=len, reverse=True):
        if name.startswith(f"{quantity}_"):
            unit = name[len(quantity) + 1 :]
            return (
                f"column {shown(name)}: {shown(unit)} is no unit of {quantity}; it can be "
                f"{', '.join(_names(quantity))}"
            )
    return (
        f"column {shown(name)} is not known. Those that are read are quantity_unit, with the "
        f"quantities {', '.join(UNITS)}: time_s, z_mm, tilt_x_rate_deg_per_s and the like"
    )


def _unit(column: str) -> str:
    return column.removeprefix(f"{READ[column].quantity}_")


def _names(quantity: str) -> list[str]:
    return [f"{quantity}_{unit}" for unit in UNITS[quantity]]
