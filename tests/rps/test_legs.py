"""Leg kinematics in closed form: the reference's jets, geometry, and what limits mean."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import RPSParameters, UnreachableError
from rps_pin.rps.kinematics import legs
from rps_pin.rps.kinematics.pose import position, rotation
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
        found = legs.leg_motion(*state, robot.platform_radius, robot.base_radius)
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
    found = legs.leg_motion(*state, 0.16, 0.46)
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


@pytest.mark.parametrize("phi", [-1.5, 0.0, 0.5, np.pi / 2, 2.0])
def test_leg_is_at_rest_where_its_joint_is_made_for_it(phi: float) -> None:
    """Level platform, legs at phi: the rest angle pi/2 - phi leaves no angle; it leans as they do.

    A leg with phi < pi/2 leans inwards, and its rest angle is positive.
    """
    rest = np.pi / 2 - phi
    np.testing.assert_allclose(legs.cone_angles(np.full(3, phi), np.eye(3), rest), 0, atol=5e-16)
    outwards = np.sum(legs.rest_axes(rest) * legs.RADIAL, axis=-1)
    np.testing.assert_array_equal(np.sign(np.round(outwards, 12)), -np.sign(round(rest, 12)))


def test_rest_axes_stand_at_the_rest_angle_in_the_plane_of_normal_and_leg() -> None:
    for rest in (-1.2, -0.1, 0.0, 0.3, 1.5):
        axes = legs.rest_axes(rest)
        np.testing.assert_allclose(np.linalg.norm(axes, axis=-1), 1, rtol=1e-15)
        np.testing.assert_allclose(axes[:, 2], np.cos(rest), rtol=1e-15)
        across = np.cross(legs.RADIAL, [0, 0, 1])
        np.testing.assert_allclose(np.sum(axes * across, axis=-1), 0, rtol=0, atol=1e-16)


def test_cone_angle_is_the_angle_between_two_directions_of_the_platform() -> None:
    """In platform axes, by SciPy: leg from revolute joint to tip against the turned normal."""
    rng = np.random.default_rng(2)
    pose = np.stack([rng.uniform(0.3, 0.9, 50), *rng.uniform(-1, 1, (2, 50))], axis=-1)
    tips = legs.tips(position(pose, 0.23), rotation(pose), 0.23)
    _, angle = legs.leg_angles_and_lengths(tips, 0.46)
    rest = 0.4
    found = legs.cone_angles(angle, rotation(pose), rest)
    turn = Rotation.from_rotvec(np.concatenate([pose[:, 1:], np.zeros((50, 1))], axis=-1))
    for leg, direction in enumerate(LEG_ANGLES):
        revolute = 0.46 * np.array([np.cos(direction), np.sin(direction), 0.0])
        seen = turn.inv().apply(tips[:, leg] - revolute)
        # The normal leans inwards: it turns about the horizontal -(z x e) of its leg.
        axis = -np.array([-np.sin(direction), np.cos(direction), 0.0])
        rest_axis = Rotation.from_rotvec(rest * axis).apply([0, 0, 1])
        expected = np.arccos(seen @ rest_axis / np.linalg.norm(seen, axis=-1))
        np.testing.assert_allclose(found[:, leg], expected, rtol=0, atol=1e-13)


def test_spherical_joint_s_limit_is_about_its_rest_axis() -> None:
    """Legs at 60 degrees, level: 30 degrees from the normal, none from a joint made for them."""
    plain = BOUNDED.replace(spherical_cone_limit=0.5)
    made_for_it = plain.replace(spherical_rest_angle=np.pi / 6)
    angle = np.full(3, np.pi / 3)
    rest = np.full(3, 0.3), angle
    for robot, fits, value in ((plain, False, np.pi / 6), (made_for_it, True, 0.0)):
        cone = legs.cone_angles(angle, np.eye(3), robot.spherical_rest_angle)
        np.testing.assert_allclose(cone, value, rtol=0, atol=1e-15)
        assert legs.within_limits(robot, *rest, cone) == fits
        broken = legs.violations(robot, *rest, cone)
        expected = [] if fits else [(leg, "spherical joint", 0.0, 0.5) for leg in (1, 2, 3)]
        assert [(v.leg, v.quantity, v.lower, v.upper) for v in broken] == expected
    # The other way round: the limit holds about the normal and not about the rest axis.
    cone = legs.cone_angles(np.full(3, np.pi / 2), np.eye(3), 0.6)
    assert legs.violations(BOUNDED.replace(spherical_cone_limit=0.5), *rest, cone)[0].value == (
        pytest.approx(0.6, abs=1e-15)
    )


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
