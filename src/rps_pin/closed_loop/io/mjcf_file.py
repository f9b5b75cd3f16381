"""A MuJoCo file (MJCF) as data: its elements with their defaults, numbers and poses.

What MuJoCo's compiler would do before it builds anything: default classes are applied, angles
become radians, and every way of giving an orientation becomes a rotation.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NoReturn

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.urdf import xml_root, xml_text
from rps_pin.errors import MechanismError

_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
#: Settings of the compiler that change masses or frames, and the value that leaves them alone.
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
    """The elements of an MJCF, and what they mean once its defaults and settings are applied.

    Parameters
    ----------
    path_or_xml
        The file's path, or its text (which begins with ``<``).

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If it is no MJCF, or uses what is not read here; with the line.
    """

    def __init__(self, path_or_xml: str | os.PathLike[str]) -> None:
        text, self.origin = xml_text(path_or_xml, "MJCF")
        self.root = xml_root(text, self.origin, "MJCF")
        if self.root.tag != "mujoco":
            raise MechanismError(
                f"{self.origin} is not a valid MJCF: its root element is <{self.root.tag}>, "
                "not <mujoco>"
            )
        for element in self.root.iter("include"):
            self.refuse(element, "is not read; put the included elements into the file itself")
        self._read_compiler()
        self._classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for element in self.section("default"):
            self._read_default(element, "main", {})

    # Elements -------------------------------------------------------------------------------------

    def section(self, tag: str) -> Iterator[Any]:
        """Yield the top elements of a tag; MuJoCo lets a section be split over several."""
        yield from self.root.findall(tag)

    def entries(self, tag: str) -> Iterator[Any]:
        """Yield the elements directly in all sections of a tag, without comments."""
        for section in self.section(tag):
            yield from children(section)

    def refuse(self, element: Any, why: str) -> NoReturn:
        """Raise a `MechanismError` that names an element and its line."""
        name = element.get("name")
        called = f"{element.tag} {name!r}" if name else f"{element.tag}"
        raise MechanismError(f"{self.origin}, line {element.sourceline}: {called} {why}")

    def attributes(self, element: Any, inherited: str = "main", tag: str = "") -> dict[str, str]:
        """Return an element's attributes and, for those it leaves out, its default class's.

        Parameters
        ----------
        element
            The element.
        inherited
            The class that applies if the element names none.
        tag
            The tag under which default classes hold it; its own if left out.
        """
        wanted = element.get("class", inherited)
        if wanted not in self._classes:
            self.refuse(
                element, f"is of class {wanted!r}; there are: {', '.join(sorted(self._classes))}"
            )
        return _over(self._classes[wanted].get(tag or str(element.tag), {}), element.attrib)

    # Values ---------------------------------------------------------------------------------------

    def numbers(self, element: Any, attributes: Mapping[str, str], name: str) -> Array | None:
        """Return an attribute's numbers, or None if it is not given."""
        text = attributes.get(name)
        if text is None:
            return None
        try:
            values = np.array([float(part) for part in text.split()])
        except ValueError:
            values = np.empty(0)
        if not values.size or not np.isfinite(values).all():
            self.refuse(element, f"{name} = {text!r} must be finite numbers")
        return values

    def vector(
        self,
        element: Any,
        attributes: Mapping[str, str],
        name: str,
        default: tuple[float, ...],
        partial: bool = False,
    ) -> Array:
        """Return as many numbers as `default` has; `partial`: it fills in what is missing."""
        values = self.numbers(element, attributes, name)
        if values is None:
            return np.array(default)
        if partial and values.size <= len(default):
            return np.concatenate([values, default[values.size :]])
        if values.size != len(default):
            self.refuse(element, f"{name} = {attributes[name]!r} must be {len(default)} numbers")
        return values

    def number(
        self, element: Any, attributes: Mapping[str, str], name: str, default: float = 0.0
    ) -> float:
        """Return an attribute of one number."""
        return float(self.vector(element, attributes, name, (default,))[0])

    def choice(
        self, element: Any, attributes: Mapping[str, str], name: str, values: str, default: str
    ) -> str:
        """Return an attribute that is one of a few words (given with spaces between)."""
        value = attributes.get(name, default)
        if value not in values.split():
            self.refuse(element, f"{name} = {value!r}; it can be: {', '.join(values.split())}")
        return value

    def angle(self, value: float) -> float:
        """Return an angle of the file in radians."""
        return math.radians(value) if self.degrees else value

    def pose(self, element: Any, attributes: Mapping[str, str]) -> pin.SE3:
        """Return an element's place in the one around it, from its ``pos`` and orientation."""
        position = self.vector(element, attributes, "pos", (0.0, 0.0, 0.0))
        return pin.SE3(self.rotation(element, attributes), position)

    def rotation(self, element: Any, attributes: Mapping[str, str]) -> Array:
        """Return an element's orientation, shape (3, 3)."""
        given = [name for name in _ORIENTATIONS if name in attributes]
        if not given:
            return np.eye(3)
        if len(given) > 1:
            self.refuse(element, f"has more than one orientation: {', '.join(given)}")
        name = given[0]
        sizes = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
        values = self.vector(element, attributes, name, (0.0,) * sizes[name])
        if name == "euler":
            return self._from_euler(values)
        lengths = [np.linalg.norm(values[:3] if name != "quat" else values)]
        if name == "xyaxes":
            lengths.append(np.linalg.norm(np.cross(values[:3], values[3:])))
        if min(lengths) < _SMALLEST_NORM:
            self.refuse(element, f"{name} = {attributes[name]!r} has no direction")
        if name == "quat":
            return rotation_of_quaternion(values)
        if name == "axisangle":
            axis = values[:3] / lengths[0]
            return np.asarray(pin.exp3(axis * self.angle(values[3])))
        if name == "zaxis":
            return rotation_of_z(values)
        x = values[:3] / lengths[0]
        y = values[3:] - x * (x @ values[3:])
        y /= np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    def _from_euler(self, angles: Array) -> Array:
        """Turn about axes in order: about moving ones (lower case) or fixed ones (upper case)."""
        result = np.eye(3)
        for letter, angle in zip(self.eulerseq, angles, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            turn = pin.exp3(axis * self.angle(angle))
            result = result @ turn if letter.islower() else turn @ result
        return np.asarray(result)

    # Settings -------------------------------------------------------------------------------------

    def _read_compiler(self) -> None:
        """Merge the compiler elements; the last one to say something is heard."""
        settings: dict[str, str] = {}
        for element in self.section("compiler"):
            settings |= element.attrib
            for name, harmless in _UNREAD_SETTINGS.items():
                if element.get(name, harmless[0]) not in harmless:
                    self.refuse(element, f"{name} = {element.get(name)!r} is not read")
            self.choice(element, settings, "angle", "degree radian", "degree")
            self.choice(element, settings, "autolimits", "true false", "true")
            self.choice(element, settings, "inertiafromgeom", "true false auto", "auto")
            sequence = settings.get("eulerseq", "xyz")
            if len(sequence) != 3 or set(sequence) - set("xyzXYZ"):
                self.refuse(element, f"eulerseq = {sequence!r} must be three letters of xyzXYZ")
            self.vector(element, settings, "inertiagrouprange", (0.0, 5.0))
        self.degrees = settings.get("angle", "degree") == "degree"
        self.eulerseq = settings.get("eulerseq", "xyz")
        self.autolimits = settings.get("autolimits", "true") == "true"
        self.inertia_from_geom = settings.get("inertiafromgeom", "auto")
        first, last = (float(part) for part in settings.get("inertiagrouprange", "0 5").split())
        self.inertia_groups = (first, last)

    def _read_default(self, element: Any, name: str, above: dict[str, dict[str, str]]) -> None:
        """Store a default class and those in it; each begins with what is above it."""
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
                    self.refuse(entry, "inside another needs a class")
                self._read_default(entry, entry.get("class"), own)


def children(element: Any) -> Iterator[Any]:
    """Yield the elements in an element, without comments."""
    return (child for child in element if isinstance(child.tag, str))


def text(values: Iterable[float]) -> str:
    """Return numbers as a file holds them, without loss."""
    return " ".join(repr(float(value)) for value in values)


def quaternion_text(rotation: Array) -> str:
    """Return a rotation as MuJoCo's quaternion (w, x, y, z)."""
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return text((w, x, y, z))


def rotation_of_quaternion(values: Array) -> Array:
    """Return the rotation of MuJoCo's quaternion (w, x, y, z), of any length; shape (3, 3)."""
    w, x, y, z = values / np.linalg.norm(values)
    return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())


def rotation_of_z(direction: Array) -> Array:
    """Return the least rotation that takes z to a direction; half a turn about x for -z."""
    x, y, z = direction / np.linalg.norm(direction)
    across = math.hypot(x, y)
    axis = np.array([-y, x, 0.0]) / across if across > _SMALLEST_NORM else np.array([1.0, 0, 0])
    return np.asarray(pin.exp3(axis * math.atan2(across, z)))


def _over(below: Mapping[str, str], above: Mapping[str, str]) -> dict[str, str]:
    """Return attributes with others laid over them, as MuJoCo does.

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
