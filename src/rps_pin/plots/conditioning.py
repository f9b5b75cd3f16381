"""Maps of singularity measures over poses."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.plots.curves import legend_above
from rps_pin.plots.style import COLOUR_MAP, figure_of, new_axes, styled
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.validation import choice, finite_number, real_array

Measure = Literal["type_ii", "constraint", "determinant"]
_LABELS = {
    "type_ii": "distance to type II (0 singular, 1 best)",
    "constraint": "distance to constraint (0 singular, 1 best)",
    "determinant": "determinant (0 singular)",
}


@styled
def plot_tilt_conditioning(
    parameters: RPSParameters,
    height: float,
    tilts: ArrayLike | None = None,
    *,
    measure: Measure = "type_ii",
    axes: Axes | None = None,
) -> Figure:
    """Draw how far all tilts at one height are from a singularity; a black line where they are.

    Parameters
    ----------
    parameters
        The robot's. Its limits are not looked at: see `plot_reasons` for those.
    height
        Of the centre, m.
    tilts
        About x and about y, increasing, shape (n,), rad; 161 from -1.5 to 1.5 if left out.
    measure
        Of `SingularityMeasures`.
    axes
        Axes to draw on; a new figure's if left out. A colour bar is added beside them.

    Raises
    ------
    InputError
        If there is no such measure, or tilts are not increasing.
    """
    across = _increasing(np.linspace(-1.5, 1.5, 161) if tilts is None else tilts, "tilts")
    x, y = np.meshgrid(across, across)
    pose = np.stack([np.full_like(x, finite_number(height, "height", "m")), x, y], axis=-1)
    axes = new_axes(axes, 2.9)
    _map(axes, parameters, pose, (np.degrees(x), np.degrees(y)), measure)
    axes.set(xlabel=f"tilt about x (degrees), at $p_z$ = {1e3 * height:.6g} mm", aspect="equal")
    axes.set_ylabel("tilt about y (degrees)")
    return figure_of(axes)


@styled
def plot_height_conditioning(
    parameters: RPSParameters,
    heights: ArrayLike,
    tilts: ArrayLike | None = None,
    *,
    direction: float = 0.0,
    measure: Measure = "type_ii",
    axes: Axes | None = None,
) -> Figure:
    """Draw how far poses are from a singularity over height and tilt about one axis.

    Parameters
    ----------
    parameters
        The robot's.
    heights
        Of the centre, increasing, shape (n,), m.
    tilts
        About the axis, increasing, shape (m,), rad; 161 from -1.5 to 1.5 if left out.
    direction
        Of the axis in the base plane, rad from x.
    measure, axes
        As for `plot_tilt_conditioning`.

    Raises
    ------
    InputError
        If there is no such measure, or heights or tilts are not increasing.
    """
    across = _increasing(np.linspace(-1.5, 1.5, 161) if tilts is None else tilts, "tilts")
    up = _increasing(heights, "heights")
    angle = finite_number(direction, "direction", "rad")
    tilt, z = np.meshgrid(across, up)
    pose = np.stack([z, tilt * np.cos(angle), tilt * np.sin(angle)], axis=-1)
    axes = new_axes(axes, 2.7)
    _map(axes, parameters, pose, (np.degrees(tilt), 1e3 * z), measure)
    about = f" about the axis {np.degrees(angle):.4g}° from x" if angle else " about x"
    axes.set(xlabel=f"tilt{about} (degrees)", ylabel="height $p_z$ (mm)")
    return figure_of(axes)


def _map(
    axes: Axes, parameters: RPSParameters, pose: Array, at: tuple[Array, Array], measure: str
) -> None:
    choice(measure, "measure", tuple(_LABELS))
    found = singularity_measures(parameters, pose, errors="mask")
    values = getattr(found, measure)
    levels: Any = 20
    if measure == "determinant":  # both signs are equally far from 0
        levels = np.linspace(-1.0, 1.0, 21) * np.abs(values).max()
    filled = axes.contourf(*at, values, levels, cmap=COLOUR_MAP)
    if found.determinant.min() < 0.0 < found.determinant.max():
        axes.contour(*at, found.determinant, [0.0], colors="black", linewidths=1.2)
        axes.plot([], [], color="black", label="singular")
        legend_above(axes)
    axes.grid(visible=False)
    figure_of(axes).colorbar(
        filled, ax=axes, label=_LABELS[measure], aspect=30, ticks=MaxNLocator(6)
    )


def _increasing(values: ArrayLike, name: str) -> Array:
    found = real_array(values, name)
    if found.ndim != 1 or found.size < 2 or not (np.diff(found) > 0.0).all():
        raise InputError(f"{name} has shape {found.shape}: it must be two numbers or more, rising")
    return found
