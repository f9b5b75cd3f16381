"""Links, joints and frames of a URDF file, read and checked, each with its line."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, NoReturn

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.urdf import vocabulary
from rps_pin.closed_loop.io.urdf.vocabulary import child, children, get, tag_of
from rps_pin.errors import few
from rps_pin.validation import LARGEST

#: Joint types by the element that may have them.
JOINT_TYPES = {
    "joint": ("revolute", "continuous", "prismatic", "fixed", "floating", "planar"),
    "drake:joint": ("ball", "planar", "screw", "universal"),
}
#: Joints of one coordinate.
SIMPLE = ("revolute", "continuous", "prismatic", "screw")
_WITH_AXIS = (*SIMPLE, "planar")
#: How many velocities a joint has.
VELOCITIES = dict.fromkeys(SIMPLE, 1) | {
    "fixed": 0,
    "universal": 2,
    "planar": 3,
    "ball": 3,
    "floating": 6,
}
#: Attributes of an ``inertia`` element.
INERTIAS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
#: Axes below this are zero.
_SHORTEST_AXIS = 1e-8
#: A quaternion's length may differ from 1 by this.
_UNIT = 1e-3


@dataclass(frozen=True)
class Mimic:
    """A joint's coordinate as a multiple of another's, plus an offset."""

    element: Any
    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Inertial:
    """What a link's ``inertial`` says.

    Attributes
    ----------
    origin
        Its element, or None.
    mass
        kg.
    tensor
        Numbers of the words `INERTIAS`, kg m^2.
    """

    origin: Any | None
    mass: float
    tensor: tuple[float, ...]


@dataclass(frozen=True)
class UrdfJoint:
    """A joint; effort, velocity and position limits are infinite where there are none.

    Attributes
    ----------
    axis
        Of unit length, shape (3,).
    damping, friction
        One number, or three for Drake's planar joint.
    pitch
        Of a screw, m per revolution.
    """

    element: Any
    name: str
    kind: str
    parent: str
    child: str
    axis: Array
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: tuple[float, ...]
    friction: float
    mimic: Mimic | None
    pitch: float


@dataclass(frozen=True)
class OffsetFrame:
    """A frame on a link, which the file names (Drake, Isaac Sim) or a loop needs."""

    name: str
    link: str
    placement: pin.SE3


@dataclass
class UrdfFile:
    """A URDF's contents.

    Attributes
    ----------
    origin
        The file's name in messages.
    robot
        Its root element.
    links
        Their elements, by name.
    inertials
        Of the links that have one, by name; `inertials` fills it.
    joints
        By name, in the file's order.
    frames
        On links.
    notes
        Sentences on what the reader has decided.
    remarks
        Names and lines of what one such sentence is about, by the sentence.
    """

    origin: str
    robot: Any
    links: dict[str, Any] = field(default_factory=dict)
    inertials: dict[str, Inertial] = field(default_factory=dict)
    joints: dict[str, UrdfJoint] = field(default_factory=dict)
    frames: list[OffsetFrame] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    remarks: dict[str, list[tuple[str, int]]] = field(default_factory=dict)

    def refuse(self, element: Any, why: str) -> NoReturn:
        """Raise `MechanismError` with the file's name and an element's line."""
        vocabulary.refuse(element, self.origin, why)

    def note(self, element: Any, words: str) -> None:
        """Add a note, with an element's line."""
        self.notes.append(f"{self.origin}, line {element.sourceline}: {words}")

    def remark(self, element: Any, name: str, words: str) -> None:
        """Add a name, with an element's line, to those that a sentence is about."""
        self.remarks.setdefault(words, []).append((name, element.sourceline))

    def all_notes(self) -> tuple[str, ...]:
        """Return the notes, those of one sentence in one."""
        gathered = (
            f"{self.origin}: {words}: {few([f'{name!r} (line {line})' for name, line in names])}"
            for words, names in self.remarks.items()
        )
        return (*self.notes, *gathered)

    # Values -------------------------------------------------------------------------------------

    def name_of(self, element: Any, attribute: str = "name") -> str:
        """Return an attribute that must be there."""
        value = get(element, attribute)
        if not value:
            self.refuse(element, f"<{tag_of(element)}> has no {attribute}")
        return str(value)

    def numbers(
        self,
        element: Any,
        attribute: str,
        count: int,
        default: Sequence[float] | None = None,
        largest: float = LARGEST,
    ) -> list[float]:
        """Return an attribute's numbers; the default, or a refusal, where it is not there."""
        text = get(element, attribute)
        if text is None:
            if default is None:
                self.refuse(element, f"<{tag_of(element)}> has no {attribute}")
            return list(default)
        parts = text.split() if text.isascii() else [text]
        if len(parts) != count or not all(_NUMBER.fullmatch(part) for part in parts):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            self.refuse(element, f"{tag_of(element)} {attribute} = {text!r} must be {wanted}")
        values = [float(part) for part in parts]
        if not all(abs(value) <= largest for value in values):
            why = f"is beyond {largest:g}" if all(map(math.isfinite, values)) else "is not finite"
            self.refuse(element, f"{tag_of(element)} {attribute} = {text!r} {why}")
        return values

    def number(self, element: Any, attribute: str, default: float | None = None) -> float:
        """Return an attribute's number."""
        return self.numbers(element, attribute, 1, None if default is None else [default])[0]

    def limit(self, element: Any, attribute: str, default: float) -> float:
        """Return a limit, which may be infinite; so is the largest number there is."""
        text = get(element, attribute)
        if text is not None and _INFINITE.fullmatch(text.strip()):
            return -math.inf if text.strip().startswith("-") else math.inf
        (value,) = self.numbers(element, attribute, 1, [default], sys.float_info.max)
        return math.copysign(math.inf, value) if abs(value) >= sys.float_info.max else value

    def placement(self, element: Any | None) -> pin.SE3:
        """Return the placement in the attributes xyz and rpy or quat_xyzw (or none)."""
        if element is None:
            return pin.SE3.Identity()
        xyz = np.array(self.numbers(element, "xyz", 3, (0, 0, 0)))
        rpy = self.numbers(element, "rpy", 3, (0, 0, 0))
        if get(element, "quat_xyzw") is None:
            return pin.SE3(pin.rpy.rpyToMatrix(np.array(rpy)), xyz)
        if get(element, "rpy") is not None:
            self.refuse(element, "an origin has rpy or quat_xyzw, not both")
        quaternion = pin.Quaternion(np.array(self.numbers(element, "quat_xyzw", 4)))
        if abs(quaternion.norm() - 1.0) > _UNIT:
            text = get(element, "quat_xyzw")
            self.refuse(element, f"quat_xyzw = {text!r} is not of length 1")
        return pin.SE3(quaternion.normalized().matrix(), xyz)

    def axis(self, element: Any | None, default: Sequence[float] = (1, 0, 0)) -> Array:
        """Return the direction in an element's xyz, of length 1."""
        if element is None:
            return np.array(default, dtype=np.float64)
        axis = np.array(self.numbers(element, "xyz", 3, default))
        length = float(np.linalg.norm(axis))
        if length < _SHORTEST_AXIS:
            self.refuse(element, f"{tag_of(element)} xyz = {get(element, 'xyz')!r} is no direction")
        return axis / length

    def known(self, element: Any, attribute: str, known: Sequence[str], what: str) -> str:
        """Return a name that must be one of those known."""
        name = get(element, attribute)
        if name not in known:
            self.refuse(element, unknown(what, attribute, name, known))
        return str(name)


def read_elements(robot: Any, origin: str) -> UrdfFile:
    """Return the links, joints and frames of a file, checked one by one.

    Raises
    ------
    MechanismError
        If a word is misspelt, a value missing or not possible, or a name taken; with the line.
    """
    file = UrdfFile(origin, robot)
    file.notes += vocabulary.check_words(robot, origin)
    for element in children(robot, "link"):
        _add(file, file.links, element, element)
    tags = [tag_of(element) for element in robot.iterchildren("*")]
    if not file.links:
        file.refuse(robot, "<robot> has no link")
    _declare_world(file)
    if "universe" in file.links:
        file.refuse(file.links["universe"], "a link cannot be called 'universe', the world's name")
    elements = [one for one in robot.iterchildren("*") if tag_of(one) in JOINT_TYPES]
    for element in elements:
        _add(file, file.joints, element, _joint(file, element))
    for tag, add in (("frame", _frame), ("fixed_frame", _fixed_frame)):
        for element in children(robot, tag) if tag in tags else ():
            file.frames.append(add(file, element))
    return file


def _add(file: UrdfFile, where: dict[str, Any], element: Any, value: Any) -> None:
    name, tag = file.name_of(element), tag_of(element)
    if name in where:
        first = where[name].element if isinstance(where[name], UrdfJoint) else where[name]
        file.refuse(
            element,
            f"there are two {tag}s called {name!r}: the other is in line {first.sourceline}",
        )
    if get(element, "drake_ignore") == "true":
        file.note(element, f"drake_ignore leaves the {tag} {name!r} out in Drake only, not here")
    where[name] = value


def _declare_world(file: UrdfFile) -> None:
    """Add the link ``world`` where joints name it as their parent, as Drake does."""
    parents = [child(one, "parent") for tag in JOINT_TYPES for one in children(file.robot, tag)]
    named = [one for one in parents if one is not None and get(one, "link") == "world"]
    if named and "world" not in file.links:
        file.links["world"] = etree.SubElement(file.robot, "link", name="world")
        file.note(named[0], "the link 'world' is not in the file; it is the world, as in Drake")


def _joint(file: UrdfFile, element: Any) -> UrdfJoint:
    name, tag = file.name_of(element), tag_of(element)
    what = f"joint {name!r}"
    if name == "universe":
        file.refuse(element, "a joint cannot be called 'universe', the world's name")
    kind = file.known(element, "type", JOINT_TYPES[tag], what)
    ends = []
    for side in ("parent", "child"):
        end = child(element, side)
        link = None if end is None else get(end, "link")
        if link not in file.links:
            file.refuse(
                element if end is None else end,
                unknown(f"{what}: {side}", "link", link, list(file.links)),
            )
        ends.append(link)
    file.placement(child(element, "origin"))
    limit = child(element, "limit")
    lower, upper = _position_limits(file, element, name, kind, limit)
    dynamics = child(element, "dynamics")
    planar = tag == "drake:joint" and kind == "planar"
    return UrdfJoint(
        element=element,
        name=name,
        kind=kind,
        parent=ends[0],
        child=ends[1],
        axis=file.axis(child(element, "axis") if kind in _WITH_AXIS else None),
        lower=lower,
        upper=upper,
        effort=_largest(file, name, None if kind == "fixed" else limit, "effort"),
        velocity=_largest(file, name, None if kind == "fixed" else limit, "velocity"),
        damping=_damping(file, dynamics, planar),
        friction=_not_negative(file, dynamics, "friction", 0.0, file.number),
        mimic=_mimic(file, child(element, "mimic")),
        pitch=_pitch(file, element) if kind == "screw" else 0.0,
    )


def _position_limits(
    file: UrdfFile, element: Any, name: str, kind: str, limit: Any
) -> tuple[float, float]:
    """Return lower and upper; infinite where the file gives neither, or 0 and 0, as in MuJoCo."""
    unbounded = (-math.inf, math.inf)
    if kind not in ("revolute", "prismatic", "screw"):
        return unbounded
    given = [name for name in ("lower", "upper") if limit is not None and get(limit, name)]
    if not given:
        file.remark(element, name, "joints without lower and upper, which have no position limits")
        return unbounded
    lower, upper = file.limit(limit, "lower", 0.0), file.limit(limit, "upper", 0.0)
    if len(given) == 1:
        missing = "upper" if given == ["lower"] else "lower"
        file.remark(limit, name, f"joints without {missing}, which is 0 by URDF's rule")
    if lower > upper:
        file.refuse(limit, f"joint {name!r}: lower = {lower:.6g} is above upper = {upper:.6g}")
    if lower == upper == 0:
        file.remark(limit, name, "joints whose lower and upper are 0, taken as no position limits")
        return unbounded
    if lower == upper:
        file.remark(limit, name, "joints that are held, as their lower and upper are equal")
    return lower, upper


def _largest(file: UrdfFile, name: str, limit: Any, attribute: str) -> float:
    """Return the limit of effort or velocity; exporters write 0 for none."""
    value = _not_negative(file, limit, attribute, math.inf, file.limit)
    if value == 0:
        file.remark(limit, name, f"joints with {attribute} 0, taken as no limit of {attribute}")
        return math.inf
    return value


def _not_negative(
    file: UrdfFile,
    element: Any,
    attribute: str,
    default: float,
    read: Callable[[Any, str, float], float],
) -> float:
    if element is None:
        return default
    value = read(element, attribute, default)
    if value < 0:
        file.refuse(element, f"{tag_of(element)} {attribute} = {value:.6g} is negative")
    return value


def _damping(file: UrdfFile, dynamics: Any, planar: bool) -> tuple[float, ...]:
    if dynamics is None:
        return (0.0,)
    several = planar and len((get(dynamics, "damping") or "").split()) == 3
    values = file.numbers(dynamics, "damping", 3 if several else 1, [0.0])
    if min(values) < 0:
        file.refuse(dynamics, f"dynamics damping = {get(dynamics, 'damping')} is negative")
    return tuple(values)


def _mimic(file: UrdfFile, element: Any) -> Mimic | None:
    if element is None:
        return None
    multiplier, offset = file.number(element, "multiplier", 1.0), file.number(element, "offset", 0)
    return Mimic(element, file.name_of(element, "joint"), multiplier, offset)


def _pitch(file: UrdfFile, element: Any) -> float:
    """Return a screw's pitch, in the joint (as Drake reads) or its actuator (as its page says)."""
    word, actuator = "drake:screw_thread_pitch", child(element, "actuator")
    pitch = child(element, word)
    if pitch is None and actuator is not None:
        pitch = child(actuator, word)
    if pitch is None:
        file.refuse(element, f"the screw joint {get(element, 'name')!r} has no {word}")
    value = file.number(pitch, "value")
    if value == 0:
        file.refuse(pitch, "a screw's pitch cannot be 0")
    return value


def _frame(file: UrdfFile, element: Any) -> OffsetFrame:
    what = f"frame {file.name_of(element)!r}"
    link = file.known(element, "link", list(file.links), what)
    return OffsetFrame(file.name_of(element), link, file.placement(element))


def _fixed_frame(file: UrdfFile, element: Any) -> OffsetFrame:
    what, parent = f"frame {file.name_of(element)!r}", child(element, "parent")
    if parent is None:
        file.refuse(element, f"{what} has no parent")
    link = file.known(parent, "link", list(file.links), what)
    return OffsetFrame(file.name_of(element), link, file.placement(child(element, "origin")))


def unknown(owner: str, what: str, given: object, known: Sequence[str]) -> str:
    """Return what to say of an unknown name."""
    near = get_close_matches(str(given), known, n=1)
    meant = f"did you mean {near[0]!r}?" if near else f"there are: {few(known)}"
    return f"{owner}: no {what} {given!r}; {meant}"
