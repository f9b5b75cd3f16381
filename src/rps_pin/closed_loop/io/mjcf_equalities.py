"""Loop closures from the ``equality`` elements of an MJCF.

=============  =================================================================================
element        becomes
=============  =================================================================================
``connect``    a spherical closure: at the anchor, fixed in body1, and in body2 where the anchor
               is in ``qpos0``; or at two sites
``weld``       a rigid closure: of body1 moved by relpose, and body2 moved by the anchor; without
               a relpose, of body1 as it is placed in ``qpos0``; or of two sites
``joint``      a `JointCoupling` q1 - ref1 = c0 + c1 (q2 - ref2); if joint2 is left out, or c1 is
               0, joint1 is fixed at ref1 + c0 and is not a joint of the tree
=============  =================================================================================

All are exact: MuJoCo's softness of constraints (solref, solimp, torquescale) is not used. The
frames of anchors are called ``NAME:1`` and ``NAME:2`` after the element, or after ``connect_1``,
``weld_2``, ... if it has no name.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling, Kind, LoopClosure
from rps_pin.closed_loop.io.mjcf_file import MjcfElement, MjcfFile, rotation_of_quaternion
from rps_pin.closed_loop.io.mjcf_tree import WORLD, MjcfTree

_KINDS: dict[str, Kind] = {"connect": "spherical", "weld": "rigid"}


@dataclass
class Equalities:
    """The equality elements of a file.

    Attributes
    ----------
    closures
        In the order of the file.
    fixed
        Coordinates of the joints that are fixed, by name.
    """

    closures: list[Closure] = field(default_factory=list)
    fixed: dict[str, float] = field(default_factory=dict)


def read_equalities(file: MjcfFile, tree: MjcfTree) -> Equalities:
    """Read the equality elements that are active, adding frames for their anchors to the tree.

    Raises
    ------
    MechanismError
        If one is of a kind that is not read, names something unknown, or couples joints by more
        than a straight line; with its line.
    """
    found = Equalities()
    for number, element in enumerate(file.entries("equality"), 1):
        if element.choice("active", "true false", "true") == "false":
            continue
        name = element.name or f"{element.tag}_{number}"
        if element.tag in _KINDS:
            frames = _frames(tree, element, name)
            found.closures.append(LoopClosure(*frames, _KINDS[element.tag], name))
        elif element.tag == "joint":
            _add_coupling(tree, element, name, found)
        else:
            element.refuse("is an equality that is not read; read are: connect, weld, joint")
    return found


def _frames(tree: MjcfTree, element: MjcfElement, name: str) -> tuple[str, str]:
    """Return the names of the two frames that the equality holds together."""
    if "site1" in element or "site2" in element:
        if "body1" in element or "body2" in element or "anchor" in element:
            element.refuse("joins two sites, or two bodies at an anchor; not both")
        one, two = (_known(element, end, tree.site_frames) for end in ("site1", "site2"))
        return one, two
    first = _known(element, "body1", tree.body_frames)
    second = _known(element, "body2", tree.body_frames) if "body2" in element else WORLD
    if first == second:
        element.refuse("joins a body to itself")
    if element.tag == "connect" and "anchor" not in element:
        element.refuse("needs an anchor")
    anchor = pin.SE3(np.eye(3), element.vector("anchor", (0.0, 0.0, 0.0)))
    between = _placement(tree, first).inverse() * _placement(tree, second)
    if element.tag == "connect":
        in_first, in_second = anchor, between.inverse() * anchor
    else:
        in_first, in_second = between * anchor, anchor
        relpose = element.vector("relpose", (0.0, 1, 0, 0, 0, 0, 0))
        if relpose[3:].any():
            in_first = pin.SE3(rotation_of_quaternion(relpose[3:]), relpose[:3])
    return (
        tree.add_frame(f"{name}:1", first, in_first),
        tree.add_frame(f"{name}:2", second, in_second),
    )


def _placement(tree: MjcfTree, frame: str) -> pin.SE3:
    """Return the placement of a frame in ``qpos0``."""
    data = tree.model.createData()
    q = tree.model.referenceConfigurations["qpos0"]
    pin.framesForwardKinematics(tree.model, data, q)
    return data.oMf[tree.model.getFrameId(frame)]


def _known(element: MjcfElement, option: str, names: dict[str, Any]) -> Any:
    """Return what an option names."""
    given = element.get(option)
    if option not in element:
        element.refuse(f"needs a {option}")
    if given not in names:
        what = option.rstrip("12")
        element.refuse(f"{option}: no {what} {given!r}; there are: {', '.join(names)}")
    return names[given]


def _add_coupling(tree: MjcfTree, element: MjcfElement, name: str, found: Equalities) -> None:
    simple = {joint.name: joint for joint in tree.joints if joint.kind in ("hinge", "slide")}
    first = _known(element, "joint1", simple)
    c = element.vector("polycoef", (0.0, 1.0, 0.0, 0.0, 0.0), partial=True)
    if c[2:].any() and "joint2" in element:
        element.refuse(
            f"couples by a curve, polycoef = {element.get('polycoef')!r}; only a straight line "
            "(the first two coefficients) is read"
        )
    if "joint2" in element and c[1] != 0:
        second = _known(element, "joint2", simple)
        if first is second:
            element.refuse("couples a joint to itself")
        offset = first.ref + c[0] - c[1] * second.ref
        found.closures.append(
            JointCoupling(first.name, second.name, float(c[1]), float(offset), name)
        )
        return
    value = first.ref + float(c[0])
    if found.fixed.get(first.name, value) != value:
        element.refuse(f"fixes {first.name!r}, which another element fixes elsewhere")
    found.fixed[first.name] = value
