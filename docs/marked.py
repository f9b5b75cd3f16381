"""Parts of pages that scripts write, between two comments that name the script."""

from __future__ import annotations

import sys
from pathlib import Path


def replaced(text: str, name: str, part: str) -> str:
    """Return a page with a new part between the markers of the running script and a name.

    Raises
    ------
    ValueError
        If the page has no such markers.
    """
    script = Path(sys.argv[0]).name
    start, end = f"<!-- made by docs/{script}: {name} -->\n", "<!-- end -->"
    before, found, rest = text.partition(start)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"the page has no place for {name!r} of {script}")
    return f"{before}{start}\n{part}\n\n{end}{after}"


def block(lines: list[str]) -> str:
    """Return lines as an indented block."""
    return "\n".join(f"    {line}".rstrip() for line in lines)
