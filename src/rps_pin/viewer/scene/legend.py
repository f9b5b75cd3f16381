"""Legend of the layers: an entry for each, with its scale and the meaning of its colours."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ColourBar:
    """Colours from the lowest value to the highest, and what these are."""

    colours: tuple[str, ...]
    """As ``#rrggbb``, evenly spaced."""
    low: str
    """Plain text at the first colour."""
    high: str
    """Plain text at the last."""


@dataclass(frozen=True)
class LegendEntry:
    """One line of the legend."""

    name: str
    """The layer's name: its node below ``/world/layers``."""
    text: str
    """What it shows, with its scale: plain text."""
    colour: str = "#888888"
    """``#rrggbb``, of the swatch."""
    bar: ColourBar | None = None
    """For layers whose colours are a scale."""
    at: tuple[float, float, float] | None = None
    """Point of the world, m, beside which the layer's reading stands; None: in the legend only."""
