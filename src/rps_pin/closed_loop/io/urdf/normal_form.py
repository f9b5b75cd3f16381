"""The plain URDF that Pinocchio's parser is given, from a file of any of the dialects.

It has links, their inertias and shapes, and joints of the types that Pinocchio reads well. Names
and order are the file's, and its numbers to the last digit. Every moving joint has stand-in limits,
and a joint of another type stands in as a revolute one: `tree` sets limits and types in the model.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.urdf.elements import INERTIAS, Inertial, UrdfFile, UrdfJoint
from rps_pin.closed_loop.io.urdf.vocabulary import child, children, get, tag_of
from rps_pin.errors import InputError

#: Types as Pinocchio is told them; of the others, revolute.
_STAND_IN = {"prismatic": "prismatic", "fixed": "fixed", "floating": "floating", "planar": "planar"}
#: Numbers that shapes need.
_SIZES: dict[str, tuple[tuple[str, int], ...]] = {
    "box": (("size", 3),),
    "sphere": (("radius", 1),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
}


class Shapes(NamedTuple):
    """What of the visuals is drawn."""

    mesh: Callable[[dict[str, str]], str]
    """The path of a mesh by its attributes; raises `InputError` where it cannot be drawn."""
    missing: list[str]
    """Here come the reasons why shapes are left out."""
    links: Collection[str]
    """Names of the links that the model has."""


def normal_form(file: UrdfFile, shapes: Shapes | None = None) -> str:
    """Return the text for Pinocchio.

    Parameters
    ----------
    file
        A URDF's contents.
    shapes
        What is drawn; None: nothing.
    """
    robot = etree.Element("robot", name=get(file.robot, "name") or "robot")
    if shapes is not None:
        named = {get(one, "name") or "": one for one in children(file.robot, "material")}
        for material in named.values():
            _material(file, material, robot)
    for name, element in file.links.items():
        link = etree.SubElement(robot, "link", name=name)
        if name in file.inertials:
            _inertial(file, file.inertials[name], etree.SubElement(link, "inertial"))
        if shapes is not None:
            for visual in children(element, "visual"):
                _visual(file, visual, link, shapes)
    for joint in file.joints.values():
        _joint(file, joint, robot)
    return str(etree.tostring(robot, encoding="unicode"))


def _inertial(file: UrdfFile, given: Inertial, inertial: Any) -> None:
    _origin(file, given.origin, inertial)
    etree.SubElement(inertial, "mass", value=_text(given.mass))
    tensor = zip(INERTIAS, given.tensor, strict=True)
    etree.SubElement(inertial, "inertia", {word: _text(value) for word, value in tensor})


def _joint(file: UrdfFile, joint: UrdfJoint, robot: Any) -> None:
    kind = _STAND_IN.get(joint.kind, "revolute")
    element = etree.SubElement(robot, "joint", name=joint.name, type=kind)
    _origin(file, child(joint.element, "origin"), element)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    if kind in ("revolute", "prismatic"):
        etree.SubElement(element, "axis", xyz=_text(joint.axis))
        limit = dict.fromkeys(("upper", "effort", "velocity"), "1")
        etree.SubElement(element, "limit", {"lower": "-1", **limit})


def _visual(file: UrdfFile, element: Any, link: Any, shapes: Shapes) -> None:
    """Copy a visual whose shape can be drawn; say why another cannot."""
    geometry = child(element, "geometry")
    inside = [] if geometry is None else list(geometry.iterchildren("*"))
    if len(inside) != 1 or get(link, "name") not in shapes.links:
        shapes.missing.append(f"a visual of {get(link, 'name')!r} (line {element.sourceline})")
        return
    tag, attributes = tag_of(inside[0]).removeprefix("drake:"), _attributes(inside[0])
    try:
        here = file.placement(child(element, "origin"))
        sizes = {name: file.numbers(inside[0], name, count) for name, count in _SIZES.get(tag, ())}
        if tag == "mesh":
            attributes["filename"] = shapes.mesh(attributes)
        elif tag not in _SIZES:
            raise InputError(f"the shape <{tag}> in line {inside[0].sourceline}")
    except InputError as error:
        shapes.missing.append(str(error))
        return
    placed = [(here, tag, attributes)]
    if tag == "capsule":
        up = pin.SE3(np.eye(3), np.array([0.0, 0.0, sizes["length"][0] / 2.0]))
        ball = {"radius": attributes["radius"]}
        placed = [(here, "cylinder", attributes)]
        placed += [(here * end, "sphere", ball) for end in (up, up.inverse())]
    for placement, kind, given in placed:
        visual = etree.SubElement(link, "visual")
        xyz, rpy = placement.translation, pin.rpy.matrixToRpy(placement.rotation)
        etree.SubElement(visual, "origin", xyz=_text(xyz), rpy=_text(rpy))
        etree.SubElement(etree.SubElement(visual, "geometry"), kind, given)
        for material in list(children(element, "material"))[:1]:
            _material(file, material, visual)


def _material(file: UrdfFile, element: Any, parent: Any) -> None:
    """Copy a material's name and colour."""
    material = etree.SubElement(parent, "material", name=get(element, "name") or "")
    color = child(element, "color")
    try:
        rgba = [0.5, 0.5, 0.5, 1.0] if color is None else file.numbers(color, "rgba", 4)
    except InputError:
        return
    if color is not None:
        etree.SubElement(material, "color", rgba=_text(rgba))


def _origin(file: UrdfFile, element: Any | None, parent: Any) -> None:
    """Copy an origin; its rotation as rpy."""
    if element is None:
        return
    if get(element, "quat_xyzw") is None:
        rpy = file.numbers(element, "rpy", 3, (0, 0, 0))
    else:
        rpy = pin.rpy.matrixToRpy(file.placement(element).rotation)
    xyz = file.numbers(element, "xyz", 3, (0, 0, 0))
    etree.SubElement(parent, "origin", xyz=_text(xyz), rpy=_text(rpy))


def _attributes(element: Any) -> dict[str, str]:
    return {str(name): str(value) for name, value in element.attrib.items() if "{" not in name}


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in np.ravel(numbers))
