"""Layer ``closures``: the frames that each closure ties together, and the gap between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.closures import ClosedFrame
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import BLUE, YELLOW, css
from rps_pin.viewer.layers.parts import ball, between
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Cylinder, Material, Part, translated


@dataclass(frozen=True)
class Closures(RobotSizedLayer):
    """A yellow mark at each closure's frame a, a blue one at its frame b, a line between them.

    The line of a ``distance`` closure is its rod; of others, the gap. A coupling is drawn in the
    same way between its joint and each that it follows.

    Parameters
    ----------
    size
        Radius of a mark, m. Default: a sixtieth of the picture's.
    """

    size: float | None = None

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether there are no closures; see `Layer`."""
        return "" if subject.mechanism.closures else "the mechanism has no closures"

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the marks and lines; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data = model.createData()
        ends = {
            node_name(f"{one.name}_{k}" if k else one.name): pair
            for one in mechanism.closures
            for k, pair in enumerate(_pairs(one, model))
        }
        size = context.radius / 60.0 if self.size is None else self.size
        yellow, blue = (Material(colour, on_top=True) for colour in (YELLOW, BLUE))
        line = Cylinder(1.0, 0.3 * size, 0.3 * size)
        parts: list[Part] = []
        for name in ends:
            parts += [
                Part(f"{name}_line", "bar", line, yellow, translated([0.0, 0.0, 0.5])),
                ball(f"{name}_a", size, yellow),
                ball(f"{name}_b", 0.55 * size, blue),
            ]

        def update(state: MotionState) -> dict[str, NodeState]:
            pin.forwardKinematics(model, data, state.q)
            states = {}
            for name, pair in ends.items():
                start, end = (np.array(frame.at(data).translation) for frame in pair)
                states[f"{name}_a"] = NodeState(translated(start))
                states[f"{name}_b"] = NodeState(translated(end))
                states[f"{name}_line"] = NodeState(between(start, end))
            return states

        text = "closures: frame a yellow, frame b blue, the gap (or rod) between them"
        if any(isinstance(closure, JointCoupling) for closure in mechanism.closures):
            text += "; couplings: joint yellow, the other blue"
        return DrawnLayer(LegendEntry("closures", text, css(YELLOW)), parts, update)


def _pairs(
    closure: LoopClosure | JointCoupling, model: pin.Model
) -> list[tuple[ClosedFrame, ClosedFrame]]:
    """Return the pairs of frames that a closure ties together."""
    if isinstance(closure, LoopClosure):
        return [closure.closed_frames(model)]
    joint, *others = (ClosedFrame(i, pin.SE3.Identity()) for i in closure.joint_ids(model))
    return [(joint, other) for other in others]
