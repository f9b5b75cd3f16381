"""Layer ``frames``: axes of the world, of every joint, and of the closures' frames."""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin

from rps_pin.closed_loop import LoopClosure
from rps_pin.viewer.layers import base
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.parts import axes
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Part
from rps_pin.viewer.scene.stage import length_text


@dataclass(frozen=True)
class Frames(RobotSizedLayer):
    """Axes x red, y green, z blue.

    Parameters
    ----------
    names
        Frames of the model. Default: every joint's, and frame b of each closure.
    size
        Length of an axis, m. Default: an eighth of the picture's radius.
    """

    names: tuple[str, ...] | None = None
    size: float | None = None

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the axes; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        closures = context.subject.mechanism.closures
        closed = [one.frame_b for one in closures if isinstance(one, LoopClosure)]
        names = dict.fromkeys([*model.names, *closed]) if self.names is None else self.names
        size = context.radius / 8.0 if self.size is None else self.size
        nodes: dict[str, int] = {}
        parts: list[Part] = []
        for name in names:
            node = node_name(name, set(nodes))
            nodes[node] = base.frame_id(model, name, "frames")
            parts += axes(node, size)

        def update(state: MotionState) -> dict[str, NodeState]:
            pin.framesForwardKinematics(model, data, state.q)
            return {node: NodeState(data.oMf[frame].homogeneous) for node, frame in nodes.items()}

        text = f"frames: x red, y green, z blue, {length_text(size)} long"
        return DrawnLayer(LegendEntry("frames", text, "#2ca02c"), parts, update)
