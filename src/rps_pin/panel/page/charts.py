"""Plots of positions, forces and conditioning in time, beside the robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.panel.history import WINDOW, History
from rps_pin.panel.panel import Panel
from rps_pin.panel.recording import Recording
from rps_pin.viewer.scene.stage import round_number

COLOURS = ("#D55E00", "#009E73", "#0072B2", "#CC79A7", "#E69F00", "#56B4E9", "#777777", "#000000")
"""Of the actuators, in order, repeated; of a 3-RPS those that its legs have."""
UNITS = {"mm": "mm", "degrees": "°"}
"""As labels have them: a line of the page is short."""
_HEIGHT = 112
_FONT = "11px sans-serif"


class Charts:
    """Three plots of the same time axis, with a mark at the present.

    Parameters
    ----------
    gui
        viser's.
    panel
        What is plotted.
    """

    def __init__(self, gui: Any, panel: Panel) -> None:
        self._scales = np.array([one.scale for one in panel.actuators])
        positions = {UNITS.get(one.unit, one.unit): None for one in panel.actuators}
        forces = {one.force_unit: None for one in panel.actuators}
        colours = [COLOURS[k % len(COLOURS)] for k in range(len(panel.actuators))]
        nothing = np.array([-WINDOW, 0.0])
        self._charts: list[Any] = []
        for title, count in (
            (f"actuators, {' and '.join(positions)}", len(colours)),
            (f"forces, {' and '.join(forces)}", len(colours)),
            ("conditioning (0 singular, 1 best)", 1),
        ):
            series = [_line(colour) for colour in colours]
            last = len(self._charts) == 2
            chart = gui.add_uplot(
                (nothing, *[np.full(2, np.nan)] * count),
                ({}, *(series if not last else [_line("#333333")])),
                title=title,
                scales=_scales(0.0, 1.0),
                cursor={"drag": {"x": False, "y": False}},
                axes=(_axis(28) if last else {"show": False}, _axis(46)),
                legend={"show": False},
                height=_HEIGHT + (20 if last else 0),
                padding=(6, 12, 0 if last else 8, 0),
            )
            self._charts.append(chart)

    @property
    def data(self) -> list[tuple[Array, ...]]:
        """Times and curves of the three plots, as shown."""
        return [chart.data for chart in self._charts]

    def show_recording(self, recording: Recording) -> None:
        """Plot a trajectory."""
        self._show(recording.time, recording.position, recording.force, recording.conditioning)

    def show_history(self, history: History, actuators: int) -> None:
        """Plot the last seconds."""
        time, rows = history.arrays()
        if len(time) < 2:
            time, rows = np.array([-WINDOW, 0.0]), np.repeat(rows, 2, axis=0)
        self._show(time, rows[:, :actuators], rows[:, actuators:-1], rows[:, -1])

    def _show(self, time: Array, position: Array, force: Array, conditioning: Array) -> None:
        *both, _ = self._charts  # the conditioning is always from 0 to 1
        for chart, rows in zip(both, (position * self._scales, force), strict=True):
            scales = _scales(*nice_range(rows))
            if chart.scales != scales:
                chart.scales = scales
        for chart, rows in zip(
            self._charts, (position * self._scales, force, conditioning[:, None]), strict=True
        ):
            chart.data = (time.copy(), *(np.ascontiguousarray(column) for column in rows.T))


def nice_range(values: Array) -> tuple[float, float]:
    """Return round ends of an axis for numbers, some of which may be NaN.

    At least a fiftieth of the numbers wide, so that rounding errors are not all that is seen.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    span = max(high - low, 0.02 * max(abs(low), abs(high))) or 1.0
    step, middle = round_number(span / 2.0), (low + high) / 2.0
    return (
        round(step * math.floor((middle - 0.55 * span) / step), 12),
        round(step * math.ceil((middle + 0.55 * span) / step), 12),
    )


def _scales(low: float, high: float) -> dict[str, Any]:
    """Return the scales of a plot's axes."""
    return {"x": {"time": False}, "y": {"range": (low, high)}}


def _line(colour: str) -> dict[str, Any]:
    """Return a curve of a plot, without points."""
    return {"stroke": colour, "width": 1.5, "points": {"show": False}}


def _axis(size: int) -> dict[str, Any]:
    """Return an axis of a plot that takes `size` pixels."""
    return {"size": size, "font": _FONT, "ticks": {"size": 4}, "gap": 3}
