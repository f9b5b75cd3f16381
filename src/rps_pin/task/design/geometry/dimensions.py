"""Dimensions of a robot that may vary, and what each of them moves.

============ ============  =====================================================================
kind         of            what a value does
============ ============  =====================================================================
``length``   points        puts the origin at this distance from that of its link, in its direction
``radius``   points        puts it at this distance from the link's axis, in its direction
``height``   points        puts it at this coordinate along the link's axis
``spread``   pairs         turns both about the axis, so that the angle between them is this
``turn``     points        turns them about the axis by this angle from where the file has them
``distance`` closures      makes it the length of the rods
``stroke``   joints        makes it the way from the lower limit to the upper one
``lower``    joints        makes it the lower limit; ``upper`` the upper one
``scale``                  multiplies all lengths of the mechanism, and limits of lengths
============ ============  =====================================================================

Points that are given together, as a list within the list, move as one: their middle is moved, and
they keep their places about it. A link's axis is its z axis unless another is given; it goes
through the link's origin, which is that of the joint that moves it. A point whose name begins with
``-`` is turned the other way. Kinds act in the order of the table, ``scale`` first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.design.geometry.points import Moved, Points
from rps_pin.validation import finite_number, fixed_array, positive_number

#: Names of points that move as one.
Group = Sequence[str]
#: Kinds that move points, in the order in which they act.
OF_POINTS = ("length", "radius", "height", "spread", "turn")
#: Kinds that set limits of joints.
OF_LIMITS = ("stroke", "lower", "upper")
KINDS = ("scale", *OF_POINTS, "distance", *OF_LIMITS)
#: Kinds whose values are angles.
ANGLES = ("spread", "turn")
_LEAST = 1e-9


@refuses_other_kinds
@dataclass(frozen=True)
class Dimension:
    """A dimension that may vary, and what it moves; see the module's table.

    Parameters
    ----------
    name
        Its name.
    lower, upper
        Its range, m or rad; equal for a dimension that is held.
    step
        Distance of its possible values from `lower` on; any value if left out.
    length, radius, height, turn
        Points, or lists of points that move as one.
    spread
        Pairs of points.
    distance
        Names of ``distance`` closures.
    stroke, lower_limit, upper_limit
        Names of joints of one coordinate.
    scale
        Whether it multiplies all lengths.
    axis
        Direction of the links' axis, shape (3,), for ``radius``, ``height``, ``spread``, ``turn``.
    stretch
        Bodies that become longer with it, by the joint that moves them, each with one direction
        (3,) or several (k, 3) in the axes of that joint: they are stretched by the ratio of the
        value to that of the file, with their density. Bodies that are not named keep their masses.

    Raises
    ------
    InputError
        If the range is empty, or the dimension moves nothing.
    """

    name: str
    lower: float
    upper: float
    step: float | None = None
    length: Sequence[str | Group] = ()
    radius: Sequence[str | Group] = ()
    height: Sequence[str | Group] = ()
    spread: Sequence[Group] = ()
    turn: Sequence[str | Group] = ()
    distance: Sequence[str] = ()
    stroke: Sequence[str] = ()
    lower_limit: Sequence[str] = ()
    upper_limit: Sequence[str] = ()
    scale: bool = False
    axis: ArrayLike = (0.0, 0.0, 1.0)
    stretch: Mapping[str, ArrayLike] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lower, upper = finite_number(self.lower, "lower"), finite_number(self.upper, "upper")
        if not lower <= upper:
            raise InputError(f"dimension {self.name!r}: its range {lower:g} to {upper:g} is empty")
        if self.step is not None:
            step = positive_number(self.step, "step")
            if step > upper - lower > 0:
                raise InputError(
                    f"dimension {self.name!r}: step = {step:g} is larger than its range, "
                    f"{upper - lower:g}"
                )
        axis = fixed_array(self.axis, "axis", (3,))
        if not np.linalg.norm(axis) > 0:
            raise InputError(f"dimension {self.name!r}: its axis is zero")
        object.__setattr__(self, "axis", axis / np.linalg.norm(axis))
        used = self.kinds
        if {*used} & {*ANGLES} and not {*used} <= {*ANGLES}:
            raise InputError(f"dimension {self.name!r} is an angle and a length: {', '.join(used)}")
        for pair in self.spread:
            if isinstance(pair, str) or len(pair) != 2:
                raise InputError(
                    f"dimension {self.name!r}: spread takes pairs of points, not {shown(pair)}"
                )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Which kinds it has."""
        return tuple(kind for kind in KINDS if self.of(kind))

    @property
    def angular(self) -> bool:
        """Whether its values are angles."""
        return bool({*self.kinds} & {*ANGLES})

    def of(self, kind: str) -> Any:
        """Return what it has of a kind."""
        return getattr(self, {"lower": "lower_limit", "upper": "upper_limit"}.get(kind, kind))

    def snapped(self, values: Array) -> Array:
        """Return values on its steps."""
        if self.step is None:
            return values
        most = math.floor((self.upper - self.lower) / self.step + 1e-9)
        steps = np.clip(np.round((values - self.lower) / self.step), 0, most)
        return np.asarray(self.lower + self.step * steps)


def together(entry: str | Group) -> tuple[str, ...]:
    """Return the names of points that move as one, without signs."""
    names = (entry,) if isinstance(entry, str) else tuple(entry)
    return tuple(name.removeprefix("-") for name in names)


def measured(points: Points, dimension: Dimension, kind: str, entry: str | Group) -> float:
    """Return what a dimension is of points of the file."""
    names, axis = together(entry), np.asarray(dimension.axis)
    points.same_carrier(names)
    middle = np.mean([points[name].origin for name in names], axis=0)
    if kind == "length":
        return float(np.linalg.norm(middle))
    if kind == "height":
        return float(middle @ axis)
    if kind == "radius":
        return float(np.linalg.norm(middle - (middle @ axis) * axis))
    if kind == "spread":
        first, second = (points[name].origin for name in names)
        return abs(float(_angle(first[None], second[None], axis)[0]))
    return 0.0


def move(moved: Moved, points: Points, dimension: Dimension, kind: str, values: Array) -> None:
    """Move the points of one kind to a dimension's values, shape (n,)."""
    axis = np.asarray(dimension.axis)
    for entry in dimension.of(kind):
        names = together(entry)
        if kind == "turn":
            for name, given in zip(
                names, (entry,) if isinstance(entry, str) else entry, strict=True
            ):
                sign = -1.0 if given.startswith("-") else 1.0
                _turn(moved, name, axis, sign * values)
            continue
        if kind == "spread":
            first, second = (moved.origin[name] for name in names)
            now = _angle(first, second, axis)
            half = (np.where(now < 0, -1.0, 1.0) * values - now) / 2
            _turn(moved, names[0], axis, -half)
            _turn(moved, names[1], axis, half)
            continue
        middle = np.mean([moved.origin[name] for name in names], axis=0)
        along = (middle @ axis)[:, None] * axis
        if kind == "length":
            shift = (values / _length(middle, dimension, names) - 1.0)[:, None] * middle
        elif kind == "radius":
            across = middle - along
            shift = (values / _length(across, dimension, names) - 1.0)[:, None] * across
        else:
            shift = values[:, None] * axis - along
        for name in names:
            moved.origin[name] = moved.origin[name] + shift


def _length(vectors: Array, dimension: Dimension, names: Sequence[str]) -> Array:
    found = np.linalg.norm(vectors, axis=-1)
    if (found < _LEAST).any():
        raise InputError(
            f"dimension {dimension.name!r}: {', '.join(names)} is at the origin or on the axis of "
            "its link, so that it has no direction to be moved in"
        )
    return np.asarray(found)


def _turn(moved: Moved, name: str, axis: Array, angles: Array) -> None:
    turns = Rotation.from_rotvec(angles[:, None] * axis).as_matrix()
    moved.origin[name] = np.einsum("nij,nj->ni", turns, moved.origin[name])
    before = moved.turn.get(name, np.eye(3))
    moved.turn[name] = turns @ before


def _angle(first: Array, second: Array, axis: Array) -> Array:
    """Return the angle from one point to another as seen along an axis, -pi to pi."""
    one = first - (first @ axis)[:, None] * axis
    other = second - (second @ axis)[:, None] * axis
    return np.asarray(np.arctan2(np.cross(one, other) @ axis, np.einsum("ni,ni->n", one, other)))
