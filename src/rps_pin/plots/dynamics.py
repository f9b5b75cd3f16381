"""Figures of actuator forces: by cause, and over speeds.

Each function draws on given axes, or makes a figure. No window is opened.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from rps_pin.errors import InputError
from rps_pin.plots.curves import (
    draw_limits,
    legend_above,
    names_for_figure,
    plot_curves,
    with_jumps,
)
from rps_pin.plots.style import figure_of, new_axes, styled, three_axes
from rps_pin.rps.dynamics.force_causes import ForceCauses
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.validation import real_array

#: Okabe and Ito's colours for the causes, told apart by colour-blind readers; and hatches, so that
#: print without colour will do.
_CAUSES = {
    "gravity": ("#0072B2", ""),
    "inertia": ("#E69F00", "//"),
    "coriolis": ("#009E73", "\\\\"),
    "friction": ("#CC79A7", "xx"),
    "payload": ("#56B4E9", ".."),
    "external": ("#F0E442", "--"),
}
_LABELS = {"coriolis": "Coriolis"}
#: Share of the largest part that can be seen.
_VISIBLE = 5e-3
#: Limits are drawn if the motion comes up to this share of them; else they are named.
_NEAR = 0.15


@styled
def plot_force_causes(
    time: ArrayLike,
    causes: ForceCauses,
    axes: Sequence[Axes] | None = None,
    *,
    limit: float = math.inf,
) -> Figure:
    """Draw the actuator forces over time as stacks of their causes, a panel for each actuator.

    Positive parts stand on zero, negative ones hang from it; the black line is the force, their
    sum. Causes that are less than 0.5 % of the largest are left out. Jumps are upright.

    Parameters
    ----------
    time
        Increasing, shape (n,), s.
    causes
        Of n samples.
    axes
        Three axes to draw on; default: those of a new figure.
    limit
        Of the forces' magnitudes, N; drawn if they come near.

    Raises
    ------
    InputError
        If the shapes do not fit, or there are not three axes.
    """
    times = real_array(time, "time")
    total = causes.total
    if times.ndim != 1 or total.shape != (times.size, 3):
        raise InputError(
            f"time has shape {times.shape} and the causes {total.shape}; they must be (n,) and "
            "(n, 3)"
        )
    axes = three_axes(axes, 4.6)
    least = _VISIBLE * max(float(np.abs(part).max()) for part in causes.parts().values())
    shown = {name: part for name, part in causes.parts().items() if np.abs(part).max() > least}
    times, total, *parts = with_jumps(times, total, *shown.values())
    shown = dict(zip(shown, parts, strict=True))
    for leg, own in enumerate(axes):
        _stacks(own, times, {name: part[:, leg] for name, part in shown.items()})
        own.plot(times, total[:, leg], color="black", label="sum")
        own.axhline(0.0, color="black", linewidth=0.6)
        draw_limits(own, total[:, leg], -limit, limit, "N")
        own.set_ylabel(f"force $F_{leg + 1}$ (N)")
        own.margins(x=0)
    axes[-1].set_xlabel("time (s)")
    legend_above(axes[0])
    return figure_of(axes[0])


@styled
def plot_sizing(sheet: SizingSheet, axes: Axes | None = None) -> Figure:
    """Draw each actuator's force over its speed, and the box of the limits.

    A motion that keeps the limits stays within the box; the dotted curves are the limit of power.
    A limit that there is not is not drawn. Crosses mark the peak forces.
    """
    axes = new_axes(axes, 3.0)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.axvline(0.0, color="black", linewidth=0.6)
    named = [one.name for one in sheet.actuators if one.name]
    labels = names_for_figure(named) or [f"actuator {one.actuator}" for one in sheet.actuators]
    plot_curves(axes, sheet.speed, sheet.force, labels)
    for line in axes.get_lines()[2:]:
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        most = int(np.abs(y).argmax())
        axes.plot(x[most], y[most], "x", color=line.get_color())
    turning = {one.angular for one in sheet.actuators}
    units = ("rad/s", "N m") if turning == {True} else ("m/s", "N")
    limits = [sheet.limits_of(k) for k in range(len(sheet.actuators))]
    if all((one.force, one.speed) == (limits[0].force, limits[0].speed) for one in limits):
        _limit_box(axes, sheet, units)
    of_slides, of_turns = ("speed (m/s)", "force (N)"), ("speed (rad/s)", "torque (N m)")
    both = ("speed (m/s or rad/s)", "force (N or N m)")
    words = both if len(turning) > 1 else of_turns if turning == {True} else of_slides
    if not named:
        words = ("speed $\\dot d_i$ (m/s), positive is out", "force $F_i$ (N), positive pushes out")
    speed = words[0].replace("rad", sheet.actuators[0].angle_unit)
    axes.set(xlabel=speed, ylabel=words[1])
    legend_above(axes)
    return figure_of(axes)


def _stacks(axes: Axes, time: np.ndarray, parts: dict[str, np.ndarray]) -> None:
    above, below = np.zeros_like(time), np.zeros_like(time)
    for name, part in parts.items():
        colour, hatch = _CAUSES[name]
        upper, lower = above + np.maximum(part, 0.0), below + np.minimum(part, 0.0)
        look: Any = {"facecolor": colour, "edgecolor": "white", "linewidth": 0.0, "hatch": hatch}
        axes.fill_between(time, above, upper, label=_LABELS.get(name, name), **look)
        axes.fill_between(time, below, lower, **look)
        above, below = upper, lower


def _limit_box(axes: Axes, sheet: SizingSheet, units: tuple[str, str]) -> None:
    """Draw what limits there are: a box, or two lines where one side is open or far away."""
    limits = sheet.limits_of(0)
    drawn, far = [], []
    for limit, values, unit in zip(
        (limits.speed, limits.force), (sheet.speed, sheet.force), units, strict=True
    ):
        near = float(np.abs(values).max()) > _NEAR * limit
        drawn.append(limit if near else math.inf)
        if np.isfinite(limit) and not near:
            far.append(f"±{limit:.4g} {unit}")
    speed, force = drawn
    look: dict[str, Any] = {"color": "black", "linewidth": 1.0}
    if np.isfinite(force) and np.isfinite(speed):
        corner = (-speed, -force)
        axes.add_patch(Rectangle(corner, 2 * speed, 2 * force, fill=False, label="limits"))
        axes.autoscale_view()
    else:
        for limit, line in ((force, axes.axhline), (speed, axes.axvline)):
            if np.isfinite(limit):
                line(limit, label="limits", **look)
                line(-limit, **look)
    if far:
        which = "limits not shown" if np.isfinite(drawn).any() else "limits"
        axes.plot([], [], " ", label=f"{which}: {', '.join(far)}")
    _power_limit(axes, sheet, limits)


def _power_limit(axes: Axes, sheet: SizingSheet, limits: ActuatorLimits) -> None:
    """Draw the limit of power as far as those of force and speed, or somewhat beyond the motion."""
    speed, force, power = limits.speed, limits.force, limits.power
    if not np.isfinite(power):
        return
    largest = min(speed, 1.2 / _NEAR * float(np.abs(sheet.speed).max()))
    highest = min(force, 1.2 / _NEAR * float(np.abs(sheet.force).max()))
    if largest * highest > power:  # else the curves lie outside
        v = np.linspace(power / highest, largest, 100)
        x, y = np.outer(v, [1, 1, -1, -1]), np.outer(power / v, [1, -1, 1, -1])
        axes.plot(x, y, ":", color="black", label=["power limit", "", "", ""])
