"""Loop closures from the ``equality`` elements of an MJCF.

=============  =================================================================================
element        becomes
=============  =================================================================================
``connect``    a spherical closure: of the anchors in both bodies, or of two sites
``weld``       a rigid closure: of body1 moved by relpose, and body2 moved by the anchor; or of
               two sites; with a torquescale of 0 a spherical one
``joint``      a `JointCoupling` q1 - ref1 = c0 + c1 (q2 - ref2) + ... + c4 (q2 - ref2)^4; without
               joint2, joint1 is held at ref1 + c0
``tendon``     a `JointCoupling` of all joints of the one or two fixed tendons, whose lengths take
               the places of q1 and q2; if it is not linear, of two joints that stand for them;
               of one spatial tendon straight between two sites, a ``distance`` closure
=============  =================================================================================

All are exact: MuJoCo's softness of constraints (solref, solimp, torquescale) is not used. The
frames of anchors are called ``NAME:1`` and ``NAME:2`` after the element, or after ``connect_1``,
``weld_2``, ... if it has no name. Elements that are not active are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling, LoopClosure
from rps_pin.closed_loop.io.mjcf.tendons import Tendons
from rps_pin.closed_loop.io.mjcf.tree import MjcfTree, pose_of

_CONNECT, _WELD, _JOINT, _TENDON = range(4)
_TAGS = ("connect", "weld", "joint", "tendon")
_SITE = 6
_TORQUESCALE = 10  # place in the numbers of a weld


def read_equalities(tree: MjcfTree, tendons: Tendons) -> list[Closure]:
    """Return the closures of the equality elements that are active, in their order.

    Frames of anchors, and joints that stand for tendons, are added to the tree.

    Raises
    ------
    MechanismError
        If an element is of a kind that is not read; with its line.
    """
    source, found = tree.source, []
    for flag in ("constraint", "equality"):
        if source.disabled(flag) and source.model.neq:
            where = source.setting("flag", attribute=flag)
            source.told[f"{flag} is disabled, so no equality closes a loop"] = [where]
            return []
    for number in np.flatnonzero(source.model.eq_active0):
        found.append(_closure(tree, tendons, int(number)))
    return found


def _closure(tree: MjcfTree, tendons: Tendons, number: int) -> Closure:
    source, m = tree.source, tree.source.model
    kind = int(m.eq_type[number])
    if kind not in (_CONNECT, _WELD, _JOINT, _TENDON):
        source.refuse(
            "equalities", number, f"is an equality that is not read; read are: {', '.join(_TAGS)}"
        )
    name = m.equality(number).name or f"{_TAGS[kind]}_{number + 1}"
    if kind in (_CONNECT, _WELD):
        frames = _frames(tree, number, name, kind)
        turns = kind == _WELD and m.eq_data[number, _TORQUESCALE]
        return LoopClosure(*frames, "rigid" if turns else "spherical", name)
    one, two = int(m.eq_obj1id[number]), int(m.eq_obj2id[number])
    curve = Polynomial(m.eq_data[number, :5])
    curve = curve.trim() if two >= 0 else Polynomial(curve.coef[:1])
    if kind == _JOINT:
        start = [m.qpos0[m.jnt_qposadr[i]] for i in (one, two)]
        if one == two:
            source.refuse("equalities", number, "couples a joint to itself")
        return _coupling(tree.joints[one], tree.joints[two], curve, start, name)
    rod = tendons.rod(one)
    if rod and two < 0:
        sites = [tree.sites[site] for site in rod]
        length = float(m.tendon_length0[one] + curve.coef[0])
        if length <= 0:
            source.refuse("equalities", number, f"holds a rod at a length of {length:g}")
        return LoopClosure(sites[0], sites[1], "distance", name, distance=length)
    for tendon in (one, two):
        if tendon >= 0 and not source.is_fixed(tendon):
            source.refuse("equalities", number, "is of a spatial tendon, which is not read")
    start = [m.tendon_length0[i] for i in (one, two)]
    if curve.degree() > 1:
        return _coupling(tendons.joint(one), tendons.joint(two), curve, start, name)
    return _sum(tree, tendons, number, curve, start, name)


def _coupling(
    joint: str, other: str, curve: Polynomial, start: list[float], name: str
) -> JointCoupling:
    """Return joint - start0 = curve(other - start1)."""
    if not curve.coef[1:].any():
        return JointCoupling(joint, {}, offset=float(start[0] + curve.coef[0]), name=name)
    if curve.degree() == 1:
        c0, c1 = map(float, curve.coef)
        offset = float(start[0] + c0 - c1 * start[1])
        return JointCoupling(joint, other, c1, offset, name)
    moved = start[0] + curve(Polynomial([-start[1], 1.0]))
    return JointCoupling(joint, other, name=name, polynomial=[float(c) for c in moved.coef])


def _sum(
    tree: MjcfTree,
    tendons: Tendons,
    number: int,
    curve: Polynomial,
    start: list[float],
    name: str,
) -> JointCoupling:
    """Return the coupling sum of coefficients * coordinates = constant, for its first joint."""
    two = int(tree.source.model.eq_obj2id[number])
    total: Array = tendons.coefficients(int(tree.source.model.eq_obj1id[number]))
    constant = start[0] + curve.coef[0]
    if curve.degree() == 1:
        total = total - curve.coef[1] * tendons.coefficients(two)
        constant -= curve.coef[1] * start[1]
    by_joint = tendons.by_joint(total)
    if not by_joint:
        tree.source.refuse("equalities", number, "couples no joint")
    joint = next(iter(by_joint))
    scale = by_joint.pop(joint)
    others = {other: -value / scale for other, value in by_joint.items()}
    return JointCoupling(joint, others, offset=float(constant / scale), name=name)


def _frames(tree: MjcfTree, number: int, name: str, kind: int) -> tuple[str, str]:
    """Return the names of the two frames that the equality holds together."""
    m = tree.source.model
    one, two = int(m.eq_obj1id[number]), int(m.eq_obj2id[number])
    if m.eq_objtype[number] == _SITE:
        return tree.sites[one], tree.sites[two]
    first, second = _anchors(m.eq_data[number], kind)
    return tree.anchor(f"{name}:1", one, first), tree.anchor(f"{name}:2", two, second)


def _anchors(data: Any, kind: int) -> tuple[pin.SE3, pin.SE3]:
    """Return the placements in body1 and body2 that a connect or weld holds together."""
    if kind == _CONNECT:
        return pin.SE3(np.eye(3), data[:3].copy()), pin.SE3(np.eye(3), data[3:6].copy())
    return pose_of(data[3:6], data[6:10]), pin.SE3(np.eye(3), data[:3].copy())
