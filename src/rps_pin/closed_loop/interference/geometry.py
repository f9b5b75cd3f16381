"""Collision geometry of a mechanism: its links' shapes as a `pin.GeometryModel`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from pinocchio import coal

from rps_pin.closed_loop.interference import meshes
from rps_pin.closed_loop.interference.shapes import (
    KINDS,
    CollisionShapes,
    LinkShape,
    MeshFile,
)
from rps_pin.errors import InputError, RPSPinError, few


def collision_geometry(model: pin.Model, shapes: CollisionShapes) -> pin.GeometryModel:
    """Return the shapes on the links of a model, in the order in which they are given.

    Raises
    ------
    InputError
        If a shape cannot be built, or its link is not in the model; says which, and why.
    """
    found, faults, loader = pin.GeometryModel(), list(shapes.faults), coal.CachedMeshLoader()
    counts: dict[str, int] = {}
    for shape in shapes.shapes:
        counts[shape.link] = counts.get(shape.link, 0) + 1
        frame = link_frame(model, shape.link)
        if frame is None:
            faults.append(f"{shape.where}: link {shape.link!r} is not in the model any more")
            continue
        joint, at = model.frames[frame].parentJoint, model.frames[frame].placement
        try:
            path, geometry = _built(shape, shapes.package_path, loader)
        except RPSPinError as error:
            faults.append(f"{shape.where}: {error}")
            continue
        item = pin.GeometryObject(
            f"{shape.link}_{counts[shape.link] - 1}", joint, frame, at * shape.placement, geometry
        )
        item.meshPath = path
        found.addGeometryObject(item)
    if faults:
        raise InputError(f"collision shapes that cannot be used: {few(faults, 3)}")
    return found


def link_frame(model: pin.Model, name: str) -> int | None:
    """Return the index of a link's frame, or of another one if no link has the name; or None."""
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    found = [index for index, frame in enumerate(model.frames) if frame.name == name]
    return found[0] if found else None


def _built(shape: LinkShape, package_path: Sequence[str], loader: Any) -> tuple[str, Any]:
    """Return the path of a shape's mesh, if it has one, and Coal's shape."""
    if shape.fault:
        raise InputError(shape.fault)
    for name, size in zip(KINDS[shape.kind], shape.sizes, strict=True):
        if not 0 < size < np.inf:
            raise InputError(f"{shape.kind}: {name} = {size:g} m must be positive")
    kind, sizes, mesh = shape.kind, shape.sizes, shape.mesh
    if kind == "given":
        return "", as_solid(mesh)
    if isinstance(mesh, MeshFile):
        scale = np.array(mesh.scale)
        path, found = meshes.mesh_file(mesh.name, Path(mesh.beside), package_path, scale, loader)
        return path, meshes.solid_or_surface(*meshes.triangles_of(found))
    if kind == "mesh":
        return "", meshes.convex(mesh)
    if kind == "plane":
        return "", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    make = {
        "box": coal.Box,
        "sphere": coal.Sphere,
        "cylinder": coal.Cylinder,
        "capsule": coal.Capsule,
        "ellipsoid": coal.Ellipsoid,
    }[kind]
    return "", make(*sizes)


def as_solid(shape: Any) -> Any:
    """Return a shape of a `pin.GeometryModel` that was given; a mesh as a solid if it is convex."""
    if hasattr(shape, "tri_indices"):
        return meshes.solid_or_surface(*meshes.triangles_of(shape))
    return shape


def scaled(shape: Any, factor: float) -> Any:
    """Return Coal's shape with all lengths multiplied.

    Raises
    ------
    InputError
        If it is of a kind that is not known here.
    """
    if hasattr(shape, "tri_indices"):
        vertices, triangles = meshes.triangles_of(shape)
        return meshes.surface(factor * vertices, triangles)
    kind = type(shape).__name__
    if kind not in _SCALED:
        raise InputError(f"shapes of the kind {kind} are not checked for interference")
    return _SCALED[kind](shape, factor)


#: Coal's shapes, made anew with lengths multiplied.
_SCALED: dict[str, Callable[[Any, float], Any]] = {
    "Convex": lambda one, by: meshes.convex(
        by * np.array([one.point(k) for k in range(one.num_points)])
    ),
    "Box": lambda one, by: coal.Box(2.0 * by * one.halfSide),
    "Sphere": lambda one, by: coal.Sphere(by * one.radius),
    "Cylinder": lambda one, by: coal.Cylinder(by * one.radius, 2.0 * by * one.halfLength),
    "Capsule": lambda one, by: coal.Capsule(by * one.radius, 2.0 * by * one.halfLength),
    "Cone": lambda one, by: coal.Cone(by * one.radius, 2.0 * by * one.halfLength),
    "Ellipsoid": lambda one, by: coal.Ellipsoid(by * one.radii),
    "Halfspace": lambda one, by: coal.Halfspace(np.ravel(one.n), by * one.d),
}
