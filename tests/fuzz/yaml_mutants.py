"""Mutants of YAML files: keys, values and nests changed as a whole."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from random import Random
from typing import Any

from ruamel.yaml import YAML

from tests.fuzz import hostile


class Raw(str):
    """A text that is written as it is, without quotes."""


#: Values as YAML writes them that no schema asks for, or not there.
ODD = [
    *("null", "~", "true", "off", "{}", "[]", "[[]]", "{a: 1}", "[1, 2]", "''", "!!str 1"),
    *(
        "!!python/object:os.system x",
        "!!binary aGk=",
        "!!set {a}",
        "!!timestamp 2001-01-01",
        "!x 1",
    ),
    *(
        "&a [*a]",
        "*a",
        "*missing",
        "2001-12-14",
        "12:30:45",
        "0o17",
        "0x1F",
        ".nan",
        ".inf",
        "-.inf",
    ),
    *("|\n  x", ">\n  x", "'\ud83e'", '"\\ud800"', '"\\0"', "? x", "- x", "<<", "%x", "@x", "`x`"),
    *(
        "!!float 1",
        "!!int 1.5",
        "!!null 1",
        "!!bool 1",
        "!!seq {}",
        "!!map []",
        "[" * 60 + "]" * 60,
    ),
]


class YamlMutator:
    """Mutants of files of one YAML schema.

    Parameters
    ----------
    required
        Keys without which the mapping that they are in must be refused.
    """

    def __init__(self, required: Collection[str] = ()) -> None:
        self._required = set(required)
        self._usual: list[Callable[[Any, Random], None]] = [
            *[_other_value] * 6,
            *(_dropped, _doubled, _moved, _renamed, _nested, _from_elsewhere),
        ]

    def mutant(self, seed: str, rng: Random) -> tuple[bytes, str]:
        """Return a mutant, and why it must be refused, if it must."""
        root = YAML(typ="safe", pure=True).load(seed)
        why = ""
        if rng.random() < 0.35:
            why = rng.choice([_misspelt, self._no_number, self._required_gone])(root, rng)
        else:
            for _ in range(rng.choice([0, 1, 1, 1, 2, 3])):
                rng.choice(self._usual)(root, rng)
        content = written(root).encode("utf-8", "surrogatepass")
        if rng.random() < 0.1:
            return hostile.with_bytes_changed(content, rng), ""
        return content, why

    def _no_number(self, root: Any, rng: Random) -> str:
        places = [(where, key) for where, key in _places(root) if type(where[key]) in (int, float)]
        if not places:
            return ""
        where, key = rng.choice(places)
        words = [one for one in hostile.NO_NUMBERS if one not in ("0x1F", "null", "1,5")]
        where[key] = Raw(rng.choice([*words, ".nan"]))
        return "a number that is none"

    def _required_gone(self, root: Any, rng: Random) -> str:
        places = [(where, key) for where, key in _places(root) if key in self._required]
        if not places:
            return ""
        where, key = rng.choice(places)
        del where[key]
        return "a required key that is missing"


def written(value: Any) -> str:
    """Return a tree as YAML in flow style, and block style at the top."""
    if isinstance(value, dict) and value:
        return "".join(f"{_key(key)}: {_flow(one)}\n" for key, one in value.items())
    return _flow(value)


def _key(key: Any) -> str:
    return key if isinstance(key, Raw) else json.dumps(str(key), ensure_ascii=False)


def _flow(value: Any) -> str:
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, float) and value in (float("inf"), -float("inf")):
        return ".inf" if value > 0 else "-.inf"
    return json.dumps(value, ensure_ascii=False)


def _places(root: Any) -> list[tuple[Any, Any]]:
    """Return containers and keys of all values."""
    found, waiting = [], [root]
    while waiting:
        where = waiting.pop()
        keys = list(where) if isinstance(where, dict) else range(len(where))
        found += [(where, key) for key in keys]
        waiting += [where[key] for key in keys if isinstance(where[key], (dict, list))]
    return found


def _chosen(root: Any, rng: Random) -> tuple[Any, Any]:
    places = _places(root)
    return rng.choice(places) if places else ({"": 0}, "")


def _other_value(root: Any, rng: Random) -> None:
    where, key = _chosen(root, rng)
    if isinstance(where[key], list) and where[key] and rng.random() < 0.4:
        where[key] = rng.choice([where[key][:-1], where[key] * 2, where[key][0]])
    elif type(where[key]) in (int, float) and rng.random() < 0.8:
        where[key] = Raw(rng.choice([hostile.number(rng), rng.choice(hostile.NO_NUMBERS)]))
    else:
        where[key] = rng.choice([hostile.text(rng), Raw(rng.choice(ODD)), Raw(hostile.number(rng))])


def _dropped(root: Any, rng: Random) -> None:
    where, key = _chosen(root, rng)
    del where[key]


def _doubled(root: Any, rng: Random) -> None:
    where, key = _chosen(root, rng)
    if isinstance(where, list):
        where.append(where[key])
    elif isinstance(key, str):
        where[Raw(f'"{key}"' if key.isidentifier() else "x")] = where[key]


def _moved(root: Any, rng: Random) -> None:
    (where, key), (target, place) = _chosen(root, rng), _chosen(root, rng)
    where[key], target[place] = target[place], where[key]
    if _is_nested(root):
        where[key], target[place] = 0, 1


def _from_elsewhere(root: Any, rng: Random) -> None:
    (where, key), (target, place) = _chosen(root, rng), _chosen(root, rng)
    before = target[place]
    target[place] = where[key]
    if _is_nested(root):
        target[place] = before


def _is_nested(root: Any) -> bool:
    """Return whether a container is in itself."""

    def inside(value: Any, above: tuple[int, ...]) -> bool:
        if not isinstance(value, (dict, list)):
            return False
        if id(value) in above:
            return True
        children = value.values() if isinstance(value, dict) else value
        return any(inside(one, (*above, id(value))) for one in children)

    return inside(root, ())


def _renamed(root: Any, rng: Random) -> None:
    where, key = _chosen(root, rng)
    if isinstance(where, dict):
        other = rng.choice(
            [hostile.text(rng), Raw(rng.choice(ODD)), Raw(rng.choice(hostile.NUMBERS))]
        )
        where[other] = where.pop(key)


def _nested(root: Any, rng: Random) -> None:
    where, key = _chosen(root, rng)
    where[key] = rng.choice([{"a": where[key]}, [where[key]], [[where[key]]]])


def _misspelt(root: Any, rng: Random) -> str:
    places = [(where, key) for where, key in _places(root) if type(key) is str and key]
    if not places:
        return ""
    where, key = rng.choice(places)
    slip = hostile.misspelt(key, rng)
    if any(slip == other for _, other in _places(root)):
        return ""
    where[slip] = where.pop(key)
    return "a misspelt key"
