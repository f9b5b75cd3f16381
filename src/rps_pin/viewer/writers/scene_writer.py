"""Interface of a front end: the commands from which it draws a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from rps_pin.arrays import Array
from rps_pin.viewer.scene.keyframes import NodeKeyframes
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Part
from rps_pin.viewer.scene.stage import Stage


class SceneWriter(Protocol):
    """A front end. Paths begin with ``/world``, whose frame is the world frame in metres."""

    def set_stage(self, stage: Stage) -> None:
        """Set camera, lights and background, and draw the stage's parts."""

    def add_part(self, path: str, part: Part, *, casts_shadow: bool = True) -> None:
        """Draw a part at a path, in the frame of the path's parent."""

    def place(self, path: str, placement: Array) -> None:
        """Place a node: homogeneous (4, 4) in its parent's frame; columns' lengths are scales."""

    def set_colour(self, path: str, colour: Sequence[float], opacity: float) -> None:
        """Colour the part at a path: red, green, blue and opacity, 0 to 1."""

    def set_visible(self, path: str, visible: bool) -> None:
        """Show or hide a node with all below it."""

    def set_legend(self, entries: Sequence[LegendEntry], visible: Sequence[bool]) -> None:
        """Show the legend of the layers, with a switch for each."""

    def set_readings(self, time: float | None, readings: Mapping[str, str]) -> None:
        """Show the layers' texts, by the layer's name, and a clock (s) where a time is given."""

    def animate(
        self,
        elapsed: Array,
        keyframes: Sequence[NodeKeyframes],
        readings: Mapping[str, Sequence[str]],
    ) -> None:
        """Play keyframes at times (s, from zero, shape (n,)) in a loop, without this process.

        With a clock, and the layers' texts at these times, by the layer's name.
        """
