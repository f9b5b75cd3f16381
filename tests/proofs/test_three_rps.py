"""urdf/rps.yaml: the 3-RPS as a file, against RPSRobot and against Newton-Euler by hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, RPSRobot
from tests.proofs import common
from tests.reference import newton_euler as ne

Array = NDArray[np.float64]

ROBOT = RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module", params=common.ENGINES)
def mechanism(request: pytest.FixtureRequest) -> Any:
    return common.loaded_in(request.param, "rps")


def motions(count: int = 15) -> Iterator[tuple[Array, Array, Array]]:
    """Pose, rate and acceleration along a motion."""
    for curve in common.swing([0.5, 0.05, -0.1], [0.1, 0.3, 0.25], [5.0, 6.0, 4.0], count):
        yield curve.value, curve.first, curve.second


def test_is_the_mechanism_of_the_preset() -> None:
    mechanism = common.loaded("rps")
    other = ROBOT.mechanism
    assert mechanism.model == other.model
    assert mechanism.closures == other.closures
    assert mechanism.actuated == other.actuated
    assert mechanism.characteristic_length == other.characteristic_length
    np.testing.assert_array_equal(mechanism.model.gravity.linear, other.model.gravity.linear)


def test_closes_from_rough_guesses(mechanism: ClosedLoopModel) -> None:
    for guess in common.guesses(mechanism, 0.2, 15):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert common.distances(mechanism, q).max() <= 1e-12


def test_closed_form_kinematics(mechanism: ClosedLoopModel) -> None:
    """Given the lengths of a pose's legs: the pose, and the legs' angles."""
    angles = [f"leg_{i}_revolute" for i in (1, 2, 3)]
    indices = [mechanism.model.joints[mechanism.model.getJointId(n)].idx_q for n in angles]
    for pose, rate, acceleration in motions():
        k = ne.kinematics(ROBOT.parameters, pose, rate, acceleration)
        near = np.add(pose, [0.01, 0.02, -0.02])
        guess = ROBOT.state(near, rate, acceleration)[0]
        q = mechanism.complete(k.leg_lengths, guess)
        np.testing.assert_allclose(q[indices], k.leg_angles, rtol=0, atol=1e-11)
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, q)
        platform = data.oMi[mechanism.model.getJointId("platform_free")]
        np.testing.assert_allclose(platform.translation, k.position, rtol=0, atol=1e-11)
        np.testing.assert_allclose(platform.rotation, k.rotation, rtol=0, atol=1e-11)


def test_dynamics_along_a_motion(mechanism: ClosedLoopModel) -> None:
    for motion in motions():
        expected = ne.inverse_dynamics(ROBOT.parameters, *motion)
        q, v, a = ROBOT.state(*motion)
        common.check_motion(mechanism, q, v, a)
        forces = common.check_forces(mechanism, q, v, a, expected.forces)
        wrenches = mechanism.closure_wrenches(q, forces)
        found = [wrenches[f"leg_{i}"][:3] for i in (1, 2, 3)]
        size = np.abs(expected.reactions).max()
        np.testing.assert_allclose(found, expected.reactions, rtol=0, atol=1e-9 * size)


def test_describes_a_mobility_of_three() -> None:
    common.check_description(common.loaded("rps"), rows=9, rank=9, mobility=3)
