"""Collision-library shapes as Meshcat draws them.

Three differences are bridged here: Meshcat's cylinders stand along y, coal's along z; Meshcat has
no capsule; and coal keeps half lengths.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.arrays import Array
from rps_pin.errors import InputError

_Y_TO_Z: Array = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Turns Meshcat's y axis onto coal's z axis."""


class Part(NamedTuple):
    """One drawable piece of a shape."""

    geometry: Any
    """A ``meshcat.geometry.Geometry`` (an untyped library)."""
    placement: Array
    """Its homogeneous 4 x 4 placement in the shape's own frame, in metres."""


def parts_of(item: pin.GeometryObject) -> list[Part]:
    """Return the pieces that draw a geometry.

    Parameters
    ----------
    item
        A box, cylinder, sphere, capsule, cone, ellipsoid or triangle mesh.

    Returns
    -------
    list of Part
        One piece; three for a capsule.

    Raises
    ------
    InputError
        If the shape is of another kind.
    """
    shape = item.geometry
    if isinstance(shape, coal.Capsule):
        return _capsule(float(shape.halfLength), float(shape.radius))
    geometry = _geometry_of(shape)
    if geometry is None:
        raise InputError(
            f"the geometry {item.name!r} is a {type(shape).__name__}; the viewer draws boxes, "
            "cylinders, spheres, capsules, cones, ellipsoids and triangle meshes"
        )
    return [_upright(geometry) if isinstance(geometry, mg.Cylinder) else _centred(geometry)]


def _geometry_of(shape: coal.CollisionGeometry) -> Any:
    """Return the one Meshcat geometry of this size, or None where there is none."""
    geometry: Any = None
    match shape:
        case coal.Box():
            geometry = mg.Box([2.0 * float(half) for half in shape.halfSide])
        case coal.Sphere():
            geometry = mg.Sphere(float(shape.radius))
        case coal.Ellipsoid():
            geometry = mg.Ellipsoid([float(radius) for radius in shape.radii])
        case coal.Cylinder():
            geometry = mg.Cylinder(2.0 * float(shape.halfLength), float(shape.radius))
        case coal.Cone():
            height, radius = 2.0 * float(shape.halfLength), float(shape.radius)
            geometry = mg.Cylinder(height, radiusTop=0.0, radiusBottom=radius)
        case coal.BVHModelBase() if shape.num_tris > 0:
            geometry = _mesh(shape)
    return geometry


def material_of(item: pin.GeometryObject) -> Any:
    """Return a shaded Meshcat material in the geometry's colour and opacity (`meshColor`)."""
    red, green, blue, opacity = (float(value) for value in np.clip(item.meshColor, 0.0, 1.0))
    colour = (round(255 * red) << 16) | (round(255 * green) << 8) | round(255 * blue)
    # A mesh shares its vertices between faces: smooth shading would round off a machine's edges.
    flat = isinstance(item.geometry, coal.BVHModelBase)
    return mg.MeshPhongMaterial(
        color=colour, opacity=opacity, flatShading=flat, specular=0x303030, shininess=40
    )


def _centred(geometry: Any) -> Part:
    return Part(geometry, np.eye(4))


def _upright(geometry: Any) -> Part:
    return Part(geometry, _Y_TO_Z)


def _capsule(half_length: float, radius: float) -> list[Part]:
    """Return a cylinder along z with a ball at either end."""
    ends = []
    for height in (-half_length, half_length):
        placement = np.eye(4)
        placement[2, 3] = height
        ends.append(Part(mg.Sphere(radius), placement))
    return [_upright(mg.Cylinder(2.0 * half_length, radius)), *ends]


def _mesh(shape: coal.BVHModelBase) -> Any:
    """Return a mesh's triangles; coal has applied the URDF's scale to them already."""
    triangles = (shape.tri_indices(index) for index in range(shape.num_tris))
    corners = np.array([[triangle[0], triangle[1], triangle[2]] for triangle in triangles])
    return mg.TriangularMeshGeometry(shape.vertices(), corners)
