"""Figures of a motion, like the paper's 7, 8 and 9, in colours that all readers can tell apart.

Each function draws on a given figure or axes, or makes one. No window is opened.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.plots import style
from rps_pin.plots.curves import draw_limits, legend_above, plot_curves, with_jumps
from rps_pin.plots.space import POSITION, axes_in_space, finish_space, frame_space
from rps_pin.rps.dynamics.motion_run import MotionRun

_LEGS = ("leg 1", "leg 2", "leg 3")
_HEIGHT = 2.2
#: Shares of the largest coordinate: motions that are none, sides of a box about them, and the least
#: side of others.
_NO_MOTION, _BOX_OF_REST, _LEAST_BOX = 1e-9, 1e-2, 1e-5
#: Share of a path's size within which its ends are one point.
_SAME_POINT = 1e-3


@style.styled
def plot_path(run: MotionRun, figure: Figure | None = None) -> Figure:
    """Draw the path of the platform's centre in space, as the paper's Fig. 7 does.

    x and y are in millimetres; z is in millimetres above its lowest value, which the label says.
    """
    axes = axes_in_space(figure)
    points = 1e3 * run.position
    base = float(points[:, 2].min())
    points = points - [0.0, 0.0, base]
    x, y, z = points.T
    axes.plot(x, y, z, color=style.BLUE)
    largest, size = 1e3 * float(np.abs(run.position).max()), float(np.ptp(points, axis=0).max())
    rests = size <= _NO_MOTION * largest
    returns = float(np.abs(points[-1] - points[0]).max()) <= _SAME_POINT * size
    first = "at rest" if rests else "start and end" if returns else "start"
    dot = {"depthshade": False, "s": 16, "zorder": 5}
    axes.scatter(x[:1], y[:1], z[:1], color="black", label=first, **dot)
    if not (rests or returns):
        axes.scatter(x[-1:], y[-1:], z[-1:], color=style.VERMILION, marker="s", label="end", **dot)
    up = f"$p_z - {base:.6g}$ (mm)"
    ends_of_box = points.min(axis=0), points.max(axis=0)
    least = (_BOX_OF_REST if rests else _LEAST_BOX) * largest
    scales = frame_space(axes, *ends_of_box, (*POSITION[:2], up), least=least)
    return finish_space(axes, figure, scales)


@style.styled
def plot_lengths(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the leg lengths over time in millimetres, as the paper's Fig. 8 does; and limits."""
    axes = style.new_axes(axes, _HEIGHT)
    plot_curves(axes, run.time, 1e3 * run.length, _LEGS)
    low, high = (0.0, math.inf) if run.parameters is None else run.parameters.leg_length_limits
    draw_limits(axes, 1e3 * run.length, 1e3 * low if low > 0 else -math.inf, 1e3 * high, "mm")
    return _over_time(axes, "length $d_i$ (mm)")


@style.styled
def plot_forces(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw the actuator forces over time in newtons, as the paper's Fig. 9 does; and limits.

    Forces jump where accelerations do: between two samples, which an upright line joins.
    """
    axes = style.new_axes(axes, _HEIGHT)
    time, force = with_jumps(run.time, run.force)
    plot_curves(axes, time, force, _LEGS)
    limit = math.inf if run.parameters is None else run.parameters.actuator_force_limit
    draw_limits(axes, force, -limit, limit, "N")
    return _over_time(axes, "force $F_i$ (N)")


@style.styled
def plot_length_phase(run: MotionRun, axes: Axes | None = None) -> Figure:
    """Draw each leg's speed over its length: mm/s over mm; and limits. Crosses mark the start."""
    axes = style.new_axes(axes, 2.6)
    length, speed = 1e3 * run.length, 1e3 * run.speed
    axes.axhline(0.0, color="black", linewidth=0.6)
    plot_curves(axes, length, speed, _LEGS)
    for leg, colour in enumerate(style.LEG_COLOURS):
        axes.plot(length[:1, leg], speed[:1, leg], "x", color=colour)
    limit = math.inf if run.parameters is None else 1e3 * run.parameters.actuator_speed_limit
    draw_limits(axes, speed, -limit, limit, "mm/s")
    axes.set(xlabel="length $d_i$ (mm)", ylabel="speed $\\dot d_i$ (mm/s)")
    legend_above(axes)
    return style.figure_of(axes)


def _over_time(axes: Axes, label: str) -> Figure:
    axes.set(xlabel="time (s)", ylabel=label)
    axes.margins(x=0)
    axes.ticklabel_format(axis="y", useOffset=False)
    legend_above(axes)
    return style.figure_of(axes)
