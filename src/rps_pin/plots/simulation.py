"""Figures of a simulated motion: with units, in colours that all readers can tell apart.

No window is opened.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.plain_text import for_figure
from rps_pin.plots.style import COLOURS, STYLE

#: Further ones where the colours come round again.
_STYLES = ("-", "--", "-.", ":")


def plot_simulation(
    simulation: Simulation, mechanism: ClosedLoopModel, figure: Figure | None = None
) -> Figure:
    """Draw the actuated joints' positions, the energies and the largest gap over time."""
    with matplotlib.rc_context(STYLE):
        figure = figure or Figure(figsize=(7.0, 7.2), layout="constrained")
        positions, energies, gaps = figure.subplots(3, 1, sharex=True)
        _plot_positions(positions, simulation, mechanism)
        _lines(
            energies,
            simulation.time,
            {
                "kinetic": simulation.kinetic,
                "potential, from the start": simulation.potential - simulation.potential[0],
                "both": simulation.energy - simulation.potential[0],
            },
        )
        energies.set_ylabel("energy (J)")
        visible = np.where(simulation.gap > 0, simulation.gap, np.nan)  # an axis of powers has no 0
        gaps.semilogy(simulation.time, visible, ".", markersize=2, color=COLOURS[0])
        gaps.set(xlabel="time (s)", ylabel="largest loop gap (m)")
        gaps.margins(x=0)
        positions.set_title(for_figure(mechanism.name), loc="left")
    return figure


def _plot_positions(axes: Axes, simulation: Simulation, mechanism: ClosedLoopModel) -> None:
    model = mechanism.model
    names = filter(model.existJointName, mechanism.actuated)  # whole joints
    joints = [(name, model.joints[model.getJointId(name)]) for name in names]
    simple = [(name, joint) for name, joint in joints if joint.nq == joint.nv == 1]
    _lines(axes, simulation.time, {name: simulation.q[:, joint.idx_q] for name, joint in simple})
    prismatic = {joint.shortname().startswith("JointModelP") for _, joint in simple}
    unit = {frozenset({True}): "m", frozenset({False}): "rad"}.get(frozenset(prismatic), "rad, m")
    axes.set_ylabel(f"actuated joints ({unit})")


def _lines(axes: Axes, time: np.ndarray, curves: dict[str, np.ndarray]) -> None:
    for index, (name, values) in enumerate(curves.items()):
        colour = COLOURS[index % len(COLOURS)]
        style = _STYLES[(index // len(COLOURS) + index) % len(_STYLES)]
        axes.plot(time, values, color=colour, linestyle=style, label=for_figure(name))
    axes.margins(x=0)
    if curves:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small")
