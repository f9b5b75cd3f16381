"""What layers are made of: arrows, crosses of axes, balls, tubes; and where a node stands."""

from __future__ import annotations

import meshcat.geometry as mg
import numpy as np

from rps_pin.arrays import Array
from rps_pin.viewer.layers.base import UNSEEN, Part

#: Okabe and Ito's colours, told apart by all; each layer has one of its own.
BLACK, ORANGE, SKY, GREEN = 0x26323F, 0xE69F00, 0x56B4E9, 0x009E73
YELLOW, BLUE, VERMILLION, PURPLE = 0xF0E442, 0x0072B2, 0xD55E00, 0xCC79A7

_SHAFT, _HEAD, _HEAD_LENGTH = 0.028, 0.07, 0.22
"""Radii of an arrow's shaft and head, and the head's length, of an arrow of length 1."""


def css(colour: int) -> str:
    """Return a colour as ``#rrggbb``."""
    return f"#{colour:06x}"


def paint(colour: int, opacity: float = 1.0, *, on_top: bool = False) -> mg.MeshPhongMaterial:
    """Return a material.

    Parameters
    ----------
    colour
        As 0xrrggbb.
    opacity
        1 hides what is behind it.
    on_top
        Whether it is drawn over all else, as a mark on the picture.
    """
    more = {"depthTest": False} if on_top else {}
    return mg.MeshPhongMaterial(
        color=colour,
        opacity=opacity,
        transparent=on_top or opacity < 1.0,
        depthWrite=opacity >= 1.0 and not on_top,
        specular=0x202020,
        shininess=20,
        **more,
    )


def arrow(node: str, colour: int) -> list[Part]:
    """Return an arrow from the node's origin to (0, 0, 1)."""
    material = paint(colour)
    straight = 1.0 - _HEAD_LENGTH
    return [
        Part(node, "shaft", mg.Cylinder(straight, _SHAFT), material, along_z(straight / 2)),
        Part(
            node,
            "head",
            mg.Cylinder(_HEAD_LENGTH, radiusTop=0.0, radiusBottom=_HEAD),
            paint(colour),
            along_z(1.0 - _HEAD_LENGTH / 2),
        ),
    ]


def double_arrow(node: str, colour: int) -> list[Part]:
    """Return an arrow with two heads, as moments are drawn."""
    second = Part(
        node,
        "second_head",
        mg.Cylinder(_HEAD_LENGTH, radiusTop=0.0, radiusBottom=_HEAD),
        paint(colour),
        along_z(1.0 - 1.3 * _HEAD_LENGTH),
    )
    return [*arrow(node, colour), second]


def cross(node: str, length: float) -> list[Part]:
    """Return three axes: x red, y green, z blue, as everywhere in robotics."""
    axes = (("x", 0xD62728, (0, 1)), ("y", 0x2CA02C, (1, 2)), ("z", 0x1F5FD0, (2, 0)))
    parts = []
    for index, (name, colour, _) in enumerate(axes):
        placement = np.eye(4)
        placement[:3, :3] = turned_to(np.eye(3)[index])[:3, :3]
        placement = placement @ along_z(length / 2)
        parts.append(
            Part(node, name, mg.Cylinder(length, 0.022 * length), paint(colour), placement)
        )
    return parts


def ball(node: str, radius: float, colour: int, opacity: float = 1.0) -> list[Part]:
    """Return a ball about the node's origin."""
    return [Part(node, "ball", mg.Sphere(radius), paint(colour, opacity), np.eye(4))]


def along_z(height: float) -> Array:
    """Return the placement of a Meshcat cylinder (which stands along y) along z, at a height."""
    return np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, height], [0, 0, 0, 1]])


def turned_to(direction: Array) -> Array:
    """Return a rotation, homogeneous (4, 4), that carries z to a unit vector."""
    x, y, z = (float(part) for part in direction)
    placement = np.eye(4)
    if z < -1.0 + 1e-12:
        placement[:3, :3] = np.diag([1.0, -1.0, -1.0])
        return placement
    # The shortest way: I + [w] + [w]^2 / (1 + z), with w = z axis x direction.
    w = np.array([[0.0, 0, x], [0, 0, y], [-x, -y, 0.0]])
    placement[:3, :3] = np.eye(3) + w + w @ w / (1.0 + z)
    return placement


def pointing(origin: Array, vector: Array) -> Array:
    """Return the placement (4, 4) of an arrow from a point, as long as the vector, m."""
    length = float(np.linalg.norm(vector))
    placement = turned_to(vector / length) if length > 0.0 else np.eye(4)
    placement[:3, :3] *= max(length, UNSEEN)
    placement[:3, 3] = origin
    return placement


def between(start: Array, end: Array) -> Array:
    """Return the placement (4, 4) of a bar of length 1 along z that joins two points, m."""
    length = float(np.linalg.norm(end - start))
    placement = turned_to((end - start) / length) if length > 0.0 else np.eye(4)
    placement[:3, 2] *= max(length, UNSEEN)
    placement[:3, 3] = start
    return placement


def at(point: Array) -> Array:
    """Return the placement (4, 4) of what stands at a point."""
    placement = np.eye(4)
    placement[:3, 3] = point
    return placement


def round_number(wanted: float) -> float:
    """Return 1, 2 or 5 times a power of ten, the largest that is not above `wanted`."""
    decade = 10.0 ** np.floor(np.log10(wanted))
    steps = (step * decade for step in (1.0, 2.0, 5.0) if step * decade <= wanted * (1 + 1e-9))
    return float(max(steps, default=decade))


def length_text(length: float) -> str:
    """Return a length in words, in a unit that suits it."""
    if length >= 1.0:
        return f"{length:.3g} m"
    return f"{1e3 * length:.3g} mm" if length >= 1e-4 else f"{1e6 * length:.3g} µm"


def tube(points: Array, radius: float, sides: int = 6) -> mg.TriangularMeshGeometry:
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
    faces = np.concatenate(
        [
            np.stack([first, beside, beside + sides], axis=1),
            np.stack([first, beside + sides, first + sides], axis=1),
        ]
    )
    return mg.TriangularMeshGeometry(vertices, faces)
