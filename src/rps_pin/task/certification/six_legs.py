"""What must hold of a pose of a platform on six legs to be inside; see `rps_pin.task.certified`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError
from rps_pin.numerics.boxes import Bounds, Group, bounded
from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.numerics.stumpff import enclosures
from rps_pin.task.certification.leg_cones import LegCones
from rps_pin.task.certification.vectors import cross, dot, norm
from rps_pin.task.paths.limits import Cone
from rps_pin.task.point_legs import PointLegs
from rps_pin.task.task import Task

Number = Any

#: Margins within this of zero are proven to be neither: the points of the legs are rounded.
_ROUNDED, _SLACK = 1e-12, 1e-9
#: A determinant of rows of unit length that is smaller than this has no sign in floats.
_SIGNED = 1e-9


class LegMargins:
    """What must be positive for a pose to be inside."""

    def __init__(self, task: Task, legs: PointLegs, start: Array, cones: Sequence[Cone]) -> None:
        self._cones = LegCones(task, legs, cones)
        model, self._legs = task.mechanism.model, legs
        at = task.of_actuators
        limits = model.lowerPositionLimit[at], model.upperPositionLimit[at]
        self._least, self._most = (np.asarray(one) + legs.offset for one in limits)
        self._least = np.maximum(self._least, 0.0)
        self._unit = 1.0 / task.characteristic_length
        rows = _rows(legs, _points(start[:, None]), self._unit)
        self._side = float(_signs(_middle(rows))[0])
        if self._side == 0.0:
            raise SingularityError("the start pose is singular", np.inf, 1 / _SIGNED)

    @property
    def groups(self) -> dict[str, tuple[int, Group]]:
        """For `rps_pin.numerics.boxes.prove`, the cheapest first."""
        found: dict[str, tuple[int, Group]] = {
            "lengths": (12, self.lengths),
            "angles": (6 + int(np.isfinite(self._legs.angles).sum()), self.angles),
            "cones": (len(self._cones), self.cones),
            "singularity": (1, self.regular),
        }
        return {name: group for name, group in found.items() if group[0]}

    def lengths(self, box: Interval) -> list[Bounds]:
        """Return bounds of the room of each leg to its limits."""

        def margins(*pose: Number) -> list[Number]:
            found = [norm(along) for along, _ in _legs(self._legs, pose)]
            above = [d - least for d, least in zip(found, self._least, strict=True)]
            below = [most - d for d, most in zip(found, self._most, strict=True)]
            return [room * self._unit - _ROUNDED for room in above + below]

        return bounded(margins, box, _SLACK)

    def angles(self, box: Interval) -> list[Bounds]:
        """Return bounds of what the universal joints' angles s and t have to their limits.

        sin(t - least) and the like are linear in u: with cos(t) > 0, of which 1 - sin(t)^2 > 0 is
        proven, cos(t) sin(s - least) is positive if s is beyond the least.
        """

        def margins(*pose: Number) -> list[Number]:
            found = []
            legs = zip(_legs(self._legs, pose), self._legs.axes, self._legs.angles, strict=True)
            for (along, _), axes, ((s_least, s_most), (t_least, t_most)) in legs:
                length = norm(along)
                x, y, z = (dot(along, axis) / length for axis in axes)
                found.append(y * y + z * z)
                if np.isfinite(s_least):
                    found.append(-y * math.cos(s_least) - z * math.sin(s_least))
                if np.isfinite(s_most):
                    found.append(z * math.sin(s_most) + y * math.cos(s_most))
                if np.isfinite(t_least):
                    found.append(x - math.sin(max(t_least, -math.pi / 2)))
                if np.isfinite(t_most):
                    found.append(math.sin(min(t_most, math.pi / 2)) - x)
            return [one - _ROUNDED for one in found]

        return bounded(margins, box, _SLACK)

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
