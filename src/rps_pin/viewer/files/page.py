"""Web page around Meshcat's viewer, for a file on disk and for a server."""

from __future__ import annotations

import html
import json
import re
from functools import cache
from pathlib import Path
from string import Template

import meshcat

from rps_pin.plain_text import plain


def page(*, title: str, note: str, policy: str, scripts: str) -> str:
    """Return a page that fills the browser's window with Meshcat's pane ``meshcat-pane``.

    Parameters
    ----------
    title
        Plain text, for the browser's tab and the caption; escaped here.
    note
        Plain text for the caption's second line (the element ``note``); escaped here.
    policy
        The page's Content-Security-Policy.
    scripts
        The ``<script>`` elements, as HTML.
    """
    text = {"title": title, "note": note, "policy": policy}
    escaped = {name: html.escape(plain(one)) for name, one in text.items()}
    return Template(own_file("page.html")).substitute(
        escaped, style=own_file("page.css"), scripts=scripts
    )


def inline_script(source: str, attributes: str = "") -> str:
    """Return a ``<script>`` element that holds `source`.

    Text that would end the element early, or make the browser's parser read past its end, gets a
    backslash, which changes nothing within JavaScript's strings and patterns. JSON has no such
    backslash: data must not contain ``<``.
    """
    source = re.sub(r"<(?=/script|!--)", r"<\\", source, flags=re.IGNORECASE)
    return f"<script{attributes}>\n{source}\n</script>"


@cache
def viewer_library() -> str:
    """Return the source of Meshcat's browser part, from the meshcat package."""
    return _distributed("main.min.js")


@cache
def licences() -> str:
    """Return the licences of `viewer_library` as a JSON text: each copy must carry them."""
    own = Path(meshcat.viewer_assets_path(), "LICENSE").read_text(encoding="utf-8")
    others = json.loads(_distributed("main.min.js.THIRD_PARTY_LICENSES.json"))
    return json.dumps([{"name": "meshcat", "licenseText": own}, *others]).replace("<", "\\u003c")


@cache
def own_file(name: str) -> str:
    """Return the text of a file beside this module: the page itself, and the scripts on it."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _distributed(name: str) -> str:
    return Path(meshcat.viewer_assets_path(), "dist", name).read_text(encoding="utf-8")
