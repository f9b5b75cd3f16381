"""Closures of the loop elements of URDF dialects.

====================================  ============================================================
``<loop>`` (URDF+)                    revolute, continuous, prismatic, planar, fixed
``<coupling>`` (URDF+)                sum of the joints to the successor = ratio * sum of those to
                                      the predecessor, each from where their chains part
``<constraint>`` (urdfdom, proposed)  revolute, prismatic, universal, spherical, link
``<loop_joint>`` (Isaac Sim)          spherical, fixed; revolute and prismatic with an axis
``<drake:ball_constraint>``           spherical
``<drake:tendon_constraint>``         a coupling, if its length cannot change
====================================  ============================================================

Offsets from links become frames, called ``NAME/LINK``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling, LoopClosure
from rps_pin.closed_loop.io.urdf.elements import SIMPLE, OffsetFrame, UrdfFile, UrdfJoint
from rps_pin.closed_loop.io.urdf.vocabulary import child, children, get, tag_of

#: Kinds of closures by the types of each dialect.
_KINDS: dict[str, dict[str, str]] = {
    "loop": {
        "revolute": "revolute",
        "continuous": "revolute",
        "prismatic": "prismatic",
        "planar": "planar",
        "fixed": "rigid",
    },
    "constraint": {
        "revolute": "revolute",
        "prismatic": "prismatic",
        "universal": "universal",
        "spherical": "spherical",
        "link": "rigid",
    },
    "loop_joint": {
        "revolute": "revolute",
        "continuous": "revolute",
        "prismatic": "prismatic",
        "spherical": "spherical",
        "fixed": "rigid",
    },
}
_WITHOUT_AXIS = ("spherical", "rigid")
_WITH_TWO_AXES = ("revolute", "planar", "universal")


def closures_of(file: UrdfFile) -> list[Closure]:
    """Return the closures of a file's loop elements, in its order; add the frames they need.

    Raises
    ------
    MechanismError
        If a name is unknown, a value is missing, or a type has no exact meaning here; with the
        line.
    """
    readers = {
        "loop": _loop,
        "coupling": _coupling,
        "constraint": _constraint,
        "loop_joint": _loop_joint,
        "drake:ball_constraint": _ball,
        "drake:tendon_constraint": _tendon,
    }
    found: list[Closure] = []
    for element in file.robot.iterchildren("*"):
        read = readers.get(tag_of(element))
        if read is not None:
            found.append(read(file, element, len(found) + 1))
    return found


def _loop(file: UrdfFile, element: Any, _: int) -> Closure:
    ends = [_part(file, element, tag) for tag in ("predecessor", "successor")]
    frames = [_end(file, element, one, child(one, "origin")) for one in ends]
    axis = file.axis(child(element, "axis"))
    return _closure(file, element, frames, [axis, axis])


def _constraint(file: UrdfFile, element: Any, _: int) -> Closure:
    frames, axes = [], []
    for side in ("parent", "child"):
        end = _part(file, element, side)
        frames.append(_end(file, element, end, child(element, f"{side}_origin")))
        axis = child(element, f"{side}_axis")
        axes.append(None if axis is None else file.axis(axis))
    kind = _kind(file, element)
    for side, axis in zip(("parent", "child"), axes, strict=True):
        needed = kind not in _WITHOUT_AXIS and (side == "parent" or kind in _WITH_TWO_AXES)
        if needed and axis is None:
            file.refuse(element, f"constraint {get(element, 'name')!r} has no <{side}_axis>")
    return _closure(file, element, frames, axes)


def _loop_joint(file: UrdfFile, element: Any, _: int) -> Closure:
    ends = [_part(file, element, tag) for tag in ("link1", "link2")]
    frames = [_end(file, element, one, one) for one in ends]
    axis = child(element, "axis")
    if axis is None and _kind(file, element) not in _WITHOUT_AXIS:
        file.refuse(element, f"loop_joint {get(element, 'name')!r} has no <axis>")
    axes = [None if axis is None else file.axis(axis)] * 2
    return _closure(file, element, frames, axes)


def _ball(file: UrdfFile, element: Any, number: int) -> Closure:
    frames = []
    for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
        end = _part(file, element, f"drake:ball_constraint_{body}")
        at = _part(file, element, f"drake:ball_constraint_{point}")
        link = file.known(end, "name", list(file.links), f"<{tag_of(end)}>")
        placement = pin.SE3(np.eye(3), np.array(file.numbers(at, "value", 3)))
        frames.append(_frame(file, f"ball_{number}", link, placement, body[-1]))
    name = get(element, "name") or f"ball_{number}"
    return _joined(file, element, frames, "spherical", name)


def _closure(
    file: UrdfFile, element: Any, frames: Sequence[str], axes: Sequence[Any]
) -> LoopClosure:
    kind, name = _kind(file, element), file.name_of(element)
    options: dict[str, Any] = {}
    if kind not in _WITHOUT_AXIS:
        options["axis"] = axes[0].tolist()
        if kind in _WITH_TWO_AXES:
            options["axis_b"] = axes[1].tolist()
    return _joined(file, element, frames, kind, name, **options)


def _joined(
    file: UrdfFile, element: Any, frames: Sequence[str], kind: str, name: str, **options: Any
) -> LoopClosure:
    """Return a closure of two frames, which must be on two links."""
    links = {frame.name: frame.link for frame in file.frames}
    a, b = (links.get(frame, frame) for frame in frames)
    if a == b:
        file.refuse(element, f"{tag_of(element)} {name!r} joins link {a!r} to itself")
    return LoopClosure(frames[0], frames[1], kind, name, **options)  # type: ignore[arg-type]


def _kind(file: UrdfFile, element: Any) -> str:
    kinds = _KINDS[tag_of(element)]
    what = f"{tag_of(element)} {get(element, 'name')!r}"
    return kinds[file.known(element, "type", list(kinds), what)]


def _part(file: UrdfFile, element: Any, tag: str) -> Any:
    part = child(element, tag)
    if part is None:
        file.refuse(element, f"{tag_of(element)} {get(element, 'name') or ''!r} has no <{tag}>")
    return part


def _end(file: UrdfFile, element: Any, end: Any, pose: Any) -> str:
    """Return the frame of a link and a pose on it."""
    what = f"{tag_of(element)} {get(element, 'name')!r}: {tag_of(end)}"
    link = file.known(end, "link", list(file.links), what)
    return _frame(file, file.name_of(element), link, file.placement(pose), tag_of(end))


def _frame(file: UrdfFile, loop: str, link: str, placement: pin.SE3, end: str) -> str:
    """Return the name of a link's own frame, or of a new one that is offset from it."""
    if placement.isIdentity(0.0):
        return link
    name = f"{loop}/{link}"
    if any(frame.name == name for frame in file.frames):
        name = f"{name}/{end}"
    file.frames.append(OffsetFrame(name, link, placement))
    return name


# Couplings ----------------------------------------------------------------------------------------


def _coupling(file: UrdfFile, element: Any, _: int) -> Closure:
    name = file.name_of(element)
    if get(element, "type") not in (None, "rolling"):
        file.refuse(element, f"coupling {name!r}: no type {get(element, 'type')!r}, only 'rolling'")
    chains = []
    for tag in ("predecessor", "successor"):
        end = _part(file, element, tag)
        link = file.known(end, "link", list(file.links), f"coupling {name!r}: {tag}")
        chains.append(_chain(file, link))
    ratio = child(element, "ratio")
    factor = 1.0 if ratio is None else file.number(ratio, "value")
    shared = {joint.name for joint in chains[0]} & {joint.name for joint in chains[1]}
    before, after = ([one for one in chain if one.name not in shared] for chain in chains)
    before, after = ([one for one in row if one.kind != "fixed"] for row in (before, after))
    for joint in (*before, *after):
        if joint.kind not in SIMPLE:
            file.refuse(
                element,
                f"coupling {name!r}: joint {joint.name!r} is {joint.kind}, and has "
                "several coordinates",
            )
    if not before or not after:
        file.refuse(
            element,
            f"coupling {name!r}: one of its links carries the other, so that there is one "
            "chain of joints, not two to couple",
        )
    terms = {one.name: 1.0 for one in after} | {one.name: -factor for one in before}
    return _linear(file, element, name, terms, 0.0)


def _chain(file: UrdfFile, link: str) -> list[UrdfJoint]:
    """Return the joints from a link to the root."""
    above = {joint.child: joint for joint in file.joints.values()}
    row = []
    while link in above:
        row.append(above[link])
        link = above[link].parent
    return row


def _tendon(file: UrdfFile, element: Any, number: int) -> Closure:
    """Return lower = sum of a q + offset = upper as a coupling."""
    name, start = get(element, "name") or f"tendon_{number}", "drake:tendon_constraint_"
    terms: dict[str, float] = {}
    for one in children(element, f"{start}joint"):
        joint = file.known(one, "name", list(file.joints), "<drake:tendon_constraint_joint>")
        if file.joints[joint].kind not in SIMPLE:
            file.refuse(one, f"joint {joint!r} is {file.joints[joint].kind}")
        terms[joint] = terms.get(joint, 0.0) + file.number(one, "a")

    def value(word: str, default: float) -> float:
        one = child(element, start + word)
        return default if one is None else file.limit(one, "value", default)

    lower, upper = value("lower_limit", -math.inf), value("upper_limit", math.inf)
    if lower != upper or not math.isfinite(value("lower_limit", math.inf)):
        file.refuse(
            element,
            f"tendon {name!r}: its length may be from {lower:.6g} to {upper:.6g}; only "
            "one that cannot change is a coupling",
        )
    if math.isfinite(value("stiffness", math.inf)) or value("damping", 0.0):
        file.refuse(
            element, f"tendon {name!r} is elastic or damped; only a stiff one is a coupling"
        )
    return _linear(file, element, name, terms, lower - value("offset", 0.0))


def _linear(
    file: UrdfFile, element: Any, name: str, terms: dict[str, float], total: float
) -> Closure:
    """Return sum of factor * q = total as a coupling of joints."""
    terms = {joint: factor for joint, factor in terms.items() if factor}
    if not terms:
        file.refuse(element, f"{tag_of(element)} {name!r} couples no joint")
    (joint, first), *others = terms.items()
    ratios = {other: -factor / first for other, factor in others}
    if len(ratios) == 1:
        (other, ratio), *_ = ratios.items()
        return JointCoupling(joint, other, ratio, total / first, name)
    return JointCoupling(joint, ratios, offset=total / first, name=name)
