"""Colours that readers of all kinds of sight tell apart; every public figure has units."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from rps_pin.plots import COLOURS, LEG_COLOURS, LEG_STYLES

#: Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
SIGHT = {
    "full": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, sight: str) -> np.ndarray:
    """Return CIE L*a*b* of a colour as someone sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(SIGHT[sight] @ linear, 0.0, 1.0)
    x, y, z = (TO_XYZ @ seen) / np.array([0.9505, 1.0, 1.089])
    f = [v ** (1 / 3) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x, y, z)]
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


#: A difference in L*a*b* that is just noticed, side by side; lines in a figure need several.
NOTICED = 2.3


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_are_told_apart(sight: str) -> None:
    apart = [
        float(np.linalg.norm(lab(a, sight) - lab(b, sight)))
        for a, b in itertools.combinations({*COLOURS, *LEG_COLOURS}, 2)
    ]
    assert min(apart) > 6 * NOTICED


def test_a_red_and_a_green_would_not_do() -> None:
    red, green = "#b35900", "#6b8000"
    assert np.linalg.norm(lab(red, "full") - lab(green, "full")) > 6 * NOTICED
    assert np.linalg.norm(lab(red, "deuteranopia") - lab(green, "deuteranopia")) < 6 * NOTICED


def test_lines_are_told_apart_in_grey() -> None:
    assert len(set(LEG_STYLES)) == len(LEG_STYLES) == len(LEG_COLOURS)
