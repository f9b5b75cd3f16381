"""Collision shapes of a URDF's links, and the pairs of links that it leaves out.

The shapes are URDF's (box, cylinder, sphere, mesh), and capsule and ellipsoid, also with Drake's
prefix. ``drake:collision_filter_group`` elements name pairs that may overlap. Nothing is refused
here: what cannot be used has its reason beside it, for when shapes are asked for.
"""

from __future__ import annotations

from itertools import product
from typing import Any

from rps_pin.closed_loop.interference.shapes import CollisionShapes, LinkShape, MeshFile
from rps_pin.closed_loop.io.urdf.elements import UrdfFile
from rps_pin.closed_loop.io.urdf.vocabulary import child, children, get, tag_of
from rps_pin.errors import MechanismError

#: Attributes of the shapes' elements, and how many numbers each is.
SIZES: dict[str, tuple[tuple[str, int], ...]] = {
    "box": (("size", 3),),
    "sphere": (("radius", 1),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "ellipsoid": (("a", 1), ("b", 1), ("c", 1)),
}
_GROUP = "drake:collision_filter_group"


def collisions_of(file: UrdfFile) -> CollisionShapes:
    """Return the collision shapes of a file."""
    shapes = [
        _shape(file, link, element)
        for link, of_link in file.links.items()
        for element in children(of_link, "collision")
    ]
    ignored: list[tuple[str, str]] = []
    faults: list[str] = []
    try:
        ignored = _filtered(file)
    except MechanismError as error:
        faults.append(str(error))
    return CollisionShapes(tuple(shapes), tuple(ignored), tuple(faults))


def _shape(file: UrdfFile, link: str, element: Any) -> LinkShape:
    where = f"{file.origin}, line {element.sourceline}: link {link!r}"
    geometry = child(element, "geometry")
    inside = [] if geometry is None else list(geometry.iterchildren("*"))
    if len(inside) != 1:
        return LinkShape(link, where, fault="its collision has no geometry, or several")
    form, kind = inside[0], tag_of(inside[0]).removeprefix("drake:")
    try:
        at = file.placement(child(element, "origin"))
        if kind == "mesh":
            x, y, z = file.numbers(form, "scale", 3, (1, 1, 1))
            mesh = MeshFile(file.name_of(form, "filename"), file.origin, (x, y, z))
            return LinkShape(link, where, kind, (), at, mesh)
        if kind not in SIZES:
            known = ", ".join((*SIZES, "mesh"))
            return LinkShape(link, where, fault=f"<{kind}> is not a shape; there are: {known}")
        sizes = [n for name, count in SIZES[kind] for n in file.numbers(form, name, count)]
        return LinkShape(link, where, kind, tuple(sizes), at)
    except MechanismError as error:
        return LinkShape(link, where, fault=str(error))


# Drake's filter groups ----------------------------------------------------------------------------


def _filtered(file: UrdfFile) -> list[tuple[str, str]]:
    """Return the pairs of links that groups leave out."""
    groups = {file.name_of(one): one for one in children(file.robot, _GROUP)}
    found: list[tuple[str, str]] = []
    for name, element in groups.items():
        if get(element, "ignore") is not None:
            continue
        for other in children(element, "drake:ignored_collision_filter_group"):
            ignored = file.known(other, "name", list(groups), f"{_GROUP} {name!r}")
            both = product(_members(file, groups, name, ()), _members(file, groups, ignored, ()))
            found += [(a, b) for a, b in both if a != b]
    return list(dict.fromkeys(found))


def _members(
    file: UrdfFile, groups: dict[str, Any], name: str, above: tuple[str, ...]
) -> list[str]:
    element = groups[name]
    if name in above:
        file.refuse(element, f"{_GROUP} {name!r} is a member of itself")
    what = f"{_GROUP} {name!r}"
    found = [
        file.known(one, "link", list(file.links), what) for one in children(element, "drake:member")
    ]
    for one in children(element, "drake:member_group"):
        inner = file.known(one, "name", list(groups), what)
        found += _members(file, groups, inner, (*above, name))
    return found
