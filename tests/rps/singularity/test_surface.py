"""The type II singular surface: against zeros found by other means, its edges, and jumps."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.optimize import brentq

from rps_pin import InputError, RPSParameters, RPSRobot
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.surface import singular_surface

SOKOLOV = RPSParameters.from_preset("sokolov")
BOX = {"z": (0.1, 0.6), "tilt_x": (-2.0, 2.0), "tilt_y": (-2.0, 2.0)}


def test_surface_lies_where_the_platform_moves_without_its_legs() -> None:
    surface = singular_surface(SOKOLOV, **BOX, points=17)
    assert len(surface.vertices) > 1000
    measures = singularity_measures(SOKOLOV, surface.vertices)
    assert np.abs(surface.measure).max() < 1e-14
    assert measures.type_ii.max() < 1e-13
    low, high = np.array(list(BOX.values())).T
    assert (surface.vertices >= low - 1e-15).all() and (surface.vertices <= high + 1e-15).all()
    assert surface.reachable.all()  # this robot has no limits


def test_surface_has_edges_only_on_the_box() -> None:
    surface = singular_surface(SOKOLOV, **BOX, points=(12, 15, 13))
    edges = Counter(
        tuple(sorted((int(t[i]), int(t[i - 1])))) for t in surface.triangles for i in range(3)
    )
    assert set(edges.values()) == {1, 2}
    low, high = np.array(list(BOX.values())).T
    on_box = (np.abs(surface.vertices - low) < 1e-12) | (np.abs(surface.vertices - high) < 1e-12)
    for edge, count in edges.items():
        if count == 1:
            assert on_box[list(edge)].all(axis=0).any()
    assert set(surface.triangles.ravel()) == set(range(len(surface.vertices)))


def test_every_line_through_the_box_meets_the_surface_where_the_sign_changes() -> None:
    """Independent of the mesh: crossings along z of the grid's lines are vertices of it."""
    surface = singular_surface(SOKOLOV, **BOX, points=9)
    heights = np.linspace(*BOX["z"], 9)
    found = 0
    for wx in np.linspace(-2, 2, 9):
        for wy in np.linspace(-2, 2, 9):
            line = np.stack([heights, np.full(9, wx), np.full(9, wy)], axis=1)
            K = leg_jacobians(SOKOLOV, line).length_jacobian
            for k in np.flatnonzero(np.diff(np.sign(np.linalg.det(K)))):
                zero = brentq(
                    lambda z, wx=wx, wy=wy: np.linalg.det(
                        leg_jacobians(SOKOLOV, [z, wx, wy]).length_jacobian
                    ),
                    *heights[k : k + 2],
                    xtol=1e-15,
                )
                gap = np.abs(surface.vertices - [zero, wx, wy]).max(axis=1).min()
                assert gap < 1e-12
                found += 1
    assert found > 10


def test_surface_knows_what_the_robot_reaches() -> None:
    limited = SOKOLOV.replace(leg_length_limits=(0.3, 0.6))
    surface = singular_surface(limited, **BOX, points=13)
    length = RPSRobot(SOKOLOV).inverse_kinematics(surface.vertices).length
    expected = ((length > 0.3) & (length < 0.6)).all(axis=1)
    np.testing.assert_array_equal(surface.reachable, expected)
    assert 0 < surface.reachable.sum() < len(surface.vertices)


def test_box_without_singularity_has_no_surface() -> None:
    surface = singular_surface(SOKOLOV, z=(0.4, 0.5), tilt_x=(-0.1, 0.1), tilt_y=(-0.1, 0.1))
    assert surface.vertices.shape == surface.triangles.shape == (0, 3)
    assert surface.measure.shape == surface.reachable.shape == (0,)


def test_zeros_on_grid_points_make_sound_triangles() -> None:
    """The flat robot is singular at z = 0, which is a layer of this grid's level line."""
    surface = singular_surface(
        SOKOLOV, z=(-0.1, 0.1), tilt_x=(-0.2, 0.2), tilt_y=(-0.2, 0.2), points=5
    )
    assert len(surface.triangles) > 0
    assert np.abs(surface.measure).max() < 1e-14


def test_passing_through_a_leg_without_length_is_not_type_ii() -> None:
    """g = h: near the level pose at z = 0 the determinant jumps; what is kept is continuous."""
    parameters = SOKOLOV.replace(platform_radius=SOKOLOV.base_radius)
    surface = singular_surface(
        parameters, z=(-0.1, 0.11), tilt_x=(-0.2, 0.21), tilt_y=(-0.2, 0.21), points=9
    )
    assert np.abs(surface.measure).max(initial=0) < 1e-9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"z": (0.5, 0.1)}, "z = .*smaller number first"),
        ({"tilt_x": (0.0, np.nan)}, "tilt_x = "),
        ({"tilt_y": (1.0,)}, "tilt_y = .*two numbers"),
        ({"tilt_x": (-5, 5), "tilt_y": (-5, 5)}, "tilted by 7.07"),
        ({"points": 1}, "points = 1"),
        ({"points": (3, 3)}, "points = "),
        ({"points": 1000}, "1,000,000,000 points"),
    ],
)
def test_bad_boxes_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        singular_surface(SOKOLOV, **(BOX | changes))  # type: ignore[arg-type]
