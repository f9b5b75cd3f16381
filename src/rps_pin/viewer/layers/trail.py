"""Layer ``trail``: the path of a point, magnified, since many a motion is too small to be seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import LoopClosure
from rps_pin.errors import InputError
from rps_pin.viewer.layers.base import Context, Drawing, Framed, Look, Part
from rps_pin.viewer.layers.shapes import (
    PURPLE,
    at,
    ball,
    css,
    length_text,
    paint,
    round_number,
    tube,
)
from rps_pin.viewer.motion import State
from rps_pin.viewer.scene.legend import Key
from rps_pin.viewer.subject import Subject

_SIZE = 0.45
"""Size that a trail is magnified to, at most, in radii of the picture."""
_MOST_POINTS = 240


@dataclass(frozen=True)
class Trail(Framed):
    """The path of a frame's origin, magnified about where it begins.

    Parameters
    ----------
    frame
        A frame of the model. Left out: a 3-RPS's platform; else the first closure's first frame.
    factor
        Magnification, at least 1. Left out: the largest round number that leaves the trail within
        the robot.
    """

    frame: str | None = None
    factor: float | None = None

    def draw(self, context: Context) -> Drawing:
        """Return a tube and a ball that runs along it; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        name = self.frame or _default_frame(context.subject)
        if not model.existFrame(name):
            known = ", ".join(frame.name for frame in model.frames)
            raise InputError(f"layer 'trail': no frame {name!r}; there are: {known}")
        frame = model.getFrameId(name)

        def place(q: Array) -> Array:
            pin.framesForwardKinematics(model, data, q)
            return np.array(data.oMf[frame].translation)

        chosen = context.motion.configurations
        stride = max(1, math.ceil(len(chosen) / _MOST_POINTS))
        points = np.array([place(q) for q in [*chosen[:-1:stride], chosen[-1]]])
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        factor = self._factor(size, context.radius)
        start = points[0]

        def magnified(point: Array) -> Array:
            moved: Array = start + factor * (point - start)
            return moved

        thickness = context.radius / 160.0
        parts = [*_on_top(ball("point", 2.6 * thickness, PURPLE))]
        line = _apart(magnified(points), thickness / 4.0)
        if len(line) > 1:
            parts.append(
                Part("path", "tube", tube(line, thickness), paint(PURPLE, on_top=True), np.eye(4))
            )

        def follow(state: State) -> dict[str, Look]:
            return {"point": Look(at(magnified(place(state.q))))}

        how = f", magnified {factor:g} times about its start" if factor != 1 else ", to scale"
        text = (
            f"path of {name}{how}: {length_text(size)} across" if size > 0.0 else f"{name}, at rest"
        )
        return Drawing(Key("trail", text, css(PURPLE)), parts, follow)

    def _factor(self, size: float, radius: float) -> float:
        if self.factor is not None:
            if not 1.0 <= self.factor < math.inf:
                raise InputError(f"layer 'trail': factor = {self.factor}; it must be at least 1")
            return self.factor
        wanted = _SIZE * radius / size if size > 1e-12 * radius else 1.0
        return max(1.0, round_number(wanted))


def _on_top(parts: list[Part]) -> list[Part]:
    """Return the parts drawn over all else: the platform would hide half of most trails."""
    return [part._replace(material=paint(PURPLE, on_top=True)) for part in parts]


def _default_frame(subject: Subject) -> str:
    if subject.robot is not None:
        return "platform"
    closed = [one for one in subject.mechanism.closures if isinstance(one, LoopClosure)]
    if not closed:
        raise InputError("layer 'trail': say which frame's path, Trail(frame=...)")
    return closed[0].frame_a


def _apart(points: Array, least: float) -> Array:
    """Return the points that lie at least so far from the one before."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= least:
            kept.append(point)
    return np.array(kept)
