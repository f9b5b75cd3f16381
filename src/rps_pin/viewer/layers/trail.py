"""Layer ``trail``: the path of a point, magnified: many motions are too small to be seen."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import LoopClosure
from rps_pin.errors import RPSPinError
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers import base
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import PURPLE, css
from rps_pin.viewer.layers.parts import ball, tube
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import UNIVERSE
from rps_pin.viewer.scene.shapes import Material, Part, translated
from rps_pin.viewer.scene.stage import length_text, round_number

_SIZE = 0.45
"""Size that a trail is magnified to, at most, in radii of the picture."""
_MOST_POINTS = 240
#: Largest path of a point that does not move, in characteristic lengths.
_STILL = 1e-9


@dataclass(frozen=True)
class Trail(RobotSizedLayer):
    """The path of a frame's origin, magnified about where it begins.

    Parameters
    ----------
    frame
        A frame of the model. Default: that of the task; else the first of a closure that can move.
    factor
        Magnification, at least 1. Default: the largest round number that keeps the trail within
        the robot.

    It is refused where the robot is at rest.
    """

    frame: str | None = None
    factor: float | None = None

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether the frame is unknown or stands still; see `Layer`."""
        base.check_magnification(self.factor, "trail")
        name = self.frame or _default_frame(subject)
        position = None if name is None else _position(subject.model, name)
        if motion.duration == 0.0:
            return "the robot is at rest: a path needs a motion"
        if position is None:
            return "it needs a frame: Trail(frame=...)"
        size = float(np.linalg.norm(np.ptp(_points(position, motion), axis=0)))
        length = subject.mechanism.characteristic_length
        return "" if size > _STILL * length else f"the origin of {name!r} does not move"

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return a tube and a ball that runs along it; see `Layer`."""
        name = self.frame or _default_frame(context.subject)
        assert name is not None  # as `missing` has made sure
        position = _position(context.subject.model, name)
        points = _points(position, context.motion)
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        factor = self.factor or max(1.0, round_number(_SIZE * context.radius / size))
        start = points[0]

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
        text = f"path of {name}, {how}: {length_text(size)} across"
        return DrawnLayer(LegendEntry("trail", text, css(PURPLE)), parts, update)


def _position(model: pin.Model, name: str) -> Callable[[Array], Array]:
    """Return a function of a configuration: the position of a frame's origin."""
    data, frame = model.createData(), base.frame_id(model, name, "trail")

    def position(q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[frame].translation)

    return position


def _points(position: Callable[[Array], Array], motion: Motion) -> Array:
    """Return positions along a motion, shape (n, 3), the first and the last among them."""
    chosen = motion.configurations
    stride = max(1, math.ceil(len(chosen) / _MOST_POINTS))
    return np.array([position(q) for q in [*chosen[:-1:stride], chosen[-1]]])


def _default_frame(subject: DisplayedMechanism) -> str | None:
    if subject.robot is not None:
        return "platform"
    mechanism = subject.mechanism
    if mechanism.has_task:
        with contextlib.suppress(RPSPinError):  # a task that does not fit an edited mechanism
            if mechanism.task.frame is not None:
                return str(mechanism.task.frame)
    closed = [one for one in subject.mechanism.closures if isinstance(one, LoopClosure)]
    model = subject.model
    for one in closed:
        for name, frame in zip((one.frame_a, one.frame_b), one.closed_frames(model), strict=True):
            if frame.joint != UNIVERSE:
                return name
    return None


def _apart(points: Array, least: float) -> Array:
    """Return the points at a distance of at least `least` from the point before."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= least:
            kept.append(point)
    return np.array(kept)
