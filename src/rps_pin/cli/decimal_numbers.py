"""Numbers of options and arguments: decimal ones, as files have them.

Python's own reading takes more: ``1_000``, Arabic digits. A typing error must not become a number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import typer
from typer.core import TyperCommand

#: Those of XML Schema, infinity and "not a number" in any spelling: a command refuses them itself.
_DECIMAL = re.compile(
    r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?(inf|infinity|nan)",
    re.ASCII | re.IGNORECASE,
)
_WHOLE = re.compile(r"[-+]?[0-9]+", re.ASCII)


def decimal(text: str) -> float:
    """Return a decimal number, or raise `ValueError`."""
    if not _DECIMAL.fullmatch(text.strip(" \t\r\n")):
        raise ValueError(f"{text!r} is not a decimal number")
    return float(text)


class DecimalCommand(TyperCommand):
    """A command whose options and arguments take decimal numbers only."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse other numbers, then convert."""
        given = self.make_parser(ctx).parse_args(args=list(args))[0]
        kinds = get_type_hints(self.callback)
        params: list[Any] = self.params
        for param in params:
            pattern = _pattern(kinds.get(param.name))
            for text in _texts(given.get(param.name)):
                if pattern and not pattern.fullmatch(text.strip(" \t\r\n")):
                    what = "whole" if pattern is _WHOLE else "decimal"
                    message = f"{text!r} is not a {what} number."
                    raise typer.BadParameter(message, ctx=ctx, param=param)
        return super().parse_args(ctx, args)


def _pattern(kind: Any) -> re.Pattern[str] | None:
    """Return what numbers of a type look like: of a float or an int, alone or of a tuple."""
    kinds = {kind, *get_args(kind)}
    kinds |= {inner for one in kinds for inner in get_args(one)}
    return _DECIMAL if float in kinds else _WHOLE if int in kinds else None


def _texts(given: Any) -> Iterator[str]:
    """Return the texts of a parameter that is given, alone, or in nests of tuples and lists."""
    if isinstance(given, str):
        yield given
    elif isinstance(given, (tuple, list)):
        for one in given:
            yield from _texts(one)
