"""Figures of other motions, mechanisms and sizes than the gallery's: no text collides either."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin import ClosedLoopModel, RPSRobot, helix, plots
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.rps.workspace import leg_grid, workspace
from rps_pin.task.sizing.sizing import size_trajectory
from rps_pin.trajectories import point_to_point
from tests.plots.overlaps import faults

MICRO, SOKOLOV = RPSRobot.from_preset("micro"), RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module", params=["lift", "wide helix"])
def run(request: pytest.FixtureRequest) -> MotionRun:
    if request.param == "lift":
        path = point_to_point([0.21, 0.0, 0.0], [0.24, 0.0, 0.0], duration=0.5)
        return run_motion(MICRO, path, 100.0)
    return run_motion(SOKOLOV, helix(SOKOLOV, radius=20e-3, pitch=0.15, height=0.4), 200.0)


@pytest.mark.parametrize("name", ["path", "lengths", "forces", "length_phase"])
def test_motions_of_other_kinds(run: MotionRun, name: str) -> None:
    assert not faults(getattr(plots, f"plot_{name}")(run))


def test_equal_legs_are_one_curve() -> None:
    path = point_to_point([0.21, 0.0, 0.0], [0.24, 0.0, 0.0], duration=0.5)
    axes = plots.plot_lengths(run_motion(MICRO, path, 100.0)).axes[0]
    assert axes.get_legend_handles_labels()[1] == ["all 3 are equal", "limits"]


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_any_number_of_assembly_modes(count: int) -> None:
    found = MICRO.assembly_modes([0.3, 0.225, 0.225])
    assert len(found.angle) == 12
    names = ("angle", "position", "rotation")
    modes = SimpleNamespace(**{name: getattr(found, name)[:count] for name in names})
    assert not faults(plots.plot_assembly_modes(MICRO.parameters, modes))


@pytest.mark.parametrize("name", ["effective", "space", "views"])
def test_on_a_figure_of_ones_own(name: str) -> None:
    @plots.styled
    def drawn() -> Figure:
        figure = Figure(figsize=(plots.PAGE, 3.0))
        space = workspace(MICRO, leg_grid(MICRO.parameters, 6))
        return getattr(plots, f"plot_{name}")(space, figure)

    figure = drawn()
    assert figure.get_size_inches() == pytest.approx([plots.PAGE, 3.0])
    assert not faults(figure)


@pytest.mark.parametrize("name", ["stewart", "rotary_stewart", "minitaur_leg", "ankle"])
def test_mechanisms_with_many_and_long_names(name: str) -> None:
    mechanism = ClosedLoopModel.load(f"urdf/{name}.yaml")
    motion = mechanism.simulate(mechanism.home, duration=0.1)
    assert not faults(plots.plot_simulation(motion, mechanism))
    path = point_to_point(mechanism.task.home, mechanism.task.home + 0.02, duration=0.5)
    figure = plots.plot_sizing(size_trajectory(mechanism.task, path, 50.0))
    assert not faults(figure)


def test_limits_far_from_a_motion_are_named_and_do_not_squeeze_it() -> None:
    """The Delta's drives bear 60 N m and 15 rad/s; the slow motion has a fraction of both."""
    task = ClosedLoopModel.load("urdf/delta.yaml").task
    path = point_to_point(task.home, task.home + np.array([0.01, 0.0, 0.01]), duration=2.0)
    sheet = size_trajectory(task, path, 50.0)
    axes = plots.plot_sizing(sheet).axes[0]
    assert axes.get_legend_handles_labels()[1][-1] == "limits: ±15 rad/s, ±60 N m"
    assert not axes.patches
    assert np.abs(axes.get_ylim()).max() < 2.0 * np.abs(sheet.force).max()


@pytest.mark.parametrize("measure", ["constraint", "determinant"])
def test_maps_of_other_measures(measure: str) -> None:
    tilts, heights = np.linspace(-1.2, 1.2, 31), np.linspace(0.3, 0.5, 5)
    p = SOKOLOV.parameters
    assert not faults(plots.plot_tilt_conditioning(p, 0.4, tilts, measure=measure))  # type: ignore[arg-type]
    figure = plots.plot_height_conditioning(p, heights, tilts, direction=1.0, measure=measure)  # type: ignore[arg-type]
    assert not faults(figure)
