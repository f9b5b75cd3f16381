"""YAML files as data: read safely, bounded in size, each value with the line it stands on.

Nothing in a file is run (tags that name Python objects are refused), keys given twice are refused,
and a nest of aliases that would unfold to something huge is refused before it is unfolded.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from rps_pin.errors import InputError

#: Larger files are refused: descriptions are written by hand, and reading takes 20 s a megabyte.
LARGEST_FILE = 200_000
#: Most values a file may hold once its aliases are unfolded.
LARGEST_CONTENT = 100_000


@dataclass(frozen=True)
class YamlFile:
    """What a YAML file holds, and where.

    Attributes
    ----------
    values
        The file's mapping; every key is text.
    origin
        The file as messages name it.
    """

    values: Mapping[str, Any]
    origin: str
    _root: Node

    def place(self, path: Sequence[str | int]) -> str:
        """Return ``"FILE, line N"`` of the value at a path of keys and indices.

        The line is that of the innermost part of the path that the file holds.
        """
        node, line = self._root, 0
        for part in path:
            child = _child(node, part)
            if child is None:
                break
            node, line = child
        return f"{self.origin}, line {line + 1}" if line or path else self.origin

    def held(self, path: Sequence[str | int]) -> tuple[str | int, ...]:
        """Return the beginning of a path that leads somewhere in the file."""
        values: Any = self.values
        for depth, part in enumerate(path):
            in_list = isinstance(values, list) and isinstance(part, int) and part < len(values)
            if not in_list and not (isinstance(values, Mapping) and part in values):
                return tuple(path[:depth])
            values = values[part]
        return tuple(path)

    def part(self, key: str) -> YamlFile:
        """Return a mapping that stands at a key, as a file of its own; lines stay the file's."""
        child = _child(self._root, key)
        if child is None:
            raise KeyError(key)
        return YamlFile(self.values[key], self.origin, child[0])


def path_text(path: Sequence[str | int]) -> str:
    """Return a path as a reader would write it: ``poses[0][2]``, ``faults[0].size``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read_yaml(path: str | os.PathLike[str], what: str) -> YamlFile:
    """Read a YAML file that holds one mapping.

    Parameters
    ----------
    path
        The file.
    what
        What the file is, for messages: ``"mechanism file"``.

    Raises
    ------
    InputError
        If the file cannot be read, is larger than `LARGEST_FILE`, or is not such a mapping; with
        the line where that shows.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a {what} is given by its path, not by {path!r}")
    origin = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        text = content[:LARGEST_FILE].decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a UTF-8 text"
        raise InputError(f"cannot read the {what} {origin}: {reason}") from None
    if len(content) > LARGEST_FILE:
        raise InputError(
            f"{what} {origin} has more than {LARGEST_FILE} bytes, the most that is read"
        )
    return _parsed(text, origin)


def _parsed(text: str, origin: str) -> YamlFile:
    try:
        root = _reader().compose(text)
        if root is not None:
            _refuse_huge(root, origin)
        values = _reader().load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f", line {mark.line + 1}" if mark else ""
        problem = " ".join(f"{error.context or ''} {error.problem or ''}".split())
        raise InputError(f"{origin}{where}: not valid YAML: {problem}") from None
    except (YAMLError, ValueError) as error:
        first = " ".join(str(error).split())
        raise InputError(f"{origin} is not valid YAML: {first}") from None
    except RecursionError:
        raise InputError(f"{origin} is nested too deeply") from None
    if not isinstance(values, Mapping):
        held = "nothing" if values is None else f"a {type(values).__name__}"
        raise InputError(f"{origin} must hold 'key: value' lines; it holds {held}")
    for key, _ in root.value:
        if key.tag not in ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"):
            _refuse_key(key, origin)
    return YamlFile(values, origin, root)


def _reader() -> YAML:
    return YAML(typ="safe", pure=True)


def _refuse_huge(root: Node, origin: str) -> None:
    """Count every value as often as aliases repeat it, entering each once; refuse nested keys."""
    sizes: dict[int, int] = {}

    def size(node: Node) -> int:
        key = id(node)
        if key not in sizes:
            sizes[key] = LARGEST_CONTENT + 1  # what a node inside itself would meet
            for name, _ in node.value if isinstance(node, MappingNode) else ():
                if not isinstance(name, ScalarNode):
                    _refuse_key(name, origin)
            sizes[key] = 1 + sum(size(child) for child in _children(node))
        return sizes[key]

    if size(root) > LARGEST_CONTENT:
        raise InputError(
            f"{origin} would unfold to more than {LARGEST_CONTENT} values, the most that is read"
        )


def _refuse_key(key: Node, origin: str) -> NoReturn:
    what = f"the key {key.value!r}" if isinstance(key, ScalarNode) else "a key"
    raise InputError(f"{origin}, line {key.start_mark.line + 1}: {what} must be text")


def _children(node: Node) -> list[Node]:
    if isinstance(node, MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def _child(node: Node, part: str | int) -> tuple[Node, int] | None:
    """Return a value in a mapping with its key's line, or one of a sequence with its own."""
    if isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
        child = node.value[part]
        return child, child.start_mark.line
    if isinstance(node, MappingNode):
        for key, value in node.value:
            if isinstance(key, ScalarNode) and key.value == str(part):
                return value, key.start_mark.line
    return None
