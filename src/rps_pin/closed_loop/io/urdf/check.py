"""Joints and links as one tree: one root, one parent each, no cycles, not too large."""

from __future__ import annotations

from rps_pin.bounds import LINKS, LINKS_IN_A_ROW, MOST_VELOCITIES, beyond
from rps_pin.closed_loop.io.urdf.elements import VELOCITIES, UrdfFile, UrdfJoint
from rps_pin.errors import few


def check_tree(file: UrdfFile) -> None:
    """Refuse joints that do not make one tree.

    Raises
    ------
    MechanismError
        If a link has two parents (with both joints), links are in a cycle, more than one has no
        parent, or there are more links in a row, or velocities, than are read; with the line.
    """
    if why := beyond(len(file.links), LINKS):
        file.refuse(file.robot, f"it has {len(file.links)} links, and {why}")
    joint_of: dict[str, UrdfJoint] = {}
    for joint in file.joints.values():
        if joint.child in joint_of:
            first = joint_of[joint.child]
            file.refuse(
                joint.element,
                f"link {joint.child!r} is the child of two joints, {first.name!r} (line "
                f"{first.element.sourceline}) and {joint.name!r}; a URDF is a tree: cut the loop "
                "there, and close it with a closure of the mechanism's description",
            )
        joint_of[joint.child] = joint
    roots = [name for name in file.links if name not in joint_of]
    if not roots:
        _refuse_cycle(file, joint_of, next(iter(file.links)))
    if len(roots) > 1:
        element = file.links[roots[1]]
        file.refuse(element, f"no joint has these as its child: {few(roots)}; a URDF has one root")
    _check_depth(file, joint_of)
    velocities = sum(VELOCITIES[joint.kind] for joint in file.joints.values())
    if why := beyond(velocities, MOST_VELOCITIES):
        file.refuse(file.robot, f"its joints have {velocities} velocities, and {why}")


def _check_depth(file: UrdfFile, joint_of: dict[str, UrdfJoint]) -> None:
    depths: dict[str, int] = {}
    for name in file.links:
        row = [name]
        while row[-1] in joint_of and row[-1] not in depths:
            if len(row) > len(file.links):
                _refuse_cycle(file, joint_of, name)
            row.append(joint_of[row[-1]].parent)
        depth = depths.get(row[-1], 0)
        for above, link in enumerate(reversed(row)):
            depths[link] = depth + above
        if why := beyond(depths[name], LINKS_IN_A_ROW):
            link = file.links[name]
            file.refuse(link, f"link {name!r} is the last of {depths[name]} in a row, and {why}")


def _refuse_cycle(file: UrdfFile, joint_of: dict[str, UrdfJoint], link: str) -> None:
    for _ in file.links:  # to one of the cycle
        link = joint_of[link].parent
    around, start = [joint_of[link]], link
    while around[-1].parent != start:
        around.append(joint_of[around[-1].parent])
    names = ", ".join(f"{one.name!r} (line {one.element.sourceline})" for one in around)
    file.refuse(around[0].element, f"these joints form a cycle, which a tree has not: {names}")
