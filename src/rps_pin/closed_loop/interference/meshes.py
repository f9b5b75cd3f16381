"""Meshes: read, as convex solids or as surfaces, and points inside of surfaces."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pinocchio import coal
from scipy.spatial import ConvexHull, QhullError

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.io.urdf.packages import file_of
from rps_pin.errors import InputError
from rps_pin.files import known_format, opened

#: A mesh whose volume is that of its convex hull, to this part of it, is convex.
_CONVEX = 1e-6


def mesh_file(
    name: str, urdf: Path, package_path: Sequence[str | os.PathLike[str]], scale: Array, loader: Any
) -> tuple[str, Any]:
    """Return the path of a mesh that a URDF names, and Coal's surface of triangles, m.

    Raises
    ------
    InputError
        If it is not found, or cannot be read as a mesh.
    """
    found = str(file_of(name, urdf, package_path).absolute())
    try:
        triangles = loader.load(found, np.broadcast_to(scale, 3).copy())
        usable = triangles.num_tris > 0 and np.isfinite(triangles.vertices()).all()
    except (ValueError, RuntimeError, IndexError):
        usable = False
    if not usable:
        with opened(found, "mesh") as file:
            what = known_format(file.read(1000))
        why = f": it is {what}" if what else ""
        raise InputError(f"{name!r}: {found} cannot be read as a mesh{why}")
    return found, triangles


def triangles_of(surface: Any) -> tuple[Array, Indices]:
    """Return the vertices (n, 3) and triangles (t, 3) of Coal's surface."""
    of = (surface.tri_indices(k) for k in range(surface.num_tris))
    return np.array(surface.vertices()), np.array([[one[0], one[1], one[2]] for one in of])


def solid_or_surface(vertices: Array, triangles: Indices) -> Any:
    """Return Coal's convex solid of triangles that bound one, else its surface of triangles."""
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):  # of one plane
        return surface(vertices, triangles)
    a, b, c = (vertices[triangles[:, k]] - vertices.mean(axis=0) for k in range(3))
    volume = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6)
    if abs(volume - hull.volume) > _CONVEX * hull.volume:
        return surface(vertices, triangles)
    return convex(vertices, hull)


def convex(vertices: Array, hull: Any = None) -> Any:
    """Return Coal's solid of the convex hull of points (n, 3).

    Raises
    ------
    InputError
        If the points lie in one plane.
    """
    try:
        hull = ConvexHull(vertices) if hull is None else hull
    except (QhullError, ValueError):
        raise InputError("the convex hull of its vertices has no volume") from None
    number = np.zeros(len(vertices), dtype=np.intp)
    number[hull.vertices] = np.arange(hull.vertices.size)
    a, b, c = (vertices[hull.simplices[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) > 0
    sides = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
    return coal.Convex(_points(vertices[hull.vertices]), _triangles(number[sides]))


def surface(vertices: Array, triangles: Indices) -> Any:
    """Return Coal's surface of triangles."""
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(triangles), len(vertices))
    found.addSubModel(_points(vertices), _triangles(triangles))
    found.endModel()
    return found


def is_inside(point: Array, corners: Array) -> bool:
    """Return whether a point is inside a closed surface of triangles (t, 3, 3): its winding number.

    By the solid angles of van Oosterom and Strackee (1983).
    """
    a, b, c = (corners[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    dot = np.einsum
    below = la * lb * lc + dot("ij,ij->i", a, b) * lc
    below = below + dot("ij,ij->i", a, c) * lb + dot("ij,ij->i", b, c) * la
    angles = np.arctan2(dot("ij,ij->i", a, np.cross(b, c)), below)
    return bool(abs(angles.sum()) > np.pi)  # of 2 pi


def _points(vertices: Array) -> Any:
    found = coal.StdVec_Vec3s()
    for vertex in np.asarray(vertices, dtype=np.float64):
        found.append(vertex)
    return found


def _triangles(numbers: Indices) -> Any:
    found = coal.StdVec_Triangle()
    for one in numbers.tolist():
        found.append(coal.Triangle(*one))
    return found
