"""Figures of a simulated motion: with units, in colours that all readers can tell apart.

No window is opened.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.plots.curves import draw_limits, legend_above, names_for_figure, plot_curves
from rps_pin.plots.style import COLOURS, panels, styled

#: Gaps of this share of the mechanism's way, and sums of energies of this share of their parts,
#: are rounding errors.
_ROUNDING = 1e-9


@styled
def plot_simulation(
    simulation: Simulation, mechanism: ClosedLoopModel, figure: Figure | None = None
) -> Figure:
    """Draw the actuated joints' positions and limits, and the energies, over time.

    The work of forces and friction is drawn if there is any; the largest gap of the loops if it is
    more than rounding, else it is a line of text.
    """
    joints = _actuated(mechanism)
    groups = [[one for one in joints if one[2] == unit] for unit in ("rad", "m")]
    drawn = [group for group in groups if group]
    open_loops = float(simulation.gap.max(initial=0.0)) > _ROUNDING
    axes = panels(figure, len(drawn) + 1 + open_loops, 0.6 + 1.5 * (len(drawn) + 1 + open_loops))
    for own, group in zip(axes, drawn, strict=False):
        _plot_positions(own, simulation, mechanism, group)
    _plot_energies(axes[len(drawn)], simulation)
    if open_loops:
        axes[-1].plot(simulation.time, simulation.gap, color=COLOURS[0])
        axes[-1].set(ylabel="loop gap (m)", yscale="log")
    axes[-1].set_xlabel("time (s)")
    if not open_loops:
        axes[-1].set_xlabel(f"time (s)\nlargest loop gap: {simulation.gap.max():.1g} m")
    for own in axes:
        own.margins(x=0)
    found = axes[0].get_figure(root=True)
    assert found is not None  # that of `panels`
    return found


def _actuated(mechanism: ClosedLoopModel) -> list[tuple[str, int, str]]:
    """Return name, place in q and unit of each actuated joint of one coordinate."""
    model = mechanism.model
    found = []
    for name in filter(model.existJointName, mechanism.actuated):  # whole joints
        joint = model.joints[model.getJointId(name)]
        if joint.nq == joint.nv == 1:
            slides = joint.shortname().startswith("JointModelP")
            found.append((name, joint.idx_q, "m" if slides else "rad"))
    return found


def _plot_positions(
    axes: Axes, simulation: Simulation, mechanism: ClosedLoopModel, group: list[Any]
) -> None:
    names, places, units = zip(*group, strict=True)
    values = simulation.q[:, list(places)]
    plot_curves(axes, simulation.time, values, names_for_figure(names))
    low = np.asarray(mechanism.model.lowerPositionLimit)[list(places)]
    high = np.asarray(mechanism.model.upperPositionLimit)[list(places)]
    if (low == low[0]).all() and (high == high[0]).all():
        draw_limits(axes, values, _finite(low[0]), _finite(high[0]), units[0])
    axes.set_ylabel(f"actuated joints ({units[0]})")
    legend_above(axes)


def _finite(limit: float) -> float:
    """Return a limit; what is as large as no limit in a file is infinite."""
    return limit if abs(limit) < 1e10 else float(np.copysign(np.inf, limit))


def _plot_energies(axes: Axes, simulation: Simulation) -> None:
    risen = simulation.potential - simulation.potential[0]
    curves: dict[str, Array] = {"kinetic": simulation.kinetic, "potential": risen}
    largest = float(np.abs([*curves.values()]).max())
    if np.abs(simulation.work).max() > _ROUNDING * largest:
        curves["work of forces"] = simulation.work
    curves["sum"] = simulation.kinetic + risen
    plot_curves(axes, simulation.time, np.stack([*curves.values()], axis=1), list(curves))
    axes.set_ylabel("energy (J)")
    legend_above(axes)
