"""Meshcat as a front end: a scene as commands of Meshcat's protocol.

Meshcat's camera turns about the origin of its scene, and its lights, clipping planes and zoom suit
an object about a metre large. So the node ``/world`` moves the robot's centre to that origin and
scales the robot to radius one. Inside ``/world`` lengths are in metres, in the world frame.

Four differences to the description of the scene are bridged here: Meshcat's cylinders stand along
y; its objects are named after the time and this machine's network address (here after their path,
so that the same scene gives the same file); its Python package writes ``castShadow`` in lower case;
and it knows no legend. The legend is sent as ``userData`` of ``/world``, readings as that of
``/readings``, and the outline of the robot as that of ``/Cameras``, which three.js leaves to its
users: the pages of this package draw them, and Meshcat's own ignore them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import meshcat
import meshcat.geometry as mg
import numpy as np
import umsgpack

from rps_pin.arrays import Array
from rps_pin.viewer.scene import shapes
from rps_pin.viewer.scene.keyframes import NodeKeyframes, continuous_quaternions
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Cylinder, LineSegments, Part, TriangleMesh, translated
from rps_pin.viewer.scene.stage import WORLD, Stage
from rps_pin.viewer.writers.window import RawCommand, Window

_Y_TO_Z: Array = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Turns a Meshcat cylinder, which stands along y, onto z."""
READINGS = "/readings"
"""Path of the node whose ``userData`` are the layers' readings."""
_FLOAT32_ARRAY = 0x17
"""Meshcat's MessagePack code for numbers that the browser reads as a ``Float32Array``."""


class MeshcatWriter:
    """A scene in a Meshcat window; see `SceneWriter` for the methods.

    Parameters
    ----------
    window
        Where the commands go: a `Recorder`, a `LocalViewer.window`, or Meshcat's own.
    """

    def __init__(self, window: Window) -> None:
        self._window = window
        self._tree = meshcat.Visualizer(window=window)

    def set_stage(self, stage: Stage) -> None:
        """Set camera, lights and background, and draw floor, grid and axes."""
        box, world = stage.box, np.eye(4)
        world[:3, :3] /= box.radius
        world[:3, 3] = -box.centre / box.radius
        self.place(WORLD, world)
        self._set("/Cameras", "userData", {"outline": list(stage.outline)})
        x, y, z = stage.camera_position
        camera = "/Cameras/default/rotated/<object>"
        self._set(camera, "fov", stage.field_of_view)
        self._set(camera, "position", [x, z, -y])  # the camera's parent has y up
        self._set("/Lights/SpotLight", "visible", True)
        lamp = "/Lights/SpotLight/<object>"
        self._set(lamp, "position", list(stage.lamp_position))
        self._set(lamp, "intensity", stage.lamp)
        self._set(lamp, "castShadow", True)
        self._set("/Lights/AmbientLight/<object>", "intensity", stage.ambient)
        self._set("/Lights/FillLight/<object>", "intensity", stage.fill)
        for side in ("PointLightNegativeX", "PointLightPositiveX"):
            self._set(f"/Lights/{side}/<object>", "intensity", stage.sides)
        self._set("/Background", "top_color", list(stage.top_colour))
        self._set("/Background", "bottom_color", list(stage.bottom_colour))
        self._set("/Grid", "visible", False)
        self._set("/Axes", "visible", False)
        self._lay_floor(stage)
        for part in stage.parts:
            self.add_part(f"{WORLD}/{part.name}", part, casts_shadow=False)

    def add_part(self, path: str, part: Part, *, casts_shadow: bool = True) -> None:
        """Draw a part at a path, in the frame of the path's parent."""
        drawn = _object(part)
        drawn.uuid = path
        drawn.geometry.uuid = f"{path}:geometry"
        drawn.material.uuid = f"{path}:material"
        self._tree[path].set_object(drawn)
        upright = isinstance(part.shape, Cylinder)
        self.place(path, part.placement @ _Y_TO_Z if upright else part.placement)
        if not casts_shadow:
            self._set(f"{path}/<object>", "castShadow", False)

    def place(self, path: str, placement: Array) -> None:
        """Place a node in its parent's frame."""
        self._tree[path].set_transform(placement)

    def set_colour(self, path: str, colour: Sequence[float], opacity: float) -> None:
        """Colour the part at a path."""
        self._set(f"{path}/<object>", "color", [*colour, opacity])

    def set_visible(self, path: str, visible: bool) -> None:
        """Show or hide a node."""
        self._set(path, "visible", visible)

    def set_legend(self, entries: Sequence[LegendEntry], visible: Sequence[bool]) -> None:
        """Send the legend to the page."""
        lines = []
        for entry, shown in zip(entries, visible, strict=True):
            line = {**asdict(entry), "visible": shown}
            lines.append(line | (line.pop("bar") or {}))
        self._set(WORLD, "userData", {"layers": lines})

    def set_readings(self, time: float | None, readings: Mapping[str, str]) -> None:
        """Send the layers' texts, and the time, to the page."""
        self._set(READINGS, "userData", {"time": time, "readings": dict(readings)})

    def animate(
        self,
        elapsed: Array,
        keyframes: Sequence[NodeKeyframes],
        readings: Mapping[str, Sequence[str]],
    ) -> None:
        """Let the page play keyframes in a loop, with its playback controls."""
        every = {name: list(texts) for name, texts in readings.items()}
        self._set(READINGS, "userData", {"every": every})
        # Meshcat's own `Animation` writes a dictionary for each keyframe; packed arrays, which
        # three.js reads as well, are a tenth of the size.
        tracks: list[tuple[str, list[dict[str, object]]]] = []
        for node in keyframes:
            tracks.append((node.path, _pose_tracks(elapsed, node.poses)))
            if node.colours is not None:
                colour = _track("material.color", "color", elapsed, node.colours)
                tracks += [(f"{part}/<object>", [colour]) for part in node.parts]
        # The tracks' times count frames of 1 / fps; with one frame a second they are seconds.
        animations = [
            {"path": path, "clip": {"fps": 1, "name": "default", "tracks": own}}
            for path, own in tracks
        ]
        options = {"play": True, "repetitions": float("inf")}
        self._send("set_animation", "", animations=animations, options=options)

    def _send(self, kind: str, path: str, **message: object) -> None:
        self._window.send(RawCommand({"type": kind, "path": path, **message}))

    def _set(self, path: str, name: str, value: object) -> None:
        self._send("set_property", path, property=name, value=value)

    def _lay_floor(self, stage: Stage) -> None:
        """Lay an invisible floor that shows nothing but shadows."""
        path = f"{WORLD}/floor"
        side = stage.floor_size
        plane = {"uuid": "floor-plane", "type": "PlaneGeometry", "width": side, "height": side}
        shadow = {
            "uuid": "floor-shadow",
            "type": "ShadowMaterial",
            "color": 0x000000,
            "opacity": stage.shadow_opacity,
            "transparent": True,
        }
        mesh = {
            "uuid": "floor",
            "type": "Mesh",
            "geometry": plane["uuid"],
            "material": shadow["uuid"],
            "matrix": np.eye(4).flatten().tolist(),
        }
        floor = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [plane],
            "materials": [shadow],
            "object": mesh,
        }
        self._send("set_object", path, object=floor)
        x, y, _ = stage.box.centre
        self.place(path, translated([x, y, stage.floor_height]))


def _object(part: Part) -> Any:
    """Return Meshcat's object for a part."""
    shape, material = part.shape, part.material
    coloured = isinstance(shape, TriangleMesh | LineSegments) and shape.colours is not None
    if isinstance(shape, LineSegments):
        points, colours = (None if rows is None else rows.astype(np.float32).T for rows in shape)
        line = mg.LineBasicMaterial(color=material.colour, vertexColors=coloured)
        return mg.LineSegments(mg.PointsGeometry(points, colours), line)
    see_through = material.on_top or material.opacity < 1.0
    options: dict[str, Any] = {"depthWrite": False} if see_through else {}
    if material.on_top:
        options["depthTest"] = False
    if material.through:
        options["userData"] = {"through": True}  # for the page: three.js does not load depthFunc
    surface = mg.MeshPhongMaterial(
        color=material.colour,
        opacity=material.opacity,
        transparent=see_through,
        vertexColors=coloured,
        flatShading=material.flat,
        specular=0x303030,
        shininess=40,
        **options,
    )
    return mg.Mesh(_geometry(shape), surface)


def _geometry(shape: shapes.Shape) -> Any:
    match shape:
        case shapes.Box():
            return mg.Box(list(shape.size))
        case shapes.Sphere():
            return mg.Sphere(shape.radius)
        case shapes.Ellipsoid():
            return mg.Ellipsoid(list(shape.radii))
        case Cylinder():
            radii = {"radiusTop": shape.upper_radius, "radiusBottom": shape.radius}
            return mg.Cylinder(shape.length, **radii)
        case TriangleMesh():
            return mg.TriangularMeshGeometry(*shape)
    raise TypeError(f"{type(shape).__name__} is not a surface")


def _pose_tracks(elapsed: Array, poses: Array) -> list[dict[str, object]]:
    """Return the tracks of poses of shape (n, 4, 4)."""
    scales = np.linalg.norm(poses[:, :3, :3], axis=1)
    rotations = poses[:, :3, :3] / scales[:, None, :]
    tracks = [
        _track("position", "vector3", elapsed, poses[:, :3, 3]),
        _track("quaternion", "quaternion", elapsed, continuous_quaternions(rotations)),
    ]
    if not np.allclose(scales, 1.0, rtol=0.0, atol=1e-9):
        tracks.append(_track("scale", "vector3", elapsed, scales))
    return tracks


def _track(name: str, kind: str, elapsed: Array, values: Array) -> dict[str, object]:
    times, packed = (
        umsgpack.Ext(_FLOAT32_ARRAY, numbers.astype("<f4").tobytes())
        for numbers in (elapsed, values)
    )
    return {"name": f".{name}", "type": kind, "times": times, "values": packed}
