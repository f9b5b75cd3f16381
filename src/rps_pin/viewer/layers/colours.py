"""Colours of the layers: one for each, and scales; colour-blind readers can tell them apart."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_hex

from rps_pin.viewer.layers.base import Colour
from rps_pin.viewer.scene.legend import ColourBar

# The palette of Okabe and Ito.
ORANGE, SKY, GREEN, YELLOW = 0xE69F00, 0x56B4E9, 0x009E73, 0xF0E442
BLUE, VERMILLION, PURPLE = 0x0072B2, 0xD55E00, 0xCC79A7

#: Of arrows: they differ from the legs of a 3-RPS (`BLUE`, `VERMILLION`, `GREEN`) and from each
#: other for the three kinds of colour-blind readers too.
GOLD, BLACK = 0xFFC20A, 0x222222

_STOPS = 7


def css(colour: int) -> str:
    """Return a colour as ``#rrggbb``."""
    return f"#{colour:06x}"


#: From safe to refused.
WARNING = LinearSegmentedColormap.from_list(
    "warning", [css(BLUE), css(YELLOW), css(VERMILLION)], N=4096
)
#: For fields over a surface.
FIELD = colormaps["viridis"]


def warning(share: float) -> Colour:
    """Return the colour of a share of what is allowed: 0 safe, 1 (and more) at the limit."""
    red, green, blue, _ = WARNING(float(np.clip(share, 0.0, 1.0)))
    return float(red), float(green), float(blue)


def colour_bar(colours: Colormap, low: str, high: str) -> ColourBar:
    """Return a bar of colours for the legend, with the texts at its ends."""
    stops = tuple(to_hex(colours(share)) for share in np.linspace(0.0, 1.0, _STOPS))
    return ColourBar(stops, low, high)
