"""Run the Python blocks of pages, and write their output and pictures into the pages.

Run it from the checkout, in an environment with the development dependencies. Arguments are pages:

    .venv/bin/python docs/write_pages.py docs/tutorial.md
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import textwrap
from pathlib import Path

import pages

WIDTH = 84


def main() -> None:
    """Run the pages and write them."""
    for page in [Path(name).resolve() for name in sys.argv[1:]] or pages.pages():
        with tempfile.TemporaryDirectory() as folder:
            text = page.read_text("utf-8")
            ran = list(pages.run(text, Path(folder)))
            for block in reversed(ran):
                if block.shown is not None:
                    start, end = block.place
                    text = text[:start] + wrapped(block.printed) + text[end:]
            page.write_text(text, "utf-8")
            for picture in Path(folder).glob("*.png"):
                if f"images/{picture.name}" in text:
                    shutil.copy(picture, pages.ROOT / "docs" / "images" / picture.name)
        print(page.name)


def wrapped(printed: str) -> str:
    """Return output with long lines broken, except in tables."""
    lines = []
    for line in printed.rstrip().splitlines():
        table = len(line) <= WIDTH or line.strip()[0] in "│┃┏┡├└"
        lines += [line.rstrip()] if table else textwrap.wrap(line, WIDTH)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
