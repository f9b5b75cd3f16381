"""Pictures on Table 2: forces near singularities, and the interpretations of Table 1."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.paper import paper_data as paper
from rps_pin.paper.comparison import force_range
from rps_pin.paper.compute import COLUMNS, Reproduction
from rps_pin.paper.mass_fit import forces_of_fit
from rps_pin.paper.near_singularity import Approach, Probe
from rps_pin.plots.curves import legend_above, plot_curves
from rps_pin.plots.style import BLACK, COLUMN, GREY, LEG_COLOURS, PAGE, styled

_DISTANCE, _FORCE = "distance to the singularity (1)", "largest $|F_i|$ (N)"


@styled
def plot_approach(found: Approach) -> Figure:
    """Draw the largest force over the distance to the singularity, both logarithmic."""
    axes = _axes(_DISTANCE, _FORCE)
    axes.loglog(found.distance, found.force, ".", color=LEG_COLOURS[0], label="computed")
    line = found.force[-1] * found.distance[-1] / found.distance
    axes.loglog(found.distance, line, "--", color=BLACK, lw=1, label="slope $-1$")
    return _with_legend(axes)


@styled
def plot_probes(probes: list[Probe]) -> Figure:
    """Draw the largest force over the smallest distance of paths that do not cross."""
    axes = _axes("smallest distance to a singularity (1)", _FORCE)
    for branch, colour, mark in zip("+-", LEG_COLOURS, "os", strict=False):
        kept = [(p.nearest, p.forces.largest) for p in probes if p.branch == branch and p.forces]
        axes.loglog(*np.transpose(kept), mark, color=colour, label=f"branch ${branch}$")
    axes.axhline(paper.THIS_STUDY.largest, color=BLACK, lw=1, ls=":", label="Table 2's largest")
    return _with_legend(axes)


@styled
def plot_interpretations(found: Reproduction) -> Figure:
    """Draw every interpretation that has forces: its distance to Table 2, its largest force."""
    axes = _axes(_FORCE, "distance to Table 2 (1)")
    for form, colour, mark in zip(("corrected", "printed"), LEG_COLOURS, ".x", strict=False):
        rows = [row for row in found.comparisons if row.path.eq_29 == form]
        kept = [(row.forces.largest, row.distance_relabelled) for row in rows]
        axes.loglog(*np.transpose(kept), mark, ms=4, color=colour, label=f"Eq. 29 {form}")
    axes.axhline(1.0, color=BLACK, lw=1, ls=":", label="no forces at all")
    return _with_legend(axes)


@styled
def plot_table_2(found: Reproduction) -> Figure:
    """Draw the least and greatest forces of Table 2 and computed ones, by leg."""
    clean = force_range(found.runs["+"].force)
    closest = min(found.comparisons, key=lambda row: row.distance_relabelled)
    bars = [
        ("Sokolov (Table 2)", paper.SOKOLOV, BLACK),
        ("This study (Table 2)", paper.THIS_STUDY, GREY),
        ("closest interpretation", closest.relabelled, LEG_COLOURS[0]),
        ("its path, the mass fitted", found.fits["This study"].fits[0].forces, LEG_COLOURS[1]),
        ("$z_0$ = 0.4 m, mm, as printed", clean, LEG_COLOURS[2]),
    ]
    figure = Figure(figsize=(PAGE, 2.4), layout="constrained")
    axes = figure.add_subplot()
    for k, (name, ranges, colour) in enumerate(bars):
        place = np.arange(3) + 0.15 * (k - 2)
        least, greatest = np.array(ranges.least), np.array(ranges.greatest)
        # A range of less than 12 N would not be seen.
        middle, span = (least + greatest) / 2, np.maximum(greatest - least, 12.0)
        axes.bar(place, span, 0.12, bottom=middle - span / 2, color=colour, label=name)
    axes.set_ylim(-480, 560)
    axes.axhline(0.0, color=BLACK, lw=0.8)
    axes.set_xticks(range(3), [f"$d_{leg}$ of Table 2" for leg in (1, 2, 3)])
    axes.set_ylabel("least to greatest force (N)")
    axes.grid(visible=False, axis="x")
    figure.legend(loc="outside right center")
    return figure


@styled
def plot_fit(found: Reproduction) -> Figure:
    """Draw the forces of the path that comes closest, its mass fitted, with Table 2's ranges."""
    figure = Figure(figsize=(PAGE, 2.4), layout="constrained")
    for axes, (column, printed) in zip(
        figure.subplots(1, 2, sharey=True), COLUMNS.items(), strict=True
    ):
        fit = found.fits[column].fits[0]
        result = next(one for one in found.paths if one.interpretation == fit.path)
        assert result.parts is not None  # it was fitted
        plot_curves(
            axes, result.times, forces_of_fit(result.parts, fit), ("$d_1$", "$d_2$", "$d_3$")
        )
        for leg, colour in enumerate(LEG_COLOURS):
            for end in (printed.least[leg], printed.greatest[leg]):
                axes.axhline(end, color=colour, lw=1.0, ls=":")
        axes.plot([], [], ":", color=GREY, label="Table 2")
        axes.margins(x=0)
        axes.set_xlabel(f"time (s); {column}: m = {fit.platform_mass:.1f} kg")
    figure.axes[0].set_ylabel("force (N)")
    legend_above(figure.axes[0])
    return figure


def _axes(x: str, y: str) -> Axes:
    axes = Figure(figsize=(COLUMN, 2.4), layout="constrained").add_subplot()
    axes.set(xlabel=x, ylabel=y)
    return axes


def _with_legend(axes: Axes) -> Figure:
    legend_above(axes)
    figure = axes.get_figure(root=True)
    assert figure is not None  # `_axes` made it
    return figure
