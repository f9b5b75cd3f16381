"""Layer ``ghosts``: transparent copies of the robot at other configurations or assembly modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.bars import moving_bars
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, Moving
from rps_pin.viewer.layers.colours import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, css
from rps_pin.viewer.motion import Motion, MotionState, checked_configurations
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import link_poses, links_of
from rps_pin.viewer.scene.shapes import Cylinder, Material, Part, translated

_OPACITY = 0.28
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)


@dataclass(frozen=True)
class Ghosts:
    """Transparent copies of the robot's moving links and rods, each in its own colour.

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

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether there are no other poses; see `Layer`."""
        if self.at is None and subject.robot is None:
            return "give the configurations, Ghosts(at=configurations)"
        found = self.configurations(subject, motion)
        return "" if len(found) else "these leg lengths have no other assembly mode"

    def configurations(self, subject: DisplayedMechanism, motion: Motion) -> Array:
        """Return the copies' configurations; see `Layer`."""
        if self.at is not None:
            return checked_configurations(subject.model, self.at)
        assert subject.robot is not None  # as `missing` has made sure
        return mode_configurations(subject.robot, motion.configurations[0], above=self.above)

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the copies; see `Layer`."""
        subject = context.subject
        links = [link for link in links_of(subject.model, subject.visual) if link.moves]
        copies = self.configurations(subject, context.motion)
        bars = moving_bars(subject)
        parts: list[Part] = []
        for copy, poses in enumerate(link_poses(subject.model, links, copies)):
            material = Material(_COLOURS[copy % len(_COLOURS)], _OPACITY)
            node = f"{copy + 1}"
            for link, pose in zip(links, poses, strict=True):
                for part in link.parts(material):
                    name, placement = f"{link.name}_{part.name}", pose @ part.placement
                    parts.append(part._replace(node=node, name=name, placement=placement))
            if bars is not None:
                parts += _bars(bars, copies[copy], node, material)
        other = "other assembly modes of these leg lengths" if self.at is None else "other poses"
        return DrawnLayer(LegendEntry("ghosts", f"{len(copies)} {other}", css(_COLOURS[0])), parts)


def _bars(bars: Moving, q: Array, node: str, material: Material) -> list[Part]:
    """Return the bars that are no links, as parts of a node, at a configuration."""
    states = bars.update(MotionState(q, np.zeros(0), np.zeros(0)))
    parts = []
    for part in bars.parts:
        place = np.array(states[part.node].placement)
        length = float(np.linalg.norm(place[:3, 2]))
        place[:3, 2] /= length
        shape = part.shape
        assert isinstance(shape, Cylinder)
        name, middle = f"bar_{part.node}", translated([0.0, 0.0, length / 2.0])
        whole = Cylinder(length, shape.radius, shape.upper_radius)
        parts.append(Part(node, name, whole, material, place @ middle))
    return parts


def mode_configurations(robot: RPSRobot, q: Array, *, above: bool = False) -> Array:
    """Return the configurations of the other assembly modes with the leg lengths of q, (k, nq)."""
    angles, lengths, position = slice(0, 6, 2), slice(1, 6, 2), slice(6, 9)
    modes = robot.assembly_modes(q[lengths])
    same = np.isclose(modes.position, q[position], rtol=0, atol=1e-6).all(axis=1)
    same &= np.isclose(modes.angle, q[angles], rtol=0, atol=1e-6).all(axis=1)  # shown already
    wanted = ~same & modes.above if above else ~same
    found = np.tile(q, (int(wanted.sum()), 1))
    found[:, angles], found[:, position] = modes.angle[wanted], modes.position[wanted]
    for row, rotation in zip(found, modes.rotation[wanted], strict=True):
        row[9:13] = pin.Quaternion(rotation).coeffs()
    return found
