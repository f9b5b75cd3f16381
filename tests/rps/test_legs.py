"""Leg kinematics in closed form: the reference's jets, geometry, and what limits mean."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSParameters, UnreachableError
from rps_pin.rps import legs
from rps_pin.rps.pose import platform_motion, position, rotation
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import LEG_ANGLES

Array = NDArray[np.float64]


def test_radial_directions_are_unit_vectors_120_degrees_apart_and_read_only() -> None:
    np.testing.assert_allclose(legs.RADIAL[0], [1, 0, 0], rtol=0, atol=0)
    gram = legs.RADIAL @ legs.RADIAL.T
    np.testing.assert_allclose(gram, 1.5 * np.eye(3) - 0.5, rtol=0, atol=1e-15)
    assert legs.RADIAL[1, 1] > 0 > legs.RADIAL[2, 1]
    with pytest.raises(ValueError, match="read-only"):
        legs.RADIAL[0, 0] = 2.0


def test_tips_stand_at_the_platform_radius_from_the_centre() -> None:
    rng = np.random.default_rng(0)
    pose = np.concatenate([rng.uniform(0.2, 1, (50, 1)), rng.uniform(-2, 2, (50, 2))], axis=-1)
    centre = position(pose, 0.3)
    tips = legs.tips(centre, rotation(pose), 0.3)
    arms = tips - centre[:, None]
    np.testing.assert_allclose(np.linalg.norm(arms, axis=-1), 0.3, rtol=1e-14)
    np.testing.assert_allclose(arms.sum(axis=1), 0, rtol=0, atol=1e-15)


def test_length_and_angle_are_polar_coordinates_in_the_leg_s_plane() -> None:
    """Tips placed at known angles, over the base and below it, and beyond their joints."""
    length, angle = np.array([0.3, 0.5, 0.7]), np.array([2.5, -0.4, 1.0])
    e = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
    inwards, up = length * np.cos(angle), length * np.sin(angle)
    tips = (0.46 - inwards)[:, None] * e + up[:, None] * [0, 0, 1]
    found = legs.leg_angles_and_lengths(tips, 0.46)
    np.testing.assert_allclose(found[0], length, rtol=1e-15)
    np.testing.assert_allclose(found[1], angle, rtol=1e-14)


def test_leg_without_length_is_named() -> None:
    tips = 0.46 * legs.RADIAL + [[0, 0, 0.1], [0, 0, 0.2], [0, 0, 0]]
    with pytest.raises(UnreachableError, match="leg 3 would have length"):
        legs.leg_angles_and_lengths(np.stack([tips + 0.1, tips]), 0.46)


def test_motion_is_the_reference_s() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        robot = strategies.random_parameters(rng)
        state = strategies.random_motions(rng, robot, 100)
        moving = platform_motion(*state, robot.platform_radius)
        found = legs.leg_motion(moving, robot.platform_radius, robot.base_radius)
        expected = ne.kinematics(robot, *state)
        pairs = {
            "length": expected.leg_lengths,
            "angle": expected.leg_angles,
            "speed": expected.leg_length_rates,
            "angle_rate": expected.leg_angle_rates,
            "acceleration": expected.leg_length_accelerations,
            "angle_acceleration": expected.leg_angle_accelerations,
        }
        assert pairs.keys() == set(found._fields)
        for name, value in pairs.items():
            assert strategies.relative_error(getattr(found, name), value) < 5e-13, name


def test_rising_level_platform_moves_its_legs_by_geometry() -> None:
    """d^2 = (g - h)^2 + z^2: d' = z z'/d, phi' = (g - h) z'/d^2."""
    state = [np.array(x, dtype=float) for x in ([0.4, 0, 0], [0.3, 0, 0], [0, 0, 0])]
    found = legs.leg_motion(platform_motion(*state, 0.16), 0.16, 0.46)
    np.testing.assert_allclose(found.length, 0.5, rtol=1e-15)
    np.testing.assert_allclose(found.speed, 0.4 * 0.3 / 0.5, rtol=1e-14)
    np.testing.assert_allclose(found.angle_rate, 0.3 * 0.3 / 0.25, rtol=1e-14)
    # z'' = 0: d'' = d phi'^2, phi'' = -2 d' phi' / d.
    np.testing.assert_allclose(found.acceleration, 0.5 * 0.36**2, rtol=1e-14)
    np.testing.assert_allclose(found.angle_acceleration, -2 * 0.24 * 0.36 / 0.5, rtol=1e-14)


@pytest.mark.parametrize("angle", [1e-9, 0.1, 1.0, np.pi / 2, 3.0, np.pi - 1e-9])
def test_cone_angle_is_between_leg_and_normal(angle: float) -> None:
    """Level platform: the normal is vertical, a leg stands at pi/2 - phi from it. Exact near 0."""
    found = legs.cone_angles(np.full(3, np.pi / 2 - angle), np.eye(3))
    np.testing.assert_allclose(found, angle, rtol=0, atol=5e-16)


def test_cone_angle_turns_with_the_platform() -> None:
    """Vertical legs: the angle is the tilt, about whatever axis."""
    way = np.linspace(0, 6, 20)
    pose = np.stack([0 * way, 0.7 * np.cos(way), 0.7 * np.sin(way)], axis=-1)
    found = legs.cone_angles(np.full((20, 3), np.pi / 2), rotation(pose))
    np.testing.assert_allclose(found, 0.7, rtol=1e-14)


BOUNDED = RPSParameters.from_preset("sokolov").replace(
    leg_length_limits=(0.2, 0.4), leg_angle_limits=(0.5, 1.5), spherical_cone_limit=0.6
)
INSIDE = {"length": [0.3] * 3, "angle": [1.0] * 3, "cone": [0.1] * 3}


@pytest.mark.parametrize(
    ("name", "quantity", "low", "high"),
    [
        ("length", "length", 0.2, 0.4),
        ("angle", "angle", 0.5, 1.5),
        ("cone", "spherical joint", 0, 0.6),
    ],
)
@pytest.mark.parametrize("leg", range(3))
def test_each_limit_of_each_leg_is_kept(
    name: str, quantity: str, low: float, high: float, leg: int
) -> None:
    for value, fits in ((low, True), (high, True), (low - 1e-9, False), (high + 1e-9, False)):
        values = {key: np.array(x) for key, x in INSIDE.items()}
        values[name][leg] = value
        assert legs.within_limits(BOUNDED, *values.values()) == fits
        broken = legs.violations(BOUNDED, *values.values())
        if fits:
            assert broken == []
        else:
            unit = "m" if name == "length" else "rad"
            assert broken == [(leg + 1, quantity, value, low, high, unit)]


def test_limits_of_a_batch_are_kept_pose_by_pose() -> None:
    length = np.array([[0.3, 0.3, 0.3], [0.3, 0.5, 0.3]])
    rest = np.ones((2, 3)), np.zeros((2, 3))
    np.testing.assert_array_equal(legs.within_limits(BOUNDED, length, *rest), [True, False])
