"""Maps of stiffness and frequencies over two coordinates of a task."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.plots.style import COLOUR_MAP, figure_of, new_axes, styled
from rps_pin.task.stiffness import StiffnessMap
from rps_pin.validation import choice

#: Of the least stiffness, by its unit: factor, and label.
_SCALE = {"N/m": 1e-6}
_LABEL = {
    "N/m": "least stiffness (N/µm)",
    "N m/rad": "least stiffness (N m/rad)",
    "of mixed units": "least stiffness (mixed units)",
}
#: Height of a new figure, inches.
_HEIGHT = 2.6


@styled
def plot_stiffness_map(
    found: StiffnessMap,
    what: Literal["stiffness", "frequency"] = "stiffness",
    axes: Axes | None = None,
) -> Figure:
    """Draw a map over two coordinates: the least stiffness against a force, or the frequency.

    Parameters
    ----------
    found
        Over poses of shape (n, k, m) that are a grid: one coordinate changes along the first axis,
        another along the second.
    what
        ``"stiffness"``: `StiffnessMap.softest`; ``"frequency"``: the lowest.
    axes
        To draw on; default: those of a new figure.

    Raises
    ------
    InputError
        If the poses are no such grid, or nothing is reached.
    """
    choice(what, "what", ("stiffness", "frequency"))
    i, j = _varying(found)
    if not found.reached.any():
        raise InputError("no pose of the map has an equilibrium")
    angular = found.angular[i], found.angular[j]
    scales = [(180 / np.pi, "°") if turns else (1e3, "mm") for turns in angular]
    first, second = scales[0][0] * found.x[:, 0, i], scales[1][0] * found.x[0, :, j]
    by_what: dict[str, tuple[Array, str]] = {
        "stiffness": (_SCALE.get(found.unit, 1.0) * found.softest, _LABEL[found.unit]),
        "frequency": (found.frequencies[..., 0], "lowest frequency (Hz)"),
    }
    values, label = by_what[what]
    axes = new_axes(axes, _HEIGHT)
    shown = np.ma.masked_invalid(values.T)
    drawn = axes.pcolormesh(first, second, shown, cmap=COLOUR_MAP, shading="nearest")
    axes.grid(visible=False)
    axes.set(
        xlabel=f"{found.coordinates[i]} ({scales[0][1]})",
        ylabel=f"{found.coordinates[j]} ({scales[1][1]})",
    )
    if angular[0] == angular[1]:
        axes.set_aspect("equal", adjustable="box")
    figure = figure_of(axes)
    figure.colorbar(drawn, ax=axes, label=label, shrink=0.9)
    return figure


def _varying(found: StiffnessMap) -> tuple[int, int]:
    """Return the coordinates that change along the first and the second axis of a grid."""
    shape = found.x.shape
    if found.x.ndim == 3 and min(shape[:2]) > 1:
        along = [
            [k for k in range(shape[-1]) if np.ptp(found.x[..., k], axis=axis).any()]
            for axis in (0, 1)
        ]
        if len(along[0]) == len(along[1]) == 1 and along[0] != along[1]:
            return along[0][0], along[1][0]
    raise InputError(
        f"the poses of the map have shape {shape}; a map is drawn over a grid of shape (n, k, "
        f"{shape[-1]}) in which one coordinate changes along each axis"
    )
