"""Maps of the distance to a singularity: the numbers drawn, and where the line lies."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure

from rps_pin import InputError, RPSParameters
from rps_pin.plots import plot_height_conditioning, plot_tilt_conditioning
from rps_pin.rps.singularity.measures import singularity_measures

SOKOLOV = RPSParameters.from_preset("sokolov")
TILTS = np.linspace(-1.2, 1.2, 41)


def contours(figure: Figure) -> list[QuadContourSet]:
    return [one for one in figure.axes[0].collections if isinstance(one, QuadContourSet)]


@pytest.mark.parametrize("measure", ["type_ii", "constraint", "determinant"])
def test_the_measure_is_drawn_over_the_tilts(measure: str) -> None:
    figure = plot_tilt_conditioning(SOKOLOV, 0.4, TILTS, measure=measure)  # type: ignore[arg-type]
    axes, bar = figure.axes
    assert axes.get_xlabel() == "tilt about x (degrees), at $p_z$ = 400 mm"
    assert axes.get_ylabel() == "tilt about y (degrees)"
    assert "(0 singular" in bar.get_ylabel()
    drawn = contours(figure)[0]
    x, y = np.meshgrid(TILTS, TILTS)
    pose = np.stack([np.full_like(x, 0.4), x, y], axis=-1)
    wanted = getattr(singularity_measures(SOKOLOV, pose), measure)
    assert drawn.zmin == wanted.min()
    assert drawn.zmax == wanted.max()


def test_the_line_lies_on_the_singularity() -> None:
    """To the grid's interpolation; on the x axis it is at 0.7975 rad, as check_path finds."""
    figure = plot_tilt_conditioning(SOKOLOV, 0.4, np.linspace(-1.2, 1.2, 161))
    line = contours(figure)[1]
    points = np.radians(np.vstack([path.vertices for path in line.get_paths()]))
    pose = np.column_stack([np.full(len(points), 0.4), points])
    assert np.abs(singularity_measures(SOKOLOV, pose).determinant).max() < 1e-3
    right = points[points[:, 0] > 0]
    on_axis = right[np.abs(right[:, 1]).argmin(), 0]
    assert on_axis == pytest.approx(0.7975, abs=2e-3)


@pytest.mark.parametrize("direction", [0.0, 1.0])
def test_over_height_and_tilt_on_ones_own_axes(direction: float) -> None:
    heights = np.linspace(0.2, 0.6, 21)
    figure = Figure()
    other, axes = figure.subplots(1, 2)
    found = plot_height_conditioning(SOKOLOV, heights, TILTS, direction=direction, axes=axes)
    assert found is figure
    assert not other.collections
    assert not other.get_xlabel()
    assert axes.get_ylabel() == "height $p_z$ (mm)"
    assert "(degrees)" in axes.get_xlabel()
    tilt, z = np.meshgrid(TILTS, heights)
    pose = np.stack([z, tilt * np.cos(direction), tilt * np.sin(direction)], axis=-1)
    wanted = singularity_measures(SOKOLOV, pose).type_ii
    drawn = next(one for one in axes.collections if isinstance(one, QuadContourSet))
    assert (drawn.zmin, drawn.zmax) == (wanted.min(), wanted.max())


def test_nonsense_is_refused() -> None:
    with pytest.raises(InputError, match="must be 'type_ii' or 'constraint' or 'determinant'"):
        plot_tilt_conditioning(SOKOLOV, 0.4, measure="type_i")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rising"):
        plot_tilt_conditioning(SOKOLOV, 0.4, [0.1, 0.1])
    with pytest.raises(InputError, match="heights"):
        plot_height_conditioning(SOKOLOV, 0.4)
    with pytest.raises(InputError, match="finite"):
        plot_tilt_conditioning(SOKOLOV, np.nan)
