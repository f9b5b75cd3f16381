"""Shapes of links as the ``visual`` elements of a URDF."""

from __future__ import annotations

from typing import Any

import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.write.numbers import number, numbers


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
