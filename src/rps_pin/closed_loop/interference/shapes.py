"""Collision shapes of links as files state them, before they are built."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import pinocchio as pin

from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds

#: Kinds of shapes, and the sizes that each has, m.
KINDS = {
    "box": ("length", "width", "height"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "ellipsoid": ("radius a", "radius b", "radius c"),
    "plane": (),
    "mesh": (),
    "given": (),
}


class MeshFile(NamedTuple):
    """A mesh that a file names."""

    name: str
    """As it stands in the file."""
    beside: str
    """The file that names it."""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A collision shape of a link.

    Attributes
    ----------
    link
        Name of the link.
    where
        The place in its file, for messages.
    kind
        One of `KINDS`. A plane is the half space below z = 0.
    sizes
        Numbers of the kind, m: sides of a box, radius and length (of a capsule: without its ends).
    placement
        Of the shape in its link. Cylinders and capsules lie along z.
    mesh
        Of a ``"mesh"`` a `MeshFile`, or points (n, 3), m, whose convex hull it is; of the kind
        ``"given"`` a shape of Coal's.
    fault
        Why it cannot be used; empty if it can.
    mask
        Types of contact and their affinity, as in MuJoCo: of two shapes, one's types must have a
        bit of the other's affinity, or the pair is not checked.
    """

    link: str
    where: str
    kind: str = "sphere"
    sizes: tuple[float, ...] = ()
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    mesh: Any = None
    fault: str = ""
    mask: tuple[int, int] = (1, 1)

    def may_touch(self, other: LinkShape) -> bool:
        """Return whether the masks of two shapes match."""
        return bool(self.mask[0] & other.mask[1] or other.mask[0] & self.mask[1])


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class CollisionShapes:
    """Collision shapes of a mechanism, and the pairs of links that are not checked.

    Attributes
    ----------
    shapes
        The shapes, each with its link.
    ignored
        Pairs of names of links that may overlap.
    faults
        What else cannot be used, in sentences.
    package_path
        Folders that are ROS packages, or hold some, where meshes are looked for first.
    """

    shapes: tuple[LinkShape, ...] = ()
    ignored: tuple[tuple[str, str], ...] = ()
    faults: tuple[str, ...] = ()
    package_path: tuple[str, ...] = ()

    def in_packages(self, folders: Iterable[str | os.PathLike[str]]) -> CollisionShapes:
        """Return the same shapes, whose meshes are looked for in further folders first.

        Raises
        ------
        InputError
            If a path is given in place of several.
        """
        if isinstance(folders, (str, bytes, os.PathLike)):
            raise InputError(f"folders = {shown(folders)}: it must be several paths: [...]")
        return replace(self, package_path=(*map(str, folders), *self.package_path))

    def ignoring(self, pairs: Any) -> CollisionShapes:
        """Return the same shapes with further pairs of links that are not checked."""
        return replace(self, ignored=(*self.ignored, *pairs_of(pairs)))

    def prefixed(self, prefix: str) -> CollisionShapes:
        """Return the same shapes of links with a prefix before their names."""
        return replace(
            self,
            shapes=tuple(replace(one, link=prefix + one.link) for one in self.shapes),
            ignored=tuple((prefix + a, prefix + b) for a, b in self.ignored),
        )


@refuses_other_kinds
def composed_shapes(parts: Mapping[str, CollisionShapes]) -> CollisionShapes:
    """Return the shapes of the parts of a composed model; see `compose`.

    Parameters
    ----------
    parts
        By the parts' names, as given to `compose`: links are called ``part/link``.
    """
    all_of = [shapes.prefixed(f"{name}/") for name, shapes in parts.items()]
    return CollisionShapes(
        tuple(shape for one in all_of for shape in one.shapes),
        tuple(pair for one in all_of for pair in one.ignored),
        tuple(fault for one in all_of for fault in one.faults),
        tuple(dict.fromkeys(folder for one in all_of for folder in one.package_path)),
    )


def shapes_of(model: pin.Model, given: Any) -> CollisionShapes:
    """Return what is given as shapes of a model: `CollisionShapes`, a `pin.GeometryModel`, or None.

    A shape that names no frame of a link belongs to the first link of its joint.

    Raises
    ------
    InputError
        If it is none of these, or a shape is on a joint that the model does not have.
    """
    if given is None or isinstance(given, CollisionShapes):
        return given or CollisionShapes()
    if not isinstance(given, pin.GeometryModel):
        raise InputError(
            f"collision = {shown(given)}: it must be CollisionShapes or a pin.GeometryModel"
        )
    found = []
    for item in given.geometryObjects:
        joint = int(item.parentJoint)
        if not 0 <= joint < model.njoints:
            raise InputError(f"shape {item.name!r} is on joint {joint}, of {model.njoints}")
        frame = _link_frame(model, item)
        at = model.frames[frame].placement.actInv(item.placement)
        where = f"shape {item.name!r}"
        name = model.frames[frame].name
        found.append(LinkShape(name, where, "given", (), at, item.geometry))
    return CollisionShapes(tuple(found))


def _link_frame(model: pin.Model, item: Any) -> int:
    joint, frame = int(item.parentJoint), int(item.parentFrame)
    kind = pin.FrameType.BODY
    if frame < model.nframes and model.frames[frame].parentJoint == joint:
        while frame and model.frames[frame].type not in (kind, pin.FrameType.JOINT):
            frame = int(model.frames[frame].parentFrame)
        if model.frames[frame].parentJoint == joint and model.frames[frame].type == kind:
            return frame
    of_joint = [k for k, one in enumerate(model.frames) if one.parentJoint == joint]
    links = [k for k in of_joint if model.frames[k].type == kind]
    return (links or of_joint or [0])[0]


def pairs_of(given: Any) -> tuple[tuple[str, str], ...]:
    """Return pairs of names, checked.

    Raises
    ------
    InputError
        If one is not two different names.
    """
    found = []
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"ignore = {shown(given)}: it must be pairs of links' names")
    for pair in given:
        several = isinstance(pair, Iterable) and not isinstance(pair, str)
        names = tuple(pair) if several else ()
        if len(names) != 2 or not all(isinstance(name, str) for name in names):
            raise InputError(f"ignore: {shown(pair)} must be a pair of links' names")
        if names[0] == names[1]:
            raise InputError(f"ignore: {names[0]!r} is paired with itself")
        found.append((names[0], names[1]))
    return tuple(found)
