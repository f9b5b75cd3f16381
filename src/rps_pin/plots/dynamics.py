"""Figures of actuator forces: by cause, and over speeds.

Each function draws on given axes, or makes a figure. No window is opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from rps_pin.errors import InputError
from rps_pin.plots.style import STYLE, figure_of, legend_above, new_axes, plot_legs, three_axes
from rps_pin.rps.dynamics.force_causes import ForceCauses
from rps_pin.task.sizing.sizing_sheet import SizingSheet
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


def plot_force_causes(
    time: ArrayLike, causes: ForceCauses, axes: Sequence[Axes] | None = None
) -> Figure:
    """Draw the actuator forces over time as stacks of their causes, a panel for each actuator.

    Positive parts stand on zero, negative ones hang from it; the black line is the force, their
    sum. Causes that are zero throughout are left out.

    Parameters
    ----------
    time
        Increasing, shape (n,), s.
    causes
        Of n samples.
    axes
        Three axes to draw on; default: those of a new figure.

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
    with matplotlib.rc_context(STYLE):
        axes = three_axes(axes, "Actuator forces by cause")
        shown = {name: part for name, part in causes.parts().items() if part.any()}
        for leg, own in enumerate(axes):
            _stacks(own, times, {name: part[:, leg] for name, part in shown.items()})
            own.plot(times, total[:, leg], color="black", linewidth=1.2, label="sum")
            own.axhline(0.0, color="black", linewidth=0.6)
            own.set_ylabel(f"force $F_{leg + 1}$ (N)")
            own.margins(x=0)
        axes[-1].set_xlabel("time (s)")
        legend_above(axes[0], columns=7)
    return figure_of(axes[0])


def plot_sizing(sheet: SizingSheet, axes: Axes | None = None) -> Figure:
    """Draw each actuator's force over its speed, and the box of the limits.

    A motion that keeps the limits stays within the box; the dotted curves are the limit of power.
    A limit that there is not is not drawn. Crosses mark the peak forces.
    """
    with matplotlib.rc_context(STYLE):
        if axes is None:
            axes = new_axes(None, (6.4, 4.6))
            figure_of(axes).suptitle("Force and speed of the actuators")
        named = [one.name for one in sheet.actuators if one.name]
        if named:
            return _sizing_of_joints(axes, sheet)
        labels = [f"actuator {one.actuator}" for one in sheet.actuators]
        plot_legs(axes, sheet.speed, sheet.force, labels)
        peak = np.abs(sheet.force).argmax(axis=0)[None]
        x, y = (np.take_along_axis(one, peak, axis=0) for one in (sheet.speed, sheet.force))
        plot_legs(axes, x, y, [""] * 3, marker="x", linestyle="")
        _limit_box(axes, sheet)
        axes.axhline(0.0, color="black", linewidth=0.6)
        axes.axvline(0.0, color="black", linewidth=0.6)
        axes.set_xlabel("speed $\\dot d_i$ (m/s), positive is out")
        axes.set_ylabel("force $F_i$ (N), positive pushes out")
        legend_above(axes, columns=5)
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


def _sizing_of_joints(axes: Axes, sheet: SizingSheet) -> Figure:
    """Draw forces over speeds of joints by their names, and the limits if they have the same."""
    for k, one in enumerate(sheet.actuators):
        v, f = sheet.speed[:, k], sheet.force[:, k]
        (line,) = axes.plot(v, f, label=one.name)
        most = int(np.abs(f).argmax())
        axes.plot(v[most], f[most], marker="x", linestyle="", color=line.get_color())
    limits = [sheet.limits_of(k) for k in range(len(sheet.actuators))]
    if all((one.force, one.speed) == (limits[0].force, limits[0].speed) for one in limits):
        _limit_box(axes, sheet)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.axvline(0.0, color="black", linewidth=0.6)
    turning = {one.angular for one in sheet.actuators}
    of_slides, of_turns = ("speed (m/s)", "force (N)"), ("speed (rad/s)", "torque (N m)")
    both = ("speed (m/s or rad/s)", "force (N or N m)")
    words = both if len(turning) > 1 else of_turns if turning == {True} else of_slides
    axes.set_xlabel(words[0])
    axes.set_ylabel(words[1])
    legend_above(axes, columns=3)
    return figure_of(axes)


def _limit_box(axes: Axes, sheet: SizingSheet) -> None:
    """Draw what limits there are: a box, or two lines where one side is open."""
    limits = sheet.limits_of(0)
    force, speed, power = limits.force, limits.speed, limits.power
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
    if np.isfinite(power):
        largest = speed if np.isfinite(speed) else 1.2 * float(np.abs(sheet.speed).max())
        highest = force if np.isfinite(force) else 1.2 * float(np.abs(sheet.force).max())
        if largest * highest > power:  # else the curves lie outside
            v = np.linspace(power / highest, largest, 100)
            x, y = np.outer(v, [1, 1, -1, -1]), np.outer(power / v, [1, -1, 1, -1])
            axes.plot(x, y, ":", color="black", label=["power limit", "", "", ""])
