"""Files and tables of the commands that compute the forces of a motion."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from rps_pin.cli.layer_options import chosen_layers
from rps_pin.rps.dynamics.motion_csv import write_csv
from rps_pin.rps.dynamics.motion_run import ActuatorSummary, MotionRun, MotionSummary
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.path import Trajectory, end_states


def write_motion(
    folder: Path,
    name: str,
    title: str,
    robot: RPSRobot,
    run: MotionRun,
) -> list[Path]:
    """Write a motion's table, figures and animation into a folder; return the files."""
    # Only commands that draw wait for these to be imported.
    from rps_pin.plots import plot_forces, plot_lengths, plot_path, save_figure
    from rps_pin.viewer import fitting_layers, save_html

    table = folder / f"{name}.csv"
    write_csv(table, run)
    files = [table]
    for figure, plot in (
        ("figure_7_path", plot_path),
        ("figure_8_lengths", plot_lengths),
        ("figure_9_forces", plot_forces),
    ):
        files += save_figure(plot(run), folder, figure)
    page = folder / "viewer.html"
    shown, at_hand = chosen_layers(None, fitting_layers(robot.mechanism))
    save_html(page, robot, run, layers=shown, hidden=at_hand, title=title)
    return [*files, page]


def actuator_table(actuators: tuple[ActuatorSummary, ...]) -> Table:
    """Return forces, lengths, speeds and powers of the actuators, a column each."""
    table = Table("", *(f"actuator {one.actuator}" for one in actuators), "unit")
    for column in table.columns[1:-1]:
        column.justify = "right"
    for label, unit, attribute in (
        ("force, minimum", "N", "force_min"),
        ("force, maximum", "N", "force_max"),
        ("force, RMS", "N", "force_rms"),
        ("length, shortest", "m", "length_min"),
        ("length, longest", "m", "length_max"),
        ("speed, peak", "m/s", "speed_peak"),
        ("power, peak", "W", "power_peak"),
        ("power, mean of |F d'|", "W", "power_mean"),
    ):
        table.add_row(label, *(f"{getattr(one, attribute):.6g}" for one in actuators), unit)
    return table


def run_table(summary: MotionSummary, path: Trajectory) -> Table:
    """Return duration, rates at the ends, accuracy, and the smallest distance to a singularity."""
    starts, ends = end_states(path)
    z, tilt_x, tilt_y = summary.minimum_pose
    table = Table(show_header=False)
    table.add_row("duration", f"{summary.duration:.6g} s ({summary.samples} samples)")
    table.add_row("starts, ends", starts if starts == ends else f"{starts}, {ends}")
    table.add_row("largest loop gap", f"{summary.loop_gap_max:.2g} m")
    table.add_row("largest KKT residual", f"{summary.residual_max:.2g} of the largest force")
    table.add_row(
        "smallest distance to a singularity\n(0 singular, 1 best)",
        f"{summary.minimum_distance:.4g} ({summary.minimum_singularity}) "
        f"at t = {summary.minimum_time:.4g} s,\n"
        f"z = {z:.6g} m, tilt = ({tilt_x:.4g}, {tilt_y:.4g}) rad",
    )
    return table


def print_exceeded(console: Console, summary: MotionSummary) -> None:
    """Print a line for each actuator limit that the motion exceeds."""
    for sentence in summary.exceeded:
        console.print(f"[bold yellow]beyond a limit:[/] {sentence}", highlight=False)
