"""Open tree of an MJCF, built by Pinocchio's parser from a plain form of the file.

Pinocchio 4.1 reads an MJCF only in part. It drops all bodies of the world but the first, the
placement of a fixed first body, bodies without attributes, sites of bodies without joints, gravity,
and defaults that follow their use; limits are shifted by ``ref``, those of slides converted from
degrees; several joints of a body become one composite joint. So the parser is given a plain form,
from which it reads masses and placements:

- one body ``world`` holds all others; every body and joint has a name;
- defaults are applied, angles in radians, orientations quaternions; ``frame`` elements are gone;
- a body with several joints is a chain of bodies with one each, massless but for the last.

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
    MjcfElement,
    MjcfFile,
    children,
    placement,
    rotation_of_quaternion,
    text,
)
from rps_pin.closed_loop.io.mjcf_inertia import add_inertia
from rps_pin.errors import MechanismError

#: Frame of the world that bears MuJoCo's name for it.
WORLD = "world"

_COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
_OF_THE_BODY = ("inertial", "joint", "freejoint")
_SEEN_ONLY = ("camera", "light")


@dataclass(frozen=True)
class MjcfJoint:
    """A joint of the file, with what Pinocchio's parser does not read."""

    name: str
    """In the model."""
    kind: str
    """``"hinge"``, ``"slide"``, ``"ball"`` or ``"free"``."""
    element: MjcfElement
    ref: float
    """Coordinate at the placements of the file, rad or m."""
    start: tuple[float, ...]
    """Coordinates in ``qpos0``, in MuJoCo's order."""

    def coordinate(self, value: float) -> float:
        """Return a number of the file in rad or m."""
        return self.element.file.angle(value) if self.kind == "hinge" else value


class MjcfTree:
    """The tree of a file, and the names of its frames.

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
        self._joint_names: dict[str, str] = {}
        self._taken = {"universe", WORLD}
        self._name_all()
        plain = etree.Element("mujoco", model=file.root.get("model", "mechanism"))
        etree.SubElement(plain, "compiler", angle="radian", inertiafromgeom="auto")
        world = etree.SubElement(etree.SubElement(plain, "worldbody"), "body", name=WORLD)
        for section in file.sections("worldbody"):
            self._read_contents(section.xml, world, pin.SE3.Identity())
        if not self.joints:
            raise MechanismError(f"{file.origin} has no joints, so it is not a mechanism")
        self.model = self._built(etree.tostring(plain))
        self._add_limits()
        for site in self._sites:
            self.add_frame(*site)
        self.model.gravity.linear = self._gravity()
        self._add_key_frames()

    def add_frame(self, name: str, frame: str, pose: pin.SE3) -> str:
        """Add a frame fixed in another; return its name, to which ``_`` is added if it is taken."""
        while self.model.existFrame(name):
            name += "_"
        parent = self.model.getFrameId(frame)
        base = self.model.frames[parent]
        kind = pin.FrameType.OP_FRAME
        self.model.addFrame(pin.Frame(name, base.parentJoint, parent, base.placement * pose, kind))
        return name

    # Names ----------------------------------------------------------------------------------------

    def _name_all(self) -> None:
        """Give every named element a name of its own: joints first, then bodies, then sites."""
        for tags, names in (
            (("joint", "freejoint"), self._joint_names),
            (("body",), self.body_frames),
            (("site",), self.site_frames),
        ):
            for section in self._file.sections("worldbody"):
                for element in map(self._file.plain, section.xml.iter(*tags)):
                    name = element.name
                    if name in names:
                        element.refuse("has a name that another one has")
                    if name:
                        free = name not in self._taken
                        names[name] = self._fresh(name if free else f"{name}_{tags[0]}")
        self.body_frames[WORLD] = WORLD

    def _fresh(self, name: str) -> str:
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    # The plain form -------------------------------------------------------------------------------

    def _read_contents(
        self, element: Any, plain: Any, pose: pin.SE3
    ) -> list[tuple[MjcfElement, pin.SE3]]:
        """Read the elements of a body (or of a ``frame`` in it); return its geoms, placed in it."""
        file = self._file
        geoms = []
        for child in children(element):
            tag = child.tag
            if tag in _OF_THE_BODY:  # read with it
                if element.tag == "frame":
                    file.plain(child).refuse("cannot be in a frame element")
            elif tag == "geom":
                geoms.append((file.read(child), pose))
            elif tag == "site":
                site = file.read(child)
                if site.name:
                    placed = pose * site.segment()[0]
                    self._sites.append((self.site_frames[site.name], plain.get("name"), placed))
            elif tag == "frame":
                geoms += self._read_contents(child, plain, pose * file.plain(child).pose())
            elif tag == "body":
                self._read_body(file.plain(child), plain, pose)
            elif tag not in _SEEN_ONLY:
                known = (*_OF_THE_BODY, "geom", "site", "frame", "body")
                file.plain(child).refuse(f"is not read; known here: {', '.join(known)}")
        return geoms

    def _read_body(self, body: MjcfElement, plain: Any, around: pin.SE3) -> None:
        if body.number("gravcomp"):
            body.refuse("has gravcomp, which is not read")
        if body.get("mocap", "false") != "false":
            body.refuse("is moved by motion capture, which is not read")
        frame = self.body_frames.get(body.name) or self._fresh(f"{plain.get('name')}_child")
        pose = around * body.pose()
        joints = [child for child in children(body.xml) if child.tag in ("joint", "freejoint")]
        for number, joint in enumerate(joints, 1):
            link = frame if number == len(joints) else self._fresh(f"{frame}_{number}")
            plain = etree.SubElement(plain, "body", name=link, **placement(pose))
            unnamed = f"{frame}_joint" + (f"_{number}" if joints[1:] else "")
            self._read_joint(joint, plain, unnamed, pose)
            pose = pin.SE3.Identity()
        if not joints:
            plain = etree.SubElement(plain, "body", name=frame, **placement(pose))
        add_inertia(body, plain, self._read_contents(body.xml, plain, pin.SE3.Identity()))

    def _read_joint(self, element: Any, plain: Any, unnamed: str, pose: pin.SE3) -> None:
        file = self._file
        free = element.tag == "freejoint"
        joint = file.plain(element) if free else file.read(element)
        kind = "free" if free else joint.choice("type", "hinge slide ball free", "hinge")
        if kind == "free":
            alone = len(element.getparent().xpath("joint | freejoint")) == 1
            if not (alone and plain.getparent().get("name") == WORLD):
                joint.refuse("is free: its body must be in the world and have no other joint")
            plain.attrib.update({"pos": "0 0 0", "quat": "1 0 0 0"})  # q is its placement
        name = self._joint_names[joint.name] if joint.name else self._fresh(unnamed)
        written = {"name": name, "type": kind, "armature": text([joint.number("armature")])}
        ref = 0.0
        if kind != "free":
            written["pos"] = text(joint.vector("pos", (0.0, 0.0, 0.0)))
        if kind in ("hinge", "slide"):
            axis = joint.vector("axis", (0.0, 0.0, 1.0))
            if not axis.any():
                joint.refuse("has an axis without direction")
            written["axis"] = text(axis / np.linalg.norm(axis))
            ref = joint.number("ref")
            ref = file.angle(ref) if kind == "hinge" else ref
            written["ref"] = text([ref])
        etree.SubElement(plain, "joint", **written)
        quaternion = pin.Quaternion(pose.rotation).coeffs()[[3, 0, 1, 2]]
        start = {"ball": (1.0, 0.0, 0.0, 0.0), "free": (*pose.translation, *quaternion)}
        self.joints.append(MjcfJoint(name, kind, joint, ref, start.get(kind, (ref,))))

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
        model = self.model
        for joint in self.joints:
            place = model.joints[model.getJointId(joint.name)]
            q, v = place.idx_q, place.idx_v
            if joint.kind == "free":  # Pinocchio's parser bounds positions by 1.01 m
                model.lowerPositionLimit[q : q + 3] = -math.inf
                model.upperPositionLimit[q : q + 3] = math.inf
            if place.nq > 1:
                continue
            if limits := self._limits(joint.element, "range", "limited"):
                low, high = map(joint.coordinate, limits)
                model.lowerPositionLimit[q], model.upperPositionLimit[q] = low, high
            if effort := self._limits(joint.element, "actuatorfrcrange", "actuatorfrclimited"):
                model.lowerEffortLimit[v], model.upperEffortLimit[v] = effort

    def _limits(self, joint: MjcfElement, name: str, flag: str) -> tuple[float, float] | None:
        """Return the limits that apply, or None."""
        limited = joint.choice(flag, "true false auto", "auto")
        given = joint.numbers(name).size
        if limited == "false" or (limited == "auto" and not given):
            return None
        if limited == "auto" and not self._file.autolimits:
            joint.refuse(f"has a {name}, but autolimits is off and {flag} is not given")
        lower, upper = joint.vector(name, (0.0, 0.0))
        if not lower < upper:
            joint.refuse(f"{name}: {lower:.6g} must be below {upper:.6g}")
        return float(lower), float(upper)

    def _gravity(self) -> Array:
        gravity, on = np.array([0.0, 0.0, -9.81]), True
        for option in self._file.sections("option"):
            gravity = option.vector("gravity", gravity)
            for name in ("density", "viscosity"):
                if option.number(name):
                    option.refuse(f"has a {name}: forces of a medium are not read")
            for flag in map(self._file.plain, option.xml.findall("flag")):
                for name in ("equality", "spring", "damper", "passive", "frictionloss", "limit"):
                    if flag.get(name) == "disable":
                        flag.refuse(f"{name} = 'disable' is not read")
                if "gravity" in flag:
                    on = flag.get("gravity") != "disable"
        return gravity if on else np.zeros(3)

    def _add_key_frames(self) -> None:
        configurations = self.model.referenceConfigurations
        start = np.concatenate([joint.start for joint in self.joints])
        configurations["qpos0"] = self.configuration(start)
        for section in self._file.sections("keyframe"):
            for key in map(self._file.plain, children(section.xml)):
                values = key.numbers("qpos")
                if not values.size:
                    continue
                if values.size != start.size:
                    key.refuse(f"has {values.size} numbers in qpos, not {start.size}")
                if key.name:
                    try:
                        configurations[key.name] = self.configuration(values)
                    except ZeroDivisionError:
                        key.refuse("has a quaternion of zeros")

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
