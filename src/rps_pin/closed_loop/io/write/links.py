"""Links of a URDF for the bodies and frames of a tree.

Pinocchio keeps one body a joint; what a URDF had as links on fixed joints are frames. Written, a
joint moves one link with all of its body's inertia, and every other frame is an empty link on a
fixed joint, below the link that it was below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.io.write.source import Names

_JOINT, _FIXED, _BODY = pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT, pin.FrameType.BODY


class Hung(NamedTuple):
    """Something at a placement in a link."""

    link: str
    placement: pin.SE3


class FixedLink(NamedTuple):
    """An empty link on a fixed joint."""

    name: str
    joint: str
    below: Hung


class Links:
    """The links of a tree.

    Attributes
    ----------
    moved : list of str
        The link that each joint moves; the first is the root link, for the world.
    of_frames : dict of int to Hung
        Of each frame of the tree, the link that it stands for, and its placement in the joint.
    hung : list of Hung
        Where each joint begins; the first means nothing.
    fixed : list of FixedLink
        The other links.
    """

    def __init__(self, model: pin.Model) -> None:
        self._model = model
        self._names = Names([frame.name for frame in model.frames])
        self._joint_names = Names([*model.names, *(frame.name for frame in model.frames)])
        self._used: set[str] = set()
        #: Of each frame, its link; with the link's placement in the joint's frame.
        self.of_frames: dict[int, Hung] = {}
        self.moved = [self._moved(joint) for joint in range(model.njoints)]
        self.fixed: list[FixedLink] = []
        for index in range(1, model.nframes):
            if index not in self.of_frames:
                self.fixed.append(self._fixed(index))
        self.hung = [Hung("", pin.SE3.Identity())]
        self.hung += [self._hung(joint) for joint in range(1, model.njoints)]

    def _moved(self, joint: int) -> str:
        """Return the name of a joint's link, and note the frames that stand for it."""
        frames = self._model.frames
        own = [i for i, frame in enumerate(frames) if frame.parentJoint == joint]
        ends = [i for i in own if i == 0 or (joint and frames[i].type == _JOINT)]
        bodies = [i for i in own if frames[i].type == _BODY and _is_identity(frames[i].placement)]
        bodies = [i for i in bodies if frames[i].parentFrame in ends or not ends]
        wanted = f"{self._model.names[joint]}_link" if joint else "base"
        name = self._link_name(frames[bodies[0]].name if bodies else None, wanted)
        for index in ends + bodies[:1]:
            self.of_frames[index] = Hung(name, pin.SE3.Identity())
        return name

    def _fixed(self, index: int) -> FixedLink:
        """Return the link for a frame, or for a fixed joint's frame and the body's behind it."""
        frames = self._model.frames
        frame = frames[index]
        below = self._below(frame)
        body, joint = index, ""
        if frame.type == _FIXED:
            after = range(index + 1, len(frames))
            behind = [
                i for i in after if frames[i].parentFrame == index and frames[i].type == _BODY
            ]
            body, joint = (behind or [-1])[0], frame.name
        name = self._link_name(frames[body].name if body >= 0 else None, f"{frame.name}_link")
        for one in {index, body} - {-1}:
            self.of_frames[one] = Hung(name, frame.placement)
        return FixedLink(name, joint or self._joint_names.fresh(f"{frame.name}_fixed"), below)

    def _link_name(self, given: str | None, wanted: str) -> str:
        """Return a frame's name for its link, or if it has none or shares it a new one."""
        name = given if given and given not in self._used else self._names.fresh(given or wanted)
        self._used.add(name)
        return name

    def _below(self, frame: pin.Frame) -> Hung:
        """Return where a frame is, in the link of the frame before it."""
        before = self.of_frames.get(frame.parentFrame)
        at_joint = Hung(self.moved[frame.parentJoint], pin.SE3.Identity())
        same = self._model.frames[frame.parentFrame].parentJoint == frame.parentJoint
        link, at = before if before is not None and same else at_joint
        return Hung(link, at.actInv(frame.placement))

    def _hung(self, joint: int) -> Hung:
        """Return where a joint begins."""
        model, placement = self._model, self._model.jointPlacements[joint]
        parent = model.parents[joint]
        for frame in model.frames:
            if frame.type == _JOINT and frame.parentJoint == joint:
                link, at = self.of_frames[frame.parentFrame]
                if model.frames[frame.parentFrame].parentJoint == parent:
                    return Hung(link, at.actInv(placement))
        return Hung(self.moved[parent], placement)


def _is_identity(placement: pin.SE3) -> bool:
    return bool(np.array_equal(placement.homogeneous, np.eye(4)))
