"""A page's Python: run in order, with what each block prints, and the pictures it writes."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent

#: A Python block and, if it follows at once, the block that shows what it prints.
_BLOCK = re.compile(r"```python\n(.*?)```(\n\n```text\n(.*?)```)?", re.DOTALL)


class Ran(NamedTuple):
    """A block of a page, after it ran."""

    place: tuple[int, int]
    """Where the text block's inside begins and ends in the page; equal where there is none."""
    shown: str | None
    """What the page says that it prints, if it says so."""
    printed: str
    """What it printed."""


def run(text: str, folder: Path) -> Iterator[Ran]:
    """Run a page's Python blocks in order, in an empty folder with the repository's URDFs."""
    (folder / "urdf").symlink_to(ROOT / "urdf")
    names: dict[str, Any] = {}
    with contextlib.chdir(folder):  # what the blocks write does not litter the checkout
        for number, block in enumerate(_BLOCK.finditer(text), start=1):
            code = compile(block[1], f"block {number}", "exec")
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec(code, names)
            yield Ran(block.span(3), block[3], printed.getvalue())


def pages() -> list[Path]:
    """Return all pages, in order."""
    return sorted(ROOT.glob("docs/**/*.md"))
