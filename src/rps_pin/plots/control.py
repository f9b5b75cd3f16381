"""Figures of a controlled motion: errors in micrometres and microradians, forces, statuses.

Each function draws on given axes, or makes a figure. No window is opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.arrays import Array, Bools
from rps_pin.control.loop.status import Status
from rps_pin.control.simulation.loop_run import LoopRun
from rps_pin.control.simulation.loop_summary import TrackingErrors, status_name
from rps_pin.plots.style import STYLE, figure_of, plot_legs, three_axes

#: Above the axes, where it hides nothing.
_LEGEND: Any = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "ncols": 3,
    "frameon": False,
    "borderaxespad": 0.1,
}


def plot_tracking(
    run: LoopRun, axes: Sequence[Axes] | None = None, *, begin: float = 0.0
) -> Figure:
    """Draw the errors (actual minus target) of centre (um), orientation (urad) and legs (um).

    Of a task: of its lengths (um), of its angles (urad), and the distance to a singularity.

    Parameters
    ----------
    run
        The run.
    axes
        Three axes to draw on; default: those of a new figure.
    begin
        Start of what is drawn, s.

    Raises
    ------
    InputError
        If there are not three axes.
    """
    here = run.time >= begin
    time = run.time[here]
    if run.task is not None:
        return _plot_task_errors(run, axes, here)
    errors = TrackingErrors.of(run)
    with matplotlib.rc_context(STYLE):
        centre, turn, legs = three_axes(axes, "Errors: actual minus target")
        plot_legs(centre, time, 1e6 * errors.centre[here], ("$p_x$", "$p_y$", "$p_z$"))
        plot_legs(legs, time, 1e6 * errors.length[here], ("$d_1$", "$d_2$", "$d_3$"))
        turn.plot(time, 1e6 * errors.turn[here], color="black")
        centre.set_ylabel("centre (µm)")
        turn.set_ylabel("orientation (µrad)")
        legs.set_ylabel("leg length (µm)")
        for own in (centre, legs):
            own.legend(**_LEGEND)
        _finish((centre, turn, legs), time)
    return figure_of(centre)


def plot_loop_forces(
    run: LoopRun, axes: Sequence[Axes] | None = None, *, begin: float = 0.0
) -> Figure:
    """Draw the actuators' forces over time (N), the distance to type II, and the statuses.

    Parameters
    ----------
    run
        The run.
    axes
        Three axes to draw on; default: those of a new figure.
    begin
        Start of what is drawn, s.

    Raises
    ------
    InputError
        If there are not three axes.
    """
    here = run.time >= begin
    time = run.time[here]
    with matplotlib.rc_context(STYLE):
        forces, distance, statuses = three_axes(axes, "Forces and statuses of the controller")
        if run.parameters is None:
            for force, (name, _, unit) in zip(run.applied[here].T, run.of_actuators, strict=True):
                forces.plot(time, force, drawstyle="steps-post", label=f"{name} ({unit})")
        else:
            labels = ("$F_1$", "$F_2$", "$F_3$")
            plot_legs(forces, time, run.applied[here], labels, drawstyle="steps-post")
            limit = run.parameters.actuator_force_limit
            if np.abs(run.applied).max() > 0.5 * limit:
                for side in (-limit, limit):
                    forces.axhline(side, color="black", linewidth=0.8, linestyle=":")
        forces.set_ylabel("force (N)" if run.task is None else "force")
        forces.legend(**_LEGEND)
        distance.plot(time, run.type_ii[here], color="black")
        top = 1.1 * float(run.type_ii[here].max(initial=0.1))
        where = "type II" if run.task is None else "singularity"
        distance.set(ylim=(0.0, top), ylabel=f"distance to\n{where} (1)")
        _draw_statuses(statuses, run)
        _finish((forces, distance, statuses), time)
    return figure_of(forces)


def _plot_task_errors(run: LoopRun, axes: Sequence[Axes] | None, here: Bools) -> Figure:
    """Draw the errors of a task's coordinates."""
    time, errors = run.time[here], 1e6 * (run.pose - run.target)[here]
    with matplotlib.rc_context(STYLE):
        lengths, angles, distance = three_axes(axes, "Errors: actual minus target")
        for error, (name, unit) in zip(errors.T, run.of_pose, strict=True):
            (lengths if unit == "m" else angles).plot(time, error, label=name)
        lengths.set_ylabel("lengths (µm)")
        angles.set_ylabel("angles (µrad)")
        distance.plot(time, run.type_ii[here], color="black")
        distance.set(ylim=(0.0, None), ylabel="distance to\nsingularity (1)")
        for own in (lengths, angles):
            if own.lines:
                own.legend(**_LEGEND)
        _finish((lengths, angles, distance), time)
    return figure_of(lengths)


def _draw_statuses(axes: Axes, run: LoopRun) -> None:
    """Draw a row of marks for each status that came up."""
    flags = [flag for flag in Status if flag and (run.status & int(flag)).any()]
    for row, flag in enumerate(flags):
        when = run.time[(run.status & int(flag)) != 0]
        axes.plot(when, np.full(when.size, row), "|", color="black", markersize=9)
    names = [status_name(int(flag)) for flag in flags]
    axes.set_yticks(range(len(names)), names)
    if not flags:
        axes.text(0.5, 0.5, "ok throughout", transform=axes.transAxes, ha="center", va="center")
    axes.set(ylim=(-0.6, max(len(names), 1) - 0.4), ylabel="status")


def _finish(axes: Sequence[Axes], time: Array) -> None:
    for own in axes:
        own.set_xlim(time[0], time[-1] if time.size > 1 else None)
    axes[-1].set_xlabel("time (s)")
