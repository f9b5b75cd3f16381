"""Rates in closed form: against Pinocchio's constraint models, complex steps and differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError, UnreachableError
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.kinematics.rates import (
    leg_jacobian_rates,
    leg_jacobians,
    platform_twist,
    pose_acceleration,
    pose_rate,
    tip_jacobians,
)
from tests.strategies import LEG_ANGLES, random_motions, random_parameters, relative_error

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ROBOTS = range(8)
#: Level, tiny, where the coefficients' series end (1), at half a turn, and beyond it.
TILTS = [0.0, 1e-200, 1e-9, 1e-3, 0.4, 1.0, 1.5, 3.0, np.pi, 4.0]


def apply(matrix: Array, vector: Array) -> Array:
    return (matrix @ vector[..., None])[..., 0]


def tip_coordinates(parameters: RPSParameters, pose: Complex) -> tuple[Complex, Complex]:
    """Eq. 1 and 4 with Rodrigues' formula, for complex poses (3,): along e_i, and height."""
    h = parameters.platform_radius
    z, wx, wy = pose
    W = np.array([[0, 0, wy], [0, 0, -wx], [-wy, wx, 0]])
    beta = np.sqrt(wx**2 + wy**2)
    R = np.eye(3) + np.sin(beta) / beta * W + 2 * (np.sin(beta / 2) / beta) ** 2 * W @ W
    centre = np.array([h / 2 * (R[0, 0] - R[1, 1]), -h * R[1, 0], z])
    e = np.array([[np.cos(a), np.sin(a), 0] for a in LEG_ANGLES])
    tips = centre + h * e @ R.T
    return (tips * e).sum(axis=1), tips[:, 2]


def complex_step(parameters: RPSParameters, pose: Array, quantity: str) -> Array:
    """Derivatives of leg lengths or angles with respect to the pose, exact to rounding."""
    columns = []
    for axis in np.eye(3):
        radial, height = tip_coordinates(parameters, pose + 1e-30j * axis)
        inwards = parameters.base_radius - radial
        (x, dx), (y, dy) = ((part.real, part.imag / 1e-30) for part in (inwards, height))
        if quantity == "length":
            columns.append((x * dx + y * dy) / np.hypot(x, y))
        else:
            columns.append((x * dy - y * dx) / (x**2 + y**2))
    return np.stack(columns, axis=-1)


def ring(parameters: RPSParameters, tilt: float, count: int = 12) -> Array:
    way = np.linspace(0.1, 2 * np.pi, count)
    height = np.full(count, 1.3 * parameters.base_radius)
    return np.stack([height, tilt * np.cos(way), tilt * np.sin(way)], axis=-1)


# Jacobians ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", ROBOTS)
@pytest.mark.parametrize("quantity", ["length", "angle"])
def test_jacobians_are_derivatives_by_complex_step(seed: int, quantity: str) -> None:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng)
    poses = random_motions(rng, parameters, 40, largest_tilt=3.1)[0]
    expected = np.array([complex_step(parameters, pose, quantity) for pose in poses])
    found = getattr(leg_jacobians(parameters, poses), f"{quantity}_jacobian")
    assert relative_error(found, expected, axes=2) < 2e-13


@pytest.mark.parametrize("tilt", TILTS)
def test_jacobians_are_smooth_in_the_tilt(tilt: float) -> None:
    """The legs' motion of `RPSRobot.motion`, derived otherwise, at every kind of tilt."""
    rng = np.random.default_rng(1)
    robot = RPSRobot(random_parameters(rng))
    pose = ring(robot.parameters, tilt)
    rate, acceleration = rng.normal(size=(2, *pose.shape))
    _, legs = robot.motion(pose, rate, acceleration)
    jacobians = leg_jacobians(robot.parameters, pose)
    change = leg_jacobian_rates(robot.parameters, pose, rate)
    K, N = jacobians.length_jacobian, jacobians.angle_jacobian
    dK, dN = change
    assert relative_error(jacobians.length, legs.length) < 1e-14
    assert relative_error(jacobians.angle, legs.angle) < 1e-14
    assert relative_error(apply(K, rate), legs.speed) < 1e-13
    assert relative_error(apply(N, rate), legs.angle_rate) < 1e-13
    assert relative_error(apply(K, acceleration) + apply(dK, rate), legs.acceleration) < 1e-12
    found = apply(N, acceleration) + apply(dN, rate)
    assert relative_error(found, legs.angle_acceleration) < 1e-12


@pytest.mark.parametrize("seed", ROBOTS)
def test_jacobian_rates_are_derivatives_by_central_differences(seed: int) -> None:
    """Fourth order: whole matrices, of which the legs' motion shows only products."""
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng)
    pose, rate, _ = random_motions(rng, parameters, 40, largest_tilt=3.0)
    rate /= 10
    step = 1e-3

    def at(time: float) -> Array:
        return np.stack(leg_jacobians(parameters, pose + time * rate)[2:])

    expected = (8 * (at(step) - at(-step)) - at(2 * step) + at(-2 * step)) / (12 * step)
    found = np.stack(leg_jacobian_rates(parameters, pose, rate))
    assert relative_error(found, expected, axes=2) < 1e-8


def test_tips_are_those_of_the_platform() -> None:
    robot = RPSRobot.from_preset("sokolov")
    pose = np.array([0.5, 0.6, -0.9])
    tip = tip_jacobians(robot.parameters, pose)
    position, turn = robot.platform_placement(pose)
    for i, angle in enumerate(LEG_ANGLES):
        e = np.array([np.cos(angle), np.sin(angle), 0])
        expected = position + turn @ (robot.parameters.platform_radius * e)
        np.testing.assert_allclose(tip.radial[i] * e + [0, 0, tip.height[i]], expected, atol=1e-16)


# Against Pinocchio, through the constraint models -------------------------------------------------


@pytest.mark.parametrize("seed", ROBOTS)
def test_rates_and_accelerations_are_those_of_the_constraint_models(seed: int) -> None:
    """From leg speeds and accelerations alone, 25 states of each robot, all to 1e-11."""
    rng = np.random.default_rng(seed)
    robot = RPSRobot(random_parameters(rng))
    parameters, mechanism = robot.parameters, robot.mechanism
    poses, zero = random_motions(rng, parameters, 40, largest_tilt=2.5)[0], np.zeros(3)
    data = mechanism.model.createData()
    body = mechanism.model.getFrameId("platform")
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    angle_v = [
        mechanism.model.joints[mechanism.model.getJointId(f"leg_{leg}_revolute")].idx_v
        for leg in (1, 2, 3)
    ]
    checked = 0
    for pose in poses:
        q = robot.state(pose, zero, zero)[0]
        if mechanism.condition(q) > 1e3:
            continue
        checked += 1
        speed, push = rng.normal(size=(2, 3))
        v = mechanism.velocity(q, speed)
        a = mechanism.acceleration(q, v, push)

        rate = pose_rate(parameters, pose, speed).value
        acceleration = pose_acceleration(parameters, pose, rate, push).value
        legs, change = leg_jacobians(parameters, pose), leg_jacobian_rates(parameters, pose, rate)
        assert relative_error(apply(legs.angle_jacobian, rate), v[angle_v]) < 1e-11
        found = apply(legs.angle_jacobian, acceleration) + apply(change.angle_jacobian, rate)
        assert relative_error(found, a[angle_v]) < 1e-11

        pin.forwardKinematics(mechanism.model, data, q, v, a)
        twist = platform_twist(parameters, pose, rate, acceleration)
        expected = pin.getFrameVelocity(mechanism.model, data, body, axes).vector
        assert relative_error(twist.total, expected) < 1e-11
        expected = pin.getFrameClassicalAcceleration(mechanism.model, data, body, axes).vector
        assert relative_error(twist.total_rate, expected) < 1e-11
    assert checked >= 25


# From legs to poses and back ----------------------------------------------------------------------


@pytest.mark.parametrize("seed", ROBOTS)
def test_pose_rates_and_leg_speeds_lead_to_each_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = RPSRobot(random_parameters(rng))
    motion = random_motions(rng, robot.parameters, 100, largest_tilt=0.8)
    pose, rate, acceleration = (part.reshape(4, 25, 3) for part in motion)
    _, legs = robot.motion(pose, rate, acceleration)
    back = pose_rate(robot.parameters, pose, legs.speed)
    assert back.determined.shape == (4, 25) and back.determined.all()
    assert relative_error(back.value, rate) < 1e-10
    back = pose_acceleration(robot.parameters, pose, rate, legs.acceleration)
    assert relative_error(back.value, acceleration) < 1e-9


FLAT = np.zeros(3)
SOKOLOV = RPSParameters.from_preset("sokolov")


def test_flat_robot_is_refused_with_the_numbers() -> None:
    """All legs in the base plane: lifting the platform moves none of them."""
    with pytest.raises(SingularityError, match=r"move inf times .* at most 1e\+08 times") as error:
        pose_rate(SOKOLOV, FLAT, np.ones(3))
    assert error.value.condition == np.inf
    assert error.value.limit == 1e8
    # d = 0.23 m, phi = z/d: d(length)/d(tilt) is h sin(phi) times columns of norm sqrt(3/2).
    with pytest.raises(SingularityError, match=r"move 1\.88e\+08 times"):
        pose_rate(SOKOLOV, [1e-9, 0, 0], np.ones(3))
    with pytest.raises(SingularityError, match=r"entry \(1,\) of 2"):
        pose_acceleration(SOKOLOV, [[0.4, 0, 0], FLAT], FLAT, np.ones(3))


def test_masked_answers_leave_out_what_is_not_determined() -> None:
    found = pose_rate(SOKOLOV, [[0.4, 0, 0], FLAT], np.ones(3), errors="mask")
    np.testing.assert_array_equal(found.determined, [True, False])
    np.testing.assert_array_equal(found.value[1], 0)
    np.testing.assert_array_equal(found.value[0], pose_rate(SOKOLOV, [0.4, 0, 0], np.ones(3)).value)
    tight = pose_rate(SOKOLOV, [0.4, 0, 0], np.ones(3), errors="mask", max_gain=0.9)
    assert not tight.determined


def test_leg_without_length_is_refused_or_masked() -> None:
    parameters = SOKOLOV.replace(platform_radius=SOKOLOV.base_radius)
    for call in (
        lambda: leg_jacobians(parameters, FLAT),
        lambda: leg_jacobian_rates(parameters, FLAT, FLAT),
        lambda: pose_rate(parameters, FLAT, np.ones(3)),
        lambda: pose_acceleration(parameters, FLAT, FLAT, np.ones(3)),
    ):
        with pytest.raises(UnreachableError, match="leg 1 would have length 0 m"):
            call()
    masked = pose_acceleration(parameters, FLAT, np.ones(3), np.ones(3), errors="mask")
    assert not masked.determined and (masked.value == 0).all()


# The twist ----------------------------------------------------------------------------------------


def test_twist_rates_are_derivatives_of_the_twist_and_of_its_parts() -> None:
    rng = np.random.default_rng(3)
    parameters = random_parameters(rng)
    pose, rate, acceleration = random_motions(rng, parameters, 50, largest_tilt=3.0)
    rate, acceleration, step = rate / 3, acceleration / 20, 1e-3

    def at(time: float) -> Array:
        here = pose + time * rate + time**2 / 2 * acceleration
        return np.stack(platform_twist(parameters, here, rate + time * acceleration)[:2])

    expected = (8 * (at(step) - at(-step)) - at(2 * step) + at(-2 * step)) / (12 * step)
    found = np.stack(platform_twist(parameters, pose, rate, acceleration)[2:])
    assert relative_error(found, expected) < 1e-8


def test_only_climb_and_tilt_are_commanded() -> None:
    rng = np.random.default_rng(4)
    pose, rate, acceleration = random_motions(rng, SOKOLOV, 20)
    twist = platform_twist(SOKOLOV, pose, rate, acceleration)
    for commanded, parasitic in (twist[:2], twist[2:]):
        np.testing.assert_array_equal(commanded[:, [0, 1, 5]], 0)
        np.testing.assert_array_equal(parasitic[:, [2, 3, 4]], 0)
    np.testing.assert_array_equal(twist.commanded[:, 2], rate[:, 0])
    assert (np.abs(twist.parasitic[:, [0, 1, 5]]) > 0).all()


def test_a_level_platform_has_no_parasitic_velocity() -> None:
    twist = platform_twist(SOKOLOV, [0.4, 0, 0], [0.1, 0.2, -0.3])
    np.testing.assert_allclose(twist.commanded, [0, 0, 0.1, 0.2, -0.3, 0], rtol=0, atol=1e-17)
    np.testing.assert_array_equal(twist.parasitic, 0)


def test_torsion_follows_from_the_tilt() -> None:
    """omega is normal to n, halfway between the vertical and the platform's normal."""
    rng = np.random.default_rng(5)
    pose, rate, _ = random_motions(rng, SOKOLOV, 50, largest_tilt=3.0)
    halfway = rotation(pose)[..., :, 2] + [0, 0, 1]
    spin = platform_twist(SOKOLOV, pose, rate).total[:, 3:]
    np.testing.assert_allclose((spin * halfway).sum(axis=1), 0, rtol=0, atol=1e-14)


# Bad input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [[0.4, 0], 1.0, "abc", [[0.4, np.nan, 0]], [None] * 3])
def test_bad_arrays_are_refused(bad: object) -> None:
    good = np.array([0.4, 0.0, 0.0])
    for call in (
        lambda: leg_jacobians(SOKOLOV, bad),  # type: ignore[arg-type]
        lambda: leg_jacobian_rates(SOKOLOV, good, bad),  # type: ignore[arg-type]
        lambda: pose_rate(SOKOLOV, bad, good),  # type: ignore[arg-type]
        lambda: pose_rate(SOKOLOV, good, bad),  # type: ignore[arg-type]
        lambda: pose_acceleration(SOKOLOV, good, good, bad),  # type: ignore[arg-type]
        lambda: platform_twist(SOKOLOV, good, bad),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError):
            call()


def test_bad_options_and_shapes_are_named() -> None:
    pose = np.array([0.4, 0.0, 0.0])
    with pytest.raises(InputError, match="errors = 'ignore'"):
        pose_rate(SOKOLOV, pose, pose, errors="ignore")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="max_gain = 0"):
        pose_rate(SOKOLOV, pose, pose, max_gain=0)
    with pytest.raises(InputError, match=r"pose \(2, 3\), leg_speed \(5, 3\)"):
        pose_rate(SOKOLOV, np.tile(pose, (2, 1)), np.ones((5, 3)))
    with pytest.raises(InputError, match=r"leg_speed has shape \(2,\); it must be .*legs 1, 2, 3"):
        pose_rate(SOKOLOV, pose, [1.0, 2.0])
