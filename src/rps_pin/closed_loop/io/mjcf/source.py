"""An MJCF as MuJoCo compiles it.

MuJoCo reads the file: included files, defaults, frames, replicates, attached models, meshes and
masses are its business. What is read here is its compiled model, in which each kind of element is
numbered.
"""

from __future__ import annotations

import os
import re
import warnings
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

from rps_pin.closed_loop.io.mjcf.appearance import without_appearance
from rps_pin.closed_loop.io.mjcf.files import MjcfFiles
from rps_pin.closed_loop.io.xml_file import xml_text
from rps_pin.errors import MechanismError, RPSPinError

#: Elements by MuJoCo's lists of them; None where an element of any tag is meant.
_TAGS: dict[str, tuple[str, ...] | None] = {
    "bodies": ("body",),
    "joints": ("joint", "freejoint"),
    "sites": ("site",),
    "tendons": ("fixed", "spatial"),
    "equalities": None,
    "actuators": None,
}
_LINE = re.compile(r"\bline (\d+)")


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
    without_shapes : str
        Why shapes were left out; empty if they were not.

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
        self._files = MjcfFiles(self._text, self.origin, self._path)
        self.name = self._files.name
        self.mujoco = _mujoco()
        self.told: dict[str, list[str]] = {}
        self.without_shapes = ""
        self._spec, self.model = self._compiled()
        try:
            self.model.names.decode()
        except UnicodeDecodeError:
            raise MechanismError(f"{self.origin} has names that are not in UTF-8") from None

    def _compiled(self) -> tuple[Any, Any]:
        """Return MuJoCo's specification and model; its warnings, some in its log, are told."""
        mujoco = self.mujoco
        logged: list[str] = []
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(logged.append)
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                spec, model = self._compiled_at_all()
        finally:
            mujoco.set_mju_user_warning(before)
        found = [*logged, *(str(one.message) for one in caught)]
        for words in found:
            self.told[f"MuJoCo warns: {_one_line(words)}"] = [self.origin]
        return spec, model

    def _compiled_at_all(self) -> tuple[Any, Any]:
        """Return MuJoCo's specification and model, without shapes if it is they that fail."""
        try:
            spec = self._parsed()
            try:
                return spec, spec.compile()
            except (ValueError, RuntimeError) as error:
                spec = without_appearance(self._parsed(), self.mujoco)
                model = spec.compile()
                without = "textures, sensors, and shapes that give no mass are left out"
                self.without_shapes = f"MuJoCo: {self._reason(error)}: {without}"
                self.told[self.without_shapes] = [self.origin]
                return spec, model
        except (ValueError, RuntimeError) as error:
            why = self._reason(error)
            raise MechanismError(f"{self.origin} is not a valid MJCF: {why}") from None

    def _parsed(self) -> Any:
        """Return MuJoCo's specification; it takes names that end in .xml, so others get that."""
        spec = self.mujoco.MjSpec
        if self._files.has_other_suffixes:
            return self._parsed_in_one_text()
        if self._path is not None and self._path.suffix == ".xml":
            return spec.from_file(str(self._path))
        if self._path is None:
            return spec.from_string(self._text)
        named = f"{self._path.absolute()}.xml"  # which is read from memory
        return spec.from_file(named, include={named: self._text.encode()})

    def _reason(self, error: ValueError | RuntimeError) -> str:
        """Return MuJoCo's reason, with file and line where it names none."""
        why = _one_line(error)
        line = _LINE.search(why)
        if line is None:
            files = map(self._files.naming, re.findall("'([^']+)'", why))
            return f"{why} ({place})" if (place := next(filter(None, files), None)) else why
        if "Include error" in why:
            return f"{why} ({self._files.broken()})"
        if line[1] != "0":
            return why
        try:
            self._in_one_text.compile()
        except (ValueError, RuntimeError) as same:
            found = _one_line(same)
            line = _LINE.search(found)
            place = self._files.at(int(line[1])) if line else None
            return _LINE.sub(str(place), found) if place else why
        return why

    @cached_property
    def _in_one_text(self) -> Any:
        """The specification of all files in one text, which has lines of included files too."""
        return self._parsed_in_one_text()

    def _parsed_in_one_text(self) -> Any:
        spec = self.mujoco.MjSpec.from_string(self._files.text)
        spec.modelfiledir = str(self._files.folder)
        return spec

    def read(self, name: str, number: int) -> Any:
        """Return an entry of an array of the model, or 0 where this MuJoCo has no such array."""
        found = getattr(self.model, name, None)
        return 0 if found is None else found[number]

    def disabled(self, flag: str) -> bool:
        """Return whether ``<flag ...="disable"/>`` is set.

        Older MuJoCos have one flag, ``passive``, for spring and damper.
        """
        names = (flag, "passive") if flag in ("spring", "damper") else (flag,)
        kinds = self.mujoco.mjtDisableBit
        bits = [int(getattr(kinds, f"mjDSBL_{name.upper()}", 0)) for name in names]
        return any(self.model.opt.disableflags & bit for bit in bits)

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
        order = next(k for k, one in enumerate(elements) if one.id == number)
        name = elements[order].name
        try:
            again = list(getattr(self._in_one_text, kind))[order]
            place = self._files.at(int(again.info.rpartition("line ")[2] or 0), _TAGS[kind], name)
        except (ValueError, IndexError):
            place = None
        if place is None:
            return f"{self.origin}: {kind} {name or number!r}"
        return f"{place}: {place.xml.tag}" + (f" {name!r}" if name else "")

    def setting(self, *tags: str, attribute: str = "") -> str:
        """Return the place of the last element of some tags, of those that have the attribute."""
        place = self._files.last(tags, attribute)
        return f"{place}: {place.xml.tag}" if place else f"{self.origin}: {tags[0]}"


def _one_line(words: object) -> str:
    return " ".join(str(words).split())


def _mujoco() -> Any:
    try:
        import mujoco  # noqa: PLC0415
    except ImportError:
        raise RPSPinError(
            "MuJoCo's files are read by MuJoCo: pip install 'rps-pin[mjcf]'"
        ) from None
    return mujoco
