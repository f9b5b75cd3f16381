"""Points of a mechanism that dimensions move: joints, ends of closures, the output frame.

A point stands in the frame of the joint that carries it (the world's for the base):

==============  ==============================================================================
name            what it is
==============  ==============================================================================
``JOINT``       the origin of a joint, in the joint before it
``CLOSURE.a``   the end of a closure at its frame a; ``CLOSURE.b`` at its frame b
``task``        the output frame of the task
==============  ==============================================================================

What a candidate changes becomes the numbers of ``placement:JOINT`` and ``closure:NAME`` (see
`rps_pin.codegen.expressions.parameters`): with the nominal placement (R, p) of a point, its new
origin p' and the turn Q of it about the carrier's axes, the shift in its own axes is R' (p' - p)
and the turn R' Q R.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.errors import InputError, MechanismError, did_you_mean
from rps_pin.task.task import Task

#: The name of the output frame.
OUTPUT = "task"


class Point(NamedTuple):
    """A point that can be moved."""

    group: str
    """The group of parameters that moves it."""
    column: int
    """Where its six numbers begin in the group."""
    carrier: int
    """The joint that carries it; 0: the world."""
    rotation: Array
    """Nominal, shape (3, 3)."""
    origin: Array
    """Nominal, in the carrier's frame, m, shape (3,)."""


class Moved(NamedTuple):
    """Where points stand in candidates."""

    origin: dict[str, Array]
    """By name, m, shape (n, 3)."""
    turn: dict[str, Array]
    """About the carrier's axes, shape (n, 3, 3); those that are not named are not turned."""


class Points:
    """All points of a task's mechanism."""

    def __init__(self, task: Task) -> None:
        model, found = task.mechanism.model, dict[str, Point]()
        for index in range(1, model.njoints):
            place = model.jointPlacements[index]
            group = f"placement:{model.names[index]}"
            found[model.names[index]] = _point(group, 0, int(model.parents[index]), place)
        self.closures: list[str] = []
        self.rods: dict[str, float] = {}
        closed_frames = task.extended.system.equations.closed_frames
        for number, closed in enumerate(closed_frames):
            name, of_task = closed.closure.name, number == len(task.mechanism.closures)
            group = f"closure:{name}"
            if task.frame is not None and number == len(closed_frames) - 1:
                of_task = True
            if of_task:
                found[OUTPUT] = _point(group, 6, closed.b.joint, closed.b.placement)
                continue
            self.closures.append(name)
            found[f"{name}.a"] = _point(group, 0, closed.a.joint, closed.a.placement)
            found[f"{name}.b"] = _point(group, 6, closed.b.joint, closed.b.placement)
            if closed.closure.distance is not None:
                self.rods[name] = float(closed.closure.distance)
        self._found = found

    def __getitem__(self, name: str) -> Point:
        if name not in self._found:
            raise MechanismError(
                f"no point {name!r}{did_you_mean(name, self._found)}; there are joints, ends of "
                f"closures and the output frame: {', '.join(self._found)}"
            )
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def at_home(self, count: int) -> Moved:
        """Return the nominal places of all points, for candidates."""
        places = {name: np.tile(point.origin, (count, 1)) for name, point in self._found.items()}
        return Moved(places, {})

    def same_carrier(self, names: Iterable[str]) -> int:
        """Return the joint that carries points.

        Raises
        ------
        InputError
            If different ones do.
        """
        carriers = {self[name].carrier for name in names}
        if len(carriers) > 1:
            raise InputError(
                f"points {', '.join(names)} are on different links: they do not move together"
            )
        return carriers.pop()

    def numbers(self, moved: Moved, groups: Mapping[str, int]) -> dict[str, Array]:
        """Return the numbers of groups, (n, size) each, of moved points.

        Parameters
        ----------
        moved
            Where the points stand.
        groups
            Names and sizes.
        """
        count = len(next(iter(moved.origin.values())))
        found = {group: np.zeros((count, size)) for group, size in groups.items()}
        for name, point in self._found.items():
            if point.group not in found:
                continue
            shift = (moved.origin[name] - point.origin) @ point.rotation
            found[point.group][:, point.column : point.column + 3] = shift
            if name in moved.turn:
                local = point.rotation.T @ moved.turn[name] @ point.rotation
                angles = Rotation.from_matrix(local).as_euler("xyz")
                found[point.group][:, point.column + 3 : point.column + 6] = angles
        return found


def _point(group: str, column: int, carrier: int, place: pin.SE3) -> Point:
    return Point(group, column, carrier, np.array(place.rotation), np.array(place.translation))
