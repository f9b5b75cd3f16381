"""Figures of a motion, like the paper's 7, 8 and 9, in colours that all readers can tell apart.

Each function draws on a given figure, or makes one. No window is opened.
"""

from __future__ import annotations

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rps_pin.arrays import Array
from rps_pin.plots import style
from rps_pin.rps.dynamics.motion_run import MotionRun

_LEGS = ("leg 1", "leg 2", "leg 3")


def plot_path(run: MotionRun, figure: Figure | None = None) -> Figure:
    """Draw the path of the platform's centre in space, as the paper's Fig. 7 does.

    x and y are in millimetres; z is in millimetres above its lowest value, which the label says.
    """
    with matplotlib.rc_context(style.STYLE):
        axes = style.axes_in_space(figure, (5.6, 5.0))
        x, y, z = 1e3 * run.position.T
        base = float(z.min())
        axes.plot(x, y, z - base, color=style.BLUE)
        axes.scatter(x[:1], y[:1], z[:1] - base, color="black", s=25, label="start")
        axes.scatter(x[-1:], y[-1:], z[-1:] - base, color="black", marker="s", s=25, label="end")
        axes.set(xlabel="$p_x$ (mm)", ylabel="$p_y$ (mm)", title="Path of the platform's centre")
        axes.set_zlabel(f"$p_z$ above {base:.6g} mm (mm)")
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_major_locator(MaxNLocator(5))
        axes.set_box_aspect(None, zoom=0.88)
        axes.legend(loc="upper left")
    return style.figure_of(axes)


def plot_lengths(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the leg lengths over time in millimetres, as the paper's Fig. 8 does."""
    return _over_time(run.time, 1e3 * run.length, "length $d_i$ (mm)", "Leg lengths", axes)


def plot_forces(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the actuator forces over time in newtons, as the paper's Fig. 9 does."""
    return _over_time(run.time, run.force, "force $F_i$ (N)", "Actuator forces", axes)


def plot_length_phase(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw each leg's speed over its length: mm/s over mm. Crosses mark the start."""
    with matplotlib.rc_context(style.STYLE):
        axes = style.new_axes(axes, (5.6, 4.2))
        length, speed = 1e3 * run.length, 1e3 * run.speed
        style.plot_legs(axes, length, speed, _LEGS)
        style.plot_legs(axes, length[:1], speed[:1], [""] * 3, marker="x", linestyle="")
        axes.axhline(0.0, color="black", linewidth=0.6)
        axes.set(xlabel="length $d_i$ (mm)", ylabel="speed $\\dot d_i$ (mm/s), positive is out")
        style.legend_above(axes, columns=3)
    return style.figure_of(axes)


def _over_time(time: Array, values: Array, label: str, title: str, axes: Axes | None) -> Figure:
    with matplotlib.rc_context(style.STYLE):
        axes = style.new_axes(axes, (6.4, 3.8))
        style.plot_legs(axes, time, values, _LEGS)
        axes.set(xlabel="time (s)", ylabel=label)
        axes.set_title(title, loc="left")
        axes.margins(x=0)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)
    return style.figure_of(axes)
