"""Closed forms of workspaces, of many points at once: five-bar, Delta, Stewart platform."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array, Bools
from rps_pin.task.workspace import TaskFields, TaskGrid, TaskWorkspace
from tests.reference import delta, stewart

#: The five-bar: bases, arms and forearms.
BASES = np.array([[0.0, 0.0], [0.4, 0.0]])
ARMS, FOREARMS = (0.3, 0.28), (0.42, 0.45)
#: On which side of the line from base to tip the elbow is: left arm left of it, right arm right.
ELBOWS = (1.0, -1.0)
#: The sign of the product of the Delta's three normals, at home.
DELTA_SIDE = -1.0


class Closed(NamedTuple):
    """What closed forms say of points (n, m)."""

    exists: Bools
    """Whether every arm reaches the point."""
    margin: Array
    """Zero at the end of the reach."""
    actuators: Array
    """(n, na); NaN where there are none."""
    gain: Array
    """K, (n, na, m); NaN likewise."""


def five_bar(points: Array) -> Closed:
    """Two circles each; K by the forearms' directions."""
    margin = np.full(len(points), np.inf)
    angles, rows = [], []
    for base, arm, fore, elbow in zip(BASES, ARMS, FOREARMS, ELBOWS, strict=True):
        d = points - base
        far = np.hypot(*d.T)
        margin = np.minimum(margin, np.minimum(arm + fore - far, far - abs(arm - fore)))
        with np.errstate(invalid="ignore", divide="ignore"):
            corner = np.arccos((arm**2 + far**2 - fore**2) / (2 * arm * far))
            angle = np.arctan2(d[:, 1], d[:, 0]) + elbow * corner
            along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
            across = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
            u = d - arm * along  # the forearm
            rows.append(u / np.einsum("ni,ni->n", u, arm * across)[:, None])
        angles.append(angle)

    return Closed(margin > 0, margin, np.stack(angles, -1), np.stack(rows, -2))


def delta_arms(
    points: Array,
    arm: float = delta.ARM,
    rod_length: float = delta.ROD,
    base: float = delta.BASE,
) -> Closed:
    """A line that meets a unit circle, see tests/reference/delta; K by the rods' directions.

    Each pair of rods bears a moment about the normal of its plane. Where these three normals lie in
    a plane the platform turns: there the mode ends too.
    """
    margin = np.full(len(points), np.inf)
    angles, rows, normals = [], [], []
    for turn in delta.TURNS:
        local = points @ turn + [delta.PLATFORM - base, 0, 0]
        b, y = local[:, [0, 2]], local[:, 1]
        far = np.hypot(*b.T)
        along = (far**2 + y**2 + arm**2 - rod_length**2) / (2 * arm)
        margin = np.minimum(margin, far - np.abs(along))
        with np.errstate(invalid="ignore"):
            turned = np.arctan2(b[:, 1], b[:, 0]) + np.arccos(along / far)
        u = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
        rod = np.stack([b[:, 0] - arm * u[:, 0], y, b[:, 1] - arm * u[:, 1]], -1)
        # arm angle = -turned: the elbow moves by ARM (sin, 0, cos) of `turned` a rad of it
        lever = arm * (rod[:, 0] * u[:, 1] - rod[:, 2] * u[:, 0])
        rows.append(rod @ turn.T / lever[:, None])
        normals.append(np.cross(rod, [0.0, 1.0, 0.0]) @ turn.T)
        angles.append((-turned + np.pi) % (2 * np.pi) - np.pi)
    volume = np.linalg.det(np.nan_to_num(np.stack(normals, -2)))
    exists = (margin > 0) & (volume * DELTA_SIDE > 0)
    margin = np.minimum(np.abs(margin), np.abs(volume))
    return Closed(exists, margin, np.stack(angles, -1), np.stack(rows, -2))


def stewart_legs(points: Array, rotation: Array) -> Array:
    """Lengths (n, 6) at one orientation, a rotation vector: the radii of six spheres."""
    turned = Rotation.from_rotvec(rotation).apply(stewart.BALLS)
    legs = points[:, None] + turned - stewart.ANCHORS
    return np.asarray(np.linalg.norm(legs, axis=-1))


def conditioning(gain: Array, length: float, angular: bool = True) -> tuple[Array, Array]:
    """1/cond and sign of the determinant of K; actuators that turn count as arcs."""
    scaled = np.nan_to_num(gain) * (length if angular else 1.0)
    values = np.linalg.svd(scaled, compute_uv=False)
    with np.errstate(invalid="ignore"):
        return values[:, -1] / values[:, 0], np.sign(np.linalg.det(scaled))


def of_body(axes: tuple[Array, ...], inside) -> TaskWorkspace:
    """A workspace whose points inside are those of a body."""
    names = ("x", "y", "z", "rx")[: len(axes)]
    angular = tuple(name == "rx" for name in names)
    grid = TaskGrid(names, angular, names, axes, np.full(len(axes), np.nan))
    flags = (~inside(grid.points())).astype(np.uint64)
    fields = TaskFields(flags, *(np.zeros(grid.shape) for _ in TaskFields._fields[1:]))
    return TaskWorkspace("body", (), grid, np.zeros(len(axes)), 0.0, ("outside",), fields)
