"""viser as a front end: a scene in viser's page.

Three parts of the description are left to Meshcat: reflections, and shadows of the robot on itself;
the background's colours, which the page has; and drawing over everything else, or through it
(`Material.on_top`, `Material.through`), which viser has not. Motions are played by `View.play`.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh

from rps_pin.arrays import Array
from rps_pin.errors import RPSPinError
from rps_pin.viewer.scene import shapes
from rps_pin.viewer.scene.keyframes import NodeKeyframes
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Box, Cylinder, LineSegments, Part, TriangleMesh
from rps_pin.viewer.scene.stage import WORLD, Stage

_LIGHT = 1.35 * math.pi
"""viser's unit of light in Meshcat's: three.js has divided by pi since its release 155."""
_LAMP_ANGLE = 0.4


class ViserWriter:
    """A scene in a viser server; see `SceneWriter` for the methods.

    Parameters
    ----------
    server
        A ``viser.ViserServer``.
    switched
        Called, in a thread of viser's, with a layer's name and whether the page switches it on.
        Default: it is shown or hidden, no more.
    """

    def __init__(self, server: Any, switched: Callable[[str, bool], object] | None = None) -> None:
        self._server, self._switched = server, switched or self._switch
        self._nodes: dict[str, Any] = {}
        self._parts: dict[str, list[tuple[Any, Array]]] = {}
        self._scales: dict[str, Array] = {}
        self._handles: dict[str, Any] = {}
        self._ticks: dict[str, Any] = {}
        self._entries: list[LegendEntry] = []
        self._readings: dict[str, str] = {}
        self._legend: Any = None

    def set_stage(self, stage: Stage) -> None:
        """Set camera and lights, and draw grid and axes."""
        box, scene = stage.box, self._server.scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light/ambient", intensity=_LIGHT * stage.ambient)
        position = np.asarray(stage.camera_position)
        lamp = np.asarray(stage.lamp_position)
        self._lamp = scene.add_light_spot(
            "/light/lamp",
            intensity=_LIGHT * stage.lamp,
            decay=0.0,
            angle=_LAMP_ANGLE,
            penumbra=0.5,
            cast_shadow=True,
            direction=tuple(-lamp),
            position=tuple(box.centre + box.radius * lamp),
        )
        self._lay_floor(stage)
        for name, direction, intensity in (
            ("fill", position, stage.fill),
            ("side_1", (-1.0, 0.0, 0.0), stage.sides),
            ("side_2", (1.0, 0.0, 0.0), stage.sides),
        ):
            scene.add_light_directional(
                f"/light/{name}", intensity=_LIGHT * intensity, position=tuple(direction)
            )
        for part in stage.parts:
            self.add_part(f"{WORLD}/{part.name}", part)
        camera, distance = self._server.initial_camera, box.radius * np.linalg.norm(position)
        camera.position = tuple(box.centre + box.radius * position)
        camera.look_at = tuple(box.centre)
        camera.fov = math.radians(stage.field_of_view)
        camera.near, camera.far = 0.01 * distance, 100.0 * distance

    def add_part(self, path: str, part: Part, *, casts_shadow: bool = True) -> None:
        """Draw a part at a path."""
        node, scene, shape = path.rpartition("/")[0], self._server.scene, part.shape
        self._node(node)
        colour = tuple((part.material.colour >> shift) & 0xFF for shift in (16, 8, 0))
        handle: Any
        if isinstance(shape, LineSegments):
            colours = np.full((len(shape.points), 3), colour, dtype=np.uint8)
            if shape.colours is not None:
                colours = np.round(255 * shape.colours).astype(np.uint8)
            handle = scene.add_line_segments(
                path,
                shape.points.reshape(-1, 2, 3),
                colours.reshape(-1, 2, 3),
                thickness=1.0,
                thickness_units="screen",
            )
        elif isinstance(shape, TriangleMesh) and shape.colours is not None:
            alpha = np.full((len(shape.colours), 1), part.material.opacity)
            colours = np.round(255 * np.hstack([shape.colours, alpha])).astype(np.uint8)
            mesh = _mesh(shape)
            mesh.visual.vertex_colors = colours
            handle = scene.add_mesh_trimesh(path, mesh, cast_shadow=False, receive_shadow=False)
        else:
            mesh = _mesh(shape)
            opacity = part.material.opacity
            handle = scene.add_mesh_simple(
                path,
                mesh.vertices,
                mesh.faces,
                color=colour,
                opacity=None if opacity == 1.0 else opacity,
                flat_shading=part.material.flat or isinstance(shape, Box | Cylinder),
                side="double",
                cast_shadow=casts_shadow,
                receive_shadow=False,
            )
        self._handles[path] = handle
        self._parts.setdefault(node, []).append((handle, part.placement))
        _place(handle, part.placement)

    def set_shadows(self, shadows: bool) -> None:
        """Cast shadows on the floor, or none: a page without a GPU draws faster so."""
        self._lamp.cast_shadow = shadows

    def _lay_floor(self, stage: Stage) -> None:
        """Lay an invisible floor that shows nothing but shadows."""
        corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        middle = np.array([*stage.box.centre[:2], stage.floor_height])
        self._server.scene.add_mesh_simple(
            "/floor",
            stage.floor_size / 2.0 * corners,
            np.array([[0, 1, 2], [0, 2, 3]]),
            opacity=0.0,
            cast_shadow=False,
            receive_shadow=stage.shadow_opacity,
            position=tuple(middle),
        )

    def place(self, path: str, placement: Array) -> None:
        """Place a node in its parent's frame."""
        scale = np.linalg.norm(placement[:3, :3], axis=0)
        rigid = placement.copy()
        rigid[:3, :3] /= scale
        _place(self._node(path), rigid)
        # A node's scale is not inherited in viser: it goes to the node's parts.
        if not np.allclose(scale, self._scales.get(path, 1.0), rtol=1e-12, atol=0.0):
            self._scales[path] = scale
            for handle, own in self._parts.get(path, []):
                scaled = np.diag([*scale, 1.0]) @ own
                handle.scale = tuple(np.linalg.norm(scaled[:3, :3], axis=0))
                handle.position = tuple(scaled[:3, 3])

    def set_colour(self, path: str, colour: Sequence[float], opacity: float) -> None:
        """Colour the part at a path."""
        handle = self._handles[path]
        handle.color = tuple(round(255 * share) for share in colour)
        handle.opacity = None if opacity == 1.0 else opacity

    def set_visible(self, path: str, visible: bool) -> None:
        """Show or hide a node."""
        self._node(path).visible = visible

    def set_legend(self, entries: Sequence[LegendEntry], visible: Sequence[bool]) -> None:
        """Show a tick for each layer beside the scene, and what those that are on mean."""
        gui = self._server.gui
        for entry, shown in zip(entries, visible, strict=True):
            if entry.name not in self._ticks:
                tick = gui.add_checkbox(entry.name, shown, hint=entry.text)
                tick.on_update(partial(self._ticked, entry.name))
                self._ticks[entry.name] = tick
            self._ticks[entry.name].value = shown
        if self._legend is None:
            self._legend = gui.add_html("")
        self._entries = list(entries)
        self._show_legend()

    def set_readings(self, time: float | None, readings: Mapping[str, str]) -> None:
        """Show the layers' texts in the legend."""
        self._readings = dict(readings)
        self._show_legend()

    def _ticked(self, name: str, event: Any) -> None:
        if event.client is not None:  # by a page, not here
            self._switched(name, event.target.value)

    def _switch(self, name: str, visible: bool) -> None:
        self.set_visible(f"{WORLD}/layers/{name}", visible)
        self._show_legend()

    def _show_legend(self) -> None:
        """Show the entries of the layers that are on."""
        if self._legend is not None:
            on = [one for one in self._entries if self._ticks[one.name].value]
            self._legend.content = "".join(_line(one, self._readings.get(one.name)) for one in on)

    def animate(
        self,
        elapsed: Array,
        keyframes: Sequence[NodeKeyframes],
        readings: Mapping[str, Sequence[str]],
    ) -> None:
        """Refuse: viser plays no keyframes."""
        raise RPSPinError("viser's page plays no motion by itself: use View.play, or Meshcat")

    def _node(self, path: str) -> Any:
        """Return a node's handle; it and its parents are made where they are not there."""
        if path not in self._nodes:
            parent = path.rpartition("/")[0]
            if parent:
                self._node(parent)
            self._nodes[path] = self._server.scene.add_frame(path, show_axes=False)
        return self._nodes[path]


def _place(handle: Any, placement: Array) -> None:
    x, y, z, w = pin.Quaternion(placement[:3, :3]).coeffs()
    handle.wxyz = (w, x, y, z)
    handle.position = tuple(placement[:3, 3])


def _line(entry: LegendEntry, reading: str | None) -> str:
    """Return an entry of the legend as HTML: its colour or colours, its text and its reading."""
    bar, text = (
        entry.bar,
        html.escape(entry.text if reading is None else f"{entry.text}: {reading}"),
    )
    swatch = f"background: {entry.colour}; width: 0.8em"
    if bar is not None:
        swatch = f"background: linear-gradient(90deg, {', '.join(bar.colours)}); width: 3em"
        text += f" ({html.escape(bar.low)} to {html.escape(bar.high)})"
    box = f'<span style="display: inline-block; height: 0.8em; {swatch}"></span>'
    return f'<div style="font-size: 80%; margin: 0 0.9em 0.3em">{box} {text}</div>'


def _mesh(shape: shapes.Shape) -> Any:
    """Return the triangles of a surface."""
    match shape:
        case Box():
            return trimesh.creation.box(shape.size)
        case shapes.Sphere():
            return trimesh.creation.icosphere(subdivisions=3, radius=shape.radius)
        case shapes.Ellipsoid():
            ball = trimesh.creation.icosphere(subdivisions=3)
            return trimesh.Trimesh(ball.vertices * shape.radii, ball.faces)
        case Cylinder():
            half = shape.length / 2.0
            outline = [[0.0, -half], [shape.radius, -half], [shape.upper_radius, half], [0.0, half]]
            return trimesh.creation.revolve(outline, sections=48)
        case TriangleMesh():
            return trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    raise TypeError(f"{type(shape).__name__} is not a surface")
