"""Layer ``trail``: the path of a point, magnified: many motions are too small to be seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import LoopClosure
from rps_pin.errors import InputError
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers import base
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import PURPLE, css
from rps_pin.viewer.layers.parts import ball, tube
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Material, Part, translated
from rps_pin.viewer.scene.stage import length_text, round_number

_SIZE = 0.45
"""Size that a trail is magnified to, at most, in radii of the picture."""
_MOST_POINTS = 240


@dataclass(frozen=True)
class Trail(RobotSizedLayer):
    """The path of a frame's origin, magnified about where it begins.

    Parameters
    ----------
    frame
        A frame of the model. Default: that of the task; else frame a of the first closure.
    factor
        Magnification, at least 1. Default: the largest round number that keeps the trail within
        the robot.
    """

    frame: str | None = None
    factor: float | None = None

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return a tube and a ball that runs along it; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        name = self.frame or _default_frame(context.subject)
        frame = base.frame_id(model, name, "trail")
        base.check_magnification(self.factor, "trail")

        def position(q: Array) -> Array:
            pin.framesForwardKinematics(model, data, q)
            return np.array(data.oMf[frame].translation)

        chosen = context.motion.configurations
        stride = max(1, math.ceil(len(chosen) / _MOST_POINTS))
        points = np.array([position(q) for q in [*chosen[:-1:stride], chosen[-1]]])
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        largest = _SIZE * context.radius / size if size > 1e-12 * context.radius else 1.0
        factor, start = self.factor or max(1.0, round_number(largest)), points[0]

        def magnified(point: Array) -> Array:
            return np.asarray(start + factor * (point - start))

        thickness = context.radius / 160.0
        # On top: the platform would hide half of most trails.
        purple = Material(PURPLE, on_top=True)
        parts = [ball("point", 2.6 * thickness, purple)]
        line = _apart(magnified(points), thickness / 4.0)
        if len(line) > 1:
            parts.append(Part("path", "tube", tube(line, thickness), purple, np.eye(4)))

        def update(state: MotionState) -> dict[str, NodeState]:
            return {"point": NodeState(translated(magnified(position(state.q))))}

        how = f"magnified {factor:g} times about its start" if factor != 1 else "to scale"
        path = f"path of {name}, {how}: {length_text(size)} across"
        text = path if size > 0.0 else f"{name}, at rest"
        return DrawnLayer(LegendEntry("trail", text, css(PURPLE)), parts, update)


def _default_frame(subject: DisplayedMechanism) -> str:
    if subject.robot is not None:
        return "platform"
    mechanism = subject.mechanism
    if mechanism.has_task and mechanism.task.frame is not None:
        return str(mechanism.task.frame)
    closed = [one for one in subject.mechanism.closures if isinstance(one, LoopClosure)]
    if not closed:
        raise InputError("layer 'trail': give the frame, Trail(frame=...)")
    return closed[0].frame_a


def _apart(points: Array, least: float) -> Array:
    """Return the points at a distance of at least `least` from the point before."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= least:
            kept.append(point)
    return np.array(kept)
