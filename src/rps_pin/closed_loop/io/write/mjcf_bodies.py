"""Bodies of a MuJoCo file: the tree's, and those that closures need.

A link without mass between two joints (a universal joint's cross) is no body of its own: MuJoCo
moves no body without mass, but a body can have several joints.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.write.links import Links
from rps_pin.closed_loop.io.write.mjcf_joints import MujocoJoint, Screw, mujoco_joints
from rps_pin.closed_loop.io.write.source import Names, Source

#: Masses (kg) and moments of inertia (kg m^2) count as none below this, MuJoCo's mjMINVAL.
NONE = 1e-15
#: MuJoCo's name of the world's body, which no other can have.
_WORLD = "world"


@dataclass
class Body:
    """A body; its frame is that of the last of its joints."""

    name: str
    placement: pin.SE3
    """In its parent's body, at zero coordinates."""
    inertia: pin.Inertia
    joints: list[tuple[MujocoJoint, pin.SE3]] = field(default_factory=list)
    """Each with its frame in the body's, at zero coordinates."""
    sites: dict[str, pin.SE3] = field(default_factory=dict)
    children: list[Body] = field(default_factory=list)


class Bodies:
    """The bodies of a tree without rows.

    Attributes
    ----------
    world
        The world's body, with the others below it.
    of_joint : dict of int to Body
        The body that each joint moves; joints before a massless link have none.
    screws
        Couplings of helical joints.
    """

    def __init__(
        self, source: Source, held: Collection[int], tendons: Collection[int], q: Array
    ) -> None:
        self._source, self._model, self._held, self._q = source, source.model, held, q
        self.joint_names = Names(source.model.names)
        links = Links(source.model).moved
        self.names = Names([_WORLD, *links])
        self._links = [self.names.fresh(name) if name == _WORLD else name for name in links]
        self.screws: list[Screw] = []
        self._children: dict[int, list[int]] = {i: [] for i in range(source.model.njoints)}
        for joint in range(1, source.model.njoints):
            self._children[source.model.parents[joint]].append(joint)
        self.world = Body(_WORLD, pin.SE3.Identity(), pin.Inertia.Zero())
        self.of_joint = {0: self.world}
        for joint in self._children[0]:
            if joint in tendons:
                continue
            self._add(joint, self.world, [], pin.SE3.Identity())
        for index in range(1, source.model.nframes):
            frame = source.model.frames[index]
            if frame.type != pin.FrameType.JOINT and frame.parentJoint in self.of_joint:
                body = self.of_joint[frame.parentJoint]
                if frame.name != body.name:
                    body.sites.setdefault(frame.name, frame.placement)

    def _add(
        self, joint: int, parent: Body, before: list[tuple[MujocoJoint, pin.SE3]], start: pin.SE3
    ) -> None:
        """Add the body of a joint, with joints before it that have none, and those behind it."""
        model = self._model
        own, screws = mujoco_joints(self._source, joint, self._q, self.joint_names)
        self.screws += screws
        at = model.jointPlacements[joint]
        joints = [(one, at.actInv(frame)) for one, frame in before]
        joints += [(one, pin.SE3.Identity()) for one in own]
        behind = self._children[joint]
        if self._is_passed_through(joint) and _can_share(joints, behind, model):
            self._add(behind[0], parent, joints, start * at)
            return
        body = Body(self._links[joint], start * at, pin.Inertia(model.inertias[joint]), joints)
        parent.children.append(body)
        self.of_joint[joint] = body
        for child in behind:
            self._add(child, body, [], pin.SE3.Identity())

    def _is_passed_through(self, joint: int) -> bool:
        """Return whether a link has no mass and does nothing but carry one joint."""
        return (
            is_massless(self._model.inertias[joint])
            and len(self._children[joint]) == 1
            and joint not in self._held
        )


def is_massless(inertia: pin.Inertia) -> bool:
    """Return whether MuJoCo takes a body for one without mass."""
    return bool(inertia.mass < NONE and np.abs(inertia.inertia).max() < NONE)


def _can_share(
    joints: list[tuple[MujocoJoint, pin.SE3]], behind: list[int], model: pin.Model
) -> bool:
    """Return whether MuJoCo lets a body have these joints and the next."""
    turns = [one for one, _ in joints if one.kind == "hinge"]
    several = [one for one, _ in joints if one.kind in ("ball", "free")]
    next_kind = model.joints[behind[0]].shortname()
    if "FreeFlyer" in next_kind or several:
        return False
    return not (turns and "Spherical" in next_kind)
