"""Parts that layers are made of: arrows, axes, balls, tubes; and the placements of nodes."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.viewer.scene.shapes import Cylinder, Material, Part, Sphere, TriangleMesh, translated

SMALLEST = 1e-6
"""Scale of a node whose size is zero: with a scale of zero it would have no direction."""

_SHAFT, _HEAD, _HEAD_LENGTH = 0.028, 0.07, 0.22
"""Radii of an arrow's shaft and head, and the head's length, of an arrow of length 1."""
_FAINT = 0.25
"""Opacity of what is seen through the robot."""


def arrow(node: str, colour: int, stout: float = 1.0) -> list[Part]:
    """Return an arrow from the node's origin to (0, 0, 1); it shows faintly through what hides it.

    Arrows of joints often begin within the links. Of two arrows along one line the stouter one is
    around the other.
    """
    length, radius = 1.0 - _HEAD_LENGTH, stout * _SHAFT
    shaft = Cylinder(length, radius, radius)
    return _also_through(
        [
            Part(node, "shaft", shaft, Material(colour), _above(length / 2)),
            _head(node, "head", colour, 1.0 - _HEAD_LENGTH / 2, stout),
        ]
    )


def double_arrow(node: str, colour: int, stout: float = 1.0) -> list[Part]:
    """Return an arrow with two heads, as moments are drawn."""
    second = _head(node, "second_head", colour, 1.0 - 1.3 * _HEAD_LENGTH, stout)
    return [*arrow(node, colour, stout), *_also_through([second])]


def _head(node: str, name: str, colour: int, height: float, stout: float) -> Part:
    cone = Cylinder(_HEAD_LENGTH, stout * _HEAD, 0.0)
    return Part(node, name, cone, Material(colour), _above(height))


def _also_through(parts: list[Part]) -> list[Part]:
    """Return parts, and faint copies of them that are drawn where something hides them."""
    faint = [
        part._replace(
            name=f"{part.name}_through",
            material=part.material._replace(opacity=_FAINT, through=True),
        )
        for part in parts
    ]
    return [*parts, *faint]


def axes(node: str, length: float) -> list[Part]:
    """Return the axes of a frame: x red, y green, z blue."""
    radius = 0.022 * length
    bar, middle = Cylinder(length, radius, radius), _above(length / 2)
    return [
        Part(node, name, bar, Material(colour), rotation_to(axis) @ middle)
        for name, colour, axis in zip("xyz", (0xD62728, 0x2CA02C, 0x1F5FD0), np.eye(3), strict=True)
    ]


def ball(node: str, radius: float, material: Material) -> Part:
    """Return a ball about the node's origin."""
    return Part(node, "ball", Sphere(radius), material, np.eye(4))


def tube(points: Array, radius: float, sides: int = 6) -> TriangleMesh:
    """Return a tube along a line of points, shape (n, 3), n at least 2, neighbours apart."""
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    across = np.empty_like(points)
    side = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    for index, tangent in enumerate(tangents):  # the last one, turned as little as need be
        side = side - (side @ tangent) * tangent
        side /= np.linalg.norm(side)
        across[index] = side
    other = np.cross(tangents, across)
    turn = 2.0 * np.pi * np.arange(sides)[:, None] / sides
    ring = np.cos(turn) * across[:, None] + np.sin(turn) * other[:, None]
    vertices = (points[:, None] + radius * ring).reshape(-1, 3)
    row, column = np.arange(len(points) - 1)[:, None] * sides, np.arange(sides)[None]
    first, beside = (row + column).ravel(), (row + (column + 1) % sides).ravel()
    one, two = (first, beside, beside + sides), (first, beside + sides, first + sides)
    return TriangleMesh(vertices, np.hstack([one, two]).T)


def flat_ring(inner: float, outer: float, sides: int = 96) -> TriangleMesh:
    """Return a ring in the plane z = 0, seen from above."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(sides)], axis=1)
    here = np.arange(sides)
    after = (here + 1) % sides
    near, far = (here, sides + here, sides + after), (here, sides + after, after)
    return TriangleMesh(np.concatenate([inner * circle, outer * circle]), np.hstack([near, far]).T)


def rotation_to(direction: Array) -> Array:
    """Return a rotation, homogeneous (4, 4), that carries z to a unit vector."""
    x, y, z = (float(part) for part in direction)
    placement = np.eye(4)
    if z < -1.0 + 1e-12:
        placement[:3, :3] = np.diag([1.0, -1.0, -1.0])
        return placement
    # The shortest rotation: I + [w] + [w]^2 / (1 + z), with w = z axis x direction.
    w = np.array([[0.0, 0, x], [0, 0, y], [-x, -y, 0.0]])
    placement[:3, :3] = np.eye(3) + w + w @ w / (1.0 + z)
    return placement


def pointing(origin: Array, vector: Array) -> Array:
    """Return the placement (4, 4) of an arrow from a point, as long as the vector, m."""
    placement, length = _along(origin, vector)
    placement[:3, :3] *= length
    return placement


def between(start: Array, end: Array) -> Array:
    """Return the placement (4, 4) of a bar of length 1 along z that joins two points, m."""
    placement, length = _along(start, end - start)
    placement[:3, 2] *= length
    return placement


def _along(origin: Array, vector: Array) -> tuple[Array, float]:
    """Return a placement at a point with z along a vector, and the vector's length."""
    length = float(np.linalg.norm(vector))
    placement = rotation_to(vector / length) if length > 0.0 else np.eye(4)
    placement[:3, 3] = origin
    return placement, max(length, SMALLEST)


def _above(height: float) -> Array:
    return translated([0.0, 0.0, height])
