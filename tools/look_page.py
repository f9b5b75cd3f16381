"""The page of `tools/look.py`: commands, what they print, and pictures in two sizes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em; color: #223; }
section { border-top: 1px solid #ccd; padding: 1em 0; }
code { font-weight: 600; } .failed { color: #b00020; font-weight: 600; }
pre { background: #f4f6f9; padding: .7em; overflow-x: auto; font-size: 12px; line-height: 1.25; }
figure { display: inline-block; margin: .5em 1em .5em 0; vertical-align: top; }
figure img.print { width: 85mm; border: 1px solid #dde; }
figcaption { font-size: 12px; color: #556; }
details img { max-width: none; border: 1px solid #dde; }
"""


def write_page(
    folder: Path, steps: Sequence[Any], site: Sequence[Path], ugly: Sequence[str]
) -> Path:
    """Write ``index.html`` into a folder; pictures are linked relative to it.

    Parameters
    ----------
    folder
        The folder, which has the pictures.
    steps
        Of `look.Step`; those of one group follow each other.
    site, ugly
        Pictures of the site, and what was found wrong there.
    """
    failed = sum(step.failed for step in steps)
    parts = [
        "<!doctype html><meta charset='utf-8'><title>What people look at</title>",
        f"<style>{_STYLE}</style><h1>What people look at</h1>",
        f"<p>{len(steps)} commands, {failed} failed. Pictures are 85 mm wide, as in a column; "
        "full size below each.</p>",
    ]
    for group, members in itertools.groupby(steps, key=lambda step: step.group):
        parts.append(f"<h2>{escape(group)}</h2>")
        parts += [_section(folder, step) for step in members]
    if site:
        parts.append("<h2>Site</h2>")
        parts.append(f"<pre>{escape(chr(10).join(ugly) or 'nothing is ugly')}</pre>")
        parts += [_figure(folder, picture) for picture in site]
    page = folder / "index.html"
    page.write_text("\n".join(parts), "utf-8")
    return page


def _section(folder: Path, step: Any) -> str:
    ended = f"exit status {step.status}, {step.seconds:.1f} s"
    mark = " class='failed'" if step.failed else ""
    faults = "".join(f"<p class='failed'>{escape(fault)}</p>" for fault in step.faults)
    pictures = "".join(_figure(folder, picture) for picture in step.pictures)
    return (
        f"<section><p><code>{escape(step.line)}</code> <span{mark}>{ended}</span></p>{faults}"
        f"<pre>{escape(step.output)}</pre>{pictures}</section>"
    )


def _figure(folder: Path, picture: Path) -> str:
    name = escape(picture.relative_to(folder).as_posix())
    return (
        f"<figure><img class='print' loading='lazy' src='{name}'><figcaption>{name}</figcaption>"
        f"<details><summary>full size</summary><img loading='lazy' src='{name}'></details></figure>"
    )
