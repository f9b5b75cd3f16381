"""Pictures of the reproduction: the paper's Figures 1 to 9, and those on Table 2."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from rps_pin import plots
from rps_pin.files import whole_file
from rps_pin.paper import table_2_figures as table_2
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.figure_1 import plot_mechanism
from rps_pin.rps.robot import RPSRobot

#: Names of the pictures' files.
NAMES = (
    *(f"figure_{number}" for number in range(1, 10)),
    *("approach", "probes", "interpretations", "table_2", "fit"),
)


def pictures(found: Reproduction) -> dict[str, Callable[[], Figure]]:
    """Return what draws each picture, by the name of its file."""
    micro = found.workspace.parameters
    return {
        "figure_1": lambda: plot_mechanism(RPSRobot.from_preset("sokolov")),
        "figure_2": lambda: plots.plot_assembly_modes(micro, found.modes),
        "figure_3": lambda: plots.plot_theoretical(micro),
        "figure_4": lambda: plots.plot_effective(found.coarse_workspace),
        "figure_5": lambda: plots.plot_space(found.coarse_workspace),
        "figure_6": lambda: plots.plot_views(found.workspace),
        "figure_7": lambda: plots.plot_path(found.runs["+"]),
        "figure_8": lambda: plot_branches(found, plots.plot_lengths),
        "figure_9": lambda: plot_branches(found, plots.plot_forces),
        "approach": lambda: table_2.plot_approach(found.approach),
        "probes": lambda: table_2.plot_probes(found.probes),
        "interpretations": lambda: table_2.plot_interpretations(found),
        "table_2": lambda: table_2.plot_table_2(found),
        "fit": lambda: table_2.plot_fit(found),
    }


def write_figures(
    found: Reproduction,
    folder: Path,
    track: Callable[[Iterable[str], str], Iterable[str]] = lambda items, _: items,
) -> list[Path]:
    """Write every picture as PNG into a folder, each whole or not at all; return the files."""
    draw = pictures(found)
    files = []
    for name in track(NAMES, "pictures"):
        path = folder / f"{name}.png"
        with matplotlib.rc_context(plots.STYLE), whole_file(path) as scratch:
            draw[name]().savefig(scratch, metadata={"Software": None})
        files.append(path)
    return files


@plots.styled
def plot_branches(found: Reproduction, plot: Callable[..., Figure]) -> Figure:
    """Draw a quantity of Table 1's helix over time, the two branches side by side."""
    figure = Figure(figsize=(plots.PAGE, 2.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for one, (branch, run) in zip(axes, found.runs.items(), strict=True):
        plot(run, one)
        one.set_xlabel(f"time (s), branch ${branch}$")
    axes[1].get_legend().remove()
    axes[1].set_ylabel("")
    return figure
