"""The table `schema.txt`: elements and attributes of MuJoCo's files, by what is done with them."""

from __future__ import annotations

from pathlib import Path


def table() -> dict[str, dict[str, list[str]]]:
    """Attributes by element and kind, by what is done."""
    found: dict[str, dict[str, list[str]]] = {}
    kinds: dict[str, list[str]] = {}
    for line in Path(__file__).with_suffix(".txt").read_text("utf-8").splitlines():
        words = line.split()
        if not line.startswith(" "):
            kinds = found[line] = {}
        elif words[0].endswith(":"):
            kinds[words[0][:-1]] = kind = words[1:]
        else:
            kind += words
    return found
