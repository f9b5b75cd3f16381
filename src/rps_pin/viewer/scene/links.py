"""A robot's links: what moves as one, with the geometries that it carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array

FIXED_JOINT = 0
"""Pinocchio's index of the universe: what hangs on it never moves."""


@dataclass(frozen=True)
class Link:
    """One link that has something to draw."""

    name: str
    """Its name in the scene tree: the link's own, made unique and free of ``/``."""
    joint: int
    """Index of the joint that carries it."""
    placement: pin.SE3
    """Pose of the link's frame in the joint's frame."""
    geometries: tuple[pin.GeometryObject, ...]
    """What it carries; each geometry's `placement` is in the joint's frame."""

    @property
    def moves(self) -> bool:
        """Whether any joint lies between the link and the world."""
        return self.joint != FIXED_JOINT

    def pose(self, data: pin.Data) -> pin.SE3:
        """Return the link's pose in the world from `data` after forward kinematics."""
        return data.oMi[self.joint] * self.placement


def links_of(model: pin.Model, visual: pin.GeometryModel) -> list[Link]:
    """Group a visual model's geometries by the link that carries them.

    A geometry that names no link (one added by hand) is grouped under its joint.
    """
    carried: dict[tuple[int, int | None], list[pin.GeometryObject]] = {}
    for item in visual.geometryObjects:
        frame = int(item.parentFrame)
        known = 0 < frame < model.nframes
        key = (int(item.parentJoint), frame if known else None)
        carried.setdefault(key, []).append(item)

    links: list[Link] = []
    taken: set[str] = set()
    for (joint, frame_index), items in carried.items():
        if frame_index is None:
            label, placement = model.names[joint], pin.SE3.Identity()
        else:
            label = model.frames[frame_index].name
            placement = model.frames[frame_index].placement
        name = node_name(label, taken)
        taken.add(name)
        links.append(Link(name, joint, placement.copy(), tuple(items)))
    return links


def node_name(label: str, taken: set[str]) -> str:
    """Return a scene-tree name for `label`: not empty, without ``/``, not in `taken`."""
    base = label.replace("/", ".") or "unnamed"
    name, count = base, 1
    while name in taken:
        count += 1
        name = f"{base}_{count}"
    return name


def link_poses(
    model: pin.Model,
    links: Sequence[Link],
    configurations: Array,
) -> Array:
    """Return every link's pose in the world at every configuration.

    Parameters
    ----------
    model
        The robot.
    links
        The links asked for.
    configurations : ndarray, shape (n, nq)
        Configurations of `model`.

    Returns
    -------
    ndarray, shape (n, len(links), 4, 4)
        Homogeneous matrices, in metres.
    """
    data = model.createData()
    poses = np.empty((len(configurations), len(links), 4, 4))
    for row, q in zip(poses, configurations, strict=True):
        pin.forwardKinematics(model, data, q)
        for index, link in enumerate(links):
            row[index] = link.pose(data).homogeneous
    return poses
