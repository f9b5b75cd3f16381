"""Batched actuator forces: against constraint models, Newton and Euler, energy, symmetry."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import (
    InputError,
    RPSParameters,
    RPSRobot,
    SingularityError,
    UnreachableError,
)
from rps_pin.rps.dynamics import actuator_forces as module
from rps_pin.rps.dynamics.loads import Payload
from tests import strategies
from tests.reference import newton_euler as ne
from tests.strategies import Motion, relative_error
from tests.worst import worst

Array = NDArray[np.float64]

STILL = np.zeros(3)
FRICTION = {
    "prismatic_damping": 30.0,
    "prismatic_friction": 5.0,
    "revolute_damping": 0.4,
    "revolute_friction": 0.3,
    "friction_speed": 0.1,
}


def sokolov() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


def random_payload(rng: np.random.Generator) -> Payload:
    inertia = strategies.rigid_body_inertia(rng, 2.0, 0.1)
    return Payload(rng.uniform(0.5, 5.0), rng.normal(scale=0.2, size=3), inertia)


def by_constraints(robot: RPSRobot, motion: Motion, wrench: Array | None = None) -> Array:
    """The forces of each sample through the constraint models."""
    states = zip(*robot.state(*motion), strict=True)
    return np.array(
        [
            robot.inverse_dynamics(*state, wrench=None if wrench is None else wrench[i]).tau
            for i, state in enumerate(states)
        ]
    )


# The same as through the constraint models --------------------------------------------------------


@pytest.mark.parametrize("rods", [False, True], ids=["massless rods", "heavy rods"])
@pytest.mark.parametrize("tilted", [False, True], ids=["vertical", "tilted gravity"])
@pytest.mark.parametrize("friction", [False, True], ids=["free", "friction"])
@pytest.mark.parametrize("payload", [False, True], ids=["bare", "payload"])
def test_forces_are_those_of_the_constraint_models(
    rods: bool, tilted: bool, friction: bool, payload: bool
) -> None:
    rng = np.random.default_rng([1, rods, tilted, friction, payload])
    errors = []
    for _ in range(8):
        parameters = strategies.random_parameters(rng, heavy_rods=rods, tilted_gravity=tilted)
        if friction:
            parameters = parameters.replace(**FRICTION)
        robot = RPSRobot(parameters, random_payload(rng) if payload else None)
        motion = strategies.random_motions(rng, parameters, 60, largest_tilt=1.2)
        wrench = rng.normal(scale=20.0, size=(60, 6))
        found = robot.actuator_forces(*motion, wrench=wrench)
        conditions = np.array([robot.mechanism.condition(q) for q in robot.state(*motion)[0]])
        expected = by_constraints(robot, motion, wrench)
        good = conditions < 1e4
        errors.append(relative_error(found[good], expected[good]))
        np.testing.assert_allclose(
            robot.actuator_forces(*motion)[good],
            by_constraints(robot, motion)[good],
            rtol=0,
            atol=1e-10 * np.abs(expected).max(),
        )
    assert worst(*errors) < 1e-10


def test_forces_are_newton_and_euler_s() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        parameters = strategies.random_parameters(rng, tilted_gravity=True)
        motion = strategies.random_motions(rng, parameters, 500, largest_tilt=1.2)
        found = RPSRobot(parameters).actuator_forces(*motion)
        expected = ne.inverse_dynamics(parameters, *motion).forces
        # Near a singularity errors of rounding grow with the forces themselves.
        reactions = ne.inverse_dynamics(parameters, *motion).reactions
        size = np.abs(reactions).max(axis=(-1, -2))[:, None]
        weight = 10 * parameters.platform_mass * 9.81
        tame = size[:, 0] < 1e3 * weight
        assert tame.mean() > 0.9
        assert (np.abs(found - expected) / size)[tame].max() < 1e-10


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-4, 1.99, 2.0, 2.01, 3.0, 4.5])
def test_tilts_of_every_size(tilt: float) -> None:
    """The functions of the tilt change their formula at 2 rad."""
    rng = np.random.default_rng(8)
    parameters = strategies.random_parameters(rng, tilted_gravity=True)
    pose, rate, acceleration = strategies.random_motions(rng, parameters, 50)
    way = rng.uniform(0, 2 * np.pi, 50)
    pose[:, 1], pose[:, 2] = tilt * np.cos(way), tilt * np.sin(way)
    robot = RPSRobot(parameters)
    found = robot.actuator_forces(pose, rate, acceleration)
    expected = ne.inverse_dynamics(parameters, pose, rate, acceleration).forces
    conditions = np.array([robot.mechanism.condition(q) for q in robot.state(pose, rate, rate)[0]])
    good = conditions < 1e3
    assert good.sum() > 20
    assert relative_error(found[good], expected[good]) < 1e-11


# Payload, wrench, friction: by hand ---------------------------------------------------------------


def upright() -> RPSParameters:
    """h = g: level legs stand upright, so that forces at the legs are seen without trigonometry."""
    return RPSParameters.from_preset("sokolov").replace(platform_radius=0.46)


def test_payload_at_rest_is_borne_by_the_lever_rule() -> None:
    """Upright legs at distance h: a weight W at (x, y) puts W/3 (1 + 2 e_i . (x, y)/h) on leg i."""
    robot = RPSRobot(upright())
    centre = np.array([0.07, -0.11, 0.3])
    loaded = robot.with_payload(Payload(2.0, centre))
    more = loaded.actuator_forces([0.4, 0, 0], STILL, STILL) - robot.actuator_forces(
        [0.4, 0, 0], STILL, STILL
    )
    ways = np.stack([np.cos(strategies.LEG_ANGLES), np.sin(strategies.LEG_ANGLES)], axis=-1)
    np.testing.assert_allclose(more, 2 * 9.81 / 3 * (1 + 2 * ways @ centre[:2] / 0.46), rtol=1e-13)
    assert loaded.with_payload(None).payload is None


def test_vertical_push_is_shared_and_moments_go_to_the_levers() -> None:
    """Upright legs: the legs bear -F_z/3 each, and moments M by -2/(3 h) e_i . (-M_y, M_x)."""
    robot = RPSRobot(upright())
    wrench = np.array([0.0, 0.0, 30.0, 4.0, -7.0, 0.0])
    bare = robot.actuator_forces([0.4, 0, 0], STILL, STILL)
    found = robot.actuator_forces([0.4, 0, 0], STILL, STILL, wrench=wrench) - bare
    ways = np.stack([np.cos(strategies.LEG_ANGLES), np.sin(strategies.LEG_ANGLES)], axis=-1)
    # sum f_i = -F_z; sum h (e_i x f_i z) = -M: h sum f_i (e_y, -e_x) = -(M_x, M_y)
    expected = -10.0 - 2 / (3 * 0.46) * (ways @ np.array([7.0, 4.0]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    levers = 0.46 * np.stack([ways[:, 1], -ways[:, 0]], axis=-1)
    np.testing.assert_allclose(found @ levers, -wrench[3:5], rtol=1e-12)


def test_a_payload_is_a_heavier_platform() -> None:
    """Centred on the platform's centre, it only adds to mass and inertia."""
    rng = np.random.default_rng(12)
    parameters = strategies.random_parameters(rng, tilted_gravity=True)
    motion = strategies.random_motions(rng, parameters, 300)
    own = strategies.rigid_body_inertia(rng, 3.0, 0.2)
    heavier = parameters.replace(
        platform_mass=parameters.platform_mass + 3.0,
        platform_inertia=parameters.platform_inertia + own,
    )
    loaded = RPSRobot(parameters).with_payload(Payload(3.0, [0, 0, 0], own))
    assert (
        relative_error(loaded.actuator_forces(*motion), RPSRobot(heavier).actuator_forces(*motion))
        < 1e-12
    )


def payload_wrench(parameters: RPSParameters, payload: Payload, motion: Motion) -> Array:
    """By Newton and Euler at the payload's own centre: what it exerts on the platform, (n, 6)."""
    k = ne.kinematics(parameters, *motion)
    R, spin = k.rotation, k.angular_velocity
    arm = R @ payload.centre
    inertia = R @ payload.inertia @ np.swapaxes(R, -1, -2)
    acceleration = (
        k.acceleration + np.cross(k.angular_acceleration, arm) + np.cross(spin, np.cross(spin, arm))
    )
    force = payload.mass * (acceleration - parameters.gravity)
    moment = (inertia @ k.angular_acceleration[..., None])[..., 0]
    moment += np.cross(spin, (inertia @ spin[..., None])[..., 0]) + np.cross(arm, force)
    return -np.concatenate([force, moment], axis=-1)


def test_a_payload_is_the_wrench_that_it_exerts() -> None:
    rng = np.random.default_rng(13)
    for _ in range(10):
        parameters = strategies.random_parameters(rng, tilted_gravity=True).replace(**FRICTION)
        payload = random_payload(rng)
        motion = strategies.random_motions(rng, parameters, 100)
        robot = RPSRobot(parameters)
        loaded = robot.with_payload(payload).actuator_forces(*motion)
        pushed = robot.actuator_forces(*motion, wrench=payload_wrench(parameters, payload, motion))
        assert relative_error(loaded, pushed) < 1e-10


def payload_power(parameters: RPSParameters, payload: Payload, motion: Motion) -> Array:
    """Power that the wrench of a payload takes, (n,)."""
    k = ne.kinematics(parameters, *motion)
    wrench = payload_wrench(parameters, payload, motion)
    return -(wrench * np.concatenate([k.velocity, k.angular_velocity], axis=-1)).sum(axis=-1)


def test_power_in_is_energy_rate_plus_dissipation() -> None:
    """sum F d' = dE/dt + power into the payload + sum over joints of e(v) v - wrench . twist."""
    rng = np.random.default_rng(14)
    for _ in range(20):
        parameters = strategies.random_parameters(rng, tilted_gravity=True).replace(**FRICTION)
        payload = random_payload(rng)
        motion = strategies.random_motions(rng, parameters, 100)
        wrench = rng.normal(scale=20.0, size=6)
        k = ne.kinematics(parameters, *motion)
        lost = 0.0
        for kind, speed in (("prismatic", k.leg_length_rates), ("revolute", k.leg_angle_rates)):
            drag = FRICTION[f"{kind}_damping"] * speed
            drag = drag + FRICTION[f"{kind}_friction"] * np.tanh(speed / 0.1)
            assert (drag * speed >= 0).all()
            lost = lost + (drag * speed).sum(axis=-1)
        gain = ne.power(parameters, *motion) + payload_power(parameters, payload, motion)
        gain -= np.concatenate([k.velocity, k.angular_velocity], axis=-1) @ wrench
        robot = RPSRobot(parameters).with_payload(payload)
        work = robot.actuator_forces(*motion, wrench=wrench) * k.leg_length_rates
        size = np.abs(work).sum(axis=-1) + np.abs(gain) + lost
        assert (np.abs(work.sum(axis=-1) - gain - lost) / size).max() < 1e-9


def test_friction_opposes_a_vertical_motion() -> None:
    """Level, at a steady climb, leg by leg: the friction of d', and of phi' through its lever.

    The work of one leg is that of a third of the climb: F' d'_i = e_p d'_i + e_r phi'_i.
    """
    parameters = RPSParameters.from_preset("sokolov").replace(**FRICTION)
    pose, rate = [0.4, 0, 0], [0.2, 0, 0]
    k = ne.kinematics(parameters, pose, rate, STILL)
    speed, turning = k.leg_length_rates, k.leg_angle_rates
    drag = 30 * speed + 5 * np.tanh(speed / 0.1)
    twist = 0.4 * turning + 0.3 * np.tanh(turning / 0.1)
    more = RPSRobot(parameters).actuator_forces(pose, rate, STILL)
    more -= sokolov().actuator_forces(pose, rate, STILL)
    np.testing.assert_allclose(more, drag + twist * turning / speed, rtol=1e-12)


def test_the_presets_have_no_friction() -> None:
    for name in RPSParameters.presets():
        assert RPSRobot.from_preset(name).mechanism.effects is None
    robot = RPSRobot(RPSParameters.from_preset("sokolov").replace(prismatic_friction=1.0))
    assert robot.mechanism.effects is not None


def test_a_robot_on_the_wall_is_one_under_turned_gravity() -> None:
    """Everything turned by Q, base and all: the weights, as wrenches in the turned base's axes.

    The forces with gravity Q' g equal those of a weightless robot on whose bodies the weights
    Q' (m g) act: the platform's as a wrench, the legs' by the virtual work of their centres.
    """
    rng = np.random.default_rng(15)
    bare = strategies.random_parameters(rng)
    turn = Rotation.random(random_state=3).as_matrix()
    gravity = turn.T @ np.array([0.0, 0.0, -9.81])
    wall = RPSRobot(bare.replace(gravity=gravity))
    massless = bare.replace(gravity=[0, 0, 0], leg_mass=0.0, leg_inertia=0.0, rod_mass=0.0,
                            rod_inertia=0.0)  # fmt: skip
    pose = strategies.random_motions(rng, bare, 50)[0]
    weight = np.append(bare.platform_mass * gravity, np.zeros(3))
    expected = RPSRobot(massless).actuator_forces(pose, STILL, STILL, wrench=weight)
    # The legs' share: K' F = -d(potential)/d(pose), by complex steps of the reference's energy.
    light = ne.ReferenceRobot(
        **{
            name: getattr(bare, name)
            for name in ("base_radius", "platform_radius", "leg_mass", "leg_com", "rod_mass",
                         "rod_com")
        },
        platform_mass=0.0,
        platform_inertia=np.zeros((3, 3)),
        gravity=gravity,
    )  # fmt: skip
    slope = [np.imag(ne.energy(light, pose + 1e-40j * e, STILL)) / 1e-40 for e in np.eye(3)]
    columns = [ne.kinematics(bare, pose, e, STILL).leg_length_rates for e in np.eye(3)]
    K = np.stack(columns, axis=-1)
    legs = np.linalg.solve(np.swapaxes(K, -1, -2), np.stack(slope, axis=-1)[..., None])[..., 0]
    found = wall.actuator_forces(pose, STILL, STILL)
    assert relative_error(found, expected + legs) < 1e-10


def test_upside_down_robot_hangs() -> None:
    """Gravity the other way round: every static force changes its sign."""
    rng = np.random.default_rng(16)
    parameters = strategies.random_parameters(rng, tilted_gravity=True)
    pose = strategies.random_motions(rng, parameters, 50)[0]
    up = RPSRobot(parameters.replace(gravity=-parameters.gravity))
    down = RPSRobot(parameters)
    np.testing.assert_allclose(
        up.actuator_forces(pose, STILL, STILL), -down.actuator_forces(pose, STILL, STILL)
    )


@given(
    parameters=strategies.parameters(),
    pose=strategies.poses(largest_tilt=1.5),
    rate=strategies.vectors(3.0),
    acceleration=strategies.vectors(20.0),
    wrench=st.none() | st.tuples(*[strategies.floats(-50, 50)] * 6).map(np.array),
)
def test_any_robot_any_state(
    parameters: RPSParameters, pose: Array, rate: Array, acceleration: Array, wrench: Array | None
) -> None:
    """Finite or refused; where the constraint model is well conditioned, equal to it."""
    robot = RPSRobot(parameters)
    found = robot.actuator_forces(pose, rate, acceleration, wrench=wrench, errors="mask")
    assert np.isfinite(np.asarray(found)).all()
    if found.mask.any():
        with pytest.raises((SingularityError, UnreachableError)):
            state = robot.state(pose, rate, acceleration)
            robot.inverse_dynamics(*state, wrench=wrench)
        return
    q, v, a = robot.state(pose, rate, acceleration)
    solved = robot.inverse_dynamics(q, v, a, wrench=wrench)
    if solved.condition < 1e3:
        size = max(np.abs(solved.tau).max(), np.abs(solved.constraint_forces).max())
        np.testing.assert_allclose(np.asarray(found), solved.tau, rtol=0, atol=1e-10 * size + 1e-30)


# Shapes -------------------------------------------------------------------------------------------


def test_a_batch_is_its_samples_and_blocks_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(17)
    robot = RPSRobot(strategies.random_parameters(rng), random_payload(rng))
    motion = strategies.random_motions(rng, robot.parameters, 24)
    wrench = rng.normal(size=(24, 6))
    whole = robot.actuator_forces(*motion, wrench=wrench)
    single = [
        robot.actuator_forces(*sample, wrench=w) for *sample, w in zip(*motion, wrench, strict=True)
    ]
    assert single[0].shape == (3,)
    np.testing.assert_allclose(whole, single, rtol=1e-12)
    shaped = robot.actuator_forces(
        *(x.reshape(2, 3, 4, 3) for x in motion), wrench=wrench.reshape(2, 3, 4, 6)
    )
    np.testing.assert_array_equal(shaped.reshape(24, 3), whole)
    monkeypatch.setattr(module, "BLOCK", 7)
    np.testing.assert_allclose(robot.actuator_forces(*motion, wrench=wrench), whole, rtol=1e-12)


def test_arguments_are_broadcast_and_left_alone() -> None:
    robot = sokolov()
    pose = np.array([[0.4, 0.1, 0.0], [0.5, 0.0, 0.2]])
    before = pose.copy()
    found = robot.actuator_forces(pose, [0.1, 0, 0], STILL, wrench=np.zeros(6))
    np.testing.assert_array_equal(found, robot.actuator_forces(pose, [[0.1, 0, 0]] * 2, STILL))
    np.testing.assert_array_equal(pose, before)
    assert robot.actuator_forces(np.empty((0, 3)), STILL, STILL).shape == (0, 3)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))])
def test_copies_carry_the_payload(copied: Callable[[RPSRobot], RPSRobot]) -> None:
    robot = sokolov().with_payload(Payload(2.0, [0.1, 0.0, 0.0]))
    again = copied(robot)
    np.testing.assert_array_equal(
        again.actuator_forces([0.4, 0.1, 0.2], STILL, STILL),
        robot.actuator_forces([0.4, 0.1, 0.2], STILL, STILL),
    )


# What is refused ----------------------------------------------------------------------------------


def test_singular_sample_is_named_and_masked() -> None:
    robot = sokolov()
    poses = np.array([[0.4, 0.0, 0.0], [0.4, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(SingularityError, match=r"sample 2 of 4: pose z = 0 m.*at most 1e\+08") as e:
        robot.actuator_forces(poses, STILL, STILL)
    assert e.value.condition > e.value.limit == robot.mechanism.max_condition
    with pytest.raises(SingularityError, match=r"sample \(1, 0\) of 4"):
        robot.actuator_forces(poses.reshape(2, 2, 3), STILL, STILL)
    with pytest.raises(SingularityError, match=r"^pose z = 0 m"):
        robot.actuator_forces([0, 0, 0], STILL, STILL)
    masked = robot.actuator_forces(poses, STILL, STILL, errors="mask")
    np.testing.assert_array_equal(masked.mask, np.array([[0] * 3, [0] * 3, [1] * 3, [1] * 3]))
    np.testing.assert_array_equal(masked[:2], robot.actuator_forces(poses[:2], STILL, STILL))
    assert np.isfinite(masked.data).all()


def near_type_ii(parameters: RPSParameters, rng: np.random.Generator, count: int) -> Array:
    """Poses 1e-1 to 1e-15 from where det d(length)/d(pose) changes its sign, found by bisection."""

    def sign(pose: Array) -> Array:
        slopes = ne.kinematics(parameters, pose[:, None], np.eye(3), STILL).leg_length_rates
        return np.sign(np.linalg.det(slopes))

    one, other = (strategies.random_motions(rng, parameters, 4000, 2.5)[0] for _ in range(2))
    across = sign(one) * sign(other) < 0
    low, high = one[across][:count], other[across][:count]
    at_low = sign(low)
    start = high - low
    for _ in range(60):
        middle = (low + high) / 2
        same = (sign(middle) == at_low)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    poses: Array = low + start * 10.0 ** -rng.uniform(1, 15, size=(len(low), 1))
    return poses


def check_refusals(robot: RPSRobot, poses: Array) -> int:
    """Compare with the constraint model's condition numbers; return how many are beyond."""
    found = robot.actuator_forces(poses, STILL, STILL, errors="mask").mask.any(axis=-1)
    conditions = [robot.mechanism.condition(q) for q in robot.state(poses, STILL, STILL)[0]]
    share = np.array(conditions) / robot.mechanism.max_condition
    clear = np.abs(np.log10(share)) > 0.01  # at the limit itself, rounding decides
    np.testing.assert_array_equal(found[clear], (share > 1)[clear])
    return int((share > 1).sum())


def test_what_the_constraint_model_refuses_is_refused() -> None:
    """Near flat, near a half turn, and near type II singularities of random robots."""
    robot = sokolov()
    small = np.geomspace(1e-1, 1e-13, 120)
    zero = np.zeros_like(small)
    assert check_refusals(robot, np.stack([small, zero, zero], axis=-1)) > 20
    assert check_refusals(robot, np.stack([zero + 0.9, np.pi - small, 0.3 * small], axis=-1)) > 20
    rng = np.random.default_rng(19)
    beyond = 0
    for _ in range(10):
        parameters = strategies.random_parameters(rng)
        beyond += check_refusals(RPSRobot(parameters), near_type_ii(parameters, rng, 40))
    assert beyond > 30


def test_samples_out_of_reach_are_refused_as_by_inverse_kinematics() -> None:
    """Each limit by itself, at random: the same samples are masked as are not reachable."""
    rng = np.random.default_rng(18)
    bare = upright()
    poses = np.stack([rng.uniform(0.15, 0.3, 3000), *rng.uniform(-0.6, 0.6, (2, 3000))], axis=-1)
    cases: list[tuple[float, dict[str, object]]] = [
        (0.1, {"leg_length_limits": (0.2, 0.25)}),
        (0.1, {"leg_length_limits": (0.0, 0.25)}),
        (1.0, {"leg_angle_limits": (1.3, 1.8)}),
        (1.0, {"leg_angle_limits": (1.2, np.pi)}),
        (1.0, {"spherical_cone_limit": 0.3}),
        (1.0, {"spherical_cone_limit": 0.5, "spherical_rest_angle": 0.3}),
    ]
    for share, limits in cases:
        pose = poses * [1.0, share, share]
        robot = RPSRobot(bare.replace(**limits))
        reachable = robot.inverse_kinematics(pose, errors="mask").reachable
        assert 0.02 < reachable.mean() < 0.98
        found = robot.actuator_forces(pose, STILL, STILL, errors="mask")
        np.testing.assert_array_equal(found.mask.any(axis=-1), ~reachable)
        first = int(np.argmin(reachable))
        with pytest.raises(UnreachableError, match=f"sample {first} of 3000: .*out of reach") as e:
            robot.actuator_forces(pose, STILL, STILL)
        assert e.value.violations


def test_limits_themselves_are_within_reach() -> None:
    robot = RPSRobot(upright().replace(leg_length_limits=(0.2, 0.25)))
    for height in (0.2, 0.25):
        assert np.isfinite(robot.actuator_forces([height, 0, 0], STILL, STILL)).all()
    for height in (0.2 - 1e-9, 0.25 + 1e-9):
        with pytest.raises(UnreachableError, match="leg 1: length"):
            robot.actuator_forces([height, 0, 0], STILL, STILL)


def test_a_leg_of_no_length_is_refused_or_masked() -> None:
    robot = RPSRobot(upright())
    with pytest.raises(UnreachableError, match="sample 1 of 2: leg 1 would have length 0 m"):
        robot.actuator_forces([[0.4, 0, 0], [0.0, 0.0, 0.0]], STILL, STILL)
    masked = robot.actuator_forces([[0.4, 0, 0], [0.0, 0, 0]], STILL, STILL, errors="mask")
    assert masked.mask.any(axis=-1).tolist() == [False, True]


@pytest.mark.parametrize("name", ["pose", "rate", "acceleration", "wrench"])
@pytest.mark.parametrize("errors", ["raise", "mask"])
def test_numbers_that_are_not_finite_are_named(name: str, errors: str) -> None:
    arguments = {"pose": [0.4, 0, 0], "rate": [0, 0, 0], "acceleration": [0, 0, 0]}
    arguments |= {"wrench": [0] * 6, name: [np.nan] * (6 if name == "wrench" else 3)}
    with pytest.raises(InputError, match=rf"{name} is not finite: entry 0 is nan"):
        sokolov().actuator_forces(**arguments, errors=errors)


def test_what_does_not_fit_is_refused() -> None:
    robot = sokolov()
    with pytest.raises(InputError, match=r"wrench has shape \(4, 6\).*\(2, 6\)"):
        robot.actuator_forces([[0.4, 0, 0]] * 2, STILL, STILL, wrench=np.zeros((4, 6)))
    with pytest.raises(InputError, match=r"wrench has shape \(3,\)"):
        robot.actuator_forces([0.4, 0, 0], STILL, STILL, wrench=np.zeros(3))
    with pytest.raises(InputError, match=r"do not go together.*\(2, 3\).*\(4, 3\)"):
        robot.actuator_forces(np.full((2, 3), 0.1), np.zeros((4, 3)), STILL)
    with pytest.raises(InputError, match=r"ignore.*'raise' or 'mask'"):
        robot.actuator_forces([0.4, 0, 0], STILL, STILL, errors="ignore")
    with pytest.raises(InputError, match=r"rate is beyond 1e\+50: entry 1 is 1e\+200"):
        robot.actuator_forces([0.4, 0.1, 0], [0, 1e200, 0], STILL)
