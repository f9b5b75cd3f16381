"""Closures as MuJoCo's equalities, exactly.

==============================  ================================================================
closure                         in MuJoCo
==============================  ================================================================
``spherical``                   ``connect`` of two sites
``rigid``                       ``weld`` of two sites
``revolute``                    two ``connect``: at the origin, and a length along the axis
``distance``                    a spatial tendon between two sites, held at its length
a coupling                      ``joint``; of several joints, a fixed tendon held at its length
the others                      frame b's body is cut in two equal parts that are welded together;
                                one of them hangs on frame a's body by the joint that the closure
                                stands for
==============================  ================================================================

The parts of a body that is cut have the same motion while the loops are closed, so the mechanism's
dynamics are those of the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.rows import across
from rps_pin.closed_loop.io.write.mjcf_bodies import Bodies, Body
from rps_pin.closed_loop.io.write.mjcf_joints import MujocoJoint
from rps_pin.closed_loop.io.write.numbers import number, numbers, quaternion
from rps_pin.closed_loop.io.write.source import Names, Source
from rps_pin.errors import MechanismError

#: Closures that MuJoCo has no equality for.
CUT = ("prismatic", "cylindrical", "universal", "planar", "point_on_line", "point_on_plane")
#: Coefficients of an equality's polynomial.
_COEFFICIENTS = 5
#: Mass and moments of a part that is welded to the world, kg and kg m^2: any will do.
_FIXED_PART = 1.0

_WHOLE = pin.SE3.Identity()


@dataclass
class Equalities:
    """The elements ``equality`` and ``tendon``."""

    equality: Any = field(default_factory=lambda: etree.Element("equality"))
    tendon: Any = field(default_factory=lambda: etree.Element("tendon"))


@dataclass(frozen=True)
class _End:
    """A closed frame: its body, and its placement in it."""

    body: Body
    placement: pin.SE3
    frame: str
    joint: int
    offset: bool = False
    """Whether it stands beside the frame of that name."""


def held_joints(source: Source) -> set[int]:
    """Return the joints whose bodies closures hold."""
    model = source.model
    of_frames = [c for c in source.closures if isinstance(c, LoopClosure)]
    return {frame.joint for closure in of_frames for frame in closure.closed_frames(model)}


def add_closures(source: Source, bodies: Bodies, q: Array) -> Equalities:
    """Return the equalities of a mechanism's closures; bodies are added, and cut.

    Parameters
    ----------
    source
        The mechanism.
    bodies
        Its bodies.
    q
        The home configuration, shape (nq,).
    """
    return _Writer(source, bodies, q).written()


class _Writer:
    def __init__(self, source: Source, bodies: Bodies, q: Array) -> None:
        self._source, self._bodies, self._q = source, bodies, q
        self._length = source.characteristic_length
        self._found = Equalities()
        self._names = Names()
        self._site_names = Names([frame.name for frame in source.model.frames])
        self._tendon_names = Names(source.model.names)

    def written(self) -> Equalities:
        self._cut_bodies()
        for closure in self._source.closures:
            if isinstance(closure, JointCoupling):
                self._couple(closure)
            else:
                a, b = self._ends(closure)
                self._close(closure, a, b)
        for hinge, slide, pitch in self._bodies.screws:
            self._couple(JointCoupling(slide, hinge, pitch, name=f"{hinge}_screw"))
        return self._found

    def _ends(self, closure: LoopClosure) -> list[_End]:
        names = (closure.frame_a, closure.frame_b)
        moved = (closure.placement_a is not None, closure.placement_b is not None)
        frames = closure.closed_frames(self._source.model)
        return [
            _End(self._bodies.of_joint[one.joint], one.placement, name, one.joint, offset)
            for one, name, offset in zip(frames, names, moved, strict=True)
        ]

    def _close(self, closure: LoopClosure, a: _End, b: _End) -> None:
        if closure.kind in CUT:
            a = self._part(closure, a, b)
        if closure.kind in ("spherical", "revolute"):
            self._hold("connect", self._site(a), self._site(b), closure.name)
        if closure.kind == "revolute":
            ahead = [
                pin.SE3(np.eye(3), self._length * np.array(axis))
                for axis in (closure.axis, closure.axis_b)
            ]
            sites = self._site(a, ahead[0]), self._site(b, ahead[1])
            self._hold("connect", *sites, closure.name)
        if closure.kind == "rigid" or closure.kind in CUT:
            self._hold("weld", self._site(a), self._site(b), closure.name)
        if closure.kind == "distance":
            self._rod(closure, a, b)

    def _hold(self, kind: str, site1: str, site2: str, name: str) -> None:
        etree.SubElement(
            self._found.equality, kind, name=self._names.fresh(name), site1=site1, site2=site2
        )

    def _site(self, end: _End, offset: pin.SE3 = _WHOLE) -> str:
        """Return the site of a frame, or of a placement in it."""
        placement = end.placement * offset
        if offset is _WHOLE and end.frame in end.body.sites and not end.offset:
            return end.frame
        name = self._site_names.fresh(f"{end.frame}_closed")
        end.body.sites[name] = placement
        return name

    def _couple(self, coupling: JointCoupling) -> None:
        if len(coupling.others) > 1:
            self._sum(coupling)
            return
        curve = (coupling.constant, *(c for terms in coupling.terms for c in terms))
        if len(curve) > _COEFFICIENTS:
            raise MechanismError(
                f"coupling {coupling.name!r} is a polynomial of degree {len(curve) - 1}; MuJoCo "
                f"has them up to degree {_COEFFICIENTS - 1}"
            )
        joints = {"joint1": coupling.joint}
        if coupling.others:
            joints["joint2"] = coupling.others[0]
        self._equality("joint", coupling.name, curve, **joints)

    def _sum(self, coupling: JointCoupling) -> None:
        """Hold the sum of joint coordinates that a tendon measures; it is 0 at zero coordinates."""
        tendon = self._tendon_names.fresh(coupling.name)
        total = etree.SubElement(self._found.tendon, "fixed", name=tendon)
        etree.SubElement(total, "joint", joint=coupling.joint, coef="1")
        for other, (ratio,) in zip(coupling.others, coupling.terms, strict=True):
            etree.SubElement(total, "joint", joint=other, coef=number(-ratio))
        self._equality("tendon", coupling.name, [coupling.constant], tendon1=tendon)

    def _equality(self, kind: str, name: str, curve: Sequence[float], **parts: str) -> None:
        """Add an equality whose first part is a polynomial of its second, or a constant."""
        coefficients = numbers([*curve, *[0.0] * _COEFFICIENTS][:_COEFFICIENTS])
        unique = self._names.fresh(name)
        etree.SubElement(self._found.equality, kind, name=unique, **parts, polycoef=coefficients)

    # Rods -----------------------------------------------------------------------------------------

    def _rod(self, closure: LoopClosure, a: _End, b: _End) -> None:
        """Hold a tendon between two sites; its length is counted from that at zero coordinates."""
        tendon = self._tendon_names.fresh(closure.name)
        rod = etree.SubElement(self._found.tendon, "spatial", name=tendon)
        sites = [self._site(a), self._site(b)]
        for site in sites:
            etree.SubElement(rod, "site", site=site)
        model = self._source.model
        data = model.createData()
        pin.forwardKinematics(model, data, pin.neutral(model))
        ends = [data.oMi[end.joint].act(end.placement.translation) for end in (a, b)]
        assert closure.distance is not None
        rest = closure.distance - float(np.linalg.norm(ends[1] - ends[0]))
        self._equality("tendon", closure.name, [rest], tendon1=tendon)

    # Bodies that are cut --------------------------------------------------------------------------

    def _cut_bodies(self) -> None:
        """Leave each body that is cut its part of its inertia."""
        for joint, parts in self._parts().items():
            body = self._bodies.of_joint[joint]
            body.inertia = _share(body.inertia, parts)

    def _parts(self) -> dict[int, int]:
        """Return into how many parts the body of a joint is cut, for those that are."""
        parts: dict[int, int] = {}
        for closure in self._source.closures:
            if isinstance(closure, LoopClosure) and closure.kind in CUT:
                joint = self._ends(closure)[1].joint
                if joint > 0:
                    parts[joint] = parts.get(joint, 1) + 1
        return parts

    def _part(self, closure: LoopClosure, a: _End, b: _End) -> _End:
        """Hang a part of b's body on a's, and return its frame that coincides with frame b."""
        model = self._source.model
        axes = _Axes(closure)
        data = model.createData()
        pin.forwardKinematics(model, data, self._q)
        placed_a, placed_b = (data.oMi[end.joint] * end.placement for end in (a, b))
        name = self._bodies.names.fresh(f"{closure.name}_part")
        here = pin.SE3(axes.turn, np.zeros(3))  # frame b in the part, at zero coordinates
        if b.joint == 0:
            inertia = pin.Inertia(_FIXED_PART, np.zeros(3), _FIXED_PART * np.eye(3))
        else:  # the body has been left its part already
            inertia = (here * b.placement.inverse()).act(b.body.inertia)
        joints = [
            (MujocoJoint(self._bodies.joint_names.fresh(f"{name}_{k}"), kind, axis, own), _WHOLE)
            for k, (kind, axis, own) in enumerate(axes.joints(placed_a.actInv(placed_b)), 1)
        ]
        part = Body(name, a.placement, inertia, joints)
        a.body.children.append(part)
        return _End(part, here, name, -1)


def _share(inertia: pin.Inertia, parts: int) -> pin.Inertia:
    return pin.Inertia(inertia.mass / parts, inertia.lever, inertia.inertia / parts)


class _Axes:
    """The joint that a closure stands for, as a row of MuJoCo's joints in frame a."""

    def __init__(self, closure: LoopClosure) -> None:
        self.kind = closure.kind
        self.axis = np.array(closure.axis)
        self.second = across(self.axis)[0]
        #: Rotation of frame b at zero coordinates.
        self.turn: Array = np.eye(3)
        if closure.axis_b is not None:
            on = self.second if self.kind == "universal" else self.axis
            self.turn = pin.Quaternion.FromTwoVectors(np.array(closure.axis_b), on).matrix()

    def joints(self, placement: pin.SE3) -> list[tuple[str, Array | None, Array]]:
        """Return the joints, with their coordinates where frame b has a placement in frame a."""
        slides: list[tuple[str, Array | None, Array]]
        slides = [("slide", t, np.array([t @ placement.translation])) for t in self._slides()]
        turned = placement.rotation @ self.turn.T
        if self.kind in ("cylindrical", "planar"):
            angle = _angle(self.axis, self.second, turned @ self.second)
            return [*slides, ("hinge", self.axis, np.array([angle]))]
        if self.kind == "universal":
            first = _angle(self.axis, self.second, turned @ self.second)
            second = -_angle(self.second, self.axis, turned.T @ self.axis)
            hinges = ((self.axis, first), (self.second, second))
            return [("hinge", axis, np.array([angle])) for axis, angle in hinges]
        if self.kind.startswith("point"):
            return [*slides, ("ball", None, quaternion(turned))]
        return slides

    def _slides(self) -> list[Array]:
        if self.kind in ("planar", "point_on_plane"):
            return list(across(self.axis))
        return [] if self.kind == "universal" else [self.axis]


def _angle(axis: Array, start: Array, end: Array) -> float:
    """Return the angle about an axis from one direction across it to another."""
    return float(np.arctan2(axis @ np.cross(start, end), start @ end))
