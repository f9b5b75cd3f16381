"""Fits find what they are given, and are least."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import RPSParameters
from rps_pin.paper.comparison import distance, force_range
from rps_pin.paper.compute import COLUMNS, Reproduction
from rps_pin.paper.interpretations import PathInterpretation
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.mass_fit import (
    MassFit,
    fit_both_masses,
    fit_mass,
    forces_of_fit,
    moved_fits,
    moved_paths,
)


def direct(found: Reproduction, fit: MassFit, mass: float, leg_mass: float) -> np.ndarray:
    """Return the forces of Table 1's robot with other masses, in Table 2's order of legs."""
    result = next(one for one in found.paths if one.interpretation == fit.path)
    robot = RPSParameters.from_preset("sokolov").replace(platform_mass=mass, leg_mass=leg_mass)
    force = lagrange_forces(robot, *fit.path.path().sample(result.times)).force
    return fit.labels.sign * force[:, list(fit.labels.order)]


@pytest.mark.parametrize("column", COLUMNS)
def test_the_best_fit_is_the_robot_s_own_forces_and_least(found: Reproduction, column: str) -> None:
    fit = found.fits[column].fits[0]
    printed = COLUMNS[column]
    force = direct(found, fit, fit.platform_mass, 0.09)
    assert_allclose(force_range(force).numbers(), fit.forces.numbers(), rtol=1e-9)
    parts = next(one.parts for one in found.paths if one.interpretation == fit.path)
    assert parts is not None
    assert_allclose(forces_of_fit(parts, fit), force, atol=1e-9 * np.abs(force).max())
    for factor in (0.5, 0.9, 0.99, 1.01, 1.1, 2.0):
        other = direct(found, fit, factor * fit.platform_mass, 0.09)
        assert distance(force_range(other), printed) > fit.distance
    both = found.fits[column].both
    assert both.distance <= fit.distance
    other = direct(found, both, both.platform_mass, both.leg_mass)
    assert distance(force_range(other), printed) == pytest.approx(both.distance, rel=1e-6)


def test_masses_that_made_the_forces_are_found_again(found: Reproduction) -> None:
    best = found.fits["This study"].fits[0]
    parts = next(one.parts for one in found.paths if one.interpretation == best.path)
    assert parts is not None
    made = force_range(direct(found, best, 3.7, 0.09))
    fit = fit_mass(best.path, parts, made)
    assert fit.platform_mass == pytest.approx(3.7, rel=1e-4)
    assert fit.distance < 1e-4
    made = force_range(direct(found, best, 3.7, 1.1))
    both = fit_both_masses(fit, parts, made)
    assert (both.platform_mass, both.leg_mass) == pytest.approx((3.7, 1.1), rel=1e-2)


def test_one_path_stands_out_for_both_columns(found: Reproduction) -> None:
    """What the page says of the path behind Table 2."""
    for column in COLUMNS:
        first, second, *_ = found.fits[column].fits
        assert (first.path.height_unit, first.path.helix_unit, first.path.branch) == (
            "m",
            "dm",
            "-",
        )
        assert first.labels == ((2, 0, 1), 1)
        assert first.distance < 0.03
        assert second.distance > 0.4


def test_moving_the_path_makes_it_worse(found: Reproduction) -> None:
    for column in COLUMNS:
        best = found.fits[column].fits[0].distance
        moved = found.fits[column].moved
        assert len(moved) == 4
        assert all(one.distance > best for one in moved)


def test_moved_paths_that_cross_are_told_and_not_fitted() -> None:
    crossing = PathInterpretation("m", "dm", "radii", "+", "corrected", "corrected")
    moved = moved_paths(crossing, quick=True)
    assert all(one.parts is None for one in moved)
    for fit in moved_fits(crossing, moved, COLUMNS["Sokolov"]):
        assert math.isnan(fit.platform_mass)
        assert math.isnan(fit.distance)
