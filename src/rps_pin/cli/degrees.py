"""``--degrees``: the angles that a command is given, prints and writes are in degrees.

One rule for all commands that have the option: without it angles are in radians, with it in
degrees, in options, text, errors, JSON and columns of CSV files, which name the unit. Not changed
are q (``configuration`` in JSON) and what files that are read hold: they name their own units.
Single values are converted by `rps_pin.cli.task_options.in_unit`.
"""

from __future__ import annotations

import itertools
import math
import re
from contextvars import ContextVar
from typing import Annotated

import typer

#: Whether the command that runs was asked for degrees.
ASKED: ContextVar[bool] = ContextVar("degrees", default=False)
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
#: Numbers with their units: ``0.1 rad``, ``0.1 to 0.2 rad``, ``(0.1, 0.2) rad``, and
#: ``(1, 0.2) m, rad``. Not one that may be of another unit.
_ANGLES = re.compile(
    rf"(?:\({_NUMBER}(?:, {_NUMBER})*\)|(?<![\w.]){_NUMBER}(?: to {_NUMBER})?)"
    r" ((?:m, |rad, )*rad)\b(?! or )",
    re.IGNORECASE,
)


def _asked(degrees: bool) -> bool:
    ASKED.set(degrees)
    return degrees


DegreesOption = Annotated[
    bool,
    typer.Option(
        "--degrees",
        help="Angles are given, printed and written in degrees; without, in radians.",
        callback=_asked,
    ),
]


def as_asked(text: str) -> str:
    """Return a message in the unit of angles that the command was asked for."""
    return words_in_degrees(text) if ASKED.get() else text


def words_in_degrees(text: str) -> str:
    """Return a text with its numbers of rad, rad/s and so on in degrees."""

    def turned(found: re.Match[str]) -> str:
        numbers, units = found.group()[: -len(found[1])], found[1].split(", ")
        each = itertools.cycle(units)

        def one(number: re.Match[str]) -> str:
            angle = next(each) == "rad"
            return f"{math.degrees(float(number[0])):.5g}" if angle else number[0]

        return re.sub(_NUMBER, one, numbers) + found[1].replace("rad", "deg")

    return _ANGLES.sub(turned, text)
