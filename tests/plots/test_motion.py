"""The figures show the numbers they are given, with units on their axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin import RPSRobot, helix
from rps_pin.plots import plot_forces, plot_lengths, plot_path, save_figure
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.trajectories import SampledPath, circle, point_to_point
from tests.plots.overlaps import faults


@pytest.fixture(scope="module")
def run() -> MotionRun:
    robot = RPSRobot.from_preset("sokolov")
    return run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 50.0)


def test_lengths_are_drawn_in_millimetres_over_seconds(run: MotionRun) -> None:
    (axes,) = plot_lengths(run).axes
    assert axes.get_xlabel() == "time (s)"
    assert "(mm)" in axes.get_ylabel()
    for leg, line in enumerate(axes.get_lines()):
        assert np.array_equal(line.get_xdata(), run.time)
        assert np.allclose(line.get_ydata(), 1e3 * run.length[:, leg], rtol=1e-15)
        assert line.get_label() == f"leg {leg + 1}"


def test_forces_are_drawn_in_newtons_on_ones_own_axes(run: MotionRun) -> None:
    figure = Figure()
    axes = figure.add_subplot()
    assert plot_forces(run, axes) is figure
    assert "(N)" in axes.get_ylabel()
    assert len(axes.get_lines()) == 3
    for leg, line in enumerate(axes.get_lines()):
        at = np.isin(line.get_xdata(), run.time)
        assert np.array_equal(np.asarray(line.get_ydata())[at], run.force[:, leg])


def test_forces_jump_upright_where_accelerations_do(run: MotionRun) -> None:
    """A helix ramps its speed: the acceleration jumps at the ends of the ramps, 0.5 s long here."""
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    ramps = np.array([path.ramp, path.duration - path.ramp])
    (axes,) = plot_forces(run).axes
    for line in axes.get_lines():
        time = np.asarray(line.get_xdata())
        upright = time[:-1][np.diff(time) == 0.0]
        assert len(upright) == 2
        assert np.abs(upright - ramps).max() <= 1 / 50.0
    smooth = run_motion(robot, circle(height=0.4, tilt=0.05, duration=1.0), 100.0)
    assert len(plot_forces(smooth).axes[0].get_lines()[0].get_xdata()) == len(smooth.time)


def test_a_robot_at_rest_is_a_point_among_round_numbers() -> None:
    robot = RPSRobot.from_preset("micro")
    still = SampledPath(np.linspace(0.0, 1.0, 6), np.tile([0.223, 0.05, 0.02], (6, 1)))
    figure = plot_path(run_motion(robot, still, 20.0))
    assert not faults(figure)
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert names == ["at rest"]
    (axes,) = figure.axes
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        ticks = [tick.get_text() for tick in axis.get_ticklabels()]
        assert all(len(tick) <= len("-0.2") for tick in ticks), ticks


def test_a_path_that_returns_has_one_point_for_both_ends() -> None:
    robot = RPSRobot.from_preset("micro")
    for path, wanted in (
        (circle(height=0.223, tilt=0.1, duration=1.0), ["start and end"]),
        (point_to_point([0.22, 0.0, 0.0], [0.23, 0.1, 0.0], duration=1.0), ["start", "end"]),
    ):
        figure = plot_path(run_motion(robot, path, 20.0))
        names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert names == wanted
        assert not faults(figure)


def test_a_path_that_only_rises_has_room_for_its_ticks() -> None:
    robot = RPSRobot.from_preset("micro")
    rise = point_to_point([0.21, 0.0, 0.0], [0.235, 0.0, 0.0], duration=1.0)
    figure = plot_path(run_motion(robot, rise, 20.0))
    assert not faults(figure)
    (axes,) = figure.axes
    assert len(axes.get_xticks()) == len(axes.get_yticks()) == 1  # they would meet at the corner


def test_the_path_in_space_is_the_helix(run: MotionRun) -> None:
    (axes,) = plot_path(run).axes
    x, y, z = axes.get_lines()[0].get_data_3d()
    assert np.allclose(np.hypot(x, y), 0.75)
    assert np.isclose(z[-1] - z[0], 0.5)
    for label in (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()):
        assert "(mm)" in label
    assert axes.get_zlabel() == "$p_z - 400$ (mm)"


def test_a_figure_is_saved_as_png_and_as_repeatable_svg(run: MotionRun, tmp_path: Path) -> None:
    png, svg = save_figure(plot_forces(run), tmp_path, "forces")
    assert png.read_bytes().startswith(b"\x89PNG")
    first = svg.read_text()
    assert "</svg>" in first
    save_figure(plot_forces(run), tmp_path, "forces")
    assert svg.read_text() == first
