"""Bounding box of a robot over a motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from pinocchio import coal
from scipy.spatial import ConvexHull

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.viewer.scene.links import Link, link_poses
from rps_pin.viewer.scene.shapes import (
    Box,
    Cylinder,
    Ellipsoid,
    LineSegments,
    Part,
    Shape,
    Sphere,
    TriangleMesh,
)

_SIDES = 16
"""Of the prism around a cylinder."""
_MOST_FRAMED = 200
"""Configurations that the box of a motion is computed from, at most."""


class BoundingBox(NamedTuple):
    """An axis-aligned box in the world frame, in metres."""

    lower: Array
    """Corner with the smallest coordinates, shape (3,)."""
    upper: Array
    """Corner with the largest coordinates, shape (3,)."""

    radius: float
    """Radius of a sphere about the box's middle that holds all in it."""
    points: Array
    """Corners of the convex hull of what is in it, shape (k, 3)."""

    @property
    def centre(self) -> Array:
        """Middle of the box, shape (3,)."""
        return (self.lower + self.upper) / 2.0

    def with_points(self, points: Array) -> BoundingBox:
        """Return a box that holds all in this one, and points in the world, shape (k, 3)."""
        return _box_around(np.concatenate([self.points, points]))


def _box_around(points: Array) -> BoundingBox:
    """Return the box around points, shape (k, 3)."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    radius = float(np.linalg.norm(points - (lower + upper) / 2.0, axis=1).max())
    if not 0.0 < radius < np.inf:
        raise InputError(f"the robot's bounding box has radius {radius} m: it cannot be shown")
    # Joggled: points of a plane have no hull else.
    hull = ConvexHull((points - lower) / radius, qhull_options="QJ").vertices
    return BoundingBox(lower, upper, radius, points[hull])


def bounding_box(model: pin.Model, links: Sequence[Link], configurations: Array) -> BoundingBox:
    """Return a box that holds every link at every configuration.

    A cylinder counts with the prism around it, others with their own bounding boxes, so the result
    is a little generous.

    Parameters
    ----------
    model
        The robot.
    links
        Its links.
    configurations : ndarray, shape (n, nq)
        Configurations of `model`.

    Raises
    ------
    InputError
        If the robot has no visual geometry, or its box has no size.
    """
    if not links:
        raise InputError("the robot has no visual geometry: there is nothing to show")
    stride = -(-len(configurations) // _MOST_FRAMED)
    poses = link_poses(model, links, configurations[::stride])
    in_world = []
    for index, link in enumerate(links):
        turned = np.einsum("nij,mj->nmi", poses[:, index, :3, :3], _corners(link))
        in_world.append((turned + poses[:, index, None, :3, 3]).reshape(-1, 3))
    return _box_around(np.concatenate(in_world))


def _corners(link: Link) -> Array:
    """Return corners around the link's geometries in the link's frame, shape (m, 3)."""
    corners = []
    for item in link.geometries:
        in_link = link.placement.actInv(item.placement)
        corners += [in_link.act(corner) for corner in _own_corners(item.geometry)]
    return np.array(corners)


def _own_corners(shape: coal.CollisionGeometry) -> Array:
    """Return corners around one shape in its own frame, shape (m, 3)."""
    if isinstance(shape, coal.Cylinder):
        turn = np.tile(np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False), 2)
        reach = shape.radius / np.cos(np.pi / _SIDES)
        ends = np.repeat([-shape.halfLength, shape.halfLength], _SIDES)
        return np.stack([reach * np.cos(turn), reach * np.sin(turn), ends], axis=1)
    shape.computeLocalAABB()
    box = shape.aabb_local
    return np.array(list(product(*zip(box.min_, box.max_, strict=True))))


def part_points(part: Part) -> Array:
    """Return points around a part, in its node's frame, shape (m, 3)."""
    points = _shape_points(part.shape)
    return points @ part.placement[:3, :3].T + part.placement[:3, 3]


def _shape_points(shape: Shape) -> Array:
    """Return points around a shape, in its own frame."""
    match shape:
        case TriangleMesh():
            return np.asarray(shape.vertices)
        case LineSegments():
            return np.asarray(shape.points)
        case Cylinder():
            turn = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
            ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(_SIDES)], axis=1)
            end = np.array([0.0, 0.0, shape.length / 2.0])
            return np.concatenate([shape.radius * ring - end, shape.upper_radius * ring + end])
        case Box():
            half = np.array(shape.size) / 2.0
        case Sphere():
            half = np.full(3, shape.radius)
        case Ellipsoid():
            half = np.array(shape.radii)
    return np.asarray(half * np.array(list(product((-1.0, 1.0), repeat=3))))
