"""Interface of the layers: options, the context that they are drawn for, and the drawn layer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints import closures
from rps_pin.errors import InputError
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.bounds import BoundingBox
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Part

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""


@dataclass(frozen=True)
class LayerContext:
    """The mechanism and the motion that a layer is drawn for."""

    subject: DisplayedMechanism
    """The mechanism."""
    motion: Motion
    """Its motion."""
    box: BoundingBox
    """The box that the robot fills over the whole motion."""

    @property
    def radius(self) -> float:
        """Radius of the sphere that the picture is framed for, m."""
        return self.box.radius


class NodeState(NamedTuple):
    """Placement and colour of a layer's node in one state."""

    placement: Array
    """Homogeneous (4, 4) in the world; its columns' lengths are scales."""
    colour: Colour | None = None
    """Of all parts of the node; None if it does not change."""


NodeStates = Mapping[str, NodeState]
"""States of a layer's nodes, by name."""


class Moving(NamedTuple):
    """Shapes that move with the robot, not as one of its links."""

    parts: Sequence[Part]
    """The shapes."""
    update: Callable[[MotionState], NodeStates]
    """Returns where their nodes are in a state."""


class DrawnLayer(NamedTuple):
    """A layer, drawn for one context."""

    legend: LegendEntry
    """Its line in the legend."""
    parts: Sequence[Part]
    """Its shapes."""
    update: Callable[[MotionState], NodeStates] | None = None
    """Returns where its nodes are in a state; None where nothing moves."""
    reading: Callable[[MotionState], str] | None = None
    """Returns the number that the layer shows in a state, with its name and unit."""
    greatest: Mapping[str, float] = {}
    """Of a layer of arrows: the greatest force and moment of the motion, by unit."""
    in_scale: Callable[[Mapping[str, float]], DrawnLayer] | None = None
    """Returns the arrows in the scale of the greatest of all layers, by unit."""


class Layer(Protocol):
    """Options of a layer.

    A method ``missing(subject, motion)``, where there is one, returns in words what the layer would
    need to show anything here, or an empty text; see `what_is_missing`.
    """

    def configurations(self, subject: DisplayedMechanism, motion: Motion) -> Array:
        """Return configurations (k, nq) besides the motion's that the picture is framed for."""

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the layer, drawn.

        Raises
        ------
        InputError
            If the mechanism or motion does not have what the layer shows.
        """


class RobotSizedLayer:
    """A layer within the robot's bounding box."""

    def configurations(self, subject: DisplayedMechanism, motion: Motion) -> Array:
        """Return none."""
        return np.empty((0, subject.model.nq))

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return what is missing here, in words: nothing."""
        return ""


def what_is_missing(layer: Layer, subject: DisplayedMechanism, motion: Motion) -> str:
    """Return in words what a layer would need to show anything here; empty where it has it."""
    of_layer = getattr(layer, "missing", None)
    return "" if of_layer is None else str(of_layer(subject, motion))


def frame_id(model: pin.Model, name: str, layer: str) -> int:
    """Return a frame's index, or raise `InputError` with the frames that there are."""
    return closures.frame_id(model, name, f"layer {layer!r}")


def check_magnification(factor: float | None, layer: str) -> None:
    """Raise `InputError` unless a factor is None, or finite and at least 1."""
    if factor is not None and not 1.0 <= factor < np.inf:
        raise InputError(f"layer {layer!r}: factor = {factor}; it must be at least 1")
