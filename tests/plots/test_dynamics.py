"""The figures show the numbers they are given, with units on their axes."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, RPSParameters, RPSRobot, helix
from rps_pin.plots import plot_force_causes, plot_sizing
from rps_pin.rps.dynamics.force_causes import ForceCauses, force_causes
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.dynamics.sizing import size_trajectory
from rps_pin.task.sizing.sizing import size_trajectory as size_of_task
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.trajectories import point_to_point
from tests.plots.overlaps import faults

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    parameters = RPSParameters.from_preset("sokolov").replace(prismatic_damping=30.0)
    return RPSRobot(parameters).with_payload(Payload(0.5, [0.1, 0.05, 0.0]))


@pytest.fixture(scope="module")
def causes(robot: RPSRobot) -> tuple[Array, ForceCauses]:
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=1.0)
    time = np.linspace(0, path.duration, 201)
    return time, force_causes(robot, *path.sample(time))


@pytest.fixture(scope="module")
def sheet(robot: RPSRobot) -> SizingSheet:
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=1.0)
    return size_trajectory(robot, path, 200.0, limits=ActuatorLimits(20.0, 0.5, 3.0))


def test_stacks_end_at_the_sums_of_their_signs(causes: tuple[Array, ForceCauses]) -> None:
    time, parts = causes
    figure = plot_force_causes(time, parts)
    assert len(figure.axes) == 3
    for leg, axes in enumerate(figure.axes):
        assert "(N)" in axes.get_ylabel()
        line = axes.get_lines()[0]
        kept = np.isin(line.get_xdata(), time)  # the others stand where forces jump
        assert np.array_equal(np.asarray(line.get_ydata())[kept], parts.total[:, leg])
        corners = np.concatenate(
            [path.vertices for area in axes.collections for path in area.get_paths()]
        )
        values = np.stack([part[:, leg] for part in parts.parts().values()])
        assert corners[:, 1].max() == pytest.approx(np.maximum(values, 0).sum(axis=0).max())
        assert corners[:, 1].min() == pytest.approx(np.minimum(values, 0).sum(axis=0).min())
    assert figure.axes[-1].get_xlabel() == "time (s)"
    legend = figure.axes[0].get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["gravity", "inertia", "Coriolis", "friction", "payload", "sum"]


def test_causes_that_would_not_be_seen_are_left_out(causes: tuple[Array, ForceCauses]) -> None:
    """At a tenth of the speed, Coriolis forces are a hundredth, and inertia is still shown."""
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=10.0)
    time = np.linspace(0, path.duration, 201)
    parts = force_causes(robot, *path.sample(time))
    assert np.abs(parts.coriolis).max() < 5e-3 * np.abs(parts.gravity).max()
    legend = plot_force_causes(time, parts).axes[0].get_legend()
    assert legend is not None
    assert "Coriolis" not in [text.get_text() for text in legend.get_texts()]


def test_causes_are_drawn_on_ones_own_axes(causes: tuple[Array, ForceCauses]) -> None:
    figure = Figure()
    axes = list(figure.subplots(3, 1))
    assert plot_force_causes(*causes, axes) is figure
    with pytest.raises(InputError, match="2 given"):
        plot_force_causes(*causes, axes[:2])
    with pytest.raises(InputError, match=r"\(5,\).*\(201, 3\)"):
        plot_force_causes(causes[0][:5], causes[1])


def test_forces_are_drawn_over_speeds_in_the_box_of_limits(sheet: SizingSheet) -> None:
    (axes,) = plot_sizing(sheet).axes
    assert "(m/s)" in axes.get_xlabel()
    assert "(N)" in axes.get_ylabel()
    curves = [line for line in axes.get_lines() if str(line.get_label()).startswith("actuator")]
    for leg, line in enumerate(curves):
        assert np.array_equal(line.get_xdata(), sheet.speed[:, leg])
        assert np.array_equal(line.get_ydata(), sheet.force[:, leg])
    (box,) = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert box.get_bbox().extents == pytest.approx([-0.5, -20.0, 0.5, 20.0])
    power = [line for line in axes.get_lines() if line.get_label() == "power limit"]
    x, y = power[0].get_data()
    assert np.multiply(x, y) == pytest.approx(np.full(100, 3.0))


@pytest.mark.parametrize(
    "limits", [ActuatorLimits(), ActuatorLimits(force=9.0), ActuatorLimits(speed=0.2)]
)
def test_limits_that_there_are_not_are_not_drawn(robot: RPSRobot, limits: ActuatorLimits) -> None:
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=1.0)
    figure = Figure()
    own = figure.add_subplot()
    assert plot_sizing(size_trajectory(robot, path, 50.0, limits=limits), own) is figure
    assert not own.patches
    labels = [line.get_label() for line in own.get_lines()]
    assert ("limits" in labels) == (limits != ActuatorLimits())


def test_a_limit_that_is_far_is_told_beside_one_that_is_near(robot: RPSRobot) -> None:
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=1.0)
    limits = ActuatorLimits(force=9e3, speed=0.2)
    axes = plot_sizing(size_trajectory(robot, path, 50.0, limits=limits)).axes[0]
    assert axes.get_legend_handles_labels()[1][-2:] == ["limits", "limits not shown: ±9000 N"]


def test_sizing_of_a_mechanism_has_its_joints_and_their_units() -> None:
    for name, unit in (("delta", "torque (N m)"), ("stewart", "force (N)")):
        task = ClosedLoopModel.load(f"urdf/{name}.yaml").task
        end = task.home.copy()
        end[:3] += [0.01, 0.005, 0.02]
        sheet = size_of_task(task, point_to_point(task.home, end, duration=0.5), 50.0)
        axes = plot_sizing(sheet).axes[0]
        assert axes.get_ylabel() == unit
        labels = axes.get_legend_handles_labels()[1]
        assert labels[: len(task.mechanism.actuated)] == list(task.mechanism.actuated)
        assert labels[-1].startswith("limits")
        assert not faults(axes.get_figure(root=True))


def test_actuators_that_do_the_same_are_one_curve() -> None:
    task = ClosedLoopModel.load("urdf/delta.yaml").task
    end = task.home + np.array([0.0, 0.0, 0.1])  # the arms are alike
    sheet = size_of_task(task, point_to_point(task.home, end, duration=0.5), 50.0)
    labels = plot_sizing(sheet).axes[0].get_legend_handles_labels()[1]
    assert labels == ["all 3 are equal", "limits: ±15 rad/s, ±60 N m"]
