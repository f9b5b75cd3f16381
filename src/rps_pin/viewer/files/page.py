"""The web page around Meshcat's viewer, for a file on disk and for a server alike."""

from __future__ import annotations

import html
import json
from functools import cache
from pathlib import Path
from string import Template

import meshcat

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="$policy">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
body { margin: 0; background: #f4f6f9; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
#caption {
  position: absolute; left: 16px; bottom: 14px; max-width: 60vw; padding: 6px 12px;
  border-radius: 6px; background: rgba(255, 255, 255, 0.75); color: #26323f;
  font: 14px/1.45 system-ui, sans-serif; pointer-events: none;
}
#caption strong { display: block; font-weight: 600; }
#caption .error { color: #a31515; }
#layers {
  position: absolute; left: 16px; top: 14px; max-width: 300px; padding: 6px 12px; display: none;
  border-radius: 6px; background: rgba(255, 255, 255, 0.75); color: #26323f;
  font: 12px/1.45 system-ui, sans-serif;
}
#layers label { display: flex; align-items: baseline; gap: 7px; }
#layers input { margin: 0; align-self: center; }
#layers .swatch { flex: none; width: 10px; height: 10px; border-radius: 2px; }
#layers .bar {
  display: flex; gap: 6px; align-items: center; margin: 0 0 3px 24px; font-size: 12px;
}
#layers .bar[hidden] { display: none; }
#layers .bar i { width: 110px; height: 8px; border-radius: 2px; }
@media (max-width: 700px) {
  #layers { max-width: 34vw; font-size: 10px; }
  #layers .bar { margin-left: 0; font-size: 9px; }
  #layers .bar i { width: 60px; }
}
.picture #layers input, .picture #layers .off { display: none; }
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="layers"></div>
<div id="caption"><strong>$title</strong><span id="note">$note</span></div>
<script>
// Whatever goes wrong is said on the page too: an empty page explains nothing.
window.addEventListener("error", (event) => {
  const note = document.getElementById("note");
  note.className = "error";
  note.textContent = "The picture cannot be shown (it needs WebGL): " + event.message;
});
</script>
$scripts
</body>
</html>
""")

# The key of the layers, with a tick for each: drawn anew whenever it comes (see `legend`).
WATCH_LAYERS = """\
function drawLayers(viewer, layers) {
  const panel = document.getElementById("layers");
  const piece = (parent, kind, name = "", text = "") => {
    const made = document.createElement(kind);
    made.className = name;
    made.textContent = text;
    parent.append(made);
    return made;
  };
  panel.replaceChildren();
  panel.style.display = layers.length ? "block" : "none";
  for (const layer of layers) {
    const entry = piece(panel, "div", layer.visible ? "" : "off");
    const label = piece(entry, "label");
    const tick = piece(label, "input");
    tick.type = "checkbox";
    tick.name = layer.name;
    tick.checked = layer.visible;
    piece(label, "span", "swatch").style.background = layer.colour;
    piece(label, "span", "", layer.text);
    const bar = piece(entry, "div", "bar");
    if (layer.colours) {
      piece(bar, "span", "", layer.low);
      piece(bar, "i").style.background = `linear-gradient(90deg, ${layer.colours.join(", ")})`;
      piece(bar, "span", "", layer.high);
    }
    bar.hidden = !layer.visible;
    tick.onchange = () => {
      viewer.set_property(["world", "layers", layer.name], "visible", tick.checked);
      viewer.set_dirty();
      entry.className = tick.checked ? "" : "off";
      bar.hidden = !tick.checked;
    };
  }
}
function watchLayers(viewer) {
  const set = viewer.set_property.bind(viewer);
  viewer.set_property = (path, property, value) => {
    set(path, property, value);
    if (property === "userData" && path.join("/") === "world") {
      drawLayers(viewer, value.layers);
    }
  };
}
"""


def page(*, title: str, note: str, policy: str, scripts: str) -> str:
    """Return a page that fills the browser's window with Meshcat's pane ``meshcat-pane``.

    Parameters
    ----------
    title
        Plain text, for the browser's tab and the caption; escaped here.
    note
        Plain text for the caption's second line (the element ``note``); escaped here.
    policy
        Content-Security-Policy: what the page may load at all.
    scripts
        The ``<script>`` elements, as HTML.
    """
    return _PAGE.substitute(
        title=html.escape(title),
        note=html.escape(note),
        policy=html.escape(policy),
        scripts=scripts,
    )


def inline_script(source: str, attributes: str = "") -> str:
    """Return a ``<script>`` element that holds `source`.

    Whatever would end the element early, or make the browser's parser read on past its end, is
    broken up with a backslash, which changes nothing inside JavaScript's strings and patterns.
    (JSON knows no such backslash: data must come without ``<``.)
    """
    for opening in ("</script", "<!--"):
        source = _break_up(source, opening)
    return f"<script{attributes}>\n{source}\n</script>"


def _break_up(source: str, opening: str) -> str:
    """Put a backslash after the ``<`` of every `opening`, in whatever case it is written."""
    pieces: list[str] = []
    start = 0
    lowered = source.lower()
    while (found := lowered.find(opening, start)) >= 0:
        pieces += [source[start : found + 1], "\\"]
        start = found + 1
    return "".join([*pieces, source[start:]])


@cache
def viewer_library() -> str:
    """Return the source of Meshcat's browser part, as it came with the meshcat package."""
    return _distributed("main.min.js")


@cache
def licences() -> str:
    """Return the licences of all that `viewer_library` contains, as a JSON text.

    They ask that a copy carries them, and a page with the library inside is a copy.
    """
    own = Path(meshcat.viewer_assets_path(), "LICENSE").read_text(encoding="utf-8")
    others = json.loads(_distributed("main.min.js.THIRD_PARTY_LICENSES.json"))
    return json.dumps([{"name": "meshcat", "licenseText": own}, *others]).replace("<", "\\u003c")


def _distributed(name: str) -> str:
    return Path(meshcat.viewer_assets_path(), "dist", name).read_text(encoding="utf-8")
