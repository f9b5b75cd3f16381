"""The key of the layers, as the page shows it: what each is, and in what scale.

The key travels as the ``userData`` of the world's node, a place that three.js leaves to its users:
our pages draw it, and Meshcat's own take no notice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rps_pin.viewer.scene.stage import WORLD
from rps_pin.viewer.server.window import RawCommand


@dataclass(frozen=True)
class ColourBar:
    """Colours from one end to the other, and what the ends mean."""

    colours: tuple[str, ...]
    """As ``#rrggbb``, evenly spaced."""
    low: str
    """Plain text at the first colour."""
    high: str
    """Plain text at the last."""


@dataclass(frozen=True)
class Key:
    """One line of the key."""

    name: str
    """The layer's name: its node below ``/world/layers``."""
    text: str
    """What it shows, with its scale: plain text."""
    colour: str = "#888888"
    """``#rrggbb``, of the swatch."""
    bar: ColourBar | None = field(default=None)
    """Where colours mean something."""


def legend_command(keys: Sequence[Key], visible: Sequence[bool]) -> RawCommand:
    """Return the command that puts the key on the page."""
    entries = [
        {
            "name": key.name,
            "text": key.text,
            "colour": key.colour,
            "visible": shown,
            **(
                {"colours": list(key.bar.colours), "low": key.bar.low, "high": key.bar.high}
                if key.bar
                else {}
            ),
        }
        for key, shown in zip(keys, visible, strict=True)
    ]
    return RawCommand(
        {
            "type": "set_property",
            "path": WORLD,
            "property": "userData",
            "value": {"layers": entries},
        }
    )
