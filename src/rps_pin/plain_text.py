"""Names and paths of others, made harmless where they are printed, drawn or written.

A name in a robot's file is text of somebody else: it may hold codes that steer a terminal, turn
the direction of writing, or mean something to Matplotlib. Rich's markup is switched off where text
is printed (`rps_pin.cli.console`).
"""

from __future__ import annotations

import unicodedata

#: Control and format characters, halves of surrogate pairs, separators of lines and paragraphs.
_CATEGORIES = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_KEPT = "\n\t"


def plain(text: object) -> str:
    r"""Return a text with its control characters written as escapes: ``\x1b`` for ESC.

    Line feeds and tabs stay. What steers a terminal or turns the direction of writing is visible
    then and has no effect, and a lone surrogate, which no encoding has, can be printed.
    """
    words = str(text)
    if words.isascii() and words.isprintable():
        return words
    return "".join(one if _is_harmless(one) else ascii(one)[1:-1] for one in words)


def for_figure(name: object) -> str:
    """Return a name for Matplotlib: `plain`, and dollar signs are dollar signs."""
    return plain(name).replace("$", r"\$")


def _is_harmless(one: str) -> bool:
    return one in _KEPT or unicodedata.category(one) not in _CATEGORIES
