"""What must hold of a pose of a platform on six legs to be inside; see `rps_pin.task.certified`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError
from rps_pin.numerics.boxes import Bounds, Groups, bounded
from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.numerics.stumpff import enclosures
from rps_pin.task.certification.leg_angles import AngleRoom, angle_rooms
from rps_pin.task.certification.leg_cones import LegCones
from rps_pin.task.certification.reasons import LimitWords, limit_words
from rps_pin.task.certification.vectors import cross, dot, norm
from rps_pin.task.paths.limits import Cone
from rps_pin.task.point_legs import PointLegs
from rps_pin.task.task import Task
from rps_pin.task.workspace.reasons import SINGULAR

Number = Any

#: Margins within this of zero are proven to be neither: the points of the legs are rounded.
_ROUNDED, _SLACK = 1e-12, 1e-9
#: A determinant of rows of unit length that is smaller than this has no sign in floats.
_SIGNED = 1e-9


class LegMargins:
    """What must be positive for a pose to be inside."""

    def __init__(self, task: Task, legs: PointLegs, start: Array, cones: Sequence[Cone]) -> None:
        self._cones = LegCones(task, legs, cones)
        self._legs = legs
        words = limit_words(task, cones)
        self._of_cones = words.cones
        self._lengths = _length_rooms(task, legs, words)
        self._angles = _angle_rooms(task, legs, words)
        self._unit = 1.0 / task.characteristic_length
        rows = _rows(legs, _points(start[:, None]), self._unit)
        self._side = float(_signs(_middle(rows))[0])
        if self._side == 0.0:
            raise SingularityError("the start pose is singular", np.inf, 1 / _SIGNED)

    @property
    def groups(self) -> Groups:
        """For `rps_pin.numerics.boxes.prove`, the cheapest first."""
        angles = [name for rooms in self._angles for one in rooms for name in one.names]
        found: Groups = {
            "lengths": ([room.name for room in self._lengths], self.lengths),
            "universal joints": ([SINGULAR] * len(self._angles), self.universal),
            "angles": (angles, self.angles),
            "cones": (self._of_cones, self.cones),
            "singularity": ([SINGULAR], self.regular),
        }
        return {name: group for name, group in found.items() if group[0]}

    def lengths(self, box: Interval) -> list[Bounds]:
        """Return bounds of the room of each leg to its limits."""

        def margins(*pose: Number) -> list[Number]:
            found = [norm(along) for along, _ in _legs(self._legs, pose)]
            rooms = [(found[one.leg] - one.limit) * one.sign for one in self._lengths]
            return [room * self._unit - _ROUNDED for room in rooms]

        return bounded(margins, box, _SLACK)

    def universal(self, box: Interval) -> list[Bounds]:
        """Return bounds of cos(t)^2 of the universal joints' second angles t."""

        def margins(*pose: Number) -> list[Number]:
            return [y * y + z * z - _ROUNDED for _, y, z in self._directions(pose)]

        return bounded(margins, box, _SLACK)

    def angles(self, box: Interval) -> list[Bounds]:
        """Return bounds of what the universal joints' angles have to their limits."""

        def margins(*pose: Number) -> list[Number]:
            found = []
            for (x, y, z), rooms in zip(self._directions(pose), self._angles, strict=True):
                across = None if all(one.simple for one in rooms) else (y * y + z * z).sqrt()
                found += [number for one in rooms for number in one.numbers(x, y, z, across)]
            return [one - _ROUNDED for one in found]

        numbers = iter(bounded(margins, box, _SLACK))
        return [room for rooms in self._angles for one in rooms for room in one.bounds(numbers)]

    def _directions(self, pose: tuple[Number, ...]) -> list[list[Number]]:
        """Return each leg's direction in the axes of its universal joint."""
        found = []
        for (along, _), axes in zip(_legs(self._legs, pose), self._legs.axes, strict=True):
            length = norm(along)
            found.append([dot(along, axis) / length for axis in axes])
        return found

    def cones(self, box: Interval) -> list[Bounds]:
        """Return bounds of the room of cones, of cosines."""

        def margins(*pose: Number) -> list[Number]:
            return [room - _ROUNDED for room in self.cone_rooms(pose)]

        return bounded(margins, box, _SLACK)

    def cone_rooms(self, pose: tuple[Number, ...]) -> list[Number]:
        """Return the room of each cone at poses, of cosines."""
        along = [one for one, _ in _legs(self._legs, pose)]
        return self._cones.rooms(along, _turn(pose))

    def regular(self, box: Interval) -> list[Bounds]:
        """Return bounds of the determinant's sign: of all of a box, or nothing."""
        centre = (box.lower + box.upper) / 2
        half = np.maximum(box.upper - centre, centre - box.lower) * (1.0 + 1e-15)
        over = _rows(self._legs, Enclosure.coordinates(box), self._unit)
        low, high = (
            np.array([[getattr(one.slopes, end) for one in row] for row in over])
            for end in ("lower", "upper")
        )
        # Shape (n, coordinates, 6, 6): K(x) is in K(centre) + sum_l slopes_l (x - centre)_l.
        slopes, apart = (
            np.moveaxis(one, (2, 3), (1, 0)) / 2 for one in (low + high, (high - low) * (1 + 1e-15))
        )
        middle = _middle(_rows(self._legs, _points(centre), self._unit))
        signs = _signs(middle)
        known = (signs != 0.0) & np.isfinite(apart).all(axis=(1, 2, 3))
        safe = np.where(known[:, None, None], middle, np.eye(6))
        M = np.linalg.inv(safe)
        off = np.abs(np.eye(6) - M @ safe)  # of M K from the identity, at most
        for i in range(box.lower.shape[0]):
            part = np.abs(M @ slopes[:, i]) + np.abs(M) @ apart[:, i]
            off += part * half[i][:, None, None]
        # The rounding of all this is far below 1e-6.
        whole = known & (off.sum(axis=-1).max(axis=-1) < 1.0 - 1e-6)
        none = np.zeros(whole.shape)
        right, wrong = signs == self._side, signs == -self._side
        return [Bounds(whole & right, whole & wrong, none, none)]


class _LengthRoom(NamedTuple):
    """The room of a leg's length to a limit: sign (length - limit)."""

    leg: int
    limit: float
    sign: float
    name: str


def _length_rooms(task: Task, legs: PointLegs, words: LimitWords) -> list[_LengthRoom]:
    """Return the limits of the lengths, m; each is above zero, too, or the leg has no direction."""
    model, found = task.mechanism.model, []
    for k, (q, offset) in enumerate(zip(task.of_actuators, legs.offset, strict=True)):
        least = float(model.lowerPositionLimit[q] + offset)
        most = float(model.upperPositionLimit[q] + offset)
        name = words.of(int(q), "lower") if least > 0.0 else SINGULAR
        found.append(_LengthRoom(k, max(least, 0.0), 1.0, name))
        if np.isfinite(most):
            found.append(_LengthRoom(k, most, -1.0, words.of(int(q), "upper")))
    return found


def _angle_rooms(task: Task, legs: PointLegs, words: LimitWords) -> list[list[AngleRoom]]:
    """Return the rooms of the angles of each leg's universal joint."""
    model, found = task.mechanism.model, []
    for limits, links in zip(legs.angles, legs.links, strict=True):
        first, second, _ = sorted(links)
        at = [int(model.joints[joint].idx_q) for joint in (first, second)]
        found.append(
            angle_rooms(limits, [(words.of(k, "lower"), words.of(k, "upper")) for k in at])
        )
    return found


def _turn(pose: tuple[Number, ...]) -> Callable[[Any], list[Number]]:
    """Return the rotation: R v = v + A w x v + B w x (w x v)."""
    w = pose[3:]
    _, a_, b_, *_ = enclosures(dot(w, w))

    def turned(v: Any) -> list[Number]:
        once = cross(w, v)
        return [one + a_ * u + b_ * t for one, u, t in zip(v, once, cross(w, once), strict=True)]

    return turned


def _legs(legs: PointLegs, pose: tuple[Number, ...]) -> list[tuple[list[Number], list[Number]]]:
    """Return of each leg its vector p + R a - b, and R a."""
    turn, found = _turn(pose), []
    for fixed, point in zip(legs.base, legs.platform, strict=True):
        turned = turn(point)
        along = [p + r - f for p, r, f in zip(pose[:3], turned, fixed, strict=True)]
        found.append((along, turned))
    return found


def _rows(legs: PointLegs, pose: tuple[Number, ...], unit: float) -> list[list[Number]]:
    """Return the legs' Pluecker coordinates (u, R a x u); moments by characteristic lengths."""
    found = []
    for along, turned in _legs(legs, pose):
        length = norm(along)
        u = [part / length for part in along]
        found.append([*u, *(part * unit for part in cross(turned, u))])
    return found


def _points(pose: Array) -> tuple[Interval, ...]:
    return tuple(Interval(one) for one in pose)


def _middle(rows: list[list[Interval]]) -> Array:
    """Return the middles of intervals, shape (n, 6, 6)."""
    found = np.array([[(one.lower + one.upper) / 2 for one in row] for row in rows])
    return np.moveaxis(found, -1, 0)


def _signs(matrices: Array) -> Array:
    """Return the signs of determinants of matrices (n, 6, 6); 0 where they are not certain."""
    size = np.linalg.norm(matrices, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        found = np.linalg.det(np.nan_to_num(matrices / size))
    return np.where(np.abs(found) > _SIGNED, np.sign(found), 0.0)
