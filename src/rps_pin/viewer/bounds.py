"""The box that a robot fills."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin.errors import InputError
from rps_pin.viewer.links import Link, link_poses


class Box(NamedTuple):
    """An axis-aligned box in the world frame, in metres."""

    lower: NDArray[np.float64]
    """Corner with the smallest coordinates, shape (3,)."""
    upper: NDArray[np.float64]
    """Corner with the largest coordinates, shape (3,)."""

    @property
    def centre(self) -> NDArray[np.float64]:
        """Middle of the box, shape (3,)."""
        return (self.lower + self.upper) / 2.0

    @property
    def radius(self) -> float:
        """Radius of the sphere around the box: half its diagonal."""
        return float(np.linalg.norm(self.upper - self.lower)) / 2.0


def bounding_box(
    model: pin.Model, links: Sequence[Link], configurations: NDArray[np.float64]
) -> Box:
    """Return a box that holds every link at every configuration.

    Each geometry counts with its own bounding box, so the result is a little generous.

    Parameters
    ----------
    model
        The robot.
    links
        Its links.
    configurations : ndarray, shape (n, nq)
        Configurations of `model`.

    Raises
    ------
    InputError
        If the robot has nothing to draw, or what it has is of no size.
    """
    if not links:
        raise InputError("the robot has no visual geometry: there is nothing to show")
    poses = link_poses(model, links, configurations)
    corners = np.concatenate(
        [_in_world(poses[:, index], _corners(link)) for index, link in enumerate(links)]
    )
    box = Box(corners.min(axis=0), corners.max(axis=0))
    if not np.isfinite(box.radius) or box.radius <= 0.0:
        raise InputError(f"the robot's bounding box has radius {box.radius} m: it cannot be shown")
    return box


def _corners(link: Link) -> NDArray[np.float64]:
    """Return the corners of the link's geometries' boxes in the link's frame, shape (m, 3)."""
    corners = []
    for item in link.geometries:
        item.geometry.computeLocalAABB()
        box = item.geometry.aabb_local
        in_link = link.placement.actInv(item.placement)
        ranges = zip(box.min_, box.max_, strict=True)
        corners += [in_link.act(np.array(corner)) for corner in product(*ranges)]
    return np.array(corners)


def _in_world(poses: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move points of shape (m, 3) by every pose of shape (n, 4, 4); the result has n m rows."""
    turned: NDArray[np.float64] = np.einsum("nij,mj->nmi", poses[:, :3, :3], points)
    return (turned + poses[:, None, :3, 3]).reshape(-1, 3)
