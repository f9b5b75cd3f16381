"""The figures show the numbers they are given, with units on their axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin import RPSRobot, helix
from rps_pin.plots import plot_forces, plot_lengths, plot_path, save_figure
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.trajectories import circle


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


def test_the_path_in_space_is_the_helix(run: MotionRun) -> None:
    (axes,) = plot_path(run).axes
    x, y, z = axes.get_lines()[0].get_data_3d()
    assert np.allclose(np.hypot(x, y), 0.75)
    assert np.isclose(z[-1] - z[0], 0.5)
    for label in (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()):
        assert "(mm)" in label
    assert "400 mm" in axes.get_zlabel()


def test_a_figure_is_saved_as_png_and_as_repeatable_svg(run: MotionRun, tmp_path: Path) -> None:
    png, svg = save_figure(plot_forces(run), tmp_path, "forces")
    assert png.read_bytes().startswith(b"\x89PNG")
    first = svg.read_text()
    assert "</svg>" in first
    save_figure(plot_forces(run), tmp_path, "forces")
    assert svg.read_text() == first
