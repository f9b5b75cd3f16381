"""Sphinx extension: a page for each class and function, and a sidebar that stays short.

The theme asks for the tree of all pages on each page. With a page for each object this takes as
long as all the rest of the build, so the sidebar unfolds only where the reader is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.ext.autosummary.generate import find_autosummary_in_files


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the steps before those of autosummary and of the theme (priority 500)."""
    app.connect("builder-inited", forget_old_pages, priority=400)
    app.connect("html-page-context", unfolded_here, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def forget_old_pages(app: Sphinx) -> None:
    """Delete pages that autosummary made of names that are in no table any more."""
    api = Path(app.srcdir) / "api"
    names = {entry.name for entry in find_autosummary_in_files([*api.glob("*.md")])}
    for page in (api / "objects").glob("*.rst"):
        if page.stem not in names:
            page.unlink()


def unfolded_here(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Let the sidebar have all pages of the first level, and those beside and below this one."""
    whole = context.get("toctree")
    if whole is not None:
        context["toctree"] = lambda **options: whole(**{**options, "collapse": True})
