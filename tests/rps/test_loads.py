"""Payloads and wrenches: their rules, and Pinocchio's own inertia algebra."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import InputError, RPSRobot
from rps_pin.errors import ParameterError
from rps_pin.rps.dynamics.loads import Payload, checked_wrench
from tests import strategies


def test_a_payload_joins_the_platform_s_inertia() -> None:
    """The model's platform has the sum; that of the robot without payload is left alone."""
    rng = np.random.default_rng(1)
    robot = RPSRobot(strategies.random_parameters(rng))
    own = strategies.rigid_body_inertia(rng, 2.0, 0.1)
    payload = Payload(2.0, [0.1, -0.2, 0.3], own)
    model, loaded = robot.mechanism.model, robot.with_payload(payload).mechanism.model
    joint = model.getJointId("platform_free")
    expected = model.inertias[joint] + pin.Inertia(2.0, np.array([0.1, -0.2, 0.3]), own)
    assert loaded.inertias[joint].isApprox(expected, 1e-14)
    assert model.inertias[joint].mass == robot.parameters.platform_mass
    assert robot.payload is None


def test_inertia_about_the_platform_is_that_of_its_points() -> None:
    """A dumbbell of two points of 1 kg: its inertia about the platform's centre, point by point."""
    points = np.array([[0.1, 0.2, 0.3], [0.3, -0.2, 0.5]])
    centre = points.mean(axis=0)

    def inertia(about: np.ndarray) -> np.ndarray:
        arms = points - about
        total: np.ndarray = sum(a @ a * np.eye(3) - np.outer(a, a) for a in arms)
        return total

    payload = Payload(2.0, centre, inertia(centre))
    np.testing.assert_allclose(payload.inertia_about_platform, inertia(np.zeros(3)), atol=1e-15)
    np.testing.assert_allclose(payload.first_moment, points.sum(axis=0), rtol=1e-15)


def test_a_point_is_the_default_and_numbers_are_read_only() -> None:
    centre = np.array([0.1, 0.0, 0.0])
    payload = Payload(1.0, centre)
    centre[0] = 5.0
    np.testing.assert_array_equal(payload.centre, [0.1, 0.0, 0.0])
    np.testing.assert_array_equal(payload.inertia, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="read-only"):
        payload.centre[0] = 1.0


@pytest.mark.parametrize("mass", [0.0, -1.0])
def test_mass_is_positive(mass: float) -> None:
    with pytest.raises(ParameterError, match=r"payload mass = .*must be positive"):
        Payload(mass)


@pytest.mark.parametrize(
    ("inertia", "rule"),
    [
        (np.diag([1.0, 1.0, 2.1]), "exceed the sum"),
        (np.diag([1.0, 1.0, -0.1]), "no rigid body"),
        ([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], "symmetric"),
    ],
)
def test_inertia_is_a_rigid_body_s(inertia: object, rule: str) -> None:
    with pytest.raises(ParameterError, match=rule):
        Payload(1.0, [0, 0, 0], inertia)


@pytest.mark.parametrize(
    "arguments",
    [("heavy",), (np.nan,), (1.0, [0, 0]), (1.0, [0, 0, np.inf]), (1.0, [0, 0, 0], np.eye(2)),
     (1.0, np.zeros((2, 3)))],
)  # fmt: skip
def test_what_is_no_payload_is_refused(arguments: tuple[object, ...]) -> None:
    with pytest.raises(InputError, match="payload"):
        Payload(*arguments)


def test_wrenches_are_broadcast() -> None:
    wrench = np.arange(6.0)
    assert checked_wrench(wrench, (2, 5)).shape == (2, 5, 6)
    assert checked_wrench(wrench, ()).shape == (6,)
    for bad in (np.zeros(5), np.zeros((3, 6)), [np.nan] * 6, "push"):
        with pytest.raises(InputError, match="wrench"):
            checked_wrench(bad, (2,))
