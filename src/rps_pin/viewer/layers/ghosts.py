"""Layer ``ghosts``: the robot at other configurations, seen through; of a 3-RPS, its modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.urdf import LEGS
from rps_pin.viewer.layers.base import Context, Drawing, Part
from rps_pin.viewer.layers.shapes import css, paint
from rps_pin.viewer.motion import Motion, checked_configurations
from rps_pin.viewer.scene.legend import Key
from rps_pin.viewer.scene.links import link_poses, links_of
from rps_pin.viewer.scene.shapes import parts_of
from rps_pin.viewer.subject import Subject

_OPACITY = 0.28
_COLOURS = (0x0072B2, 0xD55E00, 0x009E73, 0xCC79A7, 0xE69F00, 0x56B4E9)


@dataclass(frozen=True)
class Ghosts:
    """See-through copies of the robot; what moves of it, in a colour for each.

    Parameters
    ----------
    at
        Configurations, shape (k, nq). Left out, of a 3-RPS: every other assembly mode with the leg
        lengths that the motion begins with.
    above
        Of the modes, only those above the base.
    """

    at: Any = None
    above: bool = False

    def configurations(self, subject: Subject, motion: Motion) -> Array:
        """Return the copies' configurations; see `Layer`."""
        if self.at is not None:
            return checked_configurations(subject.model, self.at)
        if subject.robot is None:
            raise InputError("layer 'ghosts': say where, Ghosts(at=configurations)")
        return mode_configurations(subject.robot, motion.configurations[0], above=self.above)

    def draw(self, context: Context) -> Drawing:
        """Return the copies; see `Layer`."""
        subject = context.subject
        model = subject.model
        links = [link for link in links_of(model, subject.visual) if link.moves]
        copies = self.configurations(subject, context.motion)
        poses = link_poses(model, links, copies)
        parts: list[Part] = []
        for copy in range(len(copies)):
            colour = _COLOURS[copy % len(_COLOURS)]
            for index, link in enumerate(links):
                for item in link.geometries:
                    in_link = link.placement.actInv(item.placement).homogeneous
                    for part in parts_of(item):
                        place = poses[copy, index] @ in_link @ part.placement
                        name = f"{link.name}_{len(parts)}"
                        parts.append(
                            Part(f"{copy + 1}", name, part.geometry, _ghostly(colour), place)
                        )
        other = "other assembly modes of these leg lengths" if self.at is None else "other poses"
        return Drawing(Key("ghosts", f"{len(copies)} {other}", css(_COLOURS[0])), parts)


def _ghostly(colour: int) -> mg.MeshPhongMaterial:
    return paint(colour, _OPACITY)


def mode_configurations(robot: RPSRobot, q: Array, *, above: bool = False) -> Array:
    """Return the configurations of the other assembly modes with the leg lengths of q, (k, nq)."""
    model = robot.mechanism.model
    index = model.getJointId
    lengths = [model.joints[index(f"leg_{leg}_prismatic")].idx_q for leg in LEGS]
    angles = [model.joints[index(f"leg_{leg}_revolute")].idx_q for leg in LEGS]
    free = model.joints[index("platform_free")].idx_q
    modes = robot.assembly_modes(q[lengths])
    found = []
    for angle, position, rotation, is_above in zip(
        modes.angle, modes.position, modes.rotation, modes.above, strict=True
    ):
        if np.allclose(position, q[free : free + 3], rtol=0, atol=1e-6) and np.allclose(
            angle, q[angles], rtol=0, atol=1e-6
        ):
            continue  # the mode that is shown already
        if above and not is_above:
            continue
        other = q.copy()
        other[angles] = angle
        other[free : free + 7] = [*position, *pin.Quaternion(rotation).coeffs()]
        found.append(other)
    return np.array(found).reshape(-1, model.nq)
