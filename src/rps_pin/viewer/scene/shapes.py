"""Shapes, materials and parts of a scene, as plain data; and those of a robot's geometry.

Lengths are in metres, and every shape has its own frame at its centre. A cylinder stands along z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError


class Box(NamedTuple):
    """A box along the axes of its frame."""

    size: tuple[float, float, float]
    """Lengths of its edges along x, y, z."""


class Sphere(NamedTuple):
    """A ball."""

    radius: float


class Ellipsoid(NamedTuple):
    """An ellipsoid along the axes of its frame."""

    radii: tuple[float, float, float]


class Cylinder(NamedTuple):
    """A cylinder along z, or a cone with its tip up where the upper radius is zero."""

    length: float
    radius: float
    """Of its lower end."""
    upper_radius: float


class TriangleMesh(NamedTuple):
    """Triangles between vertices."""

    vertices: Array
    """Shape (n, 3)."""
    faces: Indices
    """Indices of vertices, shape (m, 3)."""
    colours: Array | None = None
    """Red, green and blue of each vertex, 0 to 1, shape (n, 3); None for the material's colour."""


class LineSegments(NamedTuple):
    """Straight lines between pairs of points."""

    points: Array
    """Two rows for each line, shape (2 n, 3)."""
    colours: Array | None = None
    """Red, green and blue of each point, 0 to 1, shape (2 n, 3); None for the material's colour."""


Shape = Box | Sphere | Ellipsoid | Cylinder | TriangleMesh | LineSegments


class Material(NamedTuple):
    """Surface of a shape."""

    colour: int
    """As 0xrrggbb."""
    opacity: float = 1.0
    """0 is invisible, 1 hides what is behind."""
    flat: bool = False
    """Whether each triangle has one shade; else the surface looks rounded."""
    on_top: bool = False
    """Whether it is drawn over everything else, where the front end can."""
    through: bool = False
    """Whether it is drawn only where something else hides it, where the front end can."""


class Part(NamedTuple):
    """A shape with its material, fixed to a node of the scene tree."""

    node: str
    """Name of the node; empty for the robot's or layer's own node."""
    name: str
    """Its own name below the node."""
    shape: Shape
    material: Material
    placement: Array
    """Homogeneous (4, 4), in the node's frame."""


def drawn_shapes(item: pin.GeometryObject) -> list[tuple[Shape, Array]]:
    """Return the shapes that draw a geometry, each with its placement in the geometry's frame.

    Parameters
    ----------
    item
        A box, cylinder, sphere, capsule, cone, ellipsoid or triangle mesh.

    Returns
    -------
    list of (Shape, ndarray of shape (4, 4))
        One shape; three for a capsule: a cylinder and a ball at either end.

    Raises
    ------
    InputError
        If the geometry is of another kind.
    """
    shape, here = item.geometry, np.eye(4)
    match shape:
        case coal.Capsule():
            half, radius = float(shape.halfLength), float(shape.radius)
            ends = [(Sphere(radius), translated([0.0, 0.0, height])) for height in (-half, half)]
            return [(Cylinder(2.0 * half, radius, radius), here), *ends]
        case coal.Box():
            x, y, z = (2.0 * float(half) for half in shape.halfSide)
            return [(Box((x, y, z)), here)]
        case coal.Sphere():
            return [(Sphere(float(shape.radius)), here)]
        case coal.Ellipsoid():
            a, b, c = (float(radius) for radius in shape.radii)
            return [(Ellipsoid((a, b, c)), here)]
        case coal.Cylinder() | coal.Cone():
            radius = float(shape.radius)
            upper = radius if isinstance(shape, coal.Cylinder) else 0.0
            return [(Cylinder(2.0 * float(shape.halfLength), radius, upper), here)]
        case coal.BVHModelBase() if shape.num_tris > 0:
            # coal has applied the URDF's scale to the vertices already.
            triangles = (shape.tri_indices(index) for index in range(shape.num_tris))
            faces = np.array([[triangle[0], triangle[1], triangle[2]] for triangle in triangles])
            return [(TriangleMesh(shape.vertices(), faces), here)]
    raise InputError(
        f"the geometry {item.name!r} is a {type(shape).__name__}; the viewer draws boxes, "
        "cylinders, spheres, capsules, cones, ellipsoids and triangle meshes"
    )


def material_of(item: pin.GeometryObject) -> Material:
    """Return a material with the geometry's colour and opacity (`meshColor`)."""
    colour, opacity = colour_of(item.meshColor), float(np.clip(item.meshColor[3], 0.0, 1.0))
    # Faces of a mesh share their vertices: smooth shading would round off its edges.
    return Material(colour, opacity, flat=isinstance(item.geometry, coal.BVHModelBase))


def colour_of(shares: Array) -> int:
    """Return red, green and blue, 0 to 1, as 0xrrggbb."""
    red, green, blue = (round(255 * float(share)) for share in np.clip(shares[:3], 0.0, 1.0))
    return (red << 16) | (green << 8) | blue


def translated(point: Array | list[float]) -> Array:
    """Return the placement (4, 4) at a point, not rotated."""
    placement = np.eye(4)
    placement[:3, 3] = point
    return placement
