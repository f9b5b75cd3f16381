"""The figures of the workspace show the numbers they are given, with units on their axes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from rps_pin import RPSParameters, RPSRobot
from rps_pin.errors import InputError
from rps_pin.paper import paper_comparison
from rps_pin.plots import (
    plot_assembly_modes,
    plot_comparison,
    plot_effective,
    plot_reasons,
    plot_space,
    plot_theoretical,
    plot_views,
)
from rps_pin.rps.workspace import Workspace, leg_grid, pose_grid, workspace


@pytest.fixture(scope="module")
def micro() -> RPSParameters:
    return RPSParameters.from_preset("micro")


@pytest.fixture(scope="module")
def space(micro: RPSParameters) -> Workspace:
    return workspace(micro, leg_grid(micro, 6))


def test_outlines_enclose_every_inside_point_and_no_more(space: Workspace) -> None:
    """Each point is in a filled triangle, or no further from one than rounding."""
    figure = plot_views(space)
    for axes, plane in zip(figure.axes, [(0, 1), (0, 2), (1, 2)], strict=True):
        assert "(mm)" in axes.get_xlabel() and "(mm)" in axes.get_ylabel()
        points = 1e3 * space.position[space.inside][:, plane]
        for filled in axes.collections:
            corners = np.array([path.vertices[:3] for path in filled.get_paths()])
            edges = np.roll(corners, -1, axis=1) - corners
            apart = points[:, None, None, :] - corners
            side = edges[..., 0] * apart[..., 1] - edges[..., 1] * apart[..., 0]
            within = (side > -1e-9).all(axis=-1) | (side < 1e-9).all(axis=-1)
            assert within.any(axis=1).all()
            assert np.allclose(corners.min(axis=(0, 1)), points.min(axis=0))
            assert np.allclose(corners.max(axis=(0, 1)), points.max(axis=0))
    assert "not" in figure.get_supxlabel()  # of the scales
    empty = workspace(space.parameters, pose_grid([1.0, 1.1], [0.0, 0.1]))
    with pytest.raises(InputError, match="no cell of the grid is inside"):
        plot_views(empty)


def test_the_surface_has_the_conditioning_and_says_its_scales(space: Workspace) -> None:
    figure = plot_space(space)
    axes, bar = figure.axes
    assert bar.get_ylabel() == "conditioning (1)"
    found = space.conditioning[space.inside]
    assert bar.get_ylim()[0] >= found.min() - 1e-12
    assert bar.get_ylim()[1] <= found.max() + 1e-12
    (note,) = [text.get_text() for text in figure.texts]
    factor = float(note.split()[4])
    assert note == f"x and y drawn {factor:g} times as large as z"
    span = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    sides = np.array(axes._box_aspect)  # there is no public way
    assert np.allclose(sides / sides[2], span / span[2] * [factor, factor, 1.0])


@pytest.mark.parametrize("plot", [plot_effective, plot_space])
def test_surfaces_in_space_span_the_workspace(space: Workspace, plot: object) -> None:
    figure = Figure()
    assert plot(space, figure) is figure  # type: ignore[operator]
    axes = figure.axes[0]
    low, high = axes.get_zlim()
    if plot is plot_space:
        assert np.allclose([low, high], [200, 250], atol=3)
    else:  # a flat box with equal scales has room above and below
        assert (low + high) / 2 == pytest.approx(225, abs=1)
        assert 50 <= high - low <= 90
        spans = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
        sides = np.array(axes._box_aspect)  # there is no public way
        assert np.allclose(sides / sides[0], spans / spans[0])
    assert all("(mm)" in label() for label in (axes.get_xlabel, axes.get_ylabel, axes.get_zlabel))
    figure.canvas.draw()


def test_the_theoretical_cylinder_has_the_platforms_radius(micro: RPSParameters) -> None:
    (axes,) = plot_theoretical(micro).axes
    assert any("120 mm" in one for one in axes.get_legend_handles_labels()[1])
    ends = np.array(
        [
            np.array(line.get_data_3d())[:, -1]
            for line in axes.get_lines()
            if line.get_color() != "#999999"
        ]
    )
    assert np.allclose(np.hypot(ends[:, 0], ends[:, 1]), 120.0)


def test_a_map_of_reasons_has_the_colour_of_each_tilt(micro: RPSParameters) -> None:
    tilt = np.linspace(-0.3, 0.3, 13)
    space = workspace(micro, pose_grid([0.21, 0.225], tilt))
    (axes,) = plot_reasons(space, 0.225).axes
    image = axes.get_images()[0].get_array()
    blue = np.isclose(image, to_rgba("#0072B2")).all(axis=-1)
    assert np.array_equal(blue.T, space.inside[1])
    assert axes.get_xlabel() == "tilt about x (°), at $p_z$ = 225 mm"
    with pytest.raises(InputError, match="poses"):
        plot_reasons(workspace(micro, leg_grid(micro, 3)), 0.22)


def test_assembly_modes_are_drawn_as_robots(micro: RPSParameters) -> None:
    robot = RPSRobot(micro)
    pose = np.array([[0.22, 0.1, 0.0], [0.23, 0.0, -0.1], [0.22, 0.0, 0.0]])
    legs = robot.inverse_kinematics(pose)
    position, rotation = robot.platform_placement(pose)
    modes = SimpleNamespace(angle=legs.angle, position=position, rotation=rotation)
    figure = plot_assembly_modes(micro, modes)
    assert len(figure.axes) == 3
    for k, axes in enumerate(figure.axes):
        for leg, line in enumerate(axes.get_lines()):
            base, tip = np.stack(line.get_data_3d(), axis=-1)
            assert np.isclose(np.linalg.norm(tip - base), 1e3 * legs.length[k, leg])
            assert np.isclose(np.linalg.norm(base), 120.0)
    none = SimpleNamespace(angle=np.empty((0, 3)), position=position[:0], rotation=rotation[:0])
    with pytest.raises(InputError, match="no assembly mode"):
        plot_assembly_modes(micro, none)


def test_the_comparison_is_drawn_beside_what_the_paper_states() -> None:
    rows = paper_comparison(base_radii=(0.12, 0.24), points=6)
    (axes,) = plot_comparison(rows).axes
    along_x, along_y, stated = axes.get_lines()
    assert np.allclose(along_x.get_xdata(), [120, 240])
    assert np.allclose(along_x.get_ydata(), [-1e3 * row.x[0] for row in rows])
    assert np.allclose(along_y.get_ydata(), [1e3 * row.y[1] for row in rows])
    assert np.allclose(stated.get_ydata(), 2.5)
    with pytest.raises(InputError):
        plot_comparison([])
