"""What stands around a robot: camera, light, background, floor and grid.

Meshcat's camera always turns about the origin of its scene, and its lights, clipping planes and
zoom suit something about a metre large. So the world hangs in one node, ``/world``, which moves
the middle of the robot to that origin and scales the robot to radius one; whatever its real size,
the same stage fits. Everything inside ``/world`` is in metres, in the world frame.
"""

from __future__ import annotations

import math

import meshcat
import meshcat.geometry as mg
import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array
from rps_pin.viewer.scene.bounds import Box
from rps_pin.viewer.scene.objects import put_object
from rps_pin.viewer.server.window import RawCommand, Window

WORLD = "/world"
"""Path of the node whose inside is the world frame in metres."""

_FIELD_OF_VIEW = 30.0
"""Vertical angle of the camera, in degrees: narrow, for little distortion."""
_CAMERA_AZIMUTH = math.radians(-55.0)
_CAMERA_ELEVATION = math.radians(22.0)
_CAMERA_DISTANCE = 1.02 / math.sin(math.radians(_FIELD_OF_VIEW / 2.0))
"""In radii of the robot: where the sphere around it just fits into the picture's height."""
_CAMERA = "/Cameras/default/rotated/<object>"

_TOP_COLOUR = (0.86, 0.90, 0.94)
_BOTTOM_COLOUR = (0.99, 0.99, 1.0)
_GRID_COLOUR = 0xB4BDC8
_GRID_RADIUS = 2.6
"""Radius of the grid's disc, in radii of the robot."""
_SHADOW_DARKNESS = 0.16


def grid_spacing(radius: float) -> float:
    """Return a round spacing (1, 2 or 5 times a power of ten), about a quarter of `radius`."""
    wanted = radius / 4.0
    decade = 10.0 ** math.floor(math.log10(wanted))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= wanted * (1 + 1e-9))


def set_stage(window: Window, box: Box) -> None:
    """Set up camera, lights, background, floor and grid for a robot that fills `box`.

    Parameters
    ----------
    window
        Where the commands go.
    box
        The robot's bounding box, over everything that shall be in the picture.
    """
    _place_world(window, box)
    _aim_camera(window)
    _light(window)
    _set(window, "/Background", "top_color", list(_TOP_COLOUR))
    _set(window, "/Background", "bottom_color", list(_BOTTOM_COLOUR))
    _set(window, "/Grid", "visible", False)
    _set(window, "/Axes", "visible", False)
    _lay_floor(window, box)
    for path, lines in (
        (f"{WORLD}/grid", _grid(box)),
        (f"{WORLD}/axes", mg.triad(0.25 * box.radius)),
    ):
        put_object(window, path, lines)
        _set(window, f"{path}/<object>", "castShadow", False)


def _set(window: Window, path: str, name: str, value: object) -> None:
    """Set a property; Meshcat's own command would write ``castShadow`` in small letters."""
    message = {"type": "set_property", "path": path, "property": name, "value": value}
    window.send(RawCommand(message))


def _place_world(window: Window, box: Box) -> None:
    """Bring the robot's middle to the scene's origin and its radius to one."""
    matrix = np.eye(4)
    matrix[:3, :3] /= box.radius
    matrix[:3, 3] = -box.centre / box.radius
    meshcat.Visualizer(window=window)[WORLD].set_transform(matrix)


def _aim_camera(window: Window) -> None:
    """Put the camera in front, to the right and above; it looks at the origin by itself."""
    flat = _CAMERA_DISTANCE * math.cos(_CAMERA_ELEVATION)
    x, y = flat * math.cos(_CAMERA_AZIMUTH), flat * math.sin(_CAMERA_AZIMUTH)
    z = _CAMERA_DISTANCE * math.sin(_CAMERA_ELEVATION)
    _set(window, _CAMERA, "fov", _FIELD_OF_VIEW)
    # The camera's parent has y up: (x, y, z) of the world is (x, z, -y) there.
    _set(window, _CAMERA, "position", [x, z, -y])


def _light(window: Window) -> None:
    """Light mostly from one lamp, which casts the shadows, and fill in from the others."""
    _set(window, "/Lights/SpotLight", "visible", True)
    lamp = "/Lights/SpotLight/<object>"
    _set(window, lamp, "position", [1.5, -2.5, 5.0])
    _set(window, lamp, "intensity", 0.5)
    _set(window, lamp, "castShadow", True)
    _set(window, "/Lights/AmbientLight/<object>", "intensity", 0.5)
    _set(window, "/Lights/FillLight/<object>", "intensity", 0.15)
    for side in ("PointLightNegativeX", "PointLightPositiveX"):
        _set(window, f"/Lights/{side}/<object>", "intensity", 0.25)


def _lay_floor(window: Window, box: Box) -> None:
    """Lay an invisible floor under the robot that shows nothing but shadows."""
    size = 2.0 * _GRID_RADIUS * box.radius
    path = f"{WORLD}/floor"
    plane = {"uuid": "floor-plane", "type": "PlaneGeometry", "width": size, "height": size}
    shadow = {
        "uuid": "floor-shadow",
        "type": "ShadowMaterial",
        "color": 0x000000,
        "opacity": _SHADOW_DARKNESS,
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
    window.send(RawCommand({"type": "set_object", "path": path, "object": floor}))
    matrix = np.eye(4)
    matrix[:3, 3] = [box.centre[0], box.centre[1], _floor_height(box)]
    meshcat.Visualizer(window=window)[path].set_transform(matrix)


def _floor_height(box: Box) -> float:
    """Return the floor's z: just below the robot, so that the two never flicker through."""
    return float(box.lower[2]) - 0.002 * box.radius


def _grid(box: Box) -> mg.LineSegments:
    """Return a disc of grid lines on the floor, at whole multiples of the spacing."""
    material = mg.LineBasicMaterial(color=_GRID_COLOUR)
    return mg.LineSegments(mg.PointsGeometry(_grid_points(box).T), material)


def _grid_points(box: Box) -> NDArray[np.float32]:
    """Return the ends of the grid's lines, two rows for each line, shape (2 m, 3)."""
    spacing, reach = grid_spacing(box.radius), _GRID_RADIUS * box.radius
    points: list[Array] = []
    for across, along in ((0, 1), (1, 0)):
        first = math.ceil((box.centre[across] - reach) / spacing)
        last = math.floor((box.centre[across] + reach) / spacing)
        for index in range(first, last + 1):
            offset = index * spacing - box.centre[across]
            half = math.sqrt(max(0.0, reach**2 - offset**2))
            for side in (-half, half):
                point = np.full(3, _floor_height(box))
                point[across] = index * spacing
                point[along] = box.centre[along] + side
                points.append(point)
    return np.array(points, dtype=np.float32)
