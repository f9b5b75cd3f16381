"""Regions of a task: products of intervals and balls of its coordinates, and grids in them.

All are convex, so that the straight way from the middle to any point is inside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, did_you_mean
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.validation import finite_number, positive_number, whole_number


@refuses_other_kinds
@dataclass(frozen=True)
class RoundPart:
    """A disc of two coordinates, or a ball of three.

    Parameters
    ----------
    coordinates
        Two or three names.
    centre
        As many numbers, m or rad.
    radius
        m or rad.
    """

    coordinates: Sequence[str]
    centre: Sequence[float]
    radius: float

    def __post_init__(self) -> None:
        if len(self.coordinates) not in (2, 3) or len(self.centre) != len(self.coordinates):
            raise InputError("a round part has two or three coordinates, and as many of its centre")
        for name, one in zip(self.coordinates, self.centre, strict=True):
            finite_number(one, f"the centre's {name}")
        positive_number(self.radius, "radius")

    def points(self, shells: int) -> Array:
        """Return points on circles or spheres about the centre, and the centre, (k, 2 or 3)."""
        found = [np.zeros((1, len(self.coordinates)))]
        for shell in range(1, shells + 1):
            share = shell / shells
            if len(self.coordinates) == 2:
                angles = np.arange(8 * shell) * (2 * math.pi / (8 * shell))
                found.append(share * np.stack([np.cos(angles), np.sin(angles)], axis=-1))
            else:
                found.append(share * _sphere(12 * shell**2))
        return np.asarray(np.asarray(self.centre) + self.radius * np.concatenate(found))


@refuses_other_kinds
@dataclass(frozen=True)
class Region:
    """Task coordinates that a robot must reach.

    Parameters
    ----------
    box
        Coordinates with their ends, m or rad: ``{"z": (-0.6, -0.4)}``.
    round
        Discs and balls of other coordinates: a disc of x and y with a box of z is a cylinder.
    held
        Values of the other coordinates; those of home where they are left out.
    points
        Points along each coordinate of the box, and along a diameter of a round part; an odd
        number.
    """

    box: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    round: Sequence[RoundPart] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    points: int = 5

    def __post_init__(self) -> None:
        if not self.box and not self.round:
            raise InputError("a region needs a box or a round part")
        if whole_number(self.points, "points", 3) % 2 == 0:
            raise InputError(
                f"points = {self.points}: it must be odd, so that the middle is a point"
            )
        for name, (low, high) in self.box.items():
            if not finite_number(low, name) < finite_number(high, name):
                raise InputError(f"the region's {name} from {low:g} to {high:g} is empty")
        names = [*self.box, *(name for part in self.round for name in part.coordinates), *self.held]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"coordinate {name!r} of the region is given twice")

    def grid(self, task: Task) -> Array:
        """Return points in a task's coordinates, the middle first, shape (k, m).

        Raises
        ------
        InputError
            If a coordinate is not one of the task.
        """
        parts: list[tuple[Sequence[str], Array]] = [
            ((name,), np.linspace(low, high, self.points)[:, None])
            for name, (low, high) in self.box.items()
        ]
        parts += [(part.coordinates, part.points(self.points // 2)) for part in self.round]
        known = task.coordinates
        for name in (*(n for names, _ in parts for n in names), *self.held):
            if name not in known:
                raise InputError(
                    f"no coordinate {name!r} of the task{did_you_mean(name, known)}; there are: "
                    f"{', '.join(known)}"
                )
        counts = np.meshgrid(*(np.arange(len(values)) for _, values in parts), indexing="ij")
        found = np.tile(task.home, (counts[0].size, 1))
        for name, value in self.held.items():
            found[:, known.index(name)] = value
        for (names, values), index in zip(parts, counts, strict=True):
            found[:, [known.index(name) for name in names]] = values[index.ravel()]
        middle = self.middle(task, found)
        first = int(np.argmin(np.linalg.norm(found - middle, axis=-1)))
        return np.concatenate([middle[None], np.delete(found, first, axis=0)])

    def middle(self, task: Task, found: Array) -> Array:
        """Return the middle of the region, shape (m,)."""
        middle = found[0].copy()
        for name, (low, high) in self.box.items():
            middle[task.coordinates.index(name)] = (low + high) / 2
        for part in self.round:
            for name, value in zip(part.coordinates, part.centre, strict=True):
                middle[task.coordinates.index(name)] = value
        return np.asarray(middle)


def _sphere(count: int) -> Array:
    """Return points spread evenly over the unit sphere, on a spiral, with its six axes' ends."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, math.pi * (1 + math.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    spiral = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)
    return np.asarray(np.concatenate([np.eye(3), -np.eye(3), spiral]))
