"""A robot with its layers, in any Meshcat window."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import meshcat
import meshcat.geometry as mg
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.layers import Context, Drawing, Layer, Look, layers_of
from rps_pin.viewer.motion import FRAME_RATE, State
from rps_pin.viewer.scene.animation import Clip
from rps_pin.viewer.scene.legend import legend_command
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.objects import put_object
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.scene.stage import WORLD
from rps_pin.viewer.server.playback import follow_clock
from rps_pin.viewer.server.window import RawCommand, Window
from rps_pin.viewer.subject import configuration_of, motion_of, subject_of

LAYERS_NODE = f"{WORLD}/layers"
"""Path of the node that holds the layers: one child each, by the layer's name."""


class View:
    """Load a robot and layers into a window, and show the motion's beginning.

    Parameters
    ----------
    window
        Where the commands go: a `Recorder`, a `LocalViewer.window`, or Meshcat's own.
    what
        A 3-RPS, or any mechanism.
    motion
        What it does, or where it stands: a pose (3,) of a 3-RPS, a configuration (nq,), a
        trajectory, a `MotionRun`, a `Simulation` or a `Motion`. The picture and the layers' scales
        are set for it. Left out, a mechanism's home.
    visual
        What to draw of the mechanism. Left out: a 3-RPS's own shapes, of others a skeleton.
    layers, hidden
        Names (see `rps_pin.viewer.LAYERS`) or objects such as ``Trail(factor=100)``; those in
        `hidden` are there, but switched off.

    Attributes
    ----------
    subject : Subject
        What is shown.
    motion : Motion
        What it does.
    scene : Scene
        The robot on its stage.
    drawings : dict of str to Drawing
        The layers, by the name of their node below ``/world/layers``.

    Raises
    ------
    InputError
        If the motion does not fit, a layer is unknown, or has nothing to show here.
    """

    def __init__(
        self,
        window: Window,
        what: RPSRobot | ClosedLoopModel,
        motion: Any = None,
        *,
        visual: pin.GeometryModel | None = None,
        layers: Sequence[str | Layer] = (),
        hidden: Sequence[str | Layer] = (),
    ) -> None:
        self.window = window
        self.subject = subject_of(what, visual)
        self.motion = motion_of(self.subject, motion)
        on, off = layers_of(layers), layers_of(hidden)
        framed = [
            self.motion.configurations,
            *(layer.configurations(self.subject, self.motion) for layer in on),
        ]
        self.scene = Scene(self.subject.model, self.subject.visual, window, np.concatenate(framed))
        context = Context(self.subject, self.motion, self.scene.box)
        self.drawings: dict[str, Drawing] = {}
        self._visible: dict[str, bool] = {}
        for layer in [*on, *off]:
            drawing = layer.draw(context)
            name = node_name(drawing.key.name, set(self.drawings))
            self.drawings[name] = drawing._replace(key=replace(drawing.key, name=name))
            self._visible[name] = len(self._visible) < len(on)
        self._view = meshcat.Visualizer(window=window)
        self._put()
        self._show(self.motion.state_at(0.0))

    def display(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> None:
        """Show the robot and its layers in a state.

        Parameters
        ----------
        q
            A configuration (nq,), or a pose (3,) of a 3-RPS.
        v, a
            Velocity and acceleration (nv,), for the layers that show forces; at rest if left out.

        Raises
        ------
        InputError
            If an array does not fit.
        UnreachableError
            If a pose is out of reach.
        """
        configuration = configuration_of(self.subject, q)
        rates = [self._rate(v, "v"), self._rate(a, "a")]
        self.scene.display(configuration)
        self._show(State(configuration, *rates))

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
        self._set(f"{LAYERS_NODE}/{name}", "visible", bool(visible))
        self._send_legend()

    def play(self, stop: threading.Event | None = None, *, frame_rate: float = FRAME_RATE) -> None:
        """Show the motion at the speed of its times, in a loop, until `stop` is set or Ctrl-C."""
        stop = threading.Event() if stop is None else stop
        if self.motion.duration == 0.0:
            stop.wait()
            return
        follow_clock(self.motion.duration, self.show_moment, stop, frame_rate)

    def animate(self, *, frame_rate: float = FRAME_RATE) -> None:
        """Let the window play the motion by itself, in a loop, layers included.

        Raises
        ------
        InputError
            If nothing moves, or the frame rate is not positive.
        """
        states = list(self.motion.states(frame_rate))
        clips = [
            clip
            for name, drawing in self.drawings.items()
            if drawing.follow is not None
            for clip in _clips(f"{LAYERS_NODE}/{name}", drawing, states)
        ]
        self.scene.animate(self.motion, frame_rate=frame_rate, more=clips)

    def show_moment(self, elapsed: float) -> None:
        """Show the motion's state `elapsed` seconds after its beginning."""
        state = self.motion.state_at(elapsed)
        self.scene.display(state.q)
        self._show(state)

    def _rate(self, given: ArrayLike | None, name: str) -> Array:
        nv = self.subject.model.nv
        if given is None:
            return np.zeros(nv)
        rate = np.asarray(given, dtype=np.float64)
        if rate.shape != (nv,) or not np.isfinite(rate).all():
            raise InputError(f"{name} has shape {rate.shape}; it must be ({nv},), all finite")
        return rate

    def _put(self) -> None:
        for name, drawing in self.drawings.items():
            for part in drawing.parts:
                path = f"{LAYERS_NODE}/{name}/{part.node}/{part.name}"
                put_object(self.window, path, mg.Mesh(part.geometry, part.material))
                self._view[path].set_transform(part.placement)
                self._set(f"{path}/<object>", "castShadow", False)
            if not self._visible[name]:
                self._set(f"{LAYERS_NODE}/{name}", "visible", False)
        if self.drawings:
            self._send_legend()

    def _send_legend(self) -> None:
        keys = [drawing.key for drawing in self.drawings.values()]
        self.window.send(legend_command(keys, list(self._visible.values())))

    def _show(self, state: State) -> None:
        for name, drawing in self.drawings.items():
            for node, look in (drawing.follow(state) if drawing.follow else {}).items():
                self._look(f"{LAYERS_NODE}/{name}/{node}", drawing, node, look)

    def _look(self, path: str, drawing: Drawing, node: str, look: Look) -> None:
        self._view[path].set_transform(look.placement)
        if look.colour is not None:
            for part in drawing.parts:
                if part.node == node:
                    colour = [*look.colour, float(part.material.opacity)]
                    self._set(f"{path}/{part.name}/<object>", "color", colour)

    def _set(self, path: str, name: str, value: object) -> None:
        message = {"type": "set_property", "path": path, "property": name, "value": value}
        self.window.send(RawCommand(message))


def _clips(path: str, drawing: Drawing, states: Sequence[State]) -> list[Clip]:
    """Return how a layer's nodes move through states."""
    assert drawing.follow is not None
    looks: list[Mapping[str, Look]] = [drawing.follow(state) for state in states]
    clips = []
    for node, first in looks[0].items():
        poses = np.array([look[node].placement for look in looks])
        colours = None if first.colour is None else np.array([look[node].colour for look in looks])
        parts = [
            f"{path}/{node}/{part.name}/<object>" for part in drawing.parts if part.node == node
        ]
        clips.append(Clip(f"{path}/{node}", poses, parts, colours))
    return clips
