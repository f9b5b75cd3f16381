"""Signed distances between pairs of links, with their rates, by Coal.

The distance of two links is the least one of their shapes: negative in interference, by the depth
by which shapes must be moved apart. Its rate is exact where it has one:

    d' = n . (v_b - v_a),

with n from a to b and v the velocities of the links' nearest points. A mesh that is not convex is a
surface: where it cuts another shape, the depth is that of single triangles, or next to zero if
both are such surfaces; of a shape inside it, the way to the surface.

Lengths are divided by the mechanism's characteristic length, since Coal's tolerances are absolute.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.arrays import Array
from rps_pin.closed_loop.interference.geometry import scaled
from rps_pin.closed_loop.interference.meshes import is_inside, triangles_of
from rps_pin.closed_loop.interference.pairs import pairs_of_links
from rps_pin.closed_loop.interference.shapes import CollisionShapes
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import real_vector

#: Tolerances of Coal's searches, in characteristic lengths: of distances, and of depths. Below the
#: latter its search of round shapes fails: of 400 random overlaps 38 at 1e-10, none at 1e-6.
_TOLERANCE, _TOLERANCE_OF_DEPTH = 1e-10, 1e-6
#: Surfaces that cut each other have this depth, and what is inside one at least this, in
#: characteristic lengths.
_CUTTING = 1e-9
#: Larger numbers are failures of the search.
_FAILED = 1e50


class LinkDistance(NamedTuple):
    """Signed distance between two links."""

    link_a: str
    link_b: str
    distance: float
    """m; negative in interference."""
    point_a: Array
    """Nearest point of link a, in world axes, m, shape (3,); of a pair in interference, the deepest
    one."""
    point_b: Array

    def __str__(self) -> str:
        return f"{self.link_a} and {self.link_b}: {self.distance:.6g} m"


class _Shape(NamedTuple):
    joint: int
    at: pin.SE3
    """In its joint's frame, in characteristic lengths."""
    solid: Any
    centre: Array
    """Of a ball around the shape, in the joint's frame, in characteristic lengths, shape (3,)."""
    radius: float
    corners: Array | None
    """Of a surface's triangles, shape (t, 3, 3)."""
    box: Array
    """Least and largest coordinates in the shape's own frame, shape (2, 3)."""
    inner: Array | None
    """A point of the shape in its own frame, of a solid far inside; None if it is endless."""


class _Nearest(NamedTuple):
    distance: float
    normal: Array
    point_a: Array
    point_b: Array
    shape_a: int
    shape_b: int


@refuses_other_kinds
class LinkDistances:
    """Distances of the pairs of links of a mechanism that are checked.

    `ClosedLoopModel.link_distances` makes it. An object serves one thread at a time.

    Parameters
    ----------
    model, closures
        Of the mechanism.
    length
        Its characteristic length, m.
    shapes, geometry
        Its shapes as stated, and as built, one for one.
    ignored
        Pairs of links that may overlap.

    Attributes
    ----------
    pairs : list of tuple of str
        The pairs that are checked.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Any,
        length: float,
        shapes: CollisionShapes,
        geometry: pin.GeometryModel,
        ignored: Iterable[tuple[str, str]] = (),
    ) -> None:
        self._model, self._data, self._length = model, model.createData(), length
        items = list(geometry.geometryObjects)
        self._shapes = [_shape(item, 1.0 / length) for item in items]
        of_link: dict[str, list[int]] = {}
        links: dict[str, int] = {}
        for number, (stated, item) in enumerate(zip(shapes.shapes, items, strict=True)):
            of_link.setdefault(stated.link, []).append(number)
            links[stated.link] = int(item.parentJoint)
        found = pairs_of_links(model, closures, links, (*shapes.ignored, *ignored), length)
        self.pairs: list[tuple[str, str]] = []
        self._of_pair: list[list[tuple[int, int]]] = []
        for a, b in found:
            both = [(i, j) for i in of_link[a] for j in of_link[b]]
            both = [(i, j) for i, j in both if shapes.shapes[i].may_touch(shapes.shapes[j])]
            if both:
                self.pairs.append((a, b))
                self._of_pair.append(both)
        self._request = coal.DistanceRequest()
        self._request.gjk_tolerance = _TOLERANCE
        self._request.epa_tolerance = _TOLERANCE_OF_DEPTH
        self._coarse = coal.DistanceRequest()
        self._result = coal.DistanceResult()
        one, other = np.array([s for p in self._of_pair for s in p], np.intp).reshape(-1, 2).T
        self._one, self._other = one, other
        self._first = np.cumsum([0, *map(len, self._of_pair)])[:-1].astype(np.intp)
        self._radii = np.array([shape.radius for shape in self._shapes])
        self._centres = np.array([shape.centre for shape in self._shapes]).reshape(-1, 3)
        self._joints = sorted({shape.joint for shape in self._shapes})
        self._of_joint = np.array([self._joints.index(s.joint) for s in self._shapes], np.intp)
        self._places: dict[int, tuple[pin.SE3, Any]] = {}
        self._middles = np.zeros((0, 3))
        self._twists: Array | None = None
        self.set_state(pin.neutral(model))

    # At one configuration -------------------------------------------------------------------------

    def set_state(self, q: Array, v: Array | None = None) -> None:
        """Take a configuration (nq,), and a velocity (nv,) for rates.

        Raises
        ------
        InputError
            If a shape does not fit, or a number is not finite.
        """
        self._places.clear()
        q = real_vector(q, self._model.nq, "q")
        if v is None:
            pin.forwardKinematics(self._model, self._data, q)
        else:
            v = real_vector(v, self._model.nv, "v")
            pin.forwardKinematics(self._model, self._data, q, v)
        joints = [(self._data.oMi[joint], joint) for joint in self._joints]
        turns = np.array([at.rotation for at, _ in joints]).reshape(-1, 3, 3)
        ways = np.array([at.translation for at, _ in joints]).reshape(-1, 3) / self._length
        own = self._centres[:, None, :] @ np.swapaxes(turns, 1, 2)[self._of_joint]
        self._middles = own[:, 0] + ways[self._of_joint]
        self._twists = None
        if v is not None:
            twists = [at.act(self._data.v[joint]).vector for at, joint in joints]
            self._twists = np.array(twists).reshape(-1, 6)[self._of_joint]

    def bounds(self) -> Array:
        """Return a lower bound of the distance of each pair, m, shape (pairs,): that of balls."""
        one, other = self._one, self._other
        gaps = np.linalg.norm(self._middles[one] - self._middles[other], axis=1)
        gaps = gaps - self._radii[one] - self._radii[other]
        return self._length * np.minimum.reduceat(gaps, self._first) if gaps.size else gaps

    def largest_speeds(self) -> Array:
        """Return a bound of the rate of each distance, m/s, shape (pairs,); needs a velocity.

        That is the largest speed of points of one link relative to the other.
        """
        twists = self._moving()
        relative = twists[self._one] - twists[self._other]
        turning = np.linalg.norm(relative[:, 3:], axis=1)
        found = np.full(turning.shape, np.inf)
        for shape in (self._one, self._other):
            centre = self._length * self._middles[shape]
            moves = np.linalg.norm(relative[:, :3] + np.cross(relative[:, 3:], centre), axis=1)
            with np.errstate(invalid="ignore"):
                way = np.where(turning > 0, turning * self._length * self._radii[shape], 0.0)
            found = np.minimum(found, moves + way)
        return np.maximum.reduceat(found, self._first) if found.size else found

    def distance(self, pair: int) -> LinkDistance:
        """Return the distance of a pair, by its number.

        Raises
        ------
        InputError
            If there is no such pair.
        """
        near, length = self._nearest(pair), self._length
        a, b = self.pairs[pair]
        points = length * near.point_a, length * near.point_b
        return LinkDistance(a, b, length * near.distance, *points)

    def with_rate(self, pair: int) -> tuple[float, float]:
        """Return the distance of a pair, m, and its rate, m/s; needs a velocity.

        Raises
        ------
        InputError
            If there is no such pair, or no velocity was given.
        """
        near, length, twists = self._nearest(pair), self._length, self._moving()
        speed = _speed(twists[near.shape_b], length * near.point_b, near.normal)
        speed -= _speed(twists[near.shape_a], length * near.point_a, near.normal)
        return length * near.distance, speed

    def _moving(self) -> Array:
        if self._twists is None:
            raise InputError("rates need a velocity: set_state(q, v)")
        return self._twists

    def _nearest(self, pair: int) -> _Nearest:
        """Return the least distance of a pair's shapes, in characteristic lengths."""
        if not 0 <= pair < len(self.pairs):
            raise InputError(f"no pair of links {shown(pair)}; there are {len(self.pairs)}")
        return min((self._between(*both) for both in self._of_pair[pair]), key=_distance_of)

    def _placed(self, number: int) -> tuple[pin.SE3, Any]:
        """Return the placement of a shape, in characteristic lengths, and the same for Coal."""
        if number not in self._places:
            shape = self._shapes[number]
            at = self._data.oMi[shape.joint]
            at = pin.SE3(at.rotation, at.translation / self._length) * shape.at
            self._places[number] = at, coal.Transform3s(at.rotation, at.translation)
        return self._places[number]

    def _between(self, i: int, j: int) -> _Nearest:
        """Return the distance of two shapes, by their numbers."""
        a, b = self._shapes[i], self._shapes[j]
        (at_a, place_a), (at_b, place_b) = self._placed(i), self._placed(j)
        result = self._result
        for request in (self._request, self._coarse):
            result.clear()
            distance = coal.distance(a.solid, place_a, b.solid, place_b, request, result)
            if abs(distance) < _FAILED:
                break
        points = np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())
        if a.corners is not None and b.corners is not None:  # which have no normal
            normal = _direction(points[1] - points[0])
            if distance <= _CUTTING:
                distance, normal = -_CUTTING, np.zeros(3)
        else:
            normal = np.array(result.normal)
        apart = distance > -_CUTTING
        if apart and (_is_within(a, at_a, b, at_b) or _is_within(b, at_b, a, at_a)):
            distance, normal = -max(distance, _CUTTING), -normal
        if not abs(float(normal @ normal) - 1.0) < 1e-6:
            normal = _direction(at_b.translation - at_a.translation)
        return _Nearest(float(distance), normal, *points, i, j)


def _speed(twist: Array, point: Array, along: Array) -> float:
    """Return the speed of a point of a body along a direction, in world axes, m/s."""
    (px, py, pz), (nx, ny, nz) = point.tolist(), along.tolist()
    vx, vy, vz, wx, wy, wz = twist.tolist()
    moves = nx * (vx + wy * pz - wz * py) + ny * (vy + wz * px - wx * pz)
    return float(moves + nz * (vz + wx * py - wy * px))


def _distance_of(near: _Nearest) -> float:
    return near.distance


def _direction(way: Array) -> Array:
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-300))


def _is_within(outer: _Shape, at: pin.SE3, shape: _Shape, at_shape: pin.SE3) -> bool:
    """Return whether a shape is inside another that is a surface which it does not cut."""
    if outer.corners is None or shape.inner is None:
        return False
    own = at.actInv(at_shape.act(shape.inner))
    in_box = (own > outer.box[0]).all() and (own < outer.box[1]).all()
    return bool(in_box) and is_inside(own, outer.corners)


def _shape(item: Any, scale: float) -> _Shape:
    solid = scaled(item.geometry, scale)
    placement = item.placement
    at = pin.SE3(placement.rotation, scale * placement.translation)
    if type(solid).__name__ == "Halfspace":
        endless = np.array([[-np.inf] * 3, [np.inf] * 3])
        return _Shape(int(item.parentJoint), at, solid, np.zeros(3), np.inf, None, endless, None)
    solid.computeLocalAABB()
    box = np.array([solid.aabb_local.min_, solid.aabb_local.max_])
    middle = box.mean(axis=0)
    corners, inner = None, middle
    if hasattr(solid, "tri_indices"):
        vertices, triangles = triangles_of(solid)
        corners, inner = vertices[triangles], vertices[0]
    elif hasattr(solid, "num_points"):
        inner = np.mean([solid.point(k) for k in range(solid.num_points)], axis=0)
    radius = float(np.linalg.norm(box[1] - box[0])) / 2
    return _Shape(int(item.parentJoint), at, solid, at.act(middle), radius, corners, box, inner)
