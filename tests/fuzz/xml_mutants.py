"""Mutants of URDF and MJCF files: their elements and attributes changed as a whole."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Collection
from random import Random
from typing import Any

from lxml import etree

from tests.fuzz import hostile

_NUMERIC = re.compile(r"\s*[-+]?[\d.]+([eE][-+]?\d+)?(\s+[-+]?[\d.]+([eE][-+]?\d+)?)*\s*")
#: Tags, attributes and values that other elements of the format have.
Words = Collection[str]


class XmlMutator:
    """Mutants of files of one XML format.

    Parameters
    ----------
    words
        Values of attributes that are worth a try, by attribute: types of joints and the like.
    open_tags
        Elements inside which nothing is read.
    required
        Elements and attributes that a reader must ask for: ``"joint/parent"``, ``"joint@type"``.
    strict
        Whether a misspelt word, a number that is none and a missing part must be refused.
    """

    def __init__(
        self,
        words: dict[str, list[str]],
        open_tags: Words = (),
        required: Words = (),
        strict: bool = False,
    ) -> None:
        self._words, self._open, self._required = words, set(open_tags), set(required)
        self._strict = strict
        self._usual: list[Callable[[Any, Random], None]] = [
            *[self._other_value] * 8,
            *(self._dropped, self._doubled, self._moved, self._renamed, self._attribute_gone),
            *(self._attribute_from_elsewhere, self._text_inside, self._swapped),
        ]

    def mutant(self, seed: str, rng: Random) -> tuple[bytes, str]:
        """Return a mutant, and why it must be refused, if it must."""
        root = etree.fromstring(seed.encode(), etree.XMLParser(remove_comments=True))
        why = ""
        if self._strict and rng.random() < 0.35:
            slip = rng.choice([self._misspelt, self._no_number, self._required_gone])
            why = slip(root, rng)
        else:
            for _ in range(rng.choice([0, 1, 1, 1, 2, 3])):
                rng.choice(self._usual)(root, rng)
        content = etree.tostring(root)
        if rng.random() < 0.1:
            return hostile.with_bytes_changed(content, rng), ""
        return content, why

    # What may be taken or refused ---------------------------------------------------------------

    def _other_value(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        if not element.attrib:
            return
        name = rng.choice(sorted(element.attrib))
        value = element.get(name)
        if _NUMERIC.fullmatch(value) and rng.random() < 0.85:
            parts = value.split()
            kind = rng.randrange(5)
            if kind == 0:
                parts = parts[:-1]
            elif kind == 1:
                parts.append(hostile.number(rng))
            elif kind == 2 and rng.random() < 0.5:
                parts[rng.randrange(len(parts))] = rng.choice(hostile.NO_NUMBERS)
            else:
                parts[rng.randrange(len(parts))] = hostile.number(rng)
            _set(element, name, rng.choice([" ", " ", "  ", ", "]).join(parts))
        elif name in self._words and rng.random() < 0.7:
            _set(element, name, rng.choice(self._words[name]))
        elif rng.random() < 0.5:  # the name of another part
            others = [one.get(name) for one in _elements(root) if one.get(name)]
            _set(element, name, rng.choice(others))
        else:
            _set(element, name, hostile.text(rng))

    def _dropped(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        if element.getparent() is not None:
            element.getparent().remove(element)

    def _doubled(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        if element.getparent() is not None:
            element.addnext(copy.deepcopy(element))

    def _moved(self, root: Any, rng: Random) -> None:
        element, target = (rng.choice(_elements(root)) for _ in range(2))
        if element is not root and element not in [target, *target.iterancestors()]:
            target.insert(rng.randrange(len(target) + 1), element)

    def _renamed(self, root: Any, rng: Random) -> None:
        element, other = (rng.choice(_elements(root)) for _ in range(2))
        element.tag = other.tag if rng.random() < 0.6 else rng.choice(["x", "mimic", "loop_joint"])

    def _attribute_gone(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        if element.attrib:
            del element.attrib[rng.choice(sorted(element.attrib))]

    def _attribute_from_elsewhere(self, root: Any, rng: Random) -> None:
        element, other = (rng.choice(_elements(root)) for _ in range(2))
        if other.attrib:
            name = rng.choice(sorted(other.attrib))
            _set(element, name, other.get(name))

    def _text_inside(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        made = rng.choice(["abc", "0 0 0", "\u00a0", hostile.text(rng)])
        try:
            element.text = made
        except ValueError:
            element.append(etree.Comment("x"))

    def _swapped(self, root: Any, rng: Random) -> None:
        element = rng.choice(_elements(root))
        children = list(element)
        rng.shuffle(children)
        element[:] = children

    # What must be refused -------------------------------------------------------------------------

    def _read(self, root: Any) -> list[Any]:
        return [
            one
            for one in _elements(root)
            if one is not root and not self._open & {one.tag, *(a.tag for a in one.iterancestors())}
        ]

    def _misspelt(self, root: Any, rng: Random) -> str:
        element = rng.choice(self._read(root) or [root])
        known = {one.tag for one in _elements(root)} | {
            n for e in _elements(root) for n in e.attrib
        }
        if element.attrib and rng.random() < 0.5:
            name = rng.choice(sorted(element.attrib))
            slip = hostile.misspelt(name, rng)
            if slip in known or ":" in slip:
                return ""
            element.set(slip, element.attrib.pop(name))
        elif element is root or (slip := hostile.misspelt(element.tag, rng)) in known:
            return ""
        else:
            element.tag = slip
        return "a misspelt word"

    def _no_number(self, root: Any, rng: Random) -> str:
        found = [
            (one, name)
            for one in self._read(root)
            for name, value in one.attrib.items()
            if _NUMERIC.fullmatch(value) and name not in ("name", "link", "joint", "version")
        ]
        if not found:
            return ""
        element, name = rng.choice(found)
        parts = element.get(name).split()
        infinite = element.tag == "limit"  # which may be
        words = [one for one in hostile.NO_NUMBERS if not (infinite and "inf" in one.lower())]
        parts[rng.randrange(len(parts))] = rng.choice(words)
        element.set(name, " ".join(parts))
        return "a number that is none"

    def _required_gone(self, root: Any, rng: Random) -> str:
        found = []
        for one in self._read(root):
            above = one.getparent()
            if f"{above.tag}/{one.tag}" in self._required and len(above.findall(one.tag)) == 1:
                found.append((one, ""))
            found += [(one, n) for n in one.attrib if f"{one.tag}@{n}" in self._required]
        if not found:
            return ""
        element, name = rng.choice(found)
        if name:
            del element.attrib[name]
        else:
            element.getparent().remove(element)
        return "a required part that is missing"


def _elements(root: Any) -> list[Any]:
    return list(root.iter("*"))


def _set(element: Any, name: str, value: str) -> None:
    try:
        element.set(name, value)
    except ValueError:  # characters that no XML has
        element.set(name, "&#1;")
