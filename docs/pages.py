"""Python blocks of a page: run in order, with their output and pictures."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent

#: A Python block and, if it follows directly, the text block that shows its output.
_BLOCK = re.compile(r"```python\n(.*?)```(\n\n```text\n(.*?)```)?", re.DOTALL)


class Ran(NamedTuple):
    """A block of a page after its run."""

    place: tuple[int, int]
    """Start and end of the text block's content in the page; equal if there is none."""
    shown: str | None
    """Output shown in the page, or None."""
    printed: str
    """Output of the run."""


def run(text: str, folder: Path) -> Iterator[Ran]:
    """Run a page's Python blocks in order, in an empty folder with the repository's URDFs."""
    (folder / "urdf").symlink_to(ROOT / "urdf")
    names: dict[str, Any] = {}
    with contextlib.chdir(folder):  # files of the blocks are not written to the checkout
        for number, block in enumerate(_BLOCK.finditer(text), start=1):
            code = compile(block[1], f"block {number}", "exec")
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec(code, names)
            yield Ran(block.span(3), block[3], printed.getvalue())


def pages() -> list[Path]:
    """Return all pages, in order."""
    return sorted(ROOT.glob("docs/**/*.md"))
