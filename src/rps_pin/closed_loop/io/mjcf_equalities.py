"""Loop closures from the ``equality`` elements of an MJCF.

=============  =================================================================================
element        becomes
=============  =================================================================================
``connect``    a spherical closure: at the anchor, fixed in body1, and in body2 where the anchor
               is in ``qpos0``; or at two sites
``weld``       a rigid closure: of body1 moved by relpose, and body2 moved by the anchor; without
               a relpose, of body1 as it stands in ``qpos0``; or of two sites
``joint``      a `JointCoupling` q1 - ref1 = c0 + c1 (q2 - ref2); if joint2 is left out, or c1 is
               0, joint1 is fixed at ref1 + c0 and no longer a joint of the tree
=============  =================================================================================

All are exact: what MuJoCo needs to keep them soft (solref, solimp, torquescale) has no meaning
here. The frames made for anchors are called ``NAME:1`` and ``NAME:2`` after the element, or after
``connect_1``, ``weld_2``, ... if it has no name.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling, Kind, LoopClosure
from rps_pin.closed_loop.io.mjcf_file import MjcfFile, rotation_of_quaternion
from rps_pin.closed_loop.io.mjcf_tree import WORLD, MjcfTree

_KINDS: dict[str, Kind] = {"connect": "spherical", "weld": "rigid"}


@dataclass
class Equalities:
    """What the equality elements of a file come to.

    Attributes
    ----------
    closures
        In the order of the file.
    fixed
        Coordinates of the joints that are held, by name.
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
        attributes = file.attributes(element, tag="equality")
        if file.choice(element, attributes, "active", "true false", "true") == "false":
            continue
        name = element.get("name", f"{element.tag}_{number}")
        if element.tag in _KINDS:
            frames = _frames(file, tree, element, attributes, name)
            found.closures.append(LoopClosure(*frames, _KINDS[element.tag], name))
        elif element.tag == "joint":
            _add_coupling(file, tree, element, attributes, name, found)
        else:
            file.refuse(element, "is an equality that is not read; read are: connect, weld, joint")
    return found


def _frames(
    file: MjcfFile, tree: MjcfTree, element: Any, attributes: dict[str, str], name: str
) -> tuple[str, str]:
    """Return the names of the two frames that are to stay together."""
    if "site1" in attributes or "site2" in attributes:
        if "body1" in attributes or "body2" in attributes or "anchor" in attributes:
            file.refuse(element, "joins two sites, or two bodies at an anchor; not both")
        one, two = (
            _known(file, element, attributes, option, tree.site_frames)
            for option in ("site1", "site2")
        )
        return one, two
    first = _known(file, element, attributes, "body1", tree.body_frames)
    second = WORLD
    if "body2" in attributes:
        second = _known(file, element, attributes, "body2", tree.body_frames)
    if first == second:
        file.refuse(element, "joins a body to itself")
    if element.tag == "connect" and "anchor" not in attributes:
        file.refuse(element, "needs an anchor")
    anchor = pin.SE3(np.eye(3), file.vector(element, attributes, "anchor", (0.0, 0.0, 0.0)))
    between = _placement(tree, first).inverse() * _placement(tree, second)
    if element.tag == "connect":
        in_first, in_second = anchor, between.inverse() * anchor
    else:
        in_first, in_second = between * anchor, anchor
        relpose = file.vector(element, attributes, "relpose", (0.0, 1, 0, 0, 0, 0, 0))
        if relpose[3:].any():
            in_first = pin.SE3(rotation_of_quaternion(relpose[3:]), relpose[:3])
    return (
        tree.add_frame(f"{name}:1", first, in_first),
        tree.add_frame(f"{name}:2", second, in_second),
    )


def _placement(tree: MjcfTree, frame: str) -> pin.SE3:
    """Return where a frame is in ``qpos0``."""
    data = tree.model.createData()
    q = tree.model.referenceConfigurations["qpos0"]
    pin.framesForwardKinematics(tree.model, data, q)
    return data.oMf[tree.model.getFrameId(frame)]


def _known(
    file: MjcfFile, element: Any, attributes: dict[str, str], option: str, names: dict[str, str]
) -> str:
    given = attributes.get(option)
    if given is None:
        file.refuse(element, f"needs a {option}")
    if given not in names:
        what = option.rstrip("12")
        file.refuse(element, f"{option}: no {what} {given!r}; there are: {', '.join(names)}")
    return names[given]


def _add_coupling(
    file: MjcfFile,
    tree: MjcfTree,
    element: Any,
    attributes: dict[str, str],
    name: str,
    found: Equalities,
) -> None:
    simple = {joint.name: joint for joint in tree.joints if joint.kind in ("hinge", "slide")}
    names = {joint: joint for joint in simple}
    first = simple[_known(file, element, attributes, "joint1", names)]
    c = file.vector(element, attributes, "polycoef", (0.0, 1.0, 0.0, 0.0, 0.0), partial=True)
    if c[2:].any() and "joint2" in attributes:
        file.refuse(
            element,
            f"couples by a curve, polycoef = {attributes['polycoef']!r}; only a straight line "
            "(the first two coefficients) is read",
        )
    if "joint2" in attributes and c[1] != 0:
        second = simple[_known(file, element, attributes, "joint2", names)]
        if first is second:
            file.refuse(element, "couples a joint to itself")
        offset = first.ref + c[0] - c[1] * second.ref
        found.closures.append(
            JointCoupling(first.name, second.name, float(c[1]), float(offset), name)
        )
        return
    value = first.ref + float(c[0])
    if found.fixed.get(first.name, value) != value:
        file.refuse(element, f"holds {first.name!r}, which another element holds elsewhere")
    found.fixed[first.name] = value
