"""Assembly modes of a 3-RPS, drawn as robots: the paper's Fig. 2. No window is opened."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.plots import style
from rps_pin.plots.space import axes_in_space
from rps_pin.plots.style import GREY, LEG_COLOURS, PAGE, figure_of, styled
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.parameters import RPSParameters

_COLUMNS = 4


@styled
def plot_assembly_modes(
    parameters: RPSParameters, modes: AssemblyModes, figure: Figure | None = None
) -> Figure:
    """Draw each assembly mode as a robot: base, legs and platform, as the paper's Fig. 2 does.

    All are drawn from one side, in one scale, which the line below them gives.

    Parameters
    ----------
    parameters
        The robot.
    modes
        Solutions for one triple of leg lengths: `angle` (k, 3), `position` (k, 3) and `rotation`
        (k, 3, 3) are used.
    figure
        To draw on; default: a new one.

    Raises
    ------
    InputError
        If there is no mode to draw.
    """
    count = len(modes.angle)
    if count == 0:
        raise InputError("there is no assembly mode to draw")
    base = 1e3 * parameters.base_radius * RADIAL
    arms = parameters.platform_radius * RADIAL
    tips = 1e3 * (modes.position[:, None, :] + arms @ np.swapaxes(modes.rotation, -1, -2))
    ends = [np.concatenate([base, one]) for one in tips]
    span = np.max([np.ptp(one, axis=0) for one in ends], axis=0)
    columns = min(_COLUMNS, count)
    rows = -(-count // columns)
    figure = figure or Figure(figsize=(PAGE * max(3, columns) / _COLUMNS, 0.3 + 2.0 * rows))
    figure.subplots_adjust(left=0.02, right=1.02, bottom=0.06, top=0.93, wspace=0, hspace=0.15)
    for k in range(count):
        axes = axes_in_space(figure, place=(rows, columns, k + 1))
        _draw_robot(axes, base, tips[k])
        degrees = ", ".join(f"{angle:.0f}" for angle in np.rad2deg(modes.angle[k]))
        minus = degrees.replace("-", "\N{MINUS SIGN}")
        axes.set_title(f"{k + 1}: $\\phi_i$ = {minus}°")
        middle = (ends[k].min(axis=0) + ends[k].max(axis=0)) / 2
        low, high = middle - span / 2, middle + span / 2
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(tuple(span), zoom=1.1)
        axes.view_init(elev=18, azim=-65)
        axes.set_axis_off()
    radius = 1e3 * parameters.base_radius
    figure.supxlabel(
        f"base (grey): radius {radius:.4g} mm, height 0; platform orange; equal scales"
    )
    return figure_of(axes)


def _draw_robot(axes: Axes3D, base: Array, tips: Array) -> None:
    axes.add_collection3d(Poly3DCollection([base], facecolor=(*to_rgba(GREY)[:3], 0.25)))
    axes.add_collection3d(Poly3DCollection([tips], facecolor=(*to_rgba(style.ORANGE)[:3], 0.5)))
    for leg, colour in enumerate(LEG_COLOURS):
        axes.plot(*np.stack([base[leg], tips[leg]], axis=1), color=colour, lw=1.6)
        axes.scatter(*tips[leg][:, None], color=colour, s=12)
