"""What every layer is: parts below one node, some of which follow the robot, and a key."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from rps_pin.arrays import Array
from rps_pin.viewer.motion import Motion, State
from rps_pin.viewer.scene.bounds import Box
from rps_pin.viewer.scene.legend import Key
from rps_pin.viewer.subject import Subject

Colour = tuple[float, float, float]

UNSEEN = 1e-6
"""Scale of what has no size just now: zero would leave it without a direction."""


@dataclass(frozen=True)
class Context:
    """What a layer is drawn for."""

    subject: Subject
    """The mechanism."""
    motion: Motion
    """What it does."""
    box: Box
    """What the robot fills, over the whole motion."""

    @property
    def radius(self) -> float:
        """Radius of the sphere that the picture is set for, m."""
        return self.box.radius


class Part(NamedTuple):
    """One Meshcat object of a layer."""

    node: str
    """The node below the layer's that carries it, and that may follow the robot."""
    name: str
    """Its own name below that."""
    geometry: Any
    """A ``meshcat.geometry.Geometry``."""
    material: Any
    """A ``meshcat.geometry.Material``."""
    placement: Array
    """Homogeneous (4, 4), in the node."""


class Look(NamedTuple):
    """How a node looks in one state."""

    placement: Array
    """Homogeneous (4, 4) in the world; its columns' lengths are scales."""
    colour: Colour | None = None
    """Red, green, blue from 0 to 1 of all its parts, where colours mean something."""


Follow = Callable[[State], Mapping[str, Look]]


class Drawing(NamedTuple):
    """A layer, drawn for one context."""

    key: Key
    """Its line on the page."""
    parts: Sequence[Part]
    """What it is made of."""
    follow: Follow | None = None
    """How its nodes look in a state, by name; None where nothing changes."""


class Layer(Protocol):
    """Options of a layer; drawing it makes them into parts."""

    def configurations(self, subject: Subject, motion: Motion) -> Array:
        """Return configurations (k, nq) besides the motion's that the picture shall hold."""

    def draw(self, context: Context) -> Drawing:
        """Return the layer, drawn.

        Raises
        ------
        InputError
            If the context does not have what the layer shows.
        """


class Framed:
    """A layer that needs no more room than the robot."""

    def configurations(self, subject: Subject, motion: Motion) -> Array:
        """Return none."""
        return np.empty((0, subject.model.nq))
