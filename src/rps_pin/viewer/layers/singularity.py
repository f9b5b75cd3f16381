"""Layer ``singularity``: a ring on the floor, coloured by the conditioning of passive joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import BLUE, WARNING, colour_bar, css, warning
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Material, Part, TriangleMesh, translated


@dataclass(frozen=True)
class Singularity(RobotSizedLayer):
    """A ring around the robot: blue when well conditioned, vermillion at a type II singularity.

    The measure is 1 / `ClosedLoopModel.condition`, 1 at best, 0 at a singularity, on a scale of
    logarithms.

    Parameters
    ----------
    worst
        The measure at which the colour is vermillion.
    """

    worst: float = 1e-3

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the ring; see `Layer`."""
        mechanism, box = context.subject.mechanism, context.box
        reach = 1.25 * float((box.upper - box.lower)[:2].max()) / 2.0
        ring = trimesh.creation.annulus(0.94 * reach, reach, 0.004 * box.radius, sections=72)
        surface = TriangleMesh(np.array(ring.vertices), np.array(ring.faces))
        place = translated([*box.centre[:2], box.lower[2]])
        parts = [Part("ring", "annulus", surface, Material(0xFFFFFF), np.eye(4))]

        def update(state: MotionState) -> dict[str, NodeState]:
            measure = 1.0 / max(mechanism.condition(state.q), 1.0)
            share = np.log(max(measure, self.worst)) / np.log(self.worst)
            return {"ring": NodeState(place, warning(float(share)))}

        text = "conditioning of the passive joints, 1 / cond(J_p)"
        bar = colour_bar(WARNING, "1: best", f"{self.worst:g}: singular")
        return DrawnLayer(LegendEntry("singularity", text, css(BLUE), bar), parts, update)
