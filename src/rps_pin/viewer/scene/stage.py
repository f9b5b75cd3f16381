"""Stage of a scene, as plain data: camera, lights, background, grid and floor around a robot.

Camera and lights are given in radii of the sphere around the robot, from its centre, so that one
stage suits robots of every size. Grid, axes and floor are in metres, in the world frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.viewer.scene.bounds import BoundingBox
from rps_pin.viewer.scene.shapes import LineSegments, Material, Part

WORLD = "/world"
"""Path of the node whose frame is the world frame, in metres."""

_FIELD_OF_VIEW = 30.0
_AZIMUTH, _ELEVATION = math.radians(-55.0), math.radians(22.0)
_DISTANCE = 1.02 / math.sin(math.radians(_FIELD_OF_VIEW / 2.0))
"""Of the camera, in radii of the robot: its sphere just fits into the picture's height."""
_GRID_RADIUS = 2.6
"""Of the grid's disc, in radii of the robot."""


class Stage(NamedTuple):
    """Everything around a robot: camera, lights, background, floor, grid and axes.

    One lamp casts the shadows; weak light comes from elsewhere. Intensities are from 0 to 1.
    Positions are in radii of the robot, from its centre, world axes. Colours are red, green and
    blue, 0 to 1.
    """

    box: BoundingBox
    """The box that the picture holds: the robot over its whole motion, and its layers."""
    camera_position: tuple[float, float, float]
    """Position of the camera, which looks at the robot's centre."""
    outline: tuple[float, float, float]
    """What the camera sees of the box's contents as they turn about z once: half their width, and
    lowest and highest point above the picture's middle, in halves of the picture's height."""
    floor_height: float
    """z of the floor, m."""
    floor_size: float
    """Length of the floor's sides, m."""
    parts: tuple[Part, ...]
    """The grid and the world's axes, in `WORLD`."""
    field_of_view: float = _FIELD_OF_VIEW
    """Vertical angle of the camera, in degrees."""
    lamp_position: tuple[float, float, float] = (1.5, -2.5, 5.0)
    lamp: float = 0.5
    ambient: float = 0.5
    fill: float = 0.15
    """From the camera's side."""
    sides: float = 0.25
    """From -x and from +x each."""
    top_colour: tuple[float, float, float] = (0.86, 0.90, 0.94)
    """Of the background's upper edge."""
    bottom_colour: tuple[float, float, float] = (0.99, 0.99, 1.0)
    shadow_opacity: float = 0.16
    """Of shadows on the floor."""


def stage_around(box: BoundingBox, floor: float) -> Stage:
    """Return the stage for a picture that holds `box`, of a robot that stands at z = `floor`, m."""
    flat, height = _DISTANCE * math.cos(_ELEVATION), _DISTANCE * math.sin(_ELEVATION)
    # Just below the robot, so that the two do not flicker through each other.
    floor_height = floor - 0.002 * box.radius
    lines = LineSegments(_grid_points(box, floor_height))
    grid = Part("", "grid", lines, Material(0xB4BDC8), np.eye(4))
    axes = Part("", "axes", _axes(0.25 * box.radius), Material(0xFFFFFF), np.eye(4))
    position = (flat * math.cos(_AZIMUTH), flat * math.sin(_AZIMUTH), height)
    size = 2.0 * _GRID_RADIUS * box.radius
    return Stage(box, position, _outline(box), floor_height, size, (grid, axes))


def _outline(box: BoundingBox) -> tuple[float, float, float]:
    """Return the outline of a box's contents; see `Stage`."""
    from_centre = (box.points - box.centre) / box.radius
    around, height = np.hypot(*from_centre[:, :2].T), from_centre[:, 2]
    turn = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)[:, None]
    along, across = around * np.cos(turn), around * np.sin(turn)  # towards the camera, to its right
    depth = _DISTANCE - along * math.cos(_ELEVATION) - height * math.sin(_ELEVATION)
    up = height * math.cos(_ELEVATION) - along * math.sin(_ELEVATION)
    half_picture = depth * math.tan(math.radians(_FIELD_OF_VIEW / 2.0))
    x, y = across / half_picture, up / half_picture
    # Rounded: the same picture of a robot of any size.
    half, low, high = (round(float(one), 9) for one in (np.abs(x).max(), y.min(), y.max()))
    return half, low, high


def grid_spacing(radius: float) -> float:
    """Return a round spacing (1, 2 or 5 times a power of ten), about a quarter of `radius`."""
    return round_number(radius / 4.0)


def round_number(wanted: float) -> float:
    """Return 1, 2 or 5 times a power of ten, the largest that is not above `wanted`."""
    decade = 10.0 ** math.floor(math.log10(wanted))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= wanted * (1 + 1e-9))


def length_text(length: float) -> str:
    """Return a length in words, in a unit that suits it."""
    if length >= 1.0:
        return f"{length:.3g} m"
    return f"{1e3 * length:.3g} mm" if length >= 1e-4 else f"{1e6 * length:.3g} µm"


def _axes(length: float) -> LineSegments:
    """Return the world's axes: x red, y green, z blue."""
    points, colours = np.zeros((6, 3)), np.zeros((6, 3))
    points[1::2] = length * np.eye(3)
    colours[::2] = np.eye(3)
    colours[1::2] = [[1.0, 0.6, 0.0], [0.6, 1.0, 0.0], [0.0, 0.6, 1.0]]  # lighter at the tips
    return LineSegments(points, colours)


def _grid_points(box: BoundingBox, height: float) -> Array:
    """Return a disc of lines at whole multiples of the spacing, two rows each, shape (2 n, 3)."""
    spacing, reach = grid_spacing(box.radius), _GRID_RADIUS * box.radius
    points = []
    for across, along in ((0, 1), (1, 0)):
        ends = (box.centre[across] + np.array([-reach, reach])) / spacing
        lines = spacing * np.arange(math.ceil(ends[0]), math.floor(ends[1]) + 1)
        half = np.sqrt(np.maximum(0.0, reach**2 - (lines - box.centre[across]) ** 2))
        rows = np.full((len(lines), 2, 3), height)
        rows[..., across] = lines[:, None]
        rows[..., along] = box.centre[along] + half[:, None] * [-1.0, 1.0]
        points.append(rows.reshape(-1, 3))
    return np.concatenate(points)
