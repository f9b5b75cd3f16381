"""Boxes of task coordinates that are proven to be inside a mechanism's workspace, or outside.

Of mechanisms in general by `rps_pin.task.certification`; of a platform on six legs between points
in closed form. A box of its coordinates (x, y, z, rx, ry, rz) is inside if in all of its poses

- every leg's length |p + R a - b| keeps the limits of its actuator, and is not zero;
- the angles of its universal joint (`rps_pin.task.point_legs`) keep their limits, without passing
  the angle at which that joint is singular;
- the platform is at no parallel (type II) singularity, on the start's side of these: the
  determinant of the legs' Pluecker coordinates (u, R a x u) has the start's sign. A matrix of
  intervals is regular if it is nearly the identity once it is multiplied with the inverse of its
  middle.

A 3-RPS has its own: `rps_pin.rps.workspace.certify`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import MechanismError, SingularityError
from rps_pin.numerics.boxes import Bounds, CertifiedBoxes, Progress, bounded, checked_box, prove
from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.numerics.stumpff import enclosures
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.certification.general import certify_general, refuse_turns
from rps_pin.task.point_legs import PointLegs, point_legs
from rps_pin.task.task import Task
from rps_pin.validation import real_vector

Number = Any

#: Margins within this of zero are proven to be neither: the points of the legs are rounded.
_ROUNDED, _SLACK = 1e-12, 1e-9
#: A determinant of rows of unit length that is smaller than this has no sign in floats.
_SIGNED = 1e-9


@refuses_other_kinds
def certify(
    task: Task,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    start: ArrayLike | None = None,
    free: float = 0.02,
    undecided: float = 0.01,
    most_boxes: int = 200_000,
    progress: Progress = iter,
) -> CertifiedBoxes:
    """Prove of which task coordinates of a box a mechanism reaches them, by intervals.

    A box is inside if for each of its points there is one closed configuration, that of the start's
    assembly mode, every joint keeps its limits there (by whole turns, where these make no
    difference), the closures are regular given the task's coordinates (no type I singularity), and
    K is regular, on the start's side (no type II singularity). It is joined to the start's box by
    boxes for all of whose points that configuration is proven.

    A box is outside if in all of its configurations, joined so, one limit is broken or K has the
    other sign; or if nothing closes at any of its points within the joints' limits, as far as the
    part of the output frame's pose that is no coordinate of the task stays within `free` of the
    start's.

    Parameters
    ----------
    task
        The task, of a frame in the world or of joints. A platform on six legs with universal
        joints, prismatic actuators and balls is certified in closed form; others need CasADi,
        ``pip install rps-pin[compile]``.
    lower, upper
        Least and greatest coordinates of the box, shape (m,), m and rad; equal where a coordinate
        is held.
    start
        Task coordinates (m,), followed straight from home, or a closed configuration (nq,), that
        decide the assembly mode and the side of the singularities; within the box. Left out: home,
        or the point of the box nearest to it. Of a platform on six legs, coordinates (6,) anywhere,
        home if left out.
    free
        See above, rad and characteristic lengths. A Delta's platform could turn: boxes beyond its
        reach are excluded for turns of at most this.
    undecided
        Undecided share of the volume inside at which the cutting ends.
    most_boxes
        It ends also where this many boxes are undecided.
    progress
        Wraps the loops over blocks of boxes, for a progress bar.

    Raises
    ------
    MechanismError
        If the closures are redundant or leave idle freedoms, there are fewer actuators than
        coordinates, or the task's reference frame is not the world.
    InputError
        If the box is empty, has rotation vectors longer than 2 rad, or the start is outside it.
    ClosureError, SingularityError
        If the start cannot be reached from home, or is singular.
    CompileError
        If CasADi is needed and not installed.
    """
    ends = checked_box(lower, upper, task.size, held=True)
    options: dict[str, Any] = {
        "undecided": undecided, "most_boxes": most_boxes, "progress": progress
    }  # fmt: skip
    try:
        legs = point_legs(task)
    except MechanismError:
        return certify_general(task, *ends, start=start, free=free, **options)
    refuse_turns(task, *ends)
    margins = _Margins(task, legs, task.home if start is None else real_vector(start, 6, "start"))
    groups = {
        "lengths": (12, margins.lengths),
        "angles": (margins.angle_count, margins.angles),
        "singularity": (1, margins.regular),
    }
    return prove(groups, *ends, **options)


class _Margins:
    """What must be positive for a pose to be inside."""

    def __init__(self, task: Task, legs: PointLegs, start: Array) -> None:
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

    def lengths(self, box: Interval) -> list[Bounds]:
        """Return bounds of the room of each leg to its limits."""

        def margins(*pose: Number) -> list[Number]:
            found = [_norm(along) for along, _ in _legs(self._legs, pose)]
            above = [d - least for d, least in zip(found, self._least, strict=True)]
            below = [most - d for d, most in zip(found, self._most, strict=True)]
            return [room * self._unit - _ROUNDED for room in above + below]

        return bounded(margins, box, _SLACK)

    @property
    def angle_count(self) -> int:
        """Margins of `angles`."""
        return 6 + int(np.isfinite(self._legs.angles).sum())

    def angles(self, box: Interval) -> list[Bounds]:
        """Return bounds of what the universal joints' angles s and t have to their limits.

        sin(t - least) and the like are linear in u: with cos(t) > 0, of which 1 - sin(t)^2 > 0 is
        proven, cos(t) sin(s - least) is positive if s is beyond the least.
        """

        def margins(*pose: Number) -> list[Number]:
            found = []
            legs = zip(_legs(self._legs, pose), self._legs.axes, self._legs.angles, strict=True)
            for (along, _), axes, ((s_least, s_most), (t_least, t_most)) in legs:
                length = _norm(along)
                x, y, z = (_dot(along, axis) / length for axis in axes)
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


def _legs(legs: PointLegs, pose: tuple[Number, ...]) -> list[tuple[list[Number], list[Number]]]:
    """Return of each leg its vector p + R a - b, and R a: R v = v + A w x v + B w x (w x v)."""
    position, w = pose[:3], pose[3:]
    _, a_, b_, *_ = enclosures(_dot(w, w))
    found = []
    for fixed, point in zip(legs.base, legs.platform, strict=True):
        once = _cross(w, point)
        twice = _cross(w, once)
        turned = [v + a_ * u + b_ * t for v, u, t in zip(point, once, twice, strict=True)]
        along = [p + r - f for p, r, f in zip(position, turned, fixed, strict=True)]
        found.append((along, turned))
    return found


def _rows(legs: PointLegs, pose: tuple[Number, ...], unit: float) -> list[list[Number]]:
    """Return the legs' Pluecker coordinates (u, R a x u); moments by characteristic lengths."""
    found = []
    for along, turned in _legs(legs, pose):
        length = _norm(along)
        u = [part / length for part in along]
        found.append([*u, *(part * unit for part in _cross(turned, u))])
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


def _cross(a: Any, b: Any) -> list[Number]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Any, b: Any) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _norm(v: list[Number]) -> Number:
    length: Number = _dot(v, v).sqrt()
    return length
