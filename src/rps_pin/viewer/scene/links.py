"""Links of a robot: frames that carry geometry and move as one."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.viewer.scene.mesh_colours import own_colours
from rps_pin.viewer.scene.shapes import Material, Part, Shape, drawn_shapes, material_of

UNIVERSE = 0
"""Pinocchio's index of the joint that never moves."""


@dataclass(frozen=True)
class Link:
    """A link with visual geometry."""

    name: str
    """Its name in the scene tree: the link's own, made unique and free of ``/``."""
    joint: int
    """Index of the joint that carries it."""
    placement: pin.SE3
    """Pose of the link's frame in the joint's frame."""
    geometries: tuple[pin.GeometryObject, ...]
    """Its geometry; each one's `placement` is in the joint's frame."""

    @property
    def moves(self) -> bool:
        """Whether any joint lies between the link and the world."""
        return self.joint != UNIVERSE

    def pose(self, data: pin.Data) -> pin.SE3:
        """Return the link's pose in the world from `data` after forward kinematics."""
        return data.oMi[self.joint] * self.placement

    def parts(self, material: Material | None = None) -> list[Part]:
        """Return the parts that draw the link, in its own material or in another one."""
        parts: list[Part] = []
        for item in self.geometries:
            in_link = self.placement.actInv(item.placement).homogeneous
            for shape, placement, own in _surfaces(item, material):
                name = node_name(item.name, [part.name for part in parts])
                parts.append(Part(self.name, name, shape, own, in_link @ placement))
        return parts


def _surfaces(
    item: pin.GeometryObject, material: Material | None
) -> list[tuple[Shape, Array, Material]]:
    """Return the shapes of a geometry with their placements in its frame and their materials."""
    coloured = own_colours(item) if material is None else []
    if coloured:
        return [(shape, np.eye(4), own) for shape, own in coloured]
    one = material_of(item) if material is None else material
    return [(shape, placement, one) for shape, placement in drawn_shapes(item)]


def links_of(model: pin.Model, visual: pin.GeometryModel) -> list[Link]:
    """Group a visual model's geometries by the link that carries them.

    A geometry without a parent frame is grouped under its joint.
    """
    carried: dict[tuple[int, int | None], list[pin.GeometryObject]] = {}
    for item in visual.geometryObjects:
        frame = int(item.parentFrame)
        key = (int(item.parentJoint), frame if 0 < frame < model.nframes else None)
        carried.setdefault(key, []).append(item)

    links: list[Link] = []
    for (joint, frame_index), items in carried.items():
        label, placement = model.names[joint], pin.SE3.Identity()
        if frame_index is not None:
            label, placement = model.frames[frame_index].name, model.frames[frame_index].placement
        name = node_name(label, [link.name for link in links])
        links.append(Link(name, joint, placement.copy(), tuple(items)))
    return links


def node_name(label: str, taken: Collection[str] = ()) -> str:
    """Return a scene-tree name for `label`: not empty, without ``/``, not in `taken`."""
    base = label.replace("/", ".") or "unnamed"
    name, count = base, 1
    while name in taken:
        count += 1
        name = f"{base}_{count}"
    return name


def link_poses(model: pin.Model, links: Sequence[Link], configurations: Array) -> Array:
    """Return every link's pose in the world at every configuration.

    Parameters
    ----------
    model
        The robot.
    links
        n of its links.
    configurations : ndarray, shape (m, nq)
        Configurations of `model`.

    Returns
    -------
    ndarray, shape (m, n, 4, 4)
        Homogeneous matrices, in metres.
    """
    data = model.createData()
    poses = np.empty((len(configurations), len(links), 4, 4))
    for row, q in zip(poses, configurations, strict=True):
        pin.forwardKinematics(model, data, q)
        for index, link in enumerate(links):
            row[index] = link.pose(data).homogeneous
    return poses
