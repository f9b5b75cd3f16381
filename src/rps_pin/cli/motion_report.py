"""Files and tables of the commands that compute the forces of a motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rps_pin.cli.console import print_files, table_of
from rps_pin.cli.layer_options import write_page
from rps_pin.cli.outputs import figures_in
from rps_pin.cli.task_options import unit_of
from rps_pin.rps.dynamics.motion_csv import write_csv
from rps_pin.rps.dynamics.motion_run import ActuatorSummary, MotionRun, MotionSummary
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.paths.events import pose_of_robot_in_words
from rps_pin.trajectories.path import Trajectory, end_states

_FIGURES = ("path", "lengths", "forces")


def motion_files(folder: Path, name: str) -> list[Path]:
    """Return the files that `write_motion` writes."""
    return [folder / f"{name}.csv", *figures_in(folder, *_FIGURES), folder / "viewer.html"]


def write_motion(
    folder: Path, name: str, title: str, robot: RPSRobot, run: MotionRun, degrees: bool
) -> list[Path]:
    """Write a motion's table, figures and animation into a folder; return the files."""
    # Only commands that draw wait for these to be imported.
    from rps_pin.plots import plot_forces, plot_lengths, plot_path, save_figure

    table = folder / f"{name}.csv"
    write_csv(table, run, degrees=degrees)
    files = [table]
    drawn = plot_path(run), plot_lengths(run), plot_forces(run)
    for name_of_figure, axes in zip(_FIGURES, drawn, strict=True):
        files += save_figure(axes, folder, name_of_figure)
    return [*files, write_page(folder, robot, run, title)]


def actuator_table(actuators: tuple[ActuatorSummary, ...]) -> Table:
    """Return forces, lengths, speeds and powers of the actuators, a column each."""
    quantities = (
        ("force, minimum", "N", "force_min"),
        ("force, maximum", "N", "force_max"),
        ("force, RMS", "N", "force_rms"),
        ("length, shortest", "m", "length_min"),
        ("length, longest", "m", "length_max"),
        ("speed, peak", "m/s", "speed_peak"),
        ("power, peak", "W", "power_peak"),
        ("power, mean of |F d'|", "W", "power_mean"),
    )
    rows = (
        (label, *(f"{getattr(one, attribute):.6g}" for one in actuators), unit)
        for label, unit, attribute in quantities
    )
    headers = ("", *(f"actuator {one.actuator}" for one in actuators), "unit")
    return table_of(rows, *headers, right=slice(1, -1))


def print_motion(
    console: Console,
    table: Table,
    summary: MotionSummary,
    path: Trajectory,
    files: list[Path],
    degrees: bool,
) -> None:
    """Print a table of the actuators, then accuracy, distance to a singularity, limits, files.

    Tilts of the summary are in radians or degrees.
    """
    starts, ends = end_states(path)
    where = pose_of_robot_in_words(np.array(summary.minimum_pose), unit_of(True, degrees))
    rows = {
        "duration": f"{summary.duration:.6g} s ({summary.samples} samples)",
        "starts, ends": starts if starts == ends else f"{starts}, {ends}",
        "largest loop gap": f"{summary.loop_gap_max:.2g} m",
        "largest KKT residual": f"{summary.residual_max:.2g} of the largest force",
        "smallest distance to a singularity\n(0 singular, 1 best)": (
            f"{summary.minimum_distance:.4g} ({summary.minimum_singularity}) "
            f"at t = {summary.minimum_time:.4g} s,\n{where}"
        ),
    }
    console.print(table)
    console.print(table_of(rows.items()))
    for sentence in summary.exceeded:
        console.print(f"[bold yellow]beyond a limit:[/] {escape(sentence)}", markup=True)
    print_files(console, files)
