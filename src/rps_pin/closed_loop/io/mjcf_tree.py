"""The open tree of an MJCF, built by Pinocchio's parser from a plain form of the file.

Read as it is, an MJCF loses much in Pinocchio 4.1: all bodies of the world but the first, the
place of a fixed first body, bodies without attributes, sites of bodies without joints, gravity,
defaults that follow their use; limits are shifted by ``ref``, those of slides turned from degrees;
several joints of a body become one composite joint. So the parser is given a form in which nothing
is left to it but masses and places:

- one body ``world`` holds all others; every body and joint has a name;
- defaults are applied, angles in radians, orientations quaternions; ``frame`` elements are gone;
- a body with several joints is a row of bodies with one each, without mass but for the last.

Limits, sites, gravity and key frames are added to the model afterwards.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.mjcf_file import (
    MjcfFile,
    children,
    quaternion_text,
    rotation_of_quaternion,
    text,
)
from rps_pin.closed_loop.io.mjcf_inertia import add_inertia, placed
from rps_pin.errors import MechanismError

#: Frame of the world that bears MuJoCo's name for it.
WORLD = "world"

_COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
_OF_THE_BODY = ("inertial", "joint", "freejoint")
_SEEN_ONLY = ("camera", "light")


@dataclass(frozen=True)
class MjcfJoint:
    """A joint of the file: its name in the model, and what Pinocchio's parser is not asked for."""

    name: str
    kind: str
    element: Any
    attributes: dict[str, str]
    ref: float
    """Coordinate at which the bodies stand as the file places them, rad or m."""
    start: tuple[float, ...]
    """Coordinates in ``qpos0``, as MuJoCo orders them."""


class MjcfTree:
    """The tree of a file, and what its names in the file became.

    Attributes
    ----------
    model : pin.Model
        The tree, with limits, armature, sites, gravity and reference configurations.
    joints : list of MjcfJoint
        In the order of MuJoCo's coordinates.
    body_frames, site_frames : dict
        Names of frames by names of bodies and sites. They differ where a joint, or a body, has the
        same name: then ``_body``, or ``_site``, is appended.
    """

    def __init__(self, file: MjcfFile) -> None:
        self._file = file
        self.joints: list[MjcfJoint] = []
        self._sites: list[tuple[str, str, pin.SE3]] = []
        self.body_frames: dict[str, str] = {}
        self.site_frames: dict[str, str] = {}
        self._name_all()
        plain = etree.Element("mujoco", model=file.root.get("model", "mechanism"))
        etree.SubElement(plain, "compiler", angle="radian", inertiafromgeom="auto")
        world = etree.SubElement(etree.SubElement(plain, "worldbody"), "body", name=WORLD)
        for section in file.section("worldbody"):
            self._read_contents(section, world, WORLD, pin.SE3.Identity(), "main", False)
        if not self.joints:
            raise MechanismError(f"{file.origin} has no joints, so no mechanism")
        self.model = self._built(etree.tostring(plain))
        self._add_limits()
        for name, body, placement in self._sites:
            self.add_frame(name, body, placement)
        self.model.gravity.linear = self._gravity()
        self._add_key_frames()

    def add_frame(self, name: str, frame: str, placement: pin.SE3) -> str:
        """Add a frame fixed in another; return its name, to which ``_`` is added if it is taken."""
        while self.model.existFrame(name):
            name += "_"
        parent = self.model.getFrameId(frame)
        base = self.model.frames[parent]
        self.model.addFrame(
            pin.Frame(
                name,
                base.parentJoint,
                parent,
                base.placement * placement,
                pin.FrameType.OP_FRAME,
            )
        )
        return name

    # Names ----------------------------------------------------------------------------------------

    def _name_all(self) -> None:
        """Give every named element a name of its own: joints first, then bodies, then sites."""
        self._taken = {"universe", WORLD}
        self._joint_names: dict[str, str] = {}
        self._name(("joint", "freejoint"), self._joint_names, "_joint")
        self._name(("body",), self.body_frames, "_body")
        self._name(("site",), self.site_frames, "_site")
        self.body_frames[WORLD] = WORLD

    def _name(self, tags: tuple[str, ...], names: dict[str, str], suffix: str) -> None:
        for section in self._file.section("worldbody"):
            for element in section.iter(*tags):
                name = element.get("name")
                if not name:
                    continue
                if name in names:
                    self._file.refuse(element, "has a name that another one has")
                names[name] = self._fresh(name if name not in self._taken else name + suffix)

    def _fresh(self, name: str) -> str:
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    # The plain form -------------------------------------------------------------------------------

    def _read_contents(
        self,
        element: Any,
        plain: Any,
        frame: str,
        pose: pin.SE3,
        childclass: str,
        in_frame: bool,
    ) -> list[tuple[Any, pin.SE3, str]]:
        """Read what a body (or a ``frame`` in it) holds; return its geoms, placed in the body."""
        file = self._file
        geoms = []
        for child in children(element):
            tag = child.tag
            if tag in _OF_THE_BODY:  # read with it
                if in_frame:
                    file.refuse(child, "cannot stand in a frame element")
            elif tag == "geom":
                geoms.append((child, pose, childclass))
            elif tag == "site":
                attributes = file.attributes(child, childclass)
                if name := child.get("name"):
                    place = pose * placed(file, child, attributes)[0]
                    self._sites.append((self.site_frames[name], frame, place))
            elif tag == "frame":
                inner = child.get("childclass", childclass)
                place = pose * file.pose(child, child.attrib)
                geoms += self._read_contents(child, plain, frame, place, inner, True)
            elif tag == "body":
                self._read_body(child, plain, pose, childclass)
            elif tag not in _SEEN_ONLY:
                known = (*_OF_THE_BODY, "geom", "site", "frame", "body")
                file.refuse(child, f"is not read; known here: {', '.join(known)}")
        return geoms

    def _read_body(self, element: Any, plain: Any, around: pin.SE3, childclass: str) -> None:
        file = self._file
        if file.number(element, element.attrib, "gravcomp"):
            file.refuse(element, "has gravcomp, which is not read")
        if element.get("mocap", "false") != "false":
            file.refuse(element, "is moved by motion capture, which is not read")
        childclass = element.get("childclass", childclass)
        name = element.get("name")
        frame = self.body_frames[name] if name else self._fresh(f"{plain.get('name')}_child")
        pose = around * file.pose(element, element.attrib)
        joints = [child for child in children(element) if child.tag in ("joint", "freejoint")]
        for number, joint in enumerate(joints, 1):
            last = number == len(joints)
            link = frame if last else self._fresh(f"{frame}_{number}")
            plain = _plain_body(plain, link, pose)
            self._read_joint(joint, plain, frame, number, pose, childclass, len(joints) == 1)
            pose = pin.SE3.Identity()
        if not joints:
            plain = _plain_body(plain, frame, pose)
        held = self._read_contents(element, plain, frame, pin.SE3.Identity(), childclass, False)
        add_inertia(file, element, plain, held)

    def _read_joint(
        self,
        element: Any,
        plain: Any,
        frame: str,
        number: int,
        pose: pin.SE3,
        childclass: str,
        alone: bool,
    ) -> None:
        file = self._file
        free = element.tag == "freejoint"
        attributes = dict(element.attrib) if free else file.attributes(element, childclass)
        kinds = "hinge slide ball free"
        kind = "free" if free else file.choice(element, attributes, "type", kinds, "hinge")
        if kind == "free" and not (alone and plain.getparent().get("name") == WORLD):
            file.refuse(element, "is free: its body must be in the world and have no other joint")
        if kind == "free":  # its coordinates are its place in the world
            plain.set("pos", "0 0 0")
            plain.set("quat", "1 0 0 0")
        name = element.get("name")
        if name:
            name = self._joint_names[name]
        else:
            name = self._fresh(f"{frame}_joint" + (f"_{number}" if not alone else ""))
        written = {"name": name, "type": kind}
        ref = 0.0
        if kind != "free":
            written["pos"] = text(file.vector(element, attributes, "pos", (0.0, 0.0, 0.0)))
        if kind in ("hinge", "slide"):
            axis = file.vector(element, attributes, "axis", (0.0, 0.0, 1.0))
            if not axis.any():
                file.refuse(element, "has an axis without direction")
            written["axis"] = text(axis / np.linalg.norm(axis))
            ref = file.number(element, attributes, "ref")
            ref = file.angle(ref) if kind == "hinge" else ref
            written["ref"] = text([ref])
        armature = file.number(element, attributes, "armature")
        written["armature"] = text([armature])
        etree.SubElement(plain, "joint", **written)
        quaternion = pin.Quaternion(pose.rotation).coeffs()[[3, 0, 1, 2]]
        start = {"ball": (1.0, 0.0, 0.0, 0.0), "free": (*pose.translation, *quaternion)}
        self.joints.append(MjcfJoint(name, kind, element, attributes, ref, start.get(kind, (ref,))))

    def _built(self, plain: bytes) -> pin.Model:
        """Return Pinocchio's model of a plain text; it reads files only."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plain.xml"
            path.write_bytes(plain)
            try:
                model = pin.buildModelFromMJCF(path)
            except (ValueError, RuntimeError) as error:
                raise MechanismError(f"{self._file.origin} is not a valid MJCF: {error}") from None
        for name, inertia in zip(model.names, model.inertias, strict=True):
            if not np.isfinite(inertia.matrix()).all():
                raise MechanismError(f"{self._file.origin}: what {name!r} carries is too heavy")
        return model

    # What the model gets afterwards ---------------------------------------------------------------

    def _add_limits(self) -> None:
        file, model = self._file, self.model
        for joint in self.joints:
            place = model.joints[model.getJointId(joint.name)]
            if joint.kind == "free":  # Pinocchio's parser bounds places by 1.01 m
                model.lowerPositionLimit[place.idx_q : place.idx_q + 3] = -math.inf
                model.upperPositionLimit[place.idx_q : place.idx_q + 3] = math.inf
            if place.nq > 1:
                continue
            limits = self._limits(joint, "range", "limited")
            if limits is not None:
                lower, upper = limits if joint.kind == "slide" else map(file.angle, limits)
                model.lowerPositionLimit[place.idx_q] = lower
                model.upperPositionLimit[place.idx_q] = upper
            effort = self._limits(joint, "actuatorfrcrange", "actuatorfrclimited")
            if effort is not None:
                model.lowerEffortLimit[place.idx_v], model.upperEffortLimit[place.idx_v] = effort

    def _limits(self, joint: MjcfJoint, name: str, flag: str) -> tuple[float, float] | None:
        """Return the limits that hold, or None."""
        file, element = self._file, joint.element
        limited = file.choice(element, joint.attributes, flag, "true false auto", "auto")
        given = file.numbers(element, joint.attributes, name)
        if limited == "false" or (limited == "auto" and given is None):
            return None
        if limited == "auto" and not file.autolimits:
            file.refuse(element, f"has a {name}, but autolimits is off and {flag} is not given")
        lower, upper = file.vector(element, joint.attributes, name, (0.0, 0.0))
        if not lower < upper:
            file.refuse(element, f"{name}: {lower:.6g} must be below {upper:.6g}")
        return float(lower), float(upper)

    def _gravity(self) -> Array:
        gravity = np.array([0.0, 0.0, -9.81])
        for option in self._file.section("option"):
            gravity = self._file.vector(option, option.attrib, "gravity", tuple(gravity))
            for name in ("density", "viscosity"):
                if self._file.number(option, option.attrib, name):
                    self._file.refuse(option, f"has a {name}: a medium around is not read")
            for flag in option.findall("flag"):
                for name in ("equality", "spring", "damper", "passive", "frictionloss", "limit"):
                    if flag.get(name) == "disable":
                        self._file.refuse(flag, f"{name} = 'disable' is not read")
        off = [f for o in self._file.section("option") for f in o.findall("flag[@gravity]")]
        return np.zeros(3) if off and off[-1].get("gravity") == "disable" else gravity

    def _add_key_frames(self) -> None:
        configurations = self.model.referenceConfigurations
        start = np.concatenate([joint.start for joint in self.joints])
        configurations["qpos0"] = self.configuration(start)
        for key in self._file.entries("keyframe"):
            values = self._file.numbers(key, key.attrib, "qpos")
            if values is None:
                continue
            if values.size != start.size:
                self._file.refuse(key, f"has {values.size} numbers in qpos, not {start.size}")
            if name := key.get("name"):
                try:
                    configurations[name] = self.configuration(values)
                except ZeroDivisionError:
                    self._file.refuse(key, "has a quaternion of zeros")

    def configuration(self, qpos: Iterable[float]) -> Array:
        """Return Pinocchio's configuration of MuJoCo's ``qpos``.

        The coordinates are the same but for their order: of the joints, and in quaternions,
        (x, y, z, w) in place of (w, x, y, z).
        """
        values, q = np.fromiter(qpos, np.float64), np.empty(self.model.nq)
        start = 0
        for joint in self.joints:
            size = _COORDINATES[joint.kind]
            own = values[start : start + size].copy()
            if size > 1:
                if not own[-4:].any():
                    raise ZeroDivisionError
                own[-4:] = pin.Quaternion(rotation_of_quaternion(own[-4:])).coeffs()
            index = self.model.idx_qs[self.model.getJointId(joint.name)]
            q[index : index + size] = own
            start += size
        return q


def _plain_body(parent: Any, name: str, pose: pin.SE3) -> Any:
    quaternion = quaternion_text(pose.rotation)
    return etree.SubElement(parent, "body", name=name, pos=text(pose.translation), quat=quaternion)
