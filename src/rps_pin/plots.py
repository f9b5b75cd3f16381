"""Figures of a motion, like the paper's 7, 8 and 9: axes with units, colours told apart by all.

Each function draws on a figure of your own, or makes one. Nothing here opens a window.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.typing import NDArray

from rps_pin.files import whole_file
from rps_pin.rps.motion_run import MotionRun

#: Okabe and Ito's colours for legs 1, 2, 3, told apart by colour-blind readers; and line styles,
#: so that print without colour will do.
LEG_COLOURS = ("#0072B2", "#D55E00", "#009E73")
_LEG_STYLES = ("-", "--", "-.")

#: Of all figures.
STYLE: Any = {
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 150,
    "svg.hashsalt": "rps_pin",  # the same run writes the same SVG
}


def plot_path(run: MotionRun, figure: Figure | None = None) -> Figure:
    """Draw the path of the platform's centre in space, as the paper's Fig. 7 does.

    x and y are in millimetres; z is in millimetres above its lowest value, which the label says.
    """
    with matplotlib.rc_context(STYLE):
        figure = figure or Figure(figsize=(5.6, 5.0), layout="constrained")
        axes = figure.add_subplot(projection="3d")
        assert isinstance(axes, Axes3D)  # what the projection "3d" makes
        x, y, z = 1e3 * run.position.T
        base = float(z.min())
        axes.plot(x, y, z - base, color=LEG_COLOURS[0])
        axes.scatter(x[:1], y[:1], z[:1] - base, color="black", s=25, label="start")
        axes.scatter(x[-1:], y[-1:], z[-1:] - base, color="black", marker="s", s=25, label="end")
        axes.set_xlabel("$p_x$ (mm)")
        axes.set_ylabel("$p_y$ (mm)")
        axes.set_zlabel(f"$p_z$ above {base:.6g} mm (mm)")
        axes.set_title("Path of the platform's centre")
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_major_locator(MaxNLocator(5))
        axes.set_box_aspect(None, zoom=0.88)
        axes.legend(loc="upper left")
    return figure


def plot_lengths(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the leg lengths over time in millimetres, as the paper's Fig. 8 does."""
    return _over_time(run.time, 1e3 * run.length, "length $d_i$ (mm)", "Leg lengths", axes)


def plot_forces(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the actuator forces over time in newtons, as the paper's Fig. 9 does."""
    return _over_time(run.time, run.force, "force $F_i$ (N)", "Actuator forces", axes)


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG, each whole or not at all; return the two paths."""
    written = []
    for suffix, metadata in ((".png", {}), (".svg", {"Date": None})):
        path = folder / f"{name}{suffix}"
        with matplotlib.rc_context(STYLE), whole_file(path) as scratch:
            figure.savefig(scratch, metadata=metadata)
        written.append(path)
    return written


def _over_time(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    label: str,
    title: str,
    axes: Axes | None,
) -> Figure:
    with matplotlib.rc_context(STYLE):
        if axes is None:
            axes = Figure(figsize=(6.4, 3.8), layout="constrained").add_subplot()
        legs: Sequence[tuple[str, str]] = list(zip(LEG_COLOURS, _LEG_STYLES, strict=True))
        for leg, (colour, style) in enumerate(legs):
            axes.plot(time, values[:, leg], color=colour, linestyle=style, label=f"leg {leg + 1}")
        axes.set_xlabel("time (s)")
        axes.set_ylabel(label)
        axes.set_title(title, loc="left")
        axes.margins(x=0)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)
        figure = axes.get_figure(root=True)
        assert figure is not None  # axes of a figure have one
    return figure
