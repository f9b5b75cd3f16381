"""Mistakes in URDF files, found before Pinocchio reads them.

Pinocchio's parser prints its errors to standard error and drops an element that it cannot read: a
link with a misspelt inertia loses its mass. Here such mistakes are refused, with their line.
(yourdfpy's validation does not serve: it reads missing elements as zero and knows no lines.)
"""

from __future__ import annotations

import math
from difflib import get_close_matches
from typing import Any, NoReturn

from rps_pin.errors import MechanismError

#: How many numbers an attribute holds.
_NUMBERS = {
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
}
_INERTIAS = tuple(_NUMBERS["inertia"])
_ROUNDING = 1e-12
_JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def refuse_mistakes(robot: Any, origin: str) -> None:
    """Refuse frequent mistakes.

    Parameters
    ----------
    robot
        Its root element.
    origin
        Its name in messages.

    Raises
    ------
    MechanismError
        If an attribute does not hold its numbers; a mass or a moment of inertia is missing or
        negative; a joint's type, parent or child is unknown; or more than one link has no parent.
    """
    for element in robot.iter(*_NUMBERS):
        _check_numbers(element, origin)
    for inertial in robot.iter("inertial"):
        _check_inertial(inertial, origin)
    _check_tree(robot, origin)


def _check_numbers(element: Any, origin: str) -> None:
    for attribute, count in _NUMBERS[str(element.tag)].items():
        text = element.get(attribute, " 0" * count)
        if len(text.split()) != count or not all(map(_is_finite, text.split())):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            _refuse(element, origin, f"{element.tag} {attribute} = {text!r} must be {wanted}")


def _is_finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _check_inertial(inertial: Any, origin: str) -> None:
    link = inertial.getparent().get("name")
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        _refuse(inertial, origin, f"link {link!r}: its inertial has no mass value")
    if inertia is None:
        _refuse(inertial, origin, f"link {link!r}: its inertial has no inertia")
    missing = [name for name in _INERTIAS if inertia.get(name) is None]
    if missing:
        _refuse(inertia, origin, f"link {link!r}: its inertia has no {', '.join(missing)}")
    if float(mass.get("value")) < 0:
        _refuse(mass, origin, f"link {link!r}: mass = {mass.get('value')} kg is negative")
    for name in ("ixx", "iyy", "izz"):  # slightly wrong tensors are common, and accepted
        if float(inertia.get(name)) < -_ROUNDING:
            value = inertia.get(name)
            _refuse(inertia, origin, f"link {link!r}: {name} = {value} kg m^2 is negative")


def _check_tree(robot: Any, origin: str) -> None:
    links = [link.get("name") for link in robot.iterchildren("link")]
    children = set()
    for joint in robot.iterchildren("joint"):
        name, kind = joint.get("name"), joint.get("type")
        if kind not in _JOINT_TYPES:
            _refuse(joint, origin, _unknown(f"joint {name!r}", "type", kind, _JOINT_TYPES))
        for side in ("parent", "child"):
            end = joint.find(side)
            link = None if end is None else end.get("link")
            if link not in links:
                where = joint if end is None else end
                _refuse(where, origin, _unknown(f"joint {name!r}: {side}", "link", link, links))
        children.add(joint.find("child").get("link"))
    roots = [link for link in links if link not in children]
    if len(roots) > 1:
        _refuse(robot, origin, f"{_misspelt(robot)}no joint has these as its child: {_few(roots)}")


def _misspelt(robot: Any) -> str:
    """Return a remark on elements that look like a misspelt link or joint."""
    for element in robot.iterchildren("*"):
        near = get_close_matches(str(element.tag), ("link", "joint"), n=1)
        if near and element.tag not in near:
            return f"line {element.sourceline} has a <{element.tag}> (a <{near[0]}>?); "
    return ""


def _unknown(owner: str, what: str, given: object, known: Any) -> str:
    near = get_close_matches(str(given), known, n=1)
    meant = f"did you mean {near[0]!r}?" if near else f"there are: {_few(known)}"
    return f"{owner}: no {what} {given!r}; {meant}"


def _few(names: Any) -> str:
    """Return names, the first twelve of many."""
    shown = ", ".join(map(str, names[:12]))
    return shown if len(names) <= 12 else f"{shown} and {len(names) - 12} more"


def _refuse(element: Any, origin: str, why: str) -> NoReturn:
    raise MechanismError(f"{origin} is not a valid URDF: line {element.sourceline}: {why}")
