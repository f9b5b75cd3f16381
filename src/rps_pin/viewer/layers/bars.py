"""Bars that change their direction or length as the robot moves, which no link has as a shape.

Rods of ``distance`` closures, which are no bodies; and of a skeleton, the bars that prismatic
joints draw out.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop import LoopClosure
from rps_pin.closed_loop.constraints.closures import ClosedFrame
from rps_pin.closed_loop.visuals import bar_radius, sliding_joints
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import Moving, NodeState
from rps_pin.viewer.layers.parts import between
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Cylinder, Material, Part, translated

_ROD, _BAR = Material(0x7C8794), Material(0x2963AD)
#: Of rods beside a robot's own shapes, in radii of a skeleton's bars.
_THIN = 0.4


def moving_bars(subject: DisplayedMechanism) -> Moving | None:
    """Return the bars of a mechanism, if it has any; the nodes' names are those of its closures."""
    mechanism, model = subject.mechanism, subject.model
    data = model.createData()
    ends: dict[str, tuple[ClosedFrame, ClosedFrame]] = {}
    colours: dict[str, Material] = {}
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure) and closure.kind == "distance":
            name = node_name(closure.name, ends)
            ends[name], colours[name] = closure.closed_frames(model), _ROD
    for joint in sliding_joints(mechanism) if subject.is_skeleton else ():
        name = node_name(model.names[joint], ends)
        foot = ClosedFrame(int(model.parents[joint]), model.jointPlacements[joint])
        ends[name], colours[name] = (foot, ClosedFrame(joint, pin.SE3.Identity())), _BAR
    if not ends:
        return None
    radius = bar_radius(mechanism) * (1.0 if subject.is_skeleton else _THIN)
    bar, middle = Cylinder(1.0, radius, radius), translated([0.0, 0.0, 0.5])
    parts = [Part(name, "bar", bar, colours[name], middle) for name in ends]

    def update(state: MotionState) -> dict[str, NodeState]:
        pin.forwardKinematics(model, data, state.q)
        places = {
            name: [np.array(frame.at(data).translation) for frame in pair]
            for name, pair in ends.items()
        }
        return {name: NodeState(between(*pair)) for name, pair in places.items()}

    return Moving(parts, update)
