"""Names and paths of others, made harmless where they are printed, drawn or written; numbers.

A name in a robot's file is text of somebody else: it may hold codes that steer a terminal, turn
the direction of writing, or mean something to Matplotlib. Rich's markup is switched off where text
is printed (`rps_pin.cli.console`).
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence

#: Control and format characters, halves of surrogate pairs, separators of lines and paragraphs.
_CATEGORIES = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_KEPT = "\n\t"
#: Coordinates below this are rounding errors, m or rad.
ROUNDING = 1e-12


def plain(text: object) -> str:
    r"""Return a text with its control characters written as escapes: ``\x1b`` for ESC.

    Line feeds and tabs stay. What steers a terminal or turns the direction of writing is visible
    then and has no effect, and a lone surrogate, which no encoding has, can be printed.
    """
    words = str(text)
    if words.isascii() and words.isprintable():
        return words
    return "".join(one if _is_harmless(one) else ascii(one)[1:-1] for one in words)


def short(coordinate: float) -> str:
    """Return a coordinate, m or rad, in six digits; rounding errors are 0."""
    return f"{0.0 if abs(coordinate) < ROUNDING else coordinate:.6g}"


def listed(coordinates: Iterable[float], units: Sequence[str]) -> str:
    """Return coordinates with their units: ``(1, 2) m``, or ``(1, 2) m, rad`` if they differ."""
    said = units[:1] if len(set(units)) == 1 else units
    return f"({', '.join(map(short, coordinates))}) {', '.join(said)}"


def for_figure(name: object) -> str:
    """Return a name for Matplotlib: `plain`, and dollar signs are dollar signs."""
    return plain(name).replace("$", r"\$")


def _is_harmless(one: str) -> bool:
    return one in _KEPT or unicodedata.category(one) not in _CATEGORIES
