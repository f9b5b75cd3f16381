"""Every picture can be drawn, and Figure 1 shows the computed vectors."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.testing import assert_allclose

from rps_pin import RPSRobot
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.figure_1 import POSE, plot_mechanism
from rps_pin.paper.figures import pictures
from rps_pin.paper.table_2_figures import plot_table_2
from rps_pin.plots import COLUMN, PAGE
from tests.plots.overlaps import faults


def test_there_is_a_picture_for_each_of_the_paper_s(found: Reproduction) -> None:
    assert {f"figure_{n}" for n in range(1, 10)} < set(pictures(found))


def test_axes_have_names_and_no_text_collides(found: Reproduction) -> None:
    for name, draw in pictures(found).items():
        figure = draw()
        assert isinstance(figure, Figure)
        assert figure.get_figwidth() in (COLUMN, PAGE)
        assert not faults(figure), name
        for axes in figure.axes:
            if isinstance(axes, Axes3D) or name == "table_2" or axes.get_label() == "<colorbar>":
                continue
            assert axes.get_xlabel(), name


def test_figure_1_s_legs_have_the_inverse_kinematics_lengths() -> None:
    robot = RPSRobot.from_preset("sokolov")
    figure = plot_mechanism(robot)
    joints = figure.axes[0]
    assert isinstance(joints, Axes3D)
    ends = [np.array(line.get_data_3d()) for line in joints.get_lines()]
    # For each leg: cylinder, rod, axis of the revolute joint
    lengths = []
    for cylinder, rod, axis in zip(ends[::3], ends[1::3], ends[2::3], strict=True):
        assert_allclose(cylinder[:, 1], rod[:, 0])
        assert abs((axis[:, 1] - axis[:, 0]) @ (rod[:, 1] - cylinder[:, 0])) < 1e-12
        lengths.append(np.linalg.norm(rod[:, 1] - cylinder[:, 0]))
    assert_allclose(lengths, robot.inverse_kinematics(POSE).length, rtol=1e-12)


def test_bars_of_table_2_are_the_paper_s(found: Reproduction) -> None:
    (axes,) = plot_table_2(found).axes
    sokolov = axes.containers[0]
    tops = [bar.get_y() + bar.get_height() for bar in sokolov]
    assert tops == pytest.approx([509, 95, 426])
    assert [bar.get_y() for bar in sokolov] == pytest.approx([-329, 11, -422])
