"""Layer ``ghosts``: transparent copies of the robot at other configurations or assembly modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.urdf import LEGS
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext
from rps_pin.viewer.layers.colours import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, css
from rps_pin.viewer.motion import Motion, checked_configurations
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import link_poses, links_of
from rps_pin.viewer.scene.shapes import Material, Part

_OPACITY = 0.28
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)


@dataclass(frozen=True)
class Ghosts:
    """Transparent copies of the robot's moving links, each in its own colour.

    Parameters
    ----------
    at
        Configurations, shape (k, nq). Default, for a 3-RPS: every other assembly mode with the leg
        lengths that the motion begins with.
    above
        Whether only the modes above the base are shown.
    """

    at: Any = None
    above: bool = False

    def configurations(self, subject: DisplayedMechanism, motion: Motion) -> Array:
        """Return the copies' configurations; see `Layer`."""
        if self.at is not None:
            return checked_configurations(subject.model, self.at)
        if subject.robot is None:
            raise InputError("layer 'ghosts': give the configurations, Ghosts(at=configurations)")
        return mode_configurations(subject.robot, motion.configurations[0], above=self.above)

    def draw(self, context: LayerContext) -> DrawnLayer:
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
                parts += [
                    part._replace(
                        node=f"{copy + 1}",
                        name=f"{link.name}_{part.name}",
                        placement=poses[copy, index] @ part.placement,
                    )
                    for part in link.parts(Material(colour, _OPACITY))
                ]
        other = "other assembly modes of these leg lengths" if self.at is None else "other poses"
        return DrawnLayer(LegendEntry("ghosts", f"{len(copies)} {other}", css(_COLOURS[0])), parts)


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
