"""Inertias of the bodies of an MJCF, in the plain form that Pinocchio's parser is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.mjcf_file import (
    MjcfFile,
    children,
    quaternion_text,
    rotation_of_z,
    text,
)

#: Shapes with a volume, and how many numbers their size has.
_SHAPES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
_WITHOUT_VOLUME = ("plane", "hfield")
_WATER = 1000.0


def add_inertia(
    file: MjcfFile, element: Any, plain: Any, geoms: list[tuple[Any, pin.SE3, str]]
) -> None:
    """Give a plain body its inertia: what the file says, or that of its geoms.

    Parameters
    ----------
    file
        The file.
    element
        The body in it.
    plain
        The body in the plain form.
    geoms
        Its geoms, the place of what they stand in, and their default class.
    """
    inertials = [child for child in children(element) if child.tag == "inertial"]
    if len(inertials) > 1:
        file.refuse(inertials[1], "is the second in its body")
    if inertials and not (file.inertia_from_geom == "true" and geoms):
        plain.insert(0, _inertial(file, inertials[0]))
    elif file.inertia_from_geom == "false":
        return
    else:
        for geom, around, childclass in geoms:
            _add_geom(file, geom, around, childclass, plain)


def _inertial(file: MjcfFile, element: Any) -> Any:
    pose = file.pose(element, element.attrib)
    if "mass" not in element.attrib or "pos" not in element.attrib:
        file.refuse(element, "needs a mass and a pos")
    mass = file.number(element, element.attrib, "mass")
    moments = file.vector(element, element.attrib, "diaginertia", (0.0,) * 3)
    products = np.zeros(3)
    if "fullinertia" in element.attrib:
        if "diaginertia" in element.attrib:
            file.refuse(element, "has both diaginertia and fullinertia")
        values = file.vector(element, element.attrib, "fullinertia", (0.0,) * 6)
        moments, products = values[:3], values[3:]
    matrix = np.diag(moments)
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), products, strict=True):
        matrix[i, j] = matrix[j, i] = value
    smallest, middle, largest = np.linalg.eigvalsh(matrix)
    if mass < 0 or smallest < 0 or largest > (smallest + middle) * (1 + 1e-9):
        file.refuse(
            element,
            f"is that of no rigid body: mass {mass:.6g} kg, principal moments "
            f"{smallest:.6g}, {middle:.6g} and {largest:.6g} kg m^2",
        )
    return etree.Element(
        "inertial",
        mass=repr(mass),
        pos=text(pose.translation),
        quat=quaternion_text(pose.rotation),
        fullinertia=text([*moments, *products]),
    )


def _add_geom(file: MjcfFile, element: Any, around: pin.SE3, childclass: str, plain: Any) -> None:
    attributes = file.attributes(element, childclass)
    first, last = file.inertia_groups
    if not first <= file.number(element, attributes, "group") <= last:
        return
    kind = attributes.get("type", "sphere")
    heavy = {"mass": file.number(element, attributes, "mass")}
    if "mass" not in attributes:
        heavy = {"density": file.number(element, attributes, "density", _WATER)}
    if not any(heavy.values()) or kind in _WITHOUT_VOLUME:
        return
    if min(heavy.values()) < 0:
        file.refuse(element, "has a negative mass")
    if kind not in _SHAPES or "mesh" in attributes:
        file.refuse(
            element,
            f"is a {attributes.get('type', 'mesh')} whose mass is not computed: give the body an "
            f"inertial element, or the geom a mass of 0. Computed are: {', '.join(_SHAPES)}",
        )
    if attributes.get("shellinertia", "false") != "false":
        file.refuse(element, "is a shell, whose mass is not computed")
    pose, half = placed(file, element, attributes)
    size = file.numbers(element, attributes, "size")
    values = [] if size is None else list(size)
    if half is not None and kind == "sphere":
        file.refuse(element, "is a sphere, which does not reach from one point to another")
    if half is not None:  # the first number is the width both ways
        values = [*values[:1] * (_SHAPES[kind] - 1), half]
    values = values[: _SHAPES[kind]]
    if len(values) < _SHAPES[kind] or min(values) <= 0:
        file.refuse(element, f"needs {_SHAPES[kind]} positive numbers in size")
    etree.SubElement(
        plain,
        "geom",
        type=kind,
        size=text(values),
        pos=text((around * pose).translation),
        quat=quaternion_text((around * pose).rotation),
        **{name: repr(value) for name, value in heavy.items()},
    )


def placed(
    file: MjcfFile, element: Any, attributes: Mapping[str, str]
) -> tuple[pin.SE3, float | None]:
    """Return the pose of a geom or site, and half its length if ``fromto`` gives it."""
    if "fromto" not in attributes:
        return file.pose(element, attributes), None
    ends = file.vector(element, attributes, "fromto", (0.0,) * 6)
    along = ends[:3] - ends[3:]
    length = float(np.linalg.norm(along))
    if length == 0:
        file.refuse(element, "has two ends in one place")
    return pin.SE3(rotation_of_z(along), (ends[:3] + ends[3:]) / 2), length / 2
