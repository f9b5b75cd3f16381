"""View of a robot with layers, in any front end."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import real_vector
from rps_pin.viewer.displayed_mechanism import configuration_of, displayed, motion_of
from rps_pin.viewer.layers import layer_name, layers_of
from rps_pin.viewer.layers.bars import moving_bars
from rps_pin.viewer.layers.base import (
    DrawnLayer,
    Layer,
    LayerContext,
    Moving,
    what_is_missing,
)
from rps_pin.viewer.motion import FRAME_RATE, MotionState
from rps_pin.viewer.playback import follow_clock
from rps_pin.viewer.scene.bounds import bounding_box, part_points
from rps_pin.viewer.scene.keyframes import NodeKeyframes
from rps_pin.viewer.scene.links import links_of, node_name
from rps_pin.viewer.scene.scene import ROBOT, Scene
from rps_pin.viewer.scene.shapes import Part
from rps_pin.viewer.scene.stage import WORLD
from rps_pin.viewer.writers.scene_writer import SceneWriter
from rps_pin.viewer.writers.window import Window

LAYERS_NODE = f"{WORLD}/layers"
"""Path of the node that holds the layers: one child each, by the layer's name."""
_BARS_NODE = f"{ROBOT}/bars"
"""Path of the node that holds bars which are no links."""
_MOST_SEEN = 50
"""States of a motion at which the picture holds what moves besides the links, at most."""


class View:
    """A robot with layers in a window, shown at the motion's beginning.

    Parameters
    ----------
    window
        Meshcat's window: a `Recorder`, a `LocalViewer.window`, or Meshcat's own; or another front
        end, a `SceneWriter`.
    what
        A 3-RPS, or any mechanism.
    motion
        Its motion or pose: a pose (3,) of a 3-RPS, a configuration (nq,), a trajectory, a
        `MotionRun`, a `Simulation` or a `Motion`. Picture and scales of the layers are set for it.
        Default: a mechanism's home.
    visual
        Geometry of the mechanism. Default: a 3-RPS's own; for others the shapes in the file that it
        was read from, or bars between the joints where there are none.
    layers, hidden
        Names (see `rps_pin.viewer.LAYERS`) or objects such as ``Trail(factor=100)``; those in
        `hidden` are there, but switched off; they are left out if they have nothing to show here.

    Attributes
    ----------
    subject : DisplayedMechanism
        The mechanism.
    motion : Motion
        Its motion.
    scene : Scene
        The robot on its stage.
    drawings : dict of str to DrawnLayer
        The layers, by the name of their node below ``/world/layers``.
    updates_hidden : bool
        Whether layers that are switched off follow the robot too, which a page may show by itself.

    Raises
    ------
    InputError
        If the motion does not fit, a layer is unknown, or one of `layers` has nothing to show here;
        says what is missing.
    """

    def __init__(
        self,
        window: Window | SceneWriter,
        what: RPSRobot | ClosedLoopModel,
        motion: Any = None,
        *,
        visual: pin.GeometryModel | None = None,
        layers: Sequence[str | Layer] = (),
        hidden: Sequence[str | Layer] = (),
    ) -> None:
        self.window, self.updates_hidden = window, True
        self.subject = displayed(what, visual)
        self.motion = motion_of(self.subject, motion)
        on, off = self._with_contents(layers_of(layers), layers_of(hidden))
        more = [layer.configurations(self.subject, self.motion) for layer in on]
        framed = np.concatenate([self.motion.configurations, *more])
        model, visual = self.subject.model, self.subject.visual
        bars = moving_bars(self.subject)
        self._moving: dict[str, Moving | DrawnLayer] = {_BARS_NODE: bars} if bars else {}
        self.drawings = self._drawn([*on, *off], framed)
        self._moving |= {f"{LAYERS_NODE}/{name}": one for name, one in self.drawings.items()}
        self._visible = {name: k < len(on) for k, name in enumerate(self.drawings)}
        self.scene = Scene(model, visual, window, framed, self._around())
        self._writer = self.scene.writer
        for path, drawn in self._moving.items():
            for part in drawn.parts:
                shadow = path == _BARS_NODE
                self._writer.add_part(_part_path(path, part), part, casts_shadow=shadow)
        for name, visible in self._visible.items():
            if not visible:
                self._writer.set_visible(f"{LAYERS_NODE}/{name}", False)
        if self.drawings:
            self._send_legend()
        moves = self.motion.duration > 0.0
        self._update_layers(self.motion.state_at(0.0), 0.0 if moves else None)

    def display(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> None:
        """Show the robot and its layers in a state.

        Parameters
        ----------
        q
            A configuration (nq,), or a pose (3,) of a 3-RPS.
        v, a
            Velocity and acceleration (nv,), for the layers that show forces. Default: zero.

        Raises
        ------
        InputError
            If an array does not fit.
        UnreachableError
            If a pose is out of reach.
        """
        nv = self.subject.model.nv
        rates = [
            np.zeros(nv) if given is None else real_vector(given, nv, name)
            for given, name in ((v, "v"), (a, "a"))
        ]
        self._show(MotionState(configuration_of(self.subject, q), *rates))

    def show_moment(self, elapsed: float) -> None:
        """Show the motion's state `elapsed` seconds after its beginning."""
        self._show(self.motion.state_at(elapsed), elapsed)

    def set_visible(self, name: str, visible: bool) -> None:
        """Switch a layer on or off.

        Raises
        ------
        InputError
            If there is no such layer here; says which there are.
        """
        if name not in self._visible:
            there = ", ".join(self._visible) or "none"
            raise InputError(f"no layer {name!r} in this view; there are: {there}")
        self._visible[name] = bool(visible)
        self._writer.set_visible(f"{LAYERS_NODE}/{name}", bool(visible))
        self._send_legend()

    def play(self, stop: threading.Event | None = None, *, frame_rate: float = FRAME_RATE) -> None:
        """Show the motion at the speed of its times, in a loop, until `stop` is set or Ctrl-C."""
        follow_clock(self.motion, self.show_moment, stop, frame_rate)

    def animate(self, *, frame_rate: float = FRAME_RATE) -> None:
        """Let the window play the motion in a loop, layers included.

        Raises
        ------
        InputError
            If the motion has no duration, or the frame rate is not positive.
        """
        states = list(self.motion.states(frame_rate))
        keyframes: list[NodeKeyframes] = []
        for path, drawn in self._moving.items():
            keyframes += _keyframes(path, drawn, states)
        readings = {
            name: [drawn.reading(state) for state in states]
            for name, drawn in self.drawings.items()
            if drawn.reading is not None
        }
        self.scene.animate(self.motion, frame_rate=frame_rate, more=keyframes, readings=readings)

    def _with_contents(
        self, on: Sequence[Layer], off: Sequence[Layer]
    ) -> tuple[Sequence[Layer], Sequence[Layer]]:
        """Return the layers; hidden ones with nothing to show are left out, others refused."""
        subject, motion = self.subject, self.motion
        for layer in on:
            missing = what_is_missing(layer, subject, motion)
            if missing:
                raise InputError(f"layer {layer_name(layer)!r} has nothing to show: {missing}")
        return on, [layer for layer in off if not what_is_missing(layer, subject, motion)]

    def _drawn(self, layers: Sequence[Layer], framed: Array) -> dict[str, DrawnLayer]:
        """Return the layers, drawn, by the name of their node; arrows in one scale."""
        model, visual = self.subject.model, self.subject.visual
        box = bounding_box(model, links_of(model, visual), framed)
        context = LayerContext(self.subject, self.motion, box)
        drawings: dict[str, DrawnLayer] = {}
        for layer in layers:
            drawn = layer.draw(context)
            name = node_name(drawn.legend.name, drawings)
            drawings[name] = drawn._replace(legend=replace(drawn.legend, name=name))
        greatest: dict[str, float] = {}
        for drawn in drawings.values():
            for unit, most in drawn.greatest.items():
                greatest[unit] = max(most, greatest.get(unit, 0.0))
        for name, drawn in drawings.items():
            if drawn.in_scale is not None:
                scaled = drawn.in_scale(greatest)
                drawings[name] = scaled._replace(legend=replace(scaled.legend, name=name))
        return drawings

    def _around(self) -> Array:
        """Return points around all that moves or is drawn besides the links, shape (k, 3)."""
        times = np.linspace(0.0, self.motion.duration, min(_MOST_SEEN, len(self.motion.times)))
        states = [self.motion.state_at(float(time)) for time in times]
        points = [np.empty((0, 3))]
        for drawn in self._moving.values():
            updates = [drawn.update(state) for state in states] if drawn.update else []
            for part in drawn.parts:
                own = part_points(part)
                places = [nodes[part.node].placement for nodes in updates if part.node in nodes]
                for place in places or [np.eye(4)]:
                    points.append(own @ place[:3, :3].T + place[:3, 3])
        return np.concatenate(points)

    def _show(self, state: MotionState, elapsed: float | None = None) -> None:
        self.scene.display(state.q)
        self._update_layers(state, elapsed)

    def _is_updated(self, name: str) -> bool:
        return self.updates_hidden or self._visible.get(name, True)

    def _send_legend(self) -> None:
        entries = [drawn.legend for drawn in self.drawings.values()]
        self._writer.set_legend(entries, list(self._visible.values()))

    def _update_layers(self, state: MotionState, elapsed: float | None) -> None:
        readings = {
            name: drawn.reading(state)
            for name, drawn in self.drawings.items()
            if drawn.reading is not None and self._is_updated(name)
        }
        if readings or elapsed is not None:
            self._writer.set_readings(elapsed, readings)
        for path, drawn in self._moving.items():
            if not self._is_updated(path.rpartition("/")[2]):
                continue
            for node, now in (drawn.update(state) if drawn.update else {}).items():
                self._writer.place(f"{path}/{node}", now.placement)
                if now.colour is not None:
                    for part in _parts_of(drawn, node):
                        opacity = part.material.opacity
                        self._writer.set_colour(_part_path(path, part), now.colour, opacity)


def _keyframes(
    path: str, drawn: Moving | DrawnLayer, states: Sequence[MotionState]
) -> list[NodeKeyframes]:
    """Return the keyframes of a layer's nodes at states of the motion."""
    if drawn.update is None:
        return []
    updates = [drawn.update(state) for state in states]
    keyframes = []
    for node, first in updates[0].items():
        poses = np.array([nodes[node].placement for nodes in updates])
        changes = first.colour is not None
        colours = np.array([nodes[node].colour for nodes in updates]) if changes else None
        parts = [_part_path(path, part) for part in _parts_of(drawn, node)]
        keyframes.append(NodeKeyframes(f"{path}/{node}", poses, parts, colours))
    return keyframes


def _parts_of(drawn: Moving | DrawnLayer, node: str) -> list[Part]:
    return [part for part in drawn.parts if part.node == node]


def _part_path(layer: str, part: Part) -> str:
    return f"{layer}/{part.node}/{part.name}"
