"""Figures by Matplotlib, with units, in colours that all readers can tell apart. No windows.

Each function draws on axes (or a figure) of your own, or makes a figure, and returns it. Figures
that compare with the paper stand in ``rps_pin.paper``; the 3D viewer is `rps_pin.viewer`.
"""

from rps_pin.plots.assembly_modes import plot_assembly_modes
from rps_pin.plots.conditioning import plot_height_conditioning, plot_tilt_conditioning
from rps_pin.plots.control import plot_loop_forces, plot_tracking
from rps_pin.plots.design import plot_front
from rps_pin.plots.dynamics import plot_force_causes, plot_sizing
from rps_pin.plots.machine.stiffness import plot_stiffness_map
from rps_pin.plots.machine.tolerances import plot_tolerance_map, plot_tolerance_shares
from rps_pin.plots.motion import plot_forces, plot_length_phase, plot_lengths, plot_path
from rps_pin.plots.simulation import plot_simulation
from rps_pin.plots.style import (
    COLOURS,
    COLUMN,
    LEG_COLOURS,
    LEG_STYLES,
    PAGE,
    STYLE,
    save_figure,
    styled,
)
from rps_pin.plots.task_workspace import plot_map, plot_slices
from rps_pin.plots.volumes import plot_effective, plot_space, plot_theoretical
from rps_pin.plots.workspace import plot_comparison, plot_reasons, plot_views

__all__ = [
    "COLOURS",
    "COLUMN",
    "LEG_COLOURS",
    "LEG_STYLES",
    "PAGE",
    "STYLE",
    "plot_assembly_modes",
    "plot_comparison",
    "plot_effective",
    "plot_force_causes",
    "plot_forces",
    "plot_front",
    "plot_height_conditioning",
    "plot_length_phase",
    "plot_lengths",
    "plot_loop_forces",
    "plot_map",
    "plot_path",
    "plot_reasons",
    "plot_simulation",
    "plot_sizing",
    "plot_slices",
    "plot_space",
    "plot_stiffness_map",
    "plot_theoretical",
    "plot_tilt_conditioning",
    "plot_tolerance_map",
    "plot_tolerance_shares",
    "plot_tracking",
    "plot_views",
    "save_figure",
    "styled",
]
