"""Colours that mean something: scales told apart by colour-blind readers too."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_hex
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.viewer.layers.base import Colour
from rps_pin.viewer.scene.legend import ColourBar

#: From safe to refused: blue, yellow, vermillion (Okabe and Ito's).
WARNING = LinearSegmentedColormap.from_list("warning", ["#0072B2", "#F0E442", "#D55E00"], N=4096)
#: For fields over a surface.
FIELD = colormaps["viridis"]
_STOPS = 7


def warning(share: float) -> Colour:
    """Return the colour of a share of what is allowed: 0 safe, 1 (and more) at the limit."""
    red, green, blue, _ = WARNING(float(np.clip(share, 0.0, 1.0)))
    return float(red), float(green), float(blue)


def warning_bar(low: str, high: str) -> ColourBar:
    """Return the key to `warning`."""
    return _bar(WARNING, low, high)


def field_colours(share: ArrayLike) -> Array:
    """Return colours (n, 3) of a field's values, 0 lowest and 1 highest."""
    return np.asarray(FIELD(np.asarray(share)))[:, :3]


def field_bar(low: str, high: str) -> ColourBar:
    """Return the key to `field_colours`."""
    return _bar(FIELD, low, high)


def _bar(colours: Colormap, low: str, high: str) -> ColourBar:
    stops = tuple(to_hex(colours(share)) for share in np.linspace(0.0, 1.0, _STOPS))
    return ColourBar(stops, low, high)
