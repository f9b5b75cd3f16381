"""urdf/five_bar.yaml against intersecting circles, d'Alembert's principle, Lagrange by SymPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from tests.proofs import common
from tests.reference import five_bar, virtual_power
from tests.reference.newton_euler import Jet

CENTRE, REACH, RATES = [2.0, 1.1], [0.3, 0.25], [5.0, 7.0]


@pytest.fixture(scope="module", params=common.ENGINES)
def mechanism(request: pytest.FixtureRequest) -> Any:
    return common.loaded_in(request.param, "five_bar")


def test_closes_from_rough_guesses(mechanism: ClosedLoopModel) -> None:
    for guess in common.guesses(mechanism, 0.4, 30):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert common.distances(mechanism, q).max() <= 1e-12


def test_direct_kinematics(mechanism: ClosedLoopModel) -> None:
    for curve in common.swing(CENTRE, REACH, RATES):
        left, right = curve.value
        q = mechanism.complete({"left_joint": left, "right_joint": right})
        x, z = five_bar.tip(Jet(curve.value, np.zeros(2), np.zeros(2))).value
        (found,) = common.points(mechanism, q, "left_tip")
        np.testing.assert_allclose(found, [x, 0, z], rtol=0, atol=1e-12)


def test_the_tip_moves_as_the_closed_form_says(mechanism: ClosedLoopModel) -> None:
    for curve in common.swing(CENTRE, REACH, RATES):
        q, _, _ = common.state(mechanism, five_bar.joints(curve))
        jacobian = mechanism.frame_jacobian(q, "left_tip")
        speed = jacobian[:3] @ curve.first
        expected = five_bar.tip(curve).first
        np.testing.assert_allclose(speed[[0, 2]], expected, rtol=0, atol=1e-11)


def test_dynamics_along_a_motion(mechanism: ClosedLoopModel) -> None:
    """Torques by d'Alembert, and the force between the arms by Lagrange's multipliers."""
    for curve in common.swing(CENTRE, REACH, RATES, count=20):
        joints = five_bar.joints(curve)
        q, v, a = common.state(mechanism, joints)
        common.check_motion(mechanism, q, v, a)
        expected = virtual_power.generalised_forces(
            five_bar.bodies, curve.value, curve.first, curve.second
        )
        forces = common.check_forces(mechanism, q, v, a, expected)
        absolute = np.kron(np.eye(2), np.tril(np.ones((2, 2))))
        torques, on_left = five_bar.equations().inverse_dynamics(
            absolute @ q, absolute @ v, absolute @ a, [0, 2]
        )
        np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-9 * np.abs(torques).max())
        force = mechanism.closure_wrenches(q, forces)["tips"][:3]
        expected_force = [on_left[0], 0.0, on_left[1]]
        np.testing.assert_allclose(force, expected_force, rtol=0, atol=1e-9 * np.abs(on_left).max())


def test_describes_one_redundant_row() -> None:
    common.check_description(common.loaded("five_bar"), rows=3, rank=2, mobility=2)
