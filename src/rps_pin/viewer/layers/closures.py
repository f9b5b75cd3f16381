"""Layer ``closures``: what is held together, and how far it is apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from rps_pin.closed_loop import JointCoupling, LoopClosure
from rps_pin.errors import InputError
from rps_pin.viewer.layers.base import Context, Drawing, Framed, Look, Part
from rps_pin.viewer.layers.shapes import BLUE, YELLOW, along_z, at, between, css, paint
from rps_pin.viewer.motion import State
from rps_pin.viewer.scene.legend import Key


@dataclass(frozen=True)
class Closures(Framed):
    """A yellow mark at each closure's frame a, a blue one at its frame b, a line between them.

    The line of a ``distance`` closure is its rod; of others, the gap. A coupling is drawn in the
    same way between its joints.

    Parameters
    ----------
    size
        Radius of a mark, m; left out, a sixtieth of the picture's.
    """

    size: float | None = None

    def draw(self, context: Context) -> Drawing:
        """Return the marks and lines; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data = model.createData()
        ends = {
            closure.name.replace("/", "."): _ends(closure, model, data)
            for closure in mechanism.closures
        }
        if not ends:
            raise InputError("layer 'closures': the mechanism has none")
        size = context.radius / 60.0 if self.size is None else self.size
        parts: list[Part] = []
        for name in ends:
            first = paint(YELLOW, on_top=True)
            second = paint(BLUE, on_top=True)
            line = mg.Cylinder(1.0, 0.3 * size)
            parts += [
                Part(f"{name}_line", "bar", line, paint(YELLOW, on_top=True), along_z(0.5)),
                Part(f"{name}_a", "ball", mg.Sphere(size), first, np.eye(4)),
                Part(f"{name}_b", "ball", mg.Sphere(0.55 * size), second, np.eye(4)),
            ]

        def follow(state: State) -> dict[str, Look]:
            pin.framesForwardKinematics(model, data, state.q)
            looks = {}
            for name, (placements, a, b) in ends.items():
                start, end = (np.array(placements[one].translation) for one in (a, b))
                looks[f"{name}_a"], looks[f"{name}_b"] = Look(at(start)), Look(at(end))
                looks[f"{name}_line"] = Look(between(start, end))
            return looks

        text = "closures: frame a yellow, frame b blue, the gap (or rod) between them"
        if any(isinstance(closure, JointCoupling) for closure in mechanism.closures):
            text += "; couplings: joint yellow, the other blue"
        return Drawing(Key("closures", text, css(YELLOW)), parts, follow)


def _ends(closure: LoopClosure | JointCoupling, model: pin.Model, data: pin.Data) -> Any:
    """Return the placements, and the indices in them, of what a closure ties together."""
    if isinstance(closure, JointCoupling):
        return data.oMi, model.getJointId(closure.joint), model.getJointId(closure.other)
    return data.oMf, *closure.frame_ids(model)
