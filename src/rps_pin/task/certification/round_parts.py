"""Discs and balls of coordinates to which certified boxes are restricted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, did_you_mean, shown
from rps_pin.numerics.boxes import Ball

if TYPE_CHECKING:
    from rps_pin.task.design.region import RoundPart


class Box(NamedTuple):
    """A box of coordinates, shape (m,)."""

    coordinates: tuple[str, ...]
    angular: tuple[bool, ...]
    lower: Array
    upper: Array


def balls_of(box: Box, parts: Sequence[RoundPart]) -> list[Ball]:
    """Return round parts as balls of columns of coordinates; their centres are in the box.

    Raises
    ------
    InputError
        If these are no round parts, a coordinate is none of the task or is named twice, angles and
        lengths are mixed, or a centre is outside the box.
    """
    from rps_pin.task.design.region import RoundPart  # noqa: PLC0415  (design needs certify)

    if not isinstance(parts, Sequence) or not all(isinstance(one, RoundPart) for one in parts):
        raise InputError(f"round = {shown(parts)}: it must be Sequence[RoundPart]")
    return [_ball(box, part) for part in parts]


def _ball(box: Box, part: RoundPart) -> Ball:
    names, known = list(part.coordinates), box.coordinates
    for name in names:
        if name not in known:
            raise InputError(
                f"no coordinate {name!r} of the task{did_you_mean(name, known)}; there are: "
                f"{', '.join(known)}"
            )
    if len(set(names)) < len(names):
        raise InputError(f"a round part of {', '.join(names)} names a coordinate twice")
    columns = [known.index(name) for name in names]
    units = ["rad" if box.angular[k] else "m" for k in columns]
    if len(set(units)) > 1:
        told = ", ".join(f"{name} ({unit})" for name, unit in zip(names, units, strict=True))
        raise InputError(f"a round part of {told}: lengths and angles have no common radius")
    centre = np.array(part.centre, dtype=np.float64)
    lower, upper = box.lower[columns], box.upper[columns]
    if not ((centre >= lower) & (centre <= upper)).all():
        at, low, high = (
            f"({', '.join(f'{v:.6g}' for v in one)})" for one in (centre, lower, upper)
        )
        unit = units[0]
        raise InputError(
            f"the centre {at} {unit} of a round part is not in the box, from {low} {unit} to "
            f"{high} {unit}"
        )
    return Ball(columns, centre, float(part.radius))
