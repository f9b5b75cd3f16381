"""Colours of mesh files: where a URDF gives a mesh no material, those of its own file count.

COLLADA, OBJ (with its MTL) and PLY files have them. A surface with a texture is coloured at its
vertices.
"""

from __future__ import annotations

import contextlib
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh
from pinocchio import coal

from rps_pin.arrays import Array
from rps_pin.viewer.scene.shapes import Material, TriangleMesh, colour_of

_WITH_COLOURS = (".dae", ".obj", ".ply")
_SAME = 1e-3
"""Greatest difference of the box of a mesh as coal and as trimesh read it, in parts of its size."""


def own_colours(item: pin.GeometryObject) -> list[tuple[TriangleMesh, Material]]:
    """Return the surfaces of a mesh in the colours of its file, in the geometry's frame.

    Parameters
    ----------
    item
        Any geometry.

    Returns
    -------
    list of (TriangleMesh, Material)
        One for each material. Empty where the URDF gives the colour, the geometry is no mesh, or
        its file has no colours, or not in a way that is read.
    """
    path = Path(item.meshPath)
    mesh = isinstance(item.geometry, coal.BVHModelBase)
    if item.overrideMaterial or not mesh or path.suffix.lower() not in _WITH_COLOURS:
        return []
    found: list[tuple[TriangleMesh, Material]] = []
    # Whatever a file of others has: the shape is drawn, in grey.
    with contextlib.suppress(Exception), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = _surfaces(str(path), path.stat().st_mtime_ns)
    scaled = [
        (TriangleMesh(shape.vertices * item.meshScale, shape.faces, shape.colours), material)
        for shape, material in found
    ]
    return scaled if scaled and _same_box([one.vertices for one, _ in scaled], item) else []


def _same_box(vertices: list[Array], item: pin.GeometryObject) -> bool:
    """Return whether vertices fill the box of a geometry's mesh: the same units, the same axes."""
    own, read = item.geometry.vertices(), np.concatenate(vertices)
    sides = [np.array([one.min(axis=0), one.max(axis=0)]) for one in (own, read)]
    size = float(np.ptp(own, axis=0).max())
    return bool(np.abs(sides[0] - sides[1]).max() <= _SAME * size)


@lru_cache(maxsize=128)
def _surfaces(path: str, changed: int) -> list[tuple[TriangleMesh, Material]]:
    """Return the surfaces of a file, last changed then; empty where it has no colours."""
    scene: Any = trimesh.load_scene(path)
    found: list[tuple[TriangleMesh, Material]] = []
    coloured = False
    for node in scene.graph.nodes_geometry:
        placement, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh):
            continue
        colours, colour = _colours(mesh.visual)
        if colours is None:  # vertices that differ in their place on a texture alone
            mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
        points = mesh.vertices @ placement[:3, :3].T + placement[:3, 3]
        coloured |= colours is not None or colour is not None
        material = Material(0xE6E6E6 if colour is None else colour_of(colour), flat=True)
        found.append((TriangleMesh(np.array(points), np.array(mesh.faces), colours), material))
    return found if coloured else []


def _colours(visual: Any) -> tuple[Array | None, Array | None]:
    """Return colours of the vertices (n, 3), or one colour (3,), 0 to 1; None where not given."""
    if visual.kind == "vertex":
        return np.asarray(visual.vertex_colors)[:, :3] / 255.0, None
    if visual.kind == "face":
        return None, np.asarray(visual.main_color)[:3] / 255.0
    if visual.kind != "texture":
        return None, None
    material = visual.material
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None and visual.uv is not None:
        return np.asarray(visual.to_color().vertex_colors)[:, :3] / 255.0, None
    return None, np.asarray(material.main_color)[:3] / 255.0
