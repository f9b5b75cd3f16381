"""Rods of a mechanism, and the clearance between them: links as capsules between two points.

A capsule holds all points within its radius of the segment between its ends. The clearance of two
is the distance of their segments less both radii; it is negative where they overlap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.numerics.segments import segment_distance
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.design.geometry.points import Points
from rps_pin.task.task import Task
from rps_pin.validation import non_negative_number

#: Ends that are nearer in the file's home, in characteristic lengths, are one place.
_SAME = 1e-9


@refuses_other_kinds
@dataclass(frozen=True)
class Rod:
    """A link as a capsule.

    Parameters
    ----------
    ends
        Its two ends, by the names of points; see `Dimension`.
    radius
        m; 0 is a segment.

    Raises
    ------
    InputError
        If there are not two ends, they are one, or the radius is negative.
    """

    ends: tuple[str, str]
    radius: float = 0.0

    def __post_init__(self) -> None:
        ends = (self.ends,) if isinstance(self.ends, str) else tuple(self.ends)
        if len(set(ends)) != 2 or len(ends) != 2:
            raise InputError(f"a rod has two ends, not {', '.join(map(str, ends)) or 'none'}")
        non_negative_number(self.radius, "radius", "m")


class RodClearances:
    """The least clearance between rods, of candidates at many configurations.

    Rods that share an end, by name or by its place in the file's home, may touch.

    Parameters
    ----------
    task
        The task of the file's robot.
    rods
        By name.

    Raises
    ------
    InputError
        If no two rods are apart.
    MechanismError
        If a point is unknown.
    """

    def __init__(self, task: Task, rods: Mapping[str, Rod]) -> None:
        self._points, self._rods = Points(task), dict(rods)
        model = task.extended.model
        names = dict.fromkeys(end for rod in rods.values() for end in rod.ends)
        #: A frame of each link that carries an end, by its joint, and its placement there.
        self._frames = {
            joint: next(k for k, one in enumerate(model.frames) if one.parentJoint == joint)
            for joint in {self._points[name].carrier for name in names} - {0}
        }
        self._inverse = {
            joint: model.frames[k].placement.inverse() for joint, k in self._frames.items()
        }
        data = model.createData()
        pin.framesForwardKinematics(model, data, task.extended.home)
        at_home = {j: data.oMf[k].homogeneous[None, None] for j, k in self._frames.items()}
        home = {name: self._end(name, {}, 1, at_home)[0, 0] for name in names}
        near = _SAME * task.characteristic_length
        self._pairs = [
            (one, other)
            for one, other in combinations(self._rods.values(), 2)
            if not any(
                a == b or np.linalg.norm(home[a] - home[b]) < near
                for a in one.ends
                for b in other.ends
            )
        ]
        if not self._pairs:
            raise InputError("no two rods are apart: there is no clearance between them")

    @classmethod
    def check(cls, task: Task, rod: Rod) -> None:
        """Raise `MechanismError` unless the ends of a rod are points of a task's mechanism."""
        points = Points(task)
        for end in rod.ends:
            points[end]

    def least(self, engine: Any, numbers: dict[str, Array], packed: Array, q: Array) -> Array:
        """Return the least clearance, m, shape (n, k).

        Parameters
        ----------
        engine
            Generated code of the extended mechanism.
        numbers
            Of groups of parameters, (n, size) each.
        packed
            The same in the engine's order, (n, np).
        q
            Configurations of the extended mechanism, (n, k, nq).
        """
        count, points = q.shape[:2]
        each, flat = np.repeat(packed, points, axis=0), q.reshape(count * points, -1)
        placed = {
            joint: np.asarray(engine.generated(f"frame_{k}", None, each, flat)[0]).reshape(
                count, points, 4, 4
            )
            for joint, k in self._frames.items()
        }
        ends = {
            name: self._end(name, numbers, count, placed)
            for name in dict.fromkeys(end for rod in self._rods.values() for end in rod.ends)
        }
        found = np.full((count, points), np.inf)
        for one, other in self._pairs:
            (a, b), (c, d) = ([ends[end] for end in rod.ends] for rod in (one, other))
            apart = segment_distance(a, b, c, d) - (one.radius + other.radius)
            found = np.minimum(found, apart)
        return found

    def _end(
        self, name: str, numbers: Mapping[str, Array], count: int, placed: Mapping[int, Array]
    ) -> Array:
        """Return where a point is in the world, (n, k or 1, 3), of placements (n, k, 4, 4)."""
        point = self._points[name]
        local = np.tile(point.origin, (count, 1))
        if point.group in numbers:
            shift = numbers[point.group][:, point.column : point.column + 3]
            local = local + shift @ point.rotation.T
        if point.carrier == 0:
            return local[:, None]
        inverse, place = self._inverse[point.carrier], placed[point.carrier]
        local = local @ inverse.rotation.T + inverse.translation
        return np.asarray(
            (place[..., :3, :3] @ local[:, None, :, None])[..., 0] + place[..., :3, 3]
        )
