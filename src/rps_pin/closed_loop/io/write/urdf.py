"""A mechanism as a URDF of its tree, and a description of what a URDF cannot say.

==============================  =================================================================
joint                           in the URDF
==============================  =================================================================
revolute, prismatic             the same, with limits, damping and friction
a turn without limits           ``continuous``
free-flyer, planar              ``floating``, ``planar``
spherical, universal            three or two revolute joints, which the description merges
translation, Z-Y-X, composite   a row of single joints
helical                         ``screw``, of Drake's dialect
ellipsoid, mimic                refused
==============================  =================================================================
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.urdf.inertials import gross_fault
from rps_pin.closed_loop.io.write.links import Hung, Links
from rps_pin.closed_loop.io.write.numbers import number, numbers
from rps_pin.closed_loop.io.write.shapes import add_collisions, add_visuals
from rps_pin.closed_loop.io.write.source import (
    Names,
    Source,
    axes_of,
    axis_of,
    is_cardan,
    kind_of,
    pitch_of,
    unwritten_limits,
)
from rps_pin.errors import MechanismError

_TYPES = {
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
    "planar": "planar",
    "free": "floating",
    "helical": "screw",
}
_DRAKE = "http://drake.mit.edu"
#: What stands for no limit where URDF demands one, and for a limit of 0, which is read as none.
_LARGEST, _LEAST = float(np.finfo(np.float64).max), float(np.finfo(np.float64).tiny)
#: Joints that a description merges from several, and the kind it merges them into.
_MERGED = {"ball": "spherical", "universal": "universal"}


def is_whole(joint: Any) -> bool:
    """Return whether a joint is written as one, rather than as a row of others."""
    return kind_of(joint) == "ball" or is_cardan(joint)


def urdf_text(
    source: Source, shapes: pin.GeometryModel | None, told: list[str]
) -> tuple[str, list[dict[str, Any]], list[tuple[str, str]]]:
    """Return the URDF of a tree without rows (see `without_rows`), and what its description needs.

    That are the merges, and the pairs of links that may overlap.

    Parameters
    ----------
    source
        The mechanism.
    shapes
        Shapes of its links, by the joints that move them; or None.
    told
        Takes sentences on what is left out.

    Raises
    ------
    MechanismError
        If URDF has no such joint; names it.
    """
    return _Urdf(source, shapes, told).text()


class _Urdf:
    def __init__(self, source: Source, shapes: pin.GeometryModel | None, told: list[str]) -> None:
        self._source, self._model, self._shapes = source, source.model, shapes
        self._told = told
        self._links = Links(source.model)
        self._names = Names(
            [*source.model.names, *(f.name for f in source.model.frames), *self._links.moved]
        )
        kinds = [kind_of(joint) for joint in list(source.model.joints)[1:]]
        spaces = {"drake": _DRAKE} if "helical" in kinds else {}
        self._robot = etree.Element("robot", name=source.name or "mechanism", nsmap=spaces)
        self._merges: list[dict[str, Any]] = []

    def text(self) -> tuple[str, list[dict[str, Any]], list[tuple[str, str]]]:
        for joint in range(self._model.njoints):
            if joint:
                self._add_joint(joint)
            self._add_link(joint)
        for name, joint_name, below in self._links.fixed:
            self._joint(joint_name, "fixed", below, name)
            etree.SubElement(self._robot, "link", name=name)
        ignored = add_collisions(
            self._robot, self._model, self._links.of_frames, self._source.collision, self._told
        )
        etree.indent(self._robot, space="  ")
        return str(etree.tostring(self._robot, encoding="unicode")) + "\n", self._merges, ignored

    def _add_link(self, joint: int) -> None:
        link = etree.SubElement(self._robot, "link", name=self._links.moved[joint])
        body = self._model.inertias[joint]
        if body.mass or body.inertia.any():
            inertial = etree.SubElement(link, "inertial")
            etree.SubElement(inertial, "origin", xyz=numbers(body.lever), rpy="0 0 0")
            etree.SubElement(inertial, "mass", value=number(body.mass))
            tensor = body.inertia
            if why := gross_fault(np.linalg.eigvalsh(tensor)):
                raise MechanismError(f"link {self._links.moved[joint]!r} cannot be written: {why}")
            etree.SubElement(
                inertial,
                "inertia",
                {
                    f"i{'xyz'[i]}{'xyz'[j]}": number(tensor[i, j])
                    for i in range(3)
                    for j in range(i, 3)
                },
            )
        if self._shapes is not None:
            add_visuals(link, self._shapes, joint)

    def _add_joint(self, joint: int) -> None:
        name, one = self._model.names[joint], self._model.joints[joint]
        kind, below, link = kind_of(one), self._links.hung[joint], self._links.moved[joint]
        self._told += unwritten_limits(self._model, joint, effort=True)
        if kind in _MERGED:
            self._add_row(name, kind, one, below, link)
        elif kind in _TYPES:
            if kind == "revolute" and not np.isfinite(self._range(one.idx_q)).any():
                kind = "continuous"
            element = self._joint(name, _TYPES[kind], below, link)
            if kind == "planar":
                etree.SubElement(element, "axis", xyz="0 0 1")
            elif kind != "free":
                etree.SubElement(element, "axis", xyz=numbers(axis_of(one, self._model.nq)))
                self._add_limit(element, one.idx_q, one.idx_v, bounded=kind != "continuous")
                self._add_losses(element, one.idx_v)
            if kind == "helical":
                pitch = number(2 * np.pi * pitch_of(one, self._model.nq))
                etree.SubElement(element, f"{{{_DRAKE}}}screw_thread_pitch", value=pitch)
        else:
            raise MechanismError(f"joint {name!r} ({kind}) cannot be written: URDF has none")

    def _add_row(self, name: str, kind: str, one: Any, below: Hung, link: str) -> None:
        """Add revolute joints in a row, and the merge that makes one joint of them."""
        row = []
        axes = list(np.eye(3)) if kind == "ball" else list(axes_of(one))
        for place, axis in enumerate(axes):
            part = self._names.fresh(f"{name}_{place + 1}")
            last = place == len(axes) - 1
            moved = link if last else self._names.fresh(f"{part}_link")
            bounded = kind != "ball"
            element = self._joint(part, "revolute" if bounded else "continuous", below, moved)
            etree.SubElement(element, "axis", xyz=numbers(axis))
            self._add_limit(element, one.idx_q + place, one.idx_v + place, bounded=bounded)
            if not last:
                etree.SubElement(self._robot, "link", name=moved)
            below = Hung(moved, pin.SE3.Identity())
            row.append(part)
        self._merges.append({"joints": row, "into": _MERGED[kind], "name": name})

    def _joint(self, name: str, kind: str, below: Hung, link: str) -> Any:
        tag = f"{{{_DRAKE}}}joint" if kind == "screw" else "joint"
        joint = etree.SubElement(self._robot, tag, name=name, type=kind)
        etree.SubElement(joint, "parent", link=below.link)
        etree.SubElement(joint, "child", link=link)
        add_origin(joint, below.placement)
        return joint

    def _add_limit(self, element: Any, idx_q: int, idx_v: int, *, bounded: bool) -> None:
        """Add a joint's limits; a missing one is the largest number there is."""
        model = self._model
        forces = model.upperEffortLimit[idx_v], -model.lowerEffortLimit[idx_v]
        effort = min(forces)
        if forces[0] != forces[1]:
            self._told.append(
                f"joint {element.get('name')!r}: effort of {-forces[1]:g} to {forces[0]:g} is "
                f"written as {effort:g} either way"
            )
        speed = model.upperVelocityLimit[idx_v]  # Pinocchio's reader has no sign for the lower one
        limits = {"effort": effort or _LEAST, "velocity": speed or _LEAST}
        if bounded:
            limits["lower"], limits["upper"] = self._range(idx_q)
            if limits["lower"] == limits["upper"] == 0:
                limits["upper"] = _LEAST
        if bounded or np.isfinite([effort, speed]).any():
            finite = {name: np.clip(value, -_LARGEST, _LARGEST) for name, value in limits.items()}
            texts = {name: number(value) for name, value in finite.items()}
            etree.SubElement(element, "limit", texts)

    def _range(self, idx_q: int) -> tuple[float, float]:
        """Return a coordinate's lower and upper limit."""
        model = self._model
        return float(model.lowerPositionLimit[idx_q]), float(model.upperPositionLimit[idx_q])

    def _add_losses(self, element: Any, idx_v: int) -> None:
        effects = self._source.effects
        damping, friction = effects.damping[idx_v], effects.friction[idx_v]
        if damping or friction:
            etree.SubElement(
                element, "dynamics", damping=number(damping), friction=number(friction)
            )


def add_origin(element: Any, placement: pin.SE3) -> None:
    """Add an ``origin``, unless it is the identity."""
    if np.array_equal(placement.homogeneous, np.eye(4)):
        return
    angles = numbers(pin.rpy.matrixToRpy(placement.rotation))
    etree.SubElement(element, "origin", xyz=numbers(placement.translation), rpy=angles)
