"""Robot files below folders, told by what they hold, not by what they are called."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

LARGEST = 20e6
"""Larger files are not looked into, bytes."""

MJCF, URDF, YAML = "MJCF", "URDF", "YAML"
PART = "part of an MJCF"
#: Kinds that are not robots as they stand; they are counted, not tried.
APART = {
    PART: "no model by itself",
    "SDF": "another format",
    "xacro": "a template; xacro makes a URDF of it",
    "URDF without joints": "a single body",
    "broken XML": "no XML parser reads it",
}

_DESCRIPTION = re.compile(rb"^((urdf|mjcf):[ \t]*\S|closed_loop:)", re.MULTILINE)
_ROOTS = {"mujoco": MJCF, "mujocoinclude": PART, "sdf": "SDF"}
_XACRO = "{http://www.ros.org/wiki/xacro}", "{http://ros.org/wiki/xacro}"


@dataclass(frozen=True)
class RobotFile:
    """A file, its kind, and the path to show for it."""

    path: Path
    kind: str
    shown: str
    included: bool = False
    """Whether another file includes it: a part that MuJoCo need not compile by itself."""


def robot_files(folders: Sequence[Path]) -> list[RobotFile]:
    """Return the robot files below folders, in order, each once."""
    found: dict[Path, RobotFile] = {}
    included: set[Path] = set()
    for folder in folders:
        for path in _files(folder):
            if path.resolve() in found:
                continue
            text = _beginning(path)
            kind = kind_of(text) if text is not None else None
            if kind is None:
                continue
            if kind == MJCF:
                included |= included_by(path)
            base = folder if folder.is_dir() else folder.parent
            found[path.resolve()] = RobotFile(path.absolute(), kind, str(path.relative_to(base)))
    return [
        RobotFile(one.path, one.kind, one.shown, path in included) for path, one in found.items()
    ]


def kind_of(content: bytes) -> str | None:
    """Return the kind of a file with this content, or None if it is no robot."""
    text = content.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text.startswith(b"<"):
        return YAML if _DESCRIPTION.search(content) and b"\0" not in content else None
    if not any(word in text for word in (b"<mujoco", b"<robot", b"<sdf")):
        return None
    text = re.sub(rb"^<\?xml[^>]*\?>", b"", text)  # urdfdom reads any version
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError):
        return "broken XML"
    return _kind_of_root(root)


def _kind_of_root(root: ElementTree.Element) -> str | None:
    if root.tag != "robot":
        return _ROOTS.get(root.tag)
    if any(_is_of_xacro(element) for element in root.iter()):
        return "xacro"
    if not root.findall("link"):
        return None  # a semantic description (SRDF), or a part
    moving = [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]
    return URDF if moving else "URDF without joints"


def _is_of_xacro(element: ElementTree.Element) -> bool:
    """Return whether an element, or an expression in an attribute, is xacro's."""
    values = element.attrib.values()
    return element.tag.startswith(_XACRO) or any("$(" in one or "${" in one for one in values)


def included_by(path: Path) -> set[Path]:
    """Return the files that an MJCF includes or attaches, by their resolved paths."""
    root = ElementTree.parse(path).getroot()
    names = [element.get("file", "") for element in root.iter("include")]
    return {(path.parent / name).resolve() for name in names if name}


def _files(folder: Path) -> Iterator[Path]:
    if folder.is_file():
        yield folder
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.stat().st_size <= LARGEST:
            yield path


def _beginning(path: Path) -> bytes | None:
    """Return the content of a file that may be a robot, or None."""
    with path.open("rb") as file:
        first = file.read(4096)
        if b"\0" in first:
            return None
        xml = first.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
        if not (xml or _DESCRIPTION.search(first)):
            return None
        return first + file.read()
