"""An MJCF as MuJoCo compiles it, and the places in its files that messages name.

MuJoCo reads the file: included files, defaults, frames, replicates, attached models, meshes and
masses are its business. What is read here is its compiled model, in which each kind of element is
numbered. Lines are MuJoCo's too, but for elements of included files, which have none there: these
are looked up in the text of the files.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from lxml import etree

from rps_pin.closed_loop.io.xml_file import xml_text
from rps_pin.errors import MechanismError, RPSPinError

#: Elements by MuJoCo's lists of them; None where an element of any tag is meant.
_TAGS: dict[str, tuple[str, ...] | None] = {
    "bodies": ("body",),
    "joints": ("joint", "freejoint"),
    "tendons": ("fixed", "spatial"),
    "equalities": None,
    "actuators": None,
}
_SECTIONS = {"equalities": "equality", "actuators": "actuator"}


class _Place(NamedTuple):
    """An element of one of the files."""

    file: str
    line: int
    xml: Any


class _File(NamedTuple):
    """A file that another one includes or attaches."""

    name: str
    """As it is written there."""
    path: str
    text: str


class MjcfSource:
    """A file, compiled.

    Parameters
    ----------
    path_or_xml
        The file's path, or its text (which begins with ``<``).

    Attributes
    ----------
    mujoco
        The package.
    model : mujoco.MjModel
        What MuJoCo's compiler makes of the file.
    origin : str
        The file's name, for messages.
    told : dict of str to list of str
        What the caller should know of the file, and the places in it: what is in it and is not
        part of the mechanism.

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If MuJoCo refuses it; with MuJoCo's reason.
    """

    def __init__(self, path_or_xml: str | os.PathLike[str]) -> None:
        self._text, self.origin = xml_text(path_or_xml, "MJCF")
        self._path = None if self.origin == "the MJCF text" else Path(self.origin)
        root = _root(self._text)
        if root is None or root.getroottree().docinfo.doctype:
            fault = "is not XML" if root is None else "declares a document type: refused"
            raise MechanismError(f"{self.origin} is not a valid MJCF: it {fault}")
        if root.tag != "mujoco":
            raise MechanismError(
                f"{self.origin} is not a valid MJCF: its root element is <{root.tag}>, not <mujoco>"
            )
        self.mujoco = _mujoco()
        self.told: dict[str, list[str]] = {}
        self._spec, self.model = self._compiled()
        self.name = str(root.get("model", ""))

    def _compiled(self) -> tuple[Any, Any]:
        """Return MuJoCo's specification and model; its warnings, some in its log, are told."""
        mujoco = self.mujoco
        logged: list[str] = []
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(logged.append)
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                spec = self._parsed()
                model = spec.compile()
        except ValueError as error:
            why = " ".join(str(error).split())
            raise MechanismError(f"{self.origin} is not a valid MJCF: {why}") from None
        finally:
            mujoco.set_mju_user_warning(before)
        found = [*logged, *(str(one.message) for one in caught)]
        for words in found:
            self.told[f"MuJoCo warns: {' '.join(words.split())}"] = [self.origin]
        return spec, model

    def _parsed(self) -> Any:
        """Return MuJoCo's specification; it reads files only whose names end in .xml by itself."""
        spec = self.mujoco.MjSpec
        if self._path is not None and self._path.suffix == ".xml":
            return spec.from_file(str(self._path))
        if self._path is None:
            return spec.from_string(self._text)
        parts = {one.name: one.text.encode() for one in self._parts()}
        found = spec.from_string(self._text, include=parts)
        found.modelfiledir = str(self._path.absolute().parent)
        return found

    def read(self, name: str, number: int) -> Any:
        """Return an entry of an array of the model, or 0 where this MuJoCo has no such array."""
        found = getattr(self.model, name, None)
        return 0 if found is None else found[number]

    def disabled(self, flag: str) -> bool:
        """Return whether ``<flag ...="disable"/>`` is set."""
        bit = getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}", 0)
        return bool(self.model.opt.disableflags & int(bit))

    @property
    def without_passive_forces(self) -> bool:
        """Whether MuJoCo leaves out all passive forces: springs and dampers are disabled."""
        return self.disabled("spring") and self.disabled("damper")

    def is_fixed(self, tendon: int) -> bool:
        """Return whether a tendon is a fixed one: its length is a sum of coordinates."""
        m = self.model
        return bool(m.wrap_type[m.tendon_adr[tendon]] == self.mujoco.mjtWrap.mjWRAP_JOINT)

    # Messages -------------------------------------------------------------------------------------

    def refuse(self, kind: str, number: int, why: str) -> NoReturn:
        """Raise a `MechanismError` that names an element and its line."""
        raise MechanismError(f"{self.at(kind, number)} {why}")

    def tell(self, kind: str, number: int, what: str) -> None:
        """Note something about an element that the caller should know."""
        self.told.setdefault(what, []).append(self.at(kind, number))

    def at(self, kind: str, number: int) -> str:
        """Return an element's file, line, tag and name, by its number in MuJoCo's list."""
        elements = list(getattr(self._spec, kind))
        element = next(one for one in elements if one.id == number)
        line = _line(element)
        place = self._place(kind, element, line)
        if place is None:
            return f"{self.origin}: {kind} {element.name or number!r}"
        called = f" {element.name!r}" if element.name else ""
        return f"{place.file}, line {line or place.line}: {place.xml.tag}{called}"

    def setting(self, *tags: str, attribute: str = "") -> str:
        """Return the place of the last element of some tags, of those that have the attribute."""
        found = [
            place
            for place in self._places()
            if place.xml.tag in tags and (not attribute or attribute in place.xml.attrib)
        ]
        if not found:
            return f"{self.origin}: {tags[0]}"
        return f"{found[-1].file}, line {found[-1].line}: {found[-1].xml.tag}"

    def _place(self, kind: str, element: Any, line: int) -> _Place | None:
        """Return the place that is most like that of an element of MuJoCo's list.

        Its name may have been given a prefix or a suffix, where it is attached or replicated; its
        line is that in the main file, or in an attached one, or none (0) in an included one.
        """
        tags, section = _TAGS[kind], _SECTIONS.get(kind)
        candidates = [
            place
            for place in self._places()
            if (tags is None or place.xml.tag in tags)
            and (section is None or _parent(place.xml) == section)
            and ((place.xml.get("name") or "") in element.name)
            and bool(place.xml.get("name")) == bool(element.name)
            and "default" not in _ancestors(place.xml)
        ]
        if not line:  # unnamed elements of included files: in their order
            candidates = [place for place in candidates if place.file != self.origin]
            others = [one for one in getattr(self._spec, kind) if not _line(one) and not one.name]
            if not element.name and len(others) == len(candidates):
                return candidates[[one.id for one in others].index(element.id)]
        return min(
            candidates,
            key=lambda place: (-len(place.xml.get("name") or ""), abs(place.line - line)),
            default=None,
        )

    def _places(self) -> Iterator[_Place]:
        """Yield all elements of the file and of those that it includes or attaches."""
        files = [_File("", self.origin, self._text), *self._parts()]
        for one in files:
            root = _root(one.text)
            for xml in () if root is None else root.iter(etree.Element):
                yield _Place(one.path, xml.sourceline, xml)

    def _parts(self) -> Iterator[_File]:
        """Yield the files that the file includes or attaches."""
        yield from _parts(self._text, [self._path.parent if self._path else Path()])


def _parts(text: str, folders: list[Path]) -> Iterator[_File]:
    root = _root(text)
    for xml in () if root is None else root.iter("include", "model"):
        name = xml.get("file", "")
        path = next((f / name for f in folders if name and (f / name).is_file()), None)
        if path is not None:
            found = path.read_text("utf-8", "replace")
            yield _File(name, str(path), found)
            yield from _parts(found, [*folders, path.parent])


def _root(text: str) -> Any:
    """Return the root element of a text, which MuJoCo's parser reads with less rigour."""
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, recover=True, huge_tree=True
    )
    return etree.fromstring(text.encode(), parser)


def _line(element: Any) -> int:
    """Return an element's line as MuJoCo has it, 0 if it is in an included file."""
    return int(element.info.rpartition("line ")[2] or 0)


def _parent(xml: Any) -> str:
    parent = xml.getparent()
    return "" if parent is None else str(parent.tag)


def _ancestors(xml: Any) -> set[str]:
    return {str(one.tag) for one in xml.iterancestors()}


def _mujoco() -> Any:
    try:
        import mujoco  # noqa: PLC0415
    except ImportError:
        raise RPSPinError(
            "MuJoCo's files are read by MuJoCo: pip install 'rps-pin[mjcf]'"
        ) from None
    return mujoco
