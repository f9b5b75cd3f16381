"""The files that an MJCF consists of, and the places in them that messages name.

MuJoCo counts no lines of included files. So the file and those that it includes are put into one
text, one element a line, which MuJoCo reads again where a message needs a place. Lines of attached
files it counts: the text begins with so many empty lines that none of its own has such a number.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Collection, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

from lxml import etree

from rps_pin.closed_loop.io.foreign import refuse_other_formats
from rps_pin.closed_loop.io.xml_file import parser, read_whole, without_comments
from rps_pin.errors import MechanismError
from rps_pin.files import opened

#: How deep files include or attach others, at most.
DEEPEST = 100

#: Attributes of ``compiler`` that name folders of files.
_FOLDERS = ("meshdir", "texturedir", "assetdir")


class Place(NamedTuple):
    """An element of one of the files."""

    file: str
    line: int
    xml: Any

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"


class MjcfFiles:
    """A file, those that it includes, and those that it attaches.

    Parameters
    ----------
    text, origin
        The main file's text, and its name for messages.
    path
        Of the main file; None if it is a text.

    Attributes
    ----------
    name : str
        Of the model.
    folder : Path
        Of the main file.
    has_other_suffixes : bool
        Whether it attaches files that do not end in ``.xml``, which MuJoCo takes of `text` only.

    Raises
    ------
    InputError
        If a file is too large.
    MechanismError
        If the text is no MJCF, a file declares a document type, or a file includes or attaches
        itself.
    """

    def __init__(self, text: str, origin: str, path: Path | None) -> None:
        if path is not None:
            _content(path)  # which may be in an encoding that is read here and not by MuJoCo
        root = _root(text, origin)
        if root is None or root.tag != "mujoco":
            refuse_other_formats(text, origin, "MJCF")
            raise MechanismError(f"{origin} is not a valid MJCF: it is not XML")
        self.name = str(root.get("model", ""))
        self.has_other_suffixes = False
        self.folder = path.parent if path else Path()
        self._places: list[Place] = []
        self._attached: list[Place] = []
        self._lines: list[str] = []
        self._others: list[Path] = []
        chain: tuple[Path, ...] = (path.resolve(),) if path else ()
        models: list[tuple[Path, tuple[Path, ...]]] = []
        for event, place, model in self._walk(root, origin, self.folder, chain):
            if event == "end":
                self._lines[-1] += f"</{place.xml.tag}>"
                continue
            self._places.append(place)
            if model and model.suffix != ".xml" and _is_mjcf(model):
                place.xml.set("content_type", "text/xml")
                self.has_other_suffixes = True
            self._lines.append(_start_tag(place.xml, model))
            models += [(model, (*chain, model))] if model else []
        while models:
            path, chain = models.pop()
            root = self._root_of(path)
            walk = () if root is None else self._walk(root, str(path), path.parent, chain)
            for event, place, model in walk:
                if event == "start":
                    self._attached.append(place)
                    models += [(model, (*chain, model))] if model else []
        self._refuse_irregular()
        self._first = max((place.line for place in self._attached), default=0)

    @property
    def text(self) -> str:
        """All files but the attached ones, one element a line."""
        return "\n" * self._first + "\n".join(self._lines)

    def at(self, line: int, tags: Collection[str] | None = None, name: str = "") -> Place | None:
        """Return the place of a line of `text`, or of an attached file.

        Of attached files' elements with this line and one of the tags it is that whose name is the
        longest part of the name, to which MuJoCo adds a prefix.
        """
        if line > self._first:
            own = self._places[line - self._first - 1 : line - self._first]
            return own[0] if own else None
        found = [
            place
            for place in self._attached
            if place.line == line
            and (tags is None or place.xml.tag in tags)
            and (place.xml.get("name") or "") in name
        ]
        return max(found, key=lambda place: len(place.xml.get("name") or ""), default=None)

    def last(self, tags: Sequence[str], attribute: str = "") -> Place | None:
        """Return the last element of some tags, of those that have the attribute."""
        found = [
            place
            for place in (*self._attached, *self._places)
            if place.xml.tag in tags and (not attribute or attribute in place.xml.attrib)
        ]
        return found[-1] if found else None

    def naming(self, file: str) -> Place | None:
        """Return the element that names a file, given by its path or the end of it."""
        for place in (*self._places, *self._attached):
            for key, value in place.xml.attrib.items():
                if key.startswith("file") and value and f"/{file}".endswith(f"/{value}"):
                    return place
        return None

    def broken(self) -> str:
        """Return which included or attached file is not XML, where and why; or nothing."""
        for path in self._others:
            try:
                etree.fromstring(_content(path).encode(), parser(huge_tree=True))
            except etree.XMLSyntaxError as error:
                return f"{path}: {error}"
        return ""

    def _refuse_irregular(self) -> None:
        """Refuse files, of meshes too, that MuJoCo would wait for: FIFOs and devices."""
        places = (*self._places, *self._attached)
        inside = {place.xml.get(name) or "" for place in places for name in _FOLDERS} | {""}
        for place in places:
            names = [value for key, value in place.xml.attrib.items() if key.startswith("file")]
            folders = {self.folder, Path(place.file).parent}
            for name, folder, part in product(names, folders, inside):
                if _is_irregular(str(folder / part / name)):
                    raise MechanismError(f"{place}: {name!r} is not a regular file")

    # Reading --------------------------------------------------------------------------------------

    def _walk(
        self, root: Any, file: str, main: Path, chain: tuple[Path, ...], *, included: bool = False
    ) -> Iterator[tuple[str, Place, Path | None]]:
        """Yield starts and ends of elements, those of included files in their place.

        With the start of a ``model`` comes its file. Files are looked for in `main`, the folder of
        the file that includes this one in the end, and in this one's; `chain` are the files that
        led to this one, and itself.
        """
        replaced = [root] if included else []
        folders = [main, *(path.parent for path in chain[-1:])]
        for event, xml in etree.iterwalk(root, ("start", "end"), "*"):
            if xml in replaced:
                continue
            place = Place(file, xml.sourceline, xml)
            if event == "start":
                _refuse_formats(place)
            other = None
            if event == "start" and xml.tag in ("include", "model") and xml.get("file"):
                nearest_first = xml.tag == "model"
                other = _other(place, folders[::-1] if nearest_first else folders, chain)
            if other and xml.tag == "include":
                replaced.append(xml)
                inner = self._root_of(other)
                if inner is not None:
                    to = (*chain, other)
                    yield from self._walk(inner, str(other), main, to, included=True)
                continue
            yield event, place, other

    def _root_of(self, path: Path) -> Any:
        """Return the root element of an included or attached file the first time, then None."""
        if path in self._others:
            return None
        self._others.append(path)
        return _root(_content(path), str(path))


def _refuse_formats(place: Place) -> None:
    """Refuse a percent sign in an attribute: in a message, MuJoCo takes it for a format of C."""
    for name, value in place.xml.attrib.items():
        if "%" in value:
            raise MechanismError(
                f"{place}: {name} = {value!r} has a %, which can end the process in MuJoCo"
            )


def _is_irregular(path: str) -> bool:
    """Return whether there is something that is neither a file nor a folder."""
    try:
        kind = os.stat(path).st_mode  # noqa: PTH116 (no error where a name is too long)
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


def _other(place: Place, folders: Sequence[Path], chain: Sequence[Path]) -> Path | None:
    """Return the file that an element includes or attaches, if it is there."""
    for folder in folders:
        found = folder / str(place.xml.get("file"))
        if os.path.isfile(found):  # noqa: PTH113 (no error where a name is too long)
            path = found.resolve()
            if path in chain or len(chain) > DEEPEST:
                why = "which leads back to itself" if path in chain else "too deep"
                raise MechanismError(f"{place}: {place.xml.tag} of {str(path)!r}, {why}")
            return path
    return None


def _content(path: Path) -> str:
    with opened(path, "MJCF") as file:
        content = read_whole(file, str(path), "MJCF")
    if b"\0" in content[:4]:
        raise MechanismError(f"the MJCF {path} is in UTF-16 or UTF-32; MuJoCo reads UTF-8 alone")
    return content.decode("utf-8", "replace")


def _is_mjcf(path: Path) -> bool:
    root = _root(_content(path), str(path))
    return root is not None and root.tag == "mujoco"


def _root(text: str, origin: str) -> Any:
    """Return the root element of a text, which MuJoCo's parser reads with less rigour, or None."""
    if "<!DOCTYPE" in text and "<!DOCTYPE" in without_comments(text):
        raise MechanismError(f"{origin} declares a document type, which no MJCF needs: refused")
    try:
        content = text.encode("utf-8", "surrogatepass")
        return etree.fromstring(content, parser(recover=True, huge_tree=True))
    except etree.XMLSyntaxError:
        return None


def _start_tag(xml: Any, model: Path | None) -> str:
    """Return an element's start tag, with the file that it attaches at its whole path."""
    attributes = dict(xml.attrib) | ({"file": str(model)} if model else {})
    words = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{xml.tag}{words}>"
