"""Inertias of the bodies of an MJCF, in the plain form that Pinocchio's parser is given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.mjcf_file import MjcfElement, children, placement, text
from rps_pin.validation import inertia_fault

#: Shapes with a volume, and how many numbers their size has.
_SHAPES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
_WITHOUT_VOLUME = ("plane", "hfield")
_WATER = 1000.0


def add_inertia(body: MjcfElement, plain: Any, geoms: list[tuple[MjcfElement, pin.SE3]]) -> None:
    """Give a plain body its inertia: that of the file, or that of its geoms.

    Parameters
    ----------
    body
        The body in the file.
    plain
        The body in the plain form.
    geoms
        Its geoms, each with the placement of its parent in the body.
    """
    source = body.file.inertia_from_geom
    inertials = [child for child in children(body.xml) if child.tag == "inertial"]
    if len(inertials) > 1:
        body.file.plain(inertials[1]).refuse("is the second in its body")
    if inertials and not (source == "true" and geoms):
        plain.insert(0, _inertial(body.file.plain(inertials[0])))
    elif source != "false":
        for geom, around in geoms:
            _add_geom(geom, around, plain)


def _inertial(element: MjcfElement) -> Any:
    pose = element.pose()
    if "mass" not in element or "pos" not in element:
        element.refuse("needs a mass and a pos")
    mass = element.number("mass")
    if "diaginertia" in element and "fullinertia" in element:
        element.refuse("has both diaginertia and fullinertia")
    diagonal = element.vector("diaginertia", (0.0,) * 3)
    full = element.vector("fullinertia", (*diagonal, 0.0, 0.0, 0.0))
    xx, yy, zz, xy, xz, yz = full
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    fault = "has a negative mass" if mass < 0 else inertia_fault(matrix)
    if fault:
        element.refuse(f"is not that of a rigid body: {fault}")
    return etree.Element("inertial", mass=repr(mass), fullinertia=text(full), **placement(pose))


def _add_geom(geom: MjcfElement, around: pin.SE3, plain: Any) -> None:
    first, last = geom.file.inertia_groups
    if not first <= geom.number("group") <= last:
        return
    kind = geom.get("type", "sphere")
    heavy = {"mass": geom.number("mass")}
    if "mass" not in geom:
        heavy = {"density": geom.number("density", _WATER)}
    if not any(heavy.values()) or kind in _WITHOUT_VOLUME:
        return
    if min(heavy.values()) < 0:
        geom.refuse("has a negative mass")
    if kind not in _SHAPES or "mesh" in geom:
        geom.refuse(
            f"is a {geom.get('type', 'mesh')} whose mass is not computed: give the body an "
            f"inertial element, or the geom a mass of 0. Computed are: {', '.join(_SHAPES)}"
        )
    if geom.get("shellinertia", "false") != "false":
        geom.refuse("is a shell, whose mass is not computed")
    pose, half = geom.segment()
    values = list(geom.numbers("size"))
    if half is not None and kind == "sphere":
        geom.refuse("is a sphere, which does not reach from one point to another")
    if half is not None:  # the first number is the width both ways
        values = [*values[:1] * (_SHAPES[kind] - 1), half]
    values = values[: _SHAPES[kind]]
    if len(values) < _SHAPES[kind] or min(values) <= 0:
        geom.refuse(f"needs {_SHAPES[kind]} positive numbers in size")
    attributes = placement(around * pose) | {name: repr(value) for name, value in heavy.items()}
    etree.SubElement(plain, "geom", type=kind, size=text(values), **attributes)
