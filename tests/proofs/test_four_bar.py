"""urdf/four_bar.yaml against intersecting circles, Lagrange with multipliers, one inertia M(q)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from tests.closed_loop import mechanisms
from tests.proofs import common
from tests.reference import four_bar

Array = NDArray[np.float64]

CLOSED_FORM = four_bar.FOUR_BAR
#: From the joints' angles to those of the bars from the x axis.
ABSOLUTE = np.array([[1.0, 0, 0], [1, 1, 0], [0, 0, 1]])


@pytest.fixture(scope="module", params=common.ENGINES)
def mechanism(request: pytest.FixtureRequest) -> Any:
    return common.loaded_in(request.param, "four_bar")


def closed_configuration(mechanism: ClosedLoopModel, angle: float) -> Array:
    return mechanisms.values(mechanism, CLOSED_FORM.joint_values(angle))


def state(mechanism: ClosedLoopModel, angle: float, rate: float, pull: float) -> common.State:
    """The joints' motion by Lagrange's loop equations, from absolute angles to relative ones."""
    absolute = np.array([np.arctan2(u[1], u[0]) for u in CLOSED_FORM.directions(angle)])
    v, a = four_bar.equations().completed(absolute, [rate], [pull], [0])
    order = ["crank_joint", "coupler_joint", "rocker_joint"]
    assert list(mechanism.model.names)[1:] == order
    q, v, a = (np.linalg.solve(ABSOLUTE, x) for x in (absolute, v, a))
    return q, v, a


def test_closes_from_rough_guesses(mechanism: ClosedLoopModel) -> None:
    for guess in common.guesses(mechanism, 0.4, 30):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert common.distances(mechanism, q).max() <= 1e-12


def test_the_crank_turns_all_the_way_along_the_closed_form(mechanism: ClosedLoopModel) -> None:
    q = closed_configuration(mechanism, -np.pi)
    for angle in np.linspace(-np.pi, np.pi, 73):
        q = mechanism.complete({"crank_joint": angle}, q)
        expected = closed_configuration(mechanism, angle)
        turns = (q - expected) / (2 * np.pi)  # the closed form's angles jump by whole turns
        np.testing.assert_allclose(turns, np.round(turns), rtol=0, atol=1e-12)


def test_rates_are_those_of_the_closed_form(mechanism: ClosedLoopModel) -> None:
    for angle in np.linspace(-3.0, 3.0, 13):
        expected = mechanisms.values(mechanism, CLOSED_FORM.joint_rates(angle))
        found = mechanism.velocity(closed_configuration(mechanism, angle), [1.0])
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


def test_dynamics_along_a_motion(mechanism: ClosedLoopModel) -> None:
    """Torque and force in the knee; the rows that hold nothing in the plane carry nothing."""
    for curve in common.swing(0.8, 2.5, 3.0, count=25):
        angle, rate, pull = (float(x[0]) for x in (curve.value, curve.first, curve.second))
        q, v, a = state(mechanism, angle, rate, pull)
        common.check_motion(mechanism, q, v, a)
        tau, on_coupler = four_bar.equations().inverse_dynamics(
            ABSOLUTE @ q, ABSOLUTE @ v, ABSOLUTE @ a, [0]
        )
        forces = common.check_forces(mechanism, q, v, a, tau)
        wrench = mechanism.closure_wrenches(q, forces)["knee"]
        size = np.abs(on_coupler).max()
        np.testing.assert_allclose(wrench[[0, 2]], on_coupler, rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(wrench[[1, 3, 4, 5]], 0.0, rtol=0, atol=1e-9 * size)


def test_one_generalised_inertia(mechanism: ClosedLoopModel) -> None:
    for angle in np.linspace(-3.0, 3.0, 13):
        mass = mechanism.mass_matrix(closed_configuration(mechanism, angle))
        assert mass.shape == (1, 1)
        assert mass[0, 0] == pytest.approx(CLOSED_FORM.inertia(angle), rel=1e-11)


def test_describes_three_redundant_rows() -> None:
    common.check_description(common.loaded("four_bar"), rows=5, rank=2, mobility=1)
