"""What an MJCF has for pictures, contacts and sensors alone, and MuJoCo may fail to read."""

from __future__ import annotations

from typing import Any

_LISTS = ("materials", "textures", "skins", "sensors", "hfields")


def without_appearance(spec: Any, mujoco: Any) -> Any:
    """Return a specification, changed: without what no number of the mechanism needs.

    These are materials, textures, skins, sensors, height fields, and meshes that give no mass: of
    bodies that have an ``inertial`` or cannot move, or of no mass. Small spheres without mass take
    the places of shapes, which other elements may name.
    """
    kinds = mujoco.mjtGeom
    needed = set()
    for geom in spec.geoms:
        if geom.meshname and _gives_mass(spec, geom):
            needed.add(geom.meshname)
        elif geom.meshname or geom.type in (kinds.mjGEOM_MESH, kinds.mjGEOM_HFIELD):
            geom.type, geom.size, geom.mass = kinds.mjGEOM_SPHERE, [0.01, 0.0, 0.0], 0.0
            geom.meshname = geom.hfieldname = ""
    for one in (*spec.geoms, *spec.sites, *spec.tendons, *spec.meshes):
        if hasattr(one, "material"):  # meshes of older MuJoCos have none
            one.material = ""
    unused = [mesh for mesh in spec.meshes if mesh.name not in needed]
    for one in (*unused, *(one for name in _LISTS for one in getattr(spec, name))):
        spec.delete(one)
    return spec


def _gives_mass(spec: Any, geom: Any) -> bool:
    """Return whether the mass or inertia of a body that moves needs a shape."""
    compiler = getattr(geom, "compiler", spec.compiler)
    body = geom.parent
    if int(compiler.inertiafromgeom) != 1 and (
        body.explicitinertial or not int(compiler.inertiafromgeom)
    ):
        return False
    lowest, highest = compiler.inertiagrouprange
    if not lowest <= geom.group <= highest or geom.mass == 0:
        return False
    if geom.mass != geom.mass and geom.density == 0:  # not a number: by its density
        return False
    return compiler.settotalmass > 0 or _moves(body)


def _moves(body: Any) -> bool:
    while body is not None:
        if len(body.joints):
            return True
        body = body.parent
    return False
