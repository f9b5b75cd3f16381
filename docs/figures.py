"""Sphinx extension: figures of print size are shown at a size to be read, on a phone too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docutils import nodes
from PIL import Image
from sphinx.application import Sphinx

WIDE = 1200  # pixels; at 200 dpi a journal's column has 669, its page 1377
SCREEN = 150  # dpi; pictures of screens have less, or none


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the step."""
    app.connect("doctree-read", mark_wide)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def mark_wide(app: Sphinx, doctree: nodes.document) -> None:
    """Give figures as wide as a journal's page, or column, a class for docs/_static/site.css."""
    for image in doctree.findall(nodes.image):
        with Image.open(Path(app.srcdir) / image["uri"]) as opened:
            if opened.width >= WIDE:
                image["classes"].append("wide")
            elif opened.info.get("dpi", (0, 0))[0] > SCREEN:
                image["classes"].append("column")
