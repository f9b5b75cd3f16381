"""Options of cones between frames, and of discs and balls of coordinates, for workspaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import typer

from rps_pin.arrays import Array
from rps_pin.cli.decimal_numbers import decimal
from rps_pin.errors import InputError
from rps_pin.task import Cone, Task
from rps_pin.task.design import RoundPart

_CONE = "FRAME,FRAME=ANGLE[:AXIS:AXIS]"
_ROUND = "NAME,NAME[,NAME]=RADIUS[:CENTRE:CENTRE[:CENTRE]]"
_AXES = {
    f"{sign}{name}": tuple((-1.0 if sign else 1.0) * (k == name) for k in "xyz")
    for name in "xyz"
    for sign in ("", "-")
}

ConeOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="A,B=ANGLE[:U:V]",
        help="Largest angle between axes of two frames A and B of a mechanism, as a ball has it: "
        "**base,platform=0.4**. The axes U and V are x, y, z, -x and so on, or three numbers such "
        "as **1,0,1**; z if left out. Several times.",
        show_default=False,
    ),
]
RoundOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAMES=RADIUS",
        help="With **--certify**, a disc or a ball of coordinates: **rx,ry=0.3**, about the middle "
        "of what **--over** spans, or about another centre: **rx,ry=0.3:0:0**. What is beyond it "
        "does not count. Several times.",
        show_default=False,
    ),
]


def cones_of(given: Sequence[str], degrees: bool) -> list[Cone]:
    """Return the cones of ``--cone``.

    Raises
    ------
    InputError
        If one is not of that form, or no cone.
    """
    found = []
    for text in given:
        names, _, rest = text.rpartition("=")
        frames, (limit, *axes) = names.split(","), rest.split(":")
        try:
            angle = decimal(limit) * (math.radians(1.0) if degrees else 1.0)
            if len(frames) != 2 or not all(frames) or len(axes) not in (0, 2):
                raise ValueError
            axis_a, axis_b = (_axis(one) for one in axes or ("z", "z"))
        except ValueError:
            raise InputError(
                f"--cone {text}: it must be {_CONE}, such as base,platform=0.4"
            ) from None
        found.append(Cone(frames[0], frames[1], angle, axis_a, axis_b))
    return found


def _axis(text: str) -> tuple[float, ...]:
    if text in _AXES:
        return _AXES[text]
    found = tuple(map(decimal, text.split(",")))
    if len(found) != 3:
        raise ValueError
    return found


def round_parts(
    given: Sequence[str], task: Task, lower: Array, upper: Array, degrees: bool
) -> list[RoundPart]:
    """Return the discs and balls of ``--round``, in a box of task coordinates (m,).

    Raises
    ------
    InputError
        If one is not of that form, or a coordinate is none of the task.
    """
    found = []
    for text in given:
        names, _, rest = text.rpartition("=")
        coordinates = names.split(",")
        try:
            numbers = [decimal(one) for one in rest.split(":")]
            if len(coordinates) not in (2, 3) or len(numbers) not in (1, 1 + len(coordinates)):
                raise ValueError
        except ValueError:
            raise InputError(f"--round {text}: it must be {_ROUND}, such as rx,ry=0.3") from None
        for name in coordinates:
            if name not in task.coordinates:
                raise InputError(
                    f"--round {text}: no coordinate {name!r} of the task; there are: "
                    f"{', '.join(task.coordinates)}"
                )
        columns = [task.coordinates.index(name) for name in coordinates]
        # A disc of angles and lengths is refused where boxes are certified.
        unit = math.radians(1.0) if degrees and task.angular[columns[0]] else 1.0
        radius, *centre = (unit * number for number in numbers)
        if not 0.0 < radius < math.inf:
            raise InputError(f"--round {text}: the radius must be positive, and finite")
        middle = ((lower + upper) / 2)[columns].tolist()
        found.append(RoundPart(coordinates, centre or middle, radius))
    return found
