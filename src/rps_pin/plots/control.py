"""Figures of a controlled motion: targets and actual values, errors, forces, statuses.

Each function draws on a given figure, or makes one. No window is opened. Panels that would show
nothing are left out: what they would say is a line of text.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.arrays import Array
from rps_pin.control.loop.status import Status
from rps_pin.control.simulation.loop_run import LoopRun
from rps_pin.control.simulation.loop_summary import TrackingErrors, status_name
from rps_pin.plots.curves import draw_limits, legend_above, names_for_figure, plot_curves
from rps_pin.plots.style import figure_of, panels, styled
from rps_pin.validation import LARGEST

_LEGS = ("$d_1$", "$d_2$", "$d_3$")
_FORCES = ("$F_1$", "$F_2$", "$F_3$")
#: A distance to a singularity that changes less is a number in a line of text.
_STEADY = 0.02
#: Coordinates are drawn from their start if all together span this many times what one does.
_APART = 3.0
#: What a panel is filled with.
Draw = Callable[[Axes], None]


@styled
def plot_tracking(
    run: LoopRun, figure: Figure | None = None, *, begin: float = 0.0, degrees: bool = False
) -> Figure:
    """Draw target and actual values over time, and the errors: actual minus target.

    Of a 3-RPS: leg lengths (mm), and errors of legs and centre (um) and of the orientation (urad).
    Of a task: its lengths (mm) and angles (degrees), and their errors (um and urad). Targets are
    dotted.

    Parameters
    ----------
    run
        The run.
    figure
        To draw on; default: a new one.
    begin
        Start of what is drawn, s.
    degrees
        Whether errors of angles are in degrees; else in urad.
    """
    here = run.time >= begin
    time = run.time[here]
    small = (np.degrees(1.0), "degrees") if degrees else (1e6, "µrad")
    draws = (_of_legs if run.task is None else _of_task)(run, here, small)
    axes = panels(figure, len(draws), 0.4 + 1.35 * len(draws))
    for own, draw in zip(axes, draws, strict=True):
        draw(own)
    _finish(axes, time)
    return figure_of(axes[0])


@styled
def plot_loop_forces(run: LoopRun, figure: Figure | None = None, *, begin: float = 0.0) -> Figure:
    """Draw the actuators' forces and limits over time, and what else changes.

    That is the distance to type II (to a singularity, of a task), and the statuses that came up.

    Parameters
    ----------
    run
        The run.
    figure
        To draw on; default: a new one.
    begin
        Start of what is drawn, s.
    """
    here = run.time >= begin
    time, distance = run.time[here], run.type_ii[here]
    where = "type II" if run.task is None else "singularity"
    draws, notes = _forces(run, here), []
    if np.ptp(distance) > _STEADY:
        draws.append(lambda axes: _draw_distance(axes, time, distance, where))
    else:
        notes.append(f"distance to {where}: {distance.mean():.2f} throughout")
    flags = [flag for flag in Status if flag and (run.status[here] & int(flag)).any()]
    if flags:
        draws.append(lambda axes: _draw_statuses(axes, time, run.status[here], flags))
    else:
        notes.append("status: ok throughout")
    axes = panels(figure, len(draws), 0.7 + 1.35 * len(draws))
    for own, draw in zip(axes, draws, strict=True):
        draw(own)
    _finish(axes, time, notes)
    return figure_of(axes[0])


def _of_legs(run: LoopRun, here: Any, small: tuple[float, str]) -> list[Draw]:
    """Return the panels of a 3-RPS."""
    time, errors = run.time[here], TrackingErrors.of(run)

    def lengths(axes: Axes) -> None:
        actual = 1e3 * run.length[here]
        _with_targets(axes, time, actual, actual - 1e3 * errors.length[here], _LEGS)
        axes.set_ylabel("length (mm)")

    def of_legs(axes: Axes) -> None:
        plot_curves(axes, time, 1e6 * errors.length[here], _LEGS)
        axes.set_ylabel("length error (µm)")
        legend_above(axes)

    def of_centre(axes: Axes) -> None:
        plot_curves(axes, time, 1e6 * errors.centre[here], ("$p_x$", "$p_y$", "$p_z$"))
        axes.set_ylabel("centre error (µm)")
        legend_above(axes)

    def of_turn(axes: Axes) -> None:
        axes.plot(time, small[0] * errors.turn[here], color="black")
        axes.set_ylabel(f"turn error ({small[1]})")

    return [lengths, of_legs, of_centre, of_turn]


def _of_task(run: LoopRun, here: Any, small: tuple[float, str]) -> list[Draw]:
    """Return the panels of a task: lengths, angles and the errors of each, if it has them."""
    time = run.time[here]
    draws: list[Draw] = []
    for unit, shown, factor, (scale, of_error) in (
        ("m", "position (mm)", 1e3, (1e6, "µm")),
        ("rad", "angle (degrees)", np.degrees(1.0), small),
    ):
        places = [k for k, (_, own) in enumerate(run.of_pose) if own == unit]
        if not places:
            continue
        names = names_for_figure([run.of_pose[k][0] for k in places])
        actual, target = run.pose[here][:, places], run.target[here][:, places]

        def values(axes: Axes, a: Array = factor * actual, t: Array = factor * target,
                   names: Any = names, shown: str = shown) -> None:  # fmt: skip
            apart = np.ptp(t) > _APART * np.ptp(t, axis=0).max()  # on one scale, each would be flat
            start = t[0] if apart and len(t) else 0.0
            _with_targets(axes, time, a - start, t - start, names)
            axes.set_ylabel("change of " + shown if apart else shown)

        def errors(axes: Axes, e: Array = scale * (actual - target), names: Any = names,
                   unit: str = of_error) -> None:  # fmt: skip
            plot_curves(axes, time, e, names)
            axes.set_ylabel(f"error ({unit})")
            legend_above(axes)

        draws += [values, errors]
    return draws


def _with_targets(axes: Axes, time: Array, actual: Array, target: Array, names: Any) -> None:
    """Draw actual values, and targets above them."""
    plot_curves(axes, time, actual, names)
    axes.plot(
        time, target, color="black", linestyle=":", label=["target"] + [""] * (len(names) - 1)
    )
    legend_above(axes)


def _forces(run: LoopRun, here: Any) -> list[Draw]:
    """Return the panels of forces, one for each unit."""
    time, force = run.time[here], run.applied[here]
    if run.parameters is not None:
        limit = run.parameters.actuator_force_limit
        return [lambda axes: _draw_forces(axes, time, force, _FORCES, (limit, "N"))]
    draws: list[Draw] = []
    for unit in ("N", "N m"):
        places = [k for k, one in enumerate(run.of_actuators) if one[2] == unit]
        if places:
            names = names_for_figure([run.of_actuators[k][0] for k in places])
            limits = _effort_limits(run)[places]
            common = float(limits[0]) if (limits == limits[0]).all() else np.inf

            def draw(axes: Axes, f: Array = force[:, places], names: Any = names,
                     limit: Any = (common, unit)) -> None:  # fmt: skip
                _draw_forces(axes, time, f, names, limit)

            draws.append(draw)
    return draws


def _effort_limits(run: LoopRun) -> Array:
    assert run.task is not None  # of a 3-RPS the parameters have them
    mechanism = run.task.mechanism
    found: Array = np.asarray(mechanism.model.effortLimit)[mechanism.actuated_indices]
    return found


def _draw_forces(
    axes: Axes, time: Array, force: Array, names: Any, limit: tuple[float, str]
) -> None:
    plot_curves(axes, time, force, names, drawstyle="steps-post")
    most, unit = limit
    if most < LARGEST:
        draw_limits(axes, force, -most, most, unit)
    axes.set_ylabel(f"{'force' if unit == 'N' else 'torque'} ({unit})")
    legend_above(axes)


def _draw_distance(axes: Axes, time: Array, distance: Array, where: str) -> None:
    axes.plot(time, distance, color="black")
    axes.set(ylim=(0.0, 1.1 * float(distance.max())), ylabel=f"distance to\n{where} (1)")


def _draw_statuses(axes: Axes, time: Array, status: Any, flags: list[Status]) -> None:
    """Draw a row for each status, filled while it holds."""
    step = float(time[1] - time[0]) if time.size > 1 else 1.0
    for row, flag in enumerate(flags):
        holds = np.flatnonzero(np.diff(np.pad((status & int(flag)) != 0, 1)))
        spans = [(time[a], time[b - 1] - time[a] + step) for a, b in holds.reshape(-1, 2)]
        axes.broken_barh(spans, (row - 0.3, 0.6), color="black", linewidth=0.8)
    axes.set_yticks(range(len(flags)), [status_name(int(flag)) for flag in flags])
    axes.set(ylim=(-0.6, len(flags) - 0.4), ylabel="status")


def _finish(axes: list[Axes], time: Array, notes: list[str] | None = None) -> None:
    for own in axes:
        own.set_xlim(time[0], time[-1] if time.size > 1 else None)
    axes[-1].set_xlabel("\n".join(["time (s)", *(notes or [])]))
