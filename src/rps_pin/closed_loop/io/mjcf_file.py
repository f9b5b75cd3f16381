"""MuJoCo files (MJCF) as data: elements with the attributes of their default classes.

As in MuJoCo's compiler, default classes are applied, angles become radians, and every form of an
orientation becomes a rotation.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.xml_file import xml_root, xml_text
from rps_pin.errors import MechanismError

#: How many numbers each form of an orientation has.
_ORIENTATIONS = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
#: Settings of the compiler that change masses or frames, and their values that change nothing.
_UNREAD_SETTINGS = {
    "settotalmass": ("-1", "0"),
    "balanceinertia": ("false",),
    "boundmass": ("0",),
    "boundinertia": ("0",),
    "alignfree": ("false",),
    "coordinate": ("local",),
}
_SMALLEST_NORM = 1e-12


class MjcfFile:
    """The elements of an MJCF with its defaults and settings applied.

    Parameters
    ----------
    path_or_xml
        The file's path, or its text (which begins with ``<``).

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If it is not an MJCF, or has elements that are not read here; with the line.
    """

    def __init__(self, path_or_xml: str | os.PathLike[str]) -> None:
        text, self.origin = xml_text(path_or_xml, "MJCF")
        self.root = xml_root(text, self.origin, "MJCF")
        if self.root.tag != "mujoco":
            raise MechanismError(
                f"{self.origin} is not a valid MJCF: its root element is <{self.root.tag}>, "
                "not <mujoco>"
            )
        for element in map(self.plain, self.root.iter("include")):
            element.refuse("is not read; put the included elements into the file itself")
        self._read_compiler()
        self._classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for section in self.sections("default"):
            self._read_default(section.xml, "main", {})

    # Elements -------------------------------------------------------------------------------------

    def sections(self, tag: str) -> Iterator[MjcfElement]:
        """Yield the top elements of a tag; MuJoCo merges those of one tag."""
        return map(self.plain, self.root.findall(tag))

    def entries(self, tag: str) -> Iterator[MjcfElement]:
        """Yield the elements directly in all sections of a tag, with the defaults of that tag."""
        for section in self.sections(tag):
            for element in children(section.xml):
                yield self.read(element, tag=tag)

    def plain(self, element: Any) -> MjcfElement:
        """Return an element without defaults."""
        return MjcfElement(self, element, dict(element.attrib))

    def read(self, element: Any, tag: str = "") -> MjcfElement:
        """Return an element with the attributes of its default class.

        Parameters
        ----------
        element
            The element.
        tag
            The tag that default classes have for it; its own if left out.
        """
        around = element.xpath("string(ancestor::*[@childclass][1]/@childclass)")
        wanted = element.get("class", around or "main")
        if wanted not in self._classes:
            self.plain(element).refuse(
                f"is of class {wanted!r}; there are: {', '.join(sorted(self._classes))}"
            )
        below = self._classes[wanted].get(tag or str(element.tag), {})
        return MjcfElement(self, element, _over(below, element.attrib))

    def angle(self, value: float) -> float:
        """Return an angle of the file in radians."""
        return math.radians(value) if self.degrees else value

    # Settings -------------------------------------------------------------------------------------

    def _read_compiler(self) -> None:
        """Merge the compiler elements; later ones replace the settings of earlier ones."""
        settings = MjcfElement(self, self.root, {})
        for section in (settings, *self.sections("compiler")):
            for name, harmless in _UNREAD_SETTINGS.items():
                if section.get(name, harmless[0]) not in harmless:
                    section.refuse(f"{name} = {section.get(name)!r} is not read")
            settings = MjcfElement(self, section.xml, {**settings.attributes, **section.attributes})
            self.degrees = settings.choice("angle", "degree radian", "degree") == "degree"
            self.autolimits = settings.choice("autolimits", "true false", "true") == "true"
            self.inertia_from_geom = settings.choice("inertiafromgeom", "true false auto", "auto")
            self.eulerseq = settings.get("eulerseq", "xyz")
            if len(self.eulerseq) != 3 or set(self.eulerseq) - set("xyzXYZ"):
                section.refuse(f"eulerseq = {self.eulerseq!r} must be three letters of xyzXYZ")
            self.inertia_groups = tuple(settings.vector("inertiagrouprange", (0.0, 5.0)))

    def _read_default(self, element: Any, name: str, above: dict[str, dict[str, str]]) -> None:
        """Store a default class and the classes in it, which inherit its attributes."""
        name = element.get("class", name)
        own = {tag: dict(values) for tag, values in above.items()}
        own |= {tag: values for tag, values in self._classes.get(name, {}).items() if not above}
        for entry in children(element):
            if entry.tag != "default":
                own[entry.tag] = _over(own.get(entry.tag, {}), entry.attrib)
        self._classes[name] = own
        for entry in children(element):
            if entry.tag == "default":
                if "class" not in entry.attrib:
                    self.plain(entry).refuse("inside another needs a class")
                self._read_default(entry, entry.get("class"), own)


@dataclass(frozen=True)
class MjcfElement:
    """An element of an MJCF.

    Attributes
    ----------
    file : MjcfFile
    xml : lxml element
    attributes : dict of str to str
        Its own and those of its default class.
    """

    file: MjcfFile
    xml: Any
    attributes: Mapping[str, str]

    @property
    def tag(self) -> str:
        """Its tag."""
        return str(self.xml.tag)

    @property
    def name(self) -> str:
        """Its name; empty if it has none."""
        return str(self.xml.get("name", ""))

    def __contains__(self, attribute: str) -> bool:
        return attribute in self.attributes

    def get(self, attribute: str, default: str = "") -> str:
        """Return an attribute's text."""
        return self.attributes.get(attribute, default)

    def refuse(self, why: str) -> NoReturn:
        """Raise a `MechanismError` that names the element and its line."""
        called = f"{self.tag} {self.name!r}" if self.name else self.tag
        raise MechanismError(f"{self.file.origin}, line {self.xml.sourceline}: {called} {why}")

    def numbers(self, name: str) -> Array:
        """Return an attribute's numbers: none if it is not given, else one or more."""
        if name not in self:
            return np.empty(0)
        try:
            values = np.array([float(part) for part in self.get(name).split()])
        except ValueError:
            values = np.empty(0)
        if not values.size or not np.isfinite(values).all():
            self.refuse(f"{name} = {self.get(name)!r} must be finite numbers")
        return values

    def vector(self, name: str, default: Iterable[float], partial: bool = False) -> Array:
        """Return as many numbers as `default` has; `partial`: it replaces missing ones."""
        values, default = self.numbers(name), np.array(list(default), dtype=np.float64)
        if not values.size:
            return default
        if partial and values.size <= default.size:
            return np.concatenate([values, default[values.size :]])
        if values.size != default.size:
            self.refuse(f"{name} = {self.get(name)!r} must be {default.size} numbers")
        return values

    def number(self, name: str, default: float = 0.0) -> float:
        """Return an attribute of one number."""
        return float(self.vector(name, (default,))[0])

    def choice(self, name: str, values: str, default: str) -> str:
        """Return an attribute that is one of a few words (given with spaces between)."""
        value = self.get(name, default)
        if value not in values.split():
            self.refuse(f"{name} = {value!r}; it can be: {', '.join(values.split())}")
        return value

    def pose(self) -> pin.SE3:
        """Return its placement in its parent, from its ``pos`` and orientation."""
        return pin.SE3(self.rotation(), self.vector("pos", (0.0, 0.0, 0.0)))

    def rotation(self) -> Array:
        """Return its orientation, shape (3, 3)."""
        name, *more = [name for name in _ORIENTATIONS if name in self] or [""]
        if not name:
            return np.eye(3)
        if more:
            self.refuse(f"has more than one orientation: {', '.join([name, *more])}")
        values = self.vector(name, (0.0,) * _ORIENTATIONS[name])
        if name == "euler":
            return self._from_euler(values)
        length = np.linalg.norm(values[:3] if name != "quat" else values)
        across = np.linalg.norm(np.cross(values[:3], values[3:])) if name == "xyaxes" else length
        if min(length, across) < _SMALLEST_NORM:
            self.refuse(f"{name} = {self.get(name)!r} has no direction")
        if name == "quat":
            return rotation_of_quaternion(values)
        if name == "axisangle":
            return np.asarray(pin.exp3(values[:3] / length * self.file.angle(values[3])))
        if name == "zaxis":
            return rotation_of_z(values)
        x = values[:3] / length
        y = values[3:] - x * (x @ values[3:])
        y /= np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    def _from_euler(self, angles: Array) -> Array:
        """Return the rotation about axes in order: moving ones (lower case) or fixed ones."""
        result = np.eye(3)
        for letter, angle in zip(self.file.eulerseq, angles, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            turn = pin.exp3(axis * self.file.angle(angle))
            result = result @ turn if letter.islower() else turn @ result
        return np.asarray(result)

    def segment(self) -> tuple[pin.SE3, float | None]:
        """Return the pose of a geom or site, and half its length if ``fromto`` gives it."""
        if "fromto" not in self:
            return self.pose(), None
        ends = self.vector("fromto", (0.0,) * 6)
        along = ends[:3] - ends[3:]
        length = float(np.linalg.norm(along))
        if length == 0:
            self.refuse("has two ends in one place")
        return pin.SE3(rotation_of_z(along), (ends[:3] + ends[3:]) / 2), length / 2


def children(element: Any) -> Iterator[Any]:
    """Yield the elements in an element, without comments."""
    return (child for child in element if isinstance(child.tag, str))


def text(values: Iterable[float]) -> str:
    """Return numbers for an attribute, with all their digits."""
    return " ".join(repr(float(value)) for value in values)


def placement(pose: pin.SE3) -> dict[str, str]:
    """Return a placement as the attributes ``pos`` and ``quat`` (w, x, y, z)."""
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    return {"pos": text(pose.translation), "quat": text((w, x, y, z))}


def rotation_of_quaternion(values: Array) -> Array:
    """Return the rotation of MuJoCo's quaternion (w, x, y, z), of any length; shape (3, 3)."""
    w, x, y, z = values / np.linalg.norm(values)
    return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())


def rotation_of_z(direction: Array) -> Array:
    """Return the smallest rotation from z to a direction; half a turn about x for -z."""
    x, y, z = direction / np.linalg.norm(direction)
    across = math.hypot(x, y)
    axis = np.array([-y, x, 0.0]) / across if across > _SMALLEST_NORM else np.array([1.0, 0, 0])
    return np.asarray(pin.exp3(axis * math.atan2(across, z)))


def _over(below: Mapping[str, str], above: Mapping[str, str]) -> dict[str, str]:
    """Return attributes `below` replaced by those `above`, as MuJoCo does.

    An orientation replaces one of another kind, and a shorter ``size`` only the first numbers.
    """
    result = dict(below)
    if any(name in above for name in _ORIENTATIONS):
        result = {name: value for name, value in result.items() if name not in _ORIENTATIONS}
    result |= above
    if "size" in below and "size" in above:
        old, new = below["size"].split(), above["size"].split()
        result["size"] = " ".join(new + old[len(new) :])
    return result
