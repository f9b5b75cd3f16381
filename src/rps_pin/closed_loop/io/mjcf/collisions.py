"""Collision shapes of an MJCF: its geoms with contacts, and the pairs of bodies that it excludes.

Geoms without ``contype`` and ``conaffinity`` are pictures. A mesh touches at its convex hull, as in
MuJoCo, and a plane is endless.
"""

from __future__ import annotations

import numpy as np

from rps_pin.closed_loop.interference.shapes import CollisionShapes, LinkShape
from rps_pin.closed_loop.io.mjcf.tree import MjcfTree, pose_of

#: Kinds of geoms by MuJoCo's names; sizes are half lengths there but for radii.
_KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


def collisions_of(tree: MjcfTree) -> CollisionShapes:
    """Return the collision shapes of a file."""
    source, m = tree.source, tree.source.model
    if source.without_shapes:
        return CollisionShapes(faults=(f"{source.origin}: {source.without_shapes}",))
    shapes = [
        _shape(tree, geom)
        for geom in range(m.ngeom)
        if m.geom_contype[geom] | m.geom_conaffinity[geom]
    ]
    ignored = [
        (tree.bodies[int(both) >> 16], tree.bodies[int(both) & 0xFFFF])
        for both in m.exclude_signature
    ]
    return CollisionShapes(tuple(shapes), tuple(ignored))


def _shape(tree: MjcfTree, geom: int) -> LinkShape:
    source, m = tree.source, tree.source.model
    types = source.mujoco.mjtGeom
    named = {int(getattr(types, f"mjGEOM_{kind.upper()}")): kind for kind in _KINDS}
    named[int(types.mjGEOM_SDF)] = "mesh"
    kind = named.get(int(m.geom_type[geom]), "")
    link = tree.bodies[int(m.geom_bodyid[geom])]
    name = m.geom(geom).name
    where = f"{source.origin}: geom {name or geom!r} of body {link!r}"
    at = pose_of(m.geom_pos[geom], m.geom_quat[geom])
    mask = int(m.geom_contype[geom]), int(m.geom_conaffinity[geom])
    if not kind:
        return LinkShape(link, where, fault="height fields are not read", mask=mask)
    points = None
    if kind == "mesh":
        mesh = int(m.geom_dataid[geom])
        first = int(m.mesh_vertadr[mesh])
        points = np.array(m.mesh_vert[first : first + int(m.mesh_vertnum[mesh])], dtype=np.float64)
    a, b, c = (float(size) for size in m.geom_size[geom])
    sizes: dict[str, tuple[float, ...]] = {
        "sphere": (a,),
        "capsule": (a, 2 * b),
        "cylinder": (a, 2 * b),
        "ellipsoid": (a, b, c),
        "box": (2 * a, 2 * b, 2 * c),
    }
    return LinkShape(link, where, kind, sizes.get(kind, ()), at, points, mask=mask)
