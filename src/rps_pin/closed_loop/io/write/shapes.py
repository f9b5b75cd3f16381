"""Shapes of links as the ``visual`` and ``collision`` elements of a URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.interference.geometry import link_frame
from rps_pin.closed_loop.interference.shapes import CollisionShapes, LinkShape, MeshFile
from rps_pin.closed_loop.io.urdf.packages import file_of
from rps_pin.closed_loop.io.write.links import Hung
from rps_pin.closed_loop.io.write.numbers import number, numbers
from rps_pin.errors import InputError, few

_NAMES = {
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "ellipsoid": ("a", "b", "c"),
}


def add_visuals(link: Any, shapes: pin.GeometryModel, joint: int) -> None:
    """Add the shapes that move with a joint to its link; meshes by the paths of their files."""
    for shape in shapes.geometryObjects:
        if shape.parentJoint != joint:
            continue
        form = _form(shape)
        if form is None:
            continue
        visual = etree.SubElement(link, "visual", name=shape.name)
        etree.SubElement(
            visual,
            "origin",
            xyz=numbers(shape.placement.translation),
            rpy=numbers(pin.rpy.matrixToRpy(shape.placement.rotation)),
        )
        tag, attributes = form
        etree.SubElement(etree.SubElement(visual, "geometry"), tag, attributes)
        if shape.overrideMaterial or tag != "mesh":
            material = etree.SubElement(visual, "material", name=f"{shape.name}_colour")
            etree.SubElement(material, "color", rgba=numbers(shape.meshColor))


def _form(shape: Any) -> tuple[str, dict[str, str]] | None:
    """Return a shape's element; None for one that URDF does not have."""
    form, kind = shape.geometry, type(shape.geometry).__name__
    if shape.meshPath not in ("", "BOX", "SPHERE", "CYLINDER", "CAPSULE"):
        return "mesh", {"filename": shape.meshPath, "scale": numbers(shape.meshScale.ravel())}
    if kind == "Box":
        return "box", {"size": numbers(2 * form.halfSide.ravel())}
    if kind == "Sphere":
        return "sphere", {"radius": number(form.radius)}
    if kind in ("Cylinder", "Capsule"):
        sizes = {"radius": number(form.radius), "length": number(2 * form.halfLength)}
        return kind.lower(), sizes
    return None


# Collision shapes ---------------------------------------------------------------------------------


def add_collisions(
    robot: Any,
    model: pin.Model,
    links: Mapping[int, Hung],
    shapes: CollisionShapes,
    told: list[str],
) -> list[tuple[str, str]]:
    """Add shapes to the links of a URDF; return the pairs of links that may overlap.

    Parameters
    ----------
    robot
        The root element.
    model, links
        The tree, and of each of its frames the link, with its placement in the joint's frame.
    shapes
        The shapes.
    told
        Takes a sentence on what is left out.
    """
    elements = {link.get("name"): link for link in robot.iter("link")}
    left_out = list(shapes.faults)
    written: list[tuple[str, LinkShape]] = []
    names: dict[str, str] = {}
    for shape in shapes.shapes:
        form = _stated(shape, shapes.package_path)
        frame = link_frame(model, shape.link)
        if isinstance(form, str) or frame is None:
            left_out.append(f"{shape.where} ({form if isinstance(form, str) else 'no link'})")
            continue
        hung = links[frame]
        at = hung.placement.actInv(model.frames[frame].placement * shape.placement)
        collision = etree.SubElement(elements[hung.link], "collision")
        angles = numbers(pin.rpy.matrixToRpy(at.rotation))
        etree.SubElement(collision, "origin", xyz=numbers(at.translation), rpy=angles)
        etree.SubElement(etree.SubElement(collision, "geometry"), form[0], form[1])
        names[shape.link] = hung.link
        written.append((hung.link, shape))
    if left_out:
        told.append(f"collision shapes are left out: {few(left_out)}")
    ignored = [(names.get(a, a), names.get(b, b)) for a, b in shapes.ignored]
    apart: dict[tuple[str, str], bool] = {}
    for (a, one), (b, other) in combinations(written, 2):
        if a != b:
            apart[a, b] = apart.get((a, b), False) or one.may_touch(other)
    known = {link.get("name") for link in robot.iter("link")}
    ignored += [pair for pair, touch in apart.items() if not touch]
    return [pair for pair in dict.fromkeys(ignored) if known.issuperset(pair)]


def _stated(shape: LinkShape, package_path: Sequence[str]) -> tuple[str, dict[str, str]] | str:
    """Return a shape's element, or why there is none."""
    if shape.fault:
        return shape.fault
    if isinstance(shape.mesh, MeshFile):
        try:
            path = file_of(shape.mesh.name, Path(shape.mesh.beside), package_path).absolute()
        except InputError as error:
            return str(error)
        return "mesh", {"filename": str(path), "scale": numbers(shape.mesh.scale)}
    if shape.kind == "box":
        return "box", {"size": numbers(shape.sizes)}
    if shape.kind in _NAMES:
        words = zip(_NAMES[shape.kind], shape.sizes, strict=True)
        return shape.kind, {name: number(size) for name, size in words}
    return f"a {shape.kind} that no file has"
