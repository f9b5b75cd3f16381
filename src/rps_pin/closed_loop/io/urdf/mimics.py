"""Couplings of the ``mimic`` elements of a URDF: q = multiplier * q_other + offset."""

from __future__ import annotations

from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.urdf.elements import SIMPLE, UrdfFile, UrdfJoint, unknown


def couplings_of(file: UrdfFile) -> list[JointCoupling]:
    """Return a coupling for each joint that mimics another, in the file's order.

    A multiplier of 0 holds the joint at the offset. A fixed joint has no coordinate; its ``mimic``
    says nothing, and is told in a note.

    Raises
    ------
    MechanismError
        If the other joint is unknown, fixed, or one that mimics this one in turn, or a joint has
        several coordinates; with the line.
    """
    found = []
    for joint in file.joints.values():
        mimic = joint.mimic
        if mimic is None:
            continue
        what = f"joint {joint.name!r} mimics {mimic.joint!r}"
        if joint.kind == "fixed":
            file.remark(mimic.element, joint.name, "fixed joints, whose mimic says nothing")
            continue
        if mimic.joint not in file.joints:
            file.refuse(
                mimic.element,
                unknown(f"joint {joint.name!r}: mimic", "joint", mimic.joint, list(file.joints)),
            )
        for one in (joint, file.joints[mimic.joint]):
            if one.kind not in SIMPLE:
                file.refuse(
                    mimic.element,
                    f"{what}, and {one.name!r} is {one.kind}: joints of one coordinate can mimic",
                )
        _refuse_circle(file, joint)
        if mimic.multiplier == 0:
            found.append(JointCoupling(joint.name, {}, offset=mimic.offset))
        else:
            found.append(JointCoupling(joint.name, mimic.joint, mimic.multiplier, mimic.offset))
    return found


def _refuse_circle(file: UrdfFile, joint: UrdfJoint) -> None:
    row = [joint.name]
    mimic = joint.mimic
    while mimic is not None and mimic.joint in file.joints:
        row.append(mimic.joint)
        if mimic.joint == joint.name and joint.mimic is not None:
            file.refuse(joint.mimic.element, f"joints mimic in a circle: {' -> '.join(row)}")
        if len(row) > len(file.joints):
            return  # a circle further on, which its own joints are refused for
        mimic = file.joints[mimic.joint].mimic
