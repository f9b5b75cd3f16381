"""The grid of interpretations is whole, and its choices are what their names say."""

from __future__ import annotations

import math

import pytest

from rps_pin.paper.interpretations import BODIES, body_interpretations, path_interpretations


def test_every_combination_is_there_once() -> None:
    paths = list(path_interpretations())
    assert len(paths) == len(set(paths)) == 4 * 4 * 3 * 2 * 2 * 2
    bodies = body_interpretations()
    assert len(bodies) == len(set(bodies)) == 4 * 3 * 2
    assert set(path_interpretations(quick=True)) < set(paths)


def test_the_reading_as_printed_is_in_the_grid() -> None:
    (printed,) = (
        p
        for p in path_interpretations()
        if (p.height, p.helix_radius, p.helix_pitch) == pytest.approx((0.4e-3, 0.75e-3, 0.5e-3))
        and p.as_meant
        and p.branch == "+"
    )
    assert (printed.base_radius, printed.platform_radius) == pytest.approx((0.46, 0.23))


def test_other_radii() -> None:
    radii = {p.radii: (p.base_radius, p.platform_radius) for p in path_interpretations()}
    assert radii["diameters"] == pytest.approx((0.23, 0.115))
    # A triangle of side s has a circumradius of s / sqrt(3)
    assert radii["sides of the triangles"] == pytest.approx((0.46 / 3**0.5, 0.23 / 3**0.5))


def test_masses_of_a_disc_and_rods_have_table_1_s_inertias() -> None:
    bodies = BODIES["masses of a disc and rods"]
    assert math.isclose(bodies.platform_mass * 0.23**2 / 2, 0.187)
    assert math.isclose(bodies.leg_mass * 0.4**2 / 3, 0.05)
    assert bodies.about == "joint"
