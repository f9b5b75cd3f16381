"""YAML files: the one reader, and the types of values that its schemas share.

Files are data. Nothing in a file is run (tags other than YAML's own are refused), keys given twice
are refused, and so are nested aliases that would expand to something huge, before they are
expanded. Numbers are those of YAML 1.2: not ``1_000``, which Python takes. A schema is a pydantic
model in the package that the file belongs to; messages name the file, the line and the key, and
list the keys that are possible.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Annotated, Any, NoReturn, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from rps_pin import bounds
from rps_pin.bounds import FOR_MORE, most
from rps_pin.errors import InputError, MechanismError, did_you_mean, shown
from rps_pin.files import known_format, opened, xml_root_tag
from rps_pin.validation import LARGEST

#: YAML's numbers; longer ones than `LONGEST_NUMBER` are refused.
_NUMBER = re.compile(
    r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"
    r"|[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
LONGEST_NUMBER = 400
_KINDS = ("int", "float", "str", "bool", "null", "seq", "map", "merge")
_YAML = "tag:yaml.org,2002:"


def _not_beyond(number: float) -> float:
    if abs(number) > LARGEST:
        raise ValueError(f"no number may be beyond {LARGEST:g}")
    return number


Text = Annotated[str, Field(min_length=1)]
Finite = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_not_beyond)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False), AfterValidator(_not_beyond)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), AfterValidator(_not_beyond)]
Three = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class Entry(BaseModel):
    """A mapping in a file: no other keys than its fields, no conversion of values."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


Schema = TypeVar("Schema", bound=BaseModel)


@dataclass(frozen=True)
class YamlFile:
    """The values of a YAML file, and their lines.

    Attributes
    ----------
    values
        The file's mapping; every key is text.
    origin
        The file, for messages.
    """

    values: Mapping[str, Any]
    origin: str
    _root: Node
    _line: int = 0

    def place(self, path: Sequence[str | int]) -> str:
        """Return ``"FILE, line N"`` of the value at a path of keys and indices.

        The line is that of the innermost part of the path that the file holds.
        """
        _, line = self._found(path)
        return f"{self.origin}, line {line + 1}" if line or path else self.origin

    def part(self, key: str) -> YamlFile:
        """Return the mapping at a key as a file of its own, with the lines of the whole."""
        child = _child(self._root, key)
        if child is None:
            raise KeyError(key)
        return YamlFile(self.values[key], self.origin, *child)

    @contextmanager
    def at(self, *path: str | int) -> Iterator[None]:
        """Put the place of a path before the message of an `InputError`."""
        try:
            yield
        except InputError as error:
            kind = MechanismError if isinstance(error, MechanismError) else InputError
            raise kind(f"{self.place(path)}: {error}") from None

    def validated(self, schema: type[Schema], what: str, root: Sequence[str | int] = ()) -> Schema:
        """Return the file's values as an instance of a schema.

        Parameters
        ----------
        schema
            The pydantic model.
        what
            The name of the whole in messages: ``"a mechanism"``.
        root
            The path whose line is named if the whole lacks a key.

        Raises
        ------
        InputError
            If a key is unknown (lists those that are possible) or missing, or a value is not of its
            key's type; with the line.
        """
        try:
            return schema.model_validate(dict(self.values))
        except ValidationError as error:
            problems = self._apart(problems_of(error))
        errors = [InputError(self._told(one, schema, what, root)) for one in problems]
        raise together(errors, self.origin)

    def _apart(self, problems: Sequence[Any]) -> list[Any]:
        """Return one problem for each value, and for each unknown or missing key.

        A key that is missing is not told where an unknown one is taken for it. (A value that may be
        of several kinds has a problem with each.)
        """
        found: dict[tuple[Any, ...], Any] = {}
        names = {one["loc"] for one in problems if one["type"] == "missing"}
        for one in problems:
            place, key = one["loc"][:-1], str(one["loc"][-1]) if one["loc"] else ""
            if one["type"] == "extra_forbidden":
                of_place = [name[-1] for name in names if name[:-1] == place]
                names -= {(*place, near) for near in get_close_matches(key, of_place, n=1)}
        for one in problems:
            if one["type"] != "missing":
                found.setdefault(one["loc"][: self._found(one["loc"])[0]], one)
            elif one["loc"] in names:
                found[one["loc"]] = one
        return list(found.values())

    def _told(
        self, problem: Any, schema: type[BaseModel], what: str, root: Sequence[str | int]
    ) -> str:
        """Return a problem in words, with its line."""
        depth, _ = self._found(problem["loc"])
        path, value = problem["loc"][:depth], problem["input"]
        key = problem["loc"][-1] if problem["loc"] else ""
        if problem["type"] == "missing":
            where = self.place(path or root)
            return f"{where}: {path_text(path) or what} needs {key}"
        where = self.place(path)
        if problem["type"] == "extra_forbidden":
            keys = list(_schema_at(schema, path[:-1]).model_fields)
            return (
                f"{where}: unknown key {key!r}{did_you_mean(str(key), keys)}; the keys of "
                f"{path_text(path[:-1]) or what} are: {', '.join(keys)}"
            )
        if problem["type"] == "invalid_key":
            return (
                f"{where}: {path_text(path) or what}: the key {shown(value)} is no name; numbers "
                "are written with a point, 0.5 and not 0,5"
            )
        said = "" if isinstance(value, dict) else f" = {shown(value)}"
        return f"{where}: {path_text(path) or what}{said}: {rule_of(problem)}"

    def _found(self, path: Sequence[str | int]) -> tuple[int, int]:
        """Return how many parts of a path the file holds, and the line (from 0) of the last."""
        node, line = self._root, self._line
        for depth, part in enumerate(path):
            child = _child(node, part)
            if child is None:
                return depth, line
            node, line = child
        return len(path), line


def read_config(
    path: str | os.PathLike[str], what: str, schema: type[Schema]
) -> tuple[YamlFile, Schema]:
    """Read a YAML file of a schema; return its values with their lines, and validated.

    Parameters
    ----------
    path
        The file.
    what
        Its kind, for messages: ``"mechanism"``.
    schema
        A pydantic model.

    Raises
    ------
    InputError
        As `read_yaml` and `YamlFile.validated`.
    """
    file = read_yaml(path, f"{what} file")
    return file, file.validated(schema, f"a {what}")


def problems_of(error: ValidationError) -> list[Any]:
    """Return all problems, unknown keys first, which may be misspelt missing ones."""
    problems = error.errors(include_url=False)
    return sorted(problems, key=lambda one: one["type"] != "extra_forbidden")


def rule_of(problem: Any) -> str:
    """Return the rule that one of pydantic's problems breaks: "must be greater than 0"."""
    rule = str(problem["msg"]).removeprefix("Value error, ")
    rule = rule.replace("Input should", "must", 1)
    return rule[0].lower() + rule[1:]


def together(errors: Sequence[InputError], origin: str) -> InputError:
    """Return all errors of a file as one: the first, and the others without the file's name."""
    first, *others = errors
    if not others:
        return first
    words = [str(error).removeprefix(f"{origin}, ").removeprefix(f"{origin}: ") for error in others]
    kind = MechanismError if isinstance(first, MechanismError) else InputError
    return kind("; ".join([str(first), *words]))


class Faults:
    """A block that keeps an `InputError`, so that all of a file are told at once by `tell`."""

    def __init__(self, origin: str) -> None:
        self._origin = origin
        self._errors: list[InputError] = []

    def __enter__(self) -> Faults:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> bool:
        if not isinstance(error, InputError):
            return False
        self._errors.append(error)
        return True

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._errors)

    def tell(self) -> None:
        """Raise the errors that were kept, as one, if there are any."""
        if self._errors:
            raise together(self._errors, self._origin)


def _schema_at(schema: type[BaseModel], path: Sequence[str | int]) -> type[BaseModel]:
    is_key = False  # of a mapping whose values are of the schema
    for part in path:
        if isinstance(part, str) and not is_key:
            annotation = schema.model_fields[part].annotation
            schema, is_key = next(_schemas_in(annotation)), get_origin(annotation) is dict
        else:
            is_key = False
    return schema


def _schemas_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _schemas_in(argument)


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
        Its kind, for messages: ``"mechanism file"``.

    Raises
    ------
    InputError
        If the file cannot be read, is larger than `bounds.YAML`, or is not such a mapping; with
        the line where that shows.
    """
    with opened(path, what) as file:
        limit, origin = most(bounds.YAML), os.fspath(path)
        content = file.read(limit + 1)
        if len(content) > limit:
            raise InputError(
                f"{what} {origin} has more than {limit} bytes, the most that is read; {FOR_MORE}"
            )
        _refuse_other_formats(content, origin, what)
        text = content.decode("utf-8-sig")
    if "\0" in text:
        raise InputError(f"{origin} is not valid YAML: it has bytes of value 0, as UTF-16 has")
    return _parsed(text, origin)


def _refuse_other_formats(content: bytes, origin: str, what: str) -> None:
    if told := known_format(content):
        raise InputError(f"{origin} is not a {what} but {told}")
    if root := xml_root_tag(content):
        raise InputError(f"{origin} is not a {what} but XML with the root element <{root}>")


def _parsed(text: str, origin: str) -> YamlFile:
    try:
        reader = YAML(typ="safe", pure=True)
        root, values = reader.compose(text), None
        if root is not None:
            _refuse_huge(root, origin)
            _check_nodes(root, origin)
            values = reader.constructor.construct_document(root)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f", line {mark.line + 1}" if mark else ""
        problem = " ".join(f"{error.context or ''} {error.problem or ''}".split())
        raise InputError(f"{origin}{where}: not valid YAML: {problem}") from None
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{origin} is nested too deeply") from None
    except (YAMLError, ValueError, TypeError, LookupError, ArithmeticError) as error:
        first = " ".join(str(error).split())
        raise InputError(f"{origin} is not valid YAML: {first}") from None
    if not isinstance(values, Mapping):
        held = "nothing" if values is None else f"a {type(values).__name__}"
        raise InputError(f"{origin} must hold 'key: value' lines; it holds {held}")
    for key, _ in root.value:
        if key.tag not in ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"):
            _refuse_key(key, origin)
    return YamlFile(values, origin, root)


def _refuse_huge(root: Node, origin: str) -> None:
    """Count the values with their aliases expanded, each node once; refuse keys that are nests."""
    sizes: dict[int, int] = {}
    limit = most(bounds.VALUES)

    def size(node: Node) -> int:
        key = id(node)
        if key not in sizes:
            sizes[key] = limit + 1  # for a node inside itself
            for name, _ in node.value if isinstance(node, MappingNode) else ():
                if not isinstance(name, ScalarNode):
                    _refuse_key(name, origin)
            sizes[key] = 1 + sum(size(child) for child in _children(node))
        return sizes[key]

    if size(root) > limit:
        raise InputError(
            f"{origin} would expand to more than {limit} values, the most that is read; {FOR_MORE}"
        )


def _check_nodes(root: Node, origin: str) -> None:
    """Refuse tags that are not of YAML's core, what does not fit its tag, and half characters."""
    waiting, seen = [root], set[int]()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        waiting += _children(node)
        why = _scalar_fault(node) if isinstance(node, ScalarNode) else ""
        kind = str(node.tag).removeprefix(_YAML)
        if kind not in _KINDS or not str(node.tag).startswith(_YAML):
            why = f"the tag {str(node.tag).replace(_YAML, '!!')} is not read"
        elif kind != _kind_of(node, kind):
            why = f"this is no {kind}"
        if why:
            line = node.start_mark.line + 1
            raise InputError(f"{origin}, line {line}: not valid YAML: {why}")


def _kind_of(node: Node, tagged: str) -> str:
    """Return the kind of a node: ``map``, ``seq``, or that of its tag for other scalars."""
    if isinstance(node, MappingNode):
        return "map"
    if isinstance(node, SequenceNode):
        return "seq"
    return "str" if tagged in ("map", "seq") else tagged


def _scalar_fault(node: ScalarNode) -> str:
    kind, value = str(node.tag).removeprefix(_YAML), node.value
    if kind == "bool" and value.lower() not in ("true", "false"):
        return f"{shown(value)} is neither true nor false"
    if kind in ("int", "float") and len(value) > LONGEST_NUMBER:
        return f"a number of {len(value)} digits is too long"
    if kind in ("int", "float") and not _NUMBER.fullmatch(value):
        return f"{shown(value)} is not a number of YAML"
    if kind == "float" and value[-1] in "0123456789." and math.isinf(float(value)):
        return f"{shown(value)} is too large for a number; .inf is infinite"
    if any("\ud800" <= letter <= "\udfff" for letter in value):
        return f"{shown(value)} has half a character (a surrogate)"
    return ""


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
