"""Layer ``frames``: the axes of the world, of every joint, and of the closed frames."""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin

from rps_pin.closed_loop import LoopClosure
from rps_pin.errors import InputError
from rps_pin.viewer.layers.base import Context, Drawing, Framed, Look, Part
from rps_pin.viewer.layers.shapes import cross, length_text
from rps_pin.viewer.motion import State
from rps_pin.viewer.scene.legend import Key
from rps_pin.viewer.scene.links import node_name


@dataclass(frozen=True)
class Frames(Framed):
    """Axes x red, y green, z blue.

    Parameters
    ----------
    names
        Frames of the model; left out, every joint's and the second of each closure.
    size
        Length of an axis, m; left out, an eighth of the picture's radius.
    """

    names: tuple[str, ...] | None = None
    size: float | None = None

    def draw(self, context: Context) -> Drawing:
        """Return the axes; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        names = self._names(context) if self.names is None else list(self.names)
        unknown = [name for name in names if not model.existFrame(name)]
        if unknown:
            known = ", ".join(frame.name for frame in model.frames)
            raise InputError(f"layer 'frames': no frame {unknown[0]!r}; there are: {known}")
        size = context.radius / 8.0 if self.size is None else self.size
        nodes: dict[str, int] = {}
        parts: list[Part] = []
        for name in names:
            node = node_name(name, set(nodes))
            nodes[node] = int(model.getFrameId(name))
            parts += cross(node, size)

        def follow(state: State) -> dict[str, Look]:
            pin.framesForwardKinematics(model, data, state.q)
            return {node: Look(data.oMf[frame].homogeneous) for node, frame in nodes.items()}

        text = f"frames: x red, y green, z blue, {length_text(size)} long"
        return Drawing(Key("frames", text, "#2ca02c"), parts, follow)

    def _names(self, context: Context) -> list[str]:
        closures = context.subject.mechanism.closures
        closed = [one.frame_b for one in closures if isinstance(one, LoopClosure)]
        return list(dict.fromkeys([*context.subject.model.names, *closed]))
