"""The reference itself, against things it does not share: other formulas, other principles.

Errors are relative to the sum of the magnitudes of the terms that should cancel.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.reference import newton_euler as ne
from tests.worst import worst

Array = NDArray[Any]
State = tuple[Array, Array, Array]

STEP = 1e-40


def random_robot(rng: np.random.Generator) -> ne.ReferenceRobot:
    """Heavy legs and rods, a full platform inertia, gravity in any direction."""
    base_radius = rng.uniform(0.2, 0.8)
    points = rng.normal(scale=0.2, size=(8, 3))
    mass = rng.uniform(0.5, 20.0)
    second_moment = mass / 8 * points.T @ points
    direction = rng.normal(size=3)
    return ne.ReferenceRobot(
        base_radius=base_radius,
        platform_radius=base_radius * rng.uniform(0.3, 1.2),
        platform_mass=mass,
        platform_inertia=np.trace(second_moment) * np.eye(3) - second_moment,
        leg_mass=rng.uniform(0.5, 10.0),
        leg_com=rng.uniform(0.05, 0.5),
        leg_inertia_about_com=rng.uniform(0.01, 0.5),
        rod_mass=rng.uniform(0.5, 10.0),
        rod_com=rng.uniform(0.05, 0.5),
        rod_inertia=rng.uniform(0.01, 0.5),
        gravity=9.81 * direction / np.linalg.norm(direction),
    )


def random_states(robot: ne.ReferenceRobot, rng: np.random.Generator, count: int) -> State:
    """Tilts of up to 1 rad, fast: Coriolis terms weigh as much as gravity."""
    height = robot.base_radius * rng.uniform(1.0, 3.0, size=count)
    size, way = rng.uniform(0.0, 1.0, size=count), rng.uniform(0.0, 2.0 * np.pi, size=count)
    pose = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    return pose, rng.normal(scale=3.0, size=(count, 3)), rng.normal(scale=20.0, size=(count, 3))


def samples(seed: int, robots: int, states: int) -> Iterator[tuple[ne.ReferenceRobot, State]]:
    rng = np.random.default_rng(seed)
    for _ in range(robots):
        robot = random_robot(rng)
        yield robot, random_states(robot, rng, states)


def along(state: State, function: Callable[[Array, Array], Array]) -> Array:
    """d/dt function(pose, rate) along the motion, by complex step."""
    pose, rate, acceleration = state
    moved = function(pose + 1j * STEP * rate, rate + 1j * STEP * acceleration)
    return np.imag(moved) / STEP


def relative(left: Array, right: Array) -> Array:
    """Relative differences of arrays of vectors."""
    size = np.linalg.norm(left, axis=-1) + np.linalg.norm(right, axis=-1)
    return np.linalg.norm(left - right, axis=-1) / size


def gap(left: Array, right: Array) -> float:
    return float(np.max(relative(left, right)))


def dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)


def cross_check(name: str, error: float, tolerance: float) -> None:
    print(f"{name}: {error:.2e}")
    assert error < tolerance, name


# --- kinematics ----------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 1e-200, 1e-12, 1e-8, 1e-4, 0.1, 1.0, 1.5, 3.0, 6.0])
def test_rotation_is_the_exponential_map(angle: float) -> None:
    robot = random_robot(np.random.default_rng(1))
    way = np.linspace(0.0, 2.0 * np.pi, 50)
    w = angle * np.stack([np.cos(way), np.sin(way), np.zeros(50)], axis=-1)
    pose = np.concatenate([np.ones((50, 1)), w[:, :2]], axis=-1)
    rotation = ne.motion(robot, pose, np.zeros(3), np.zeros(3)).rotation.value
    bound = 2e-15 if angle < 2.0 else 1e-13  # the series cancels at large angles
    cross_check(
        "rotation", float(np.max(np.abs(rotation - Rotation.from_rotvec(w).as_matrix()))), bound
    )


def test_position_follows_the_constraint() -> None:
    """p_x = h/2 (u_x - v_y), p_y = -h u_y; every B_i in its plane, at (phi, d)."""
    for robot, (pose, rate, acceleration) in samples(2, 20, 50):
        k = ne.kinematics(robot, pose, rate, acceleration)
        w = np.concatenate([pose[:, 1:], np.zeros((50, 1))], axis=-1)
        R = Rotation.from_rotvec(w).as_matrix()
        u, v, h = R[:, :, 0], R[:, :, 1], robot.platform_radius
        expected = np.stack([h / 2 * (u[:, 0] - v[:, 1]), -h * u[:, 1], pose[:, 0]], axis=-1)
        np.testing.assert_allclose(k.position, expected, rtol=0, atol=1e-15)
        for i, angle in enumerate(np.deg2rad([0.0, 120.0, -120.0])):
            radial = np.array([np.cos(angle), np.sin(angle), 0.0])
            tip = expected + h * R @ radial
            reach = robot.base_radius - k.leg_lengths[:, i] * np.cos(k.leg_angles[:, i])
            rise = k.leg_lengths[:, i] * np.sin(k.leg_angles[:, i])
            joint = reach[:, None] * radial + rise[:, None] * np.array([0.0, 0.0, 1.0])
            np.testing.assert_allclose(tip, joint, rtol=0, atol=2e-15)


def test_level_pose_is_exact() -> None:
    """At w = 0: omega = w', alpha = w'', P_xy'' = h (w_x'^2 - w_y'^2)/2, -h w_x' w_y'."""
    robot = random_robot(np.random.default_rng(3))
    h = robot.platform_radius
    k = ne.kinematics(robot, [0.9, 0.0, 0.0], [0.3, 2.0, -3.0], [0.7, 5.0, 11.0])
    np.testing.assert_allclose(k.angular_velocity, [2.0, -3.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(k.angular_acceleration, [5.0, 11.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(k.velocity, [0.0, 0.0, 0.3], atol=1e-15)
    np.testing.assert_allclose(k.acceleration, [h * (4.0 - 9.0) / 2, h * 6.0, 0.7], atol=1e-14)


@pytest.mark.parametrize("size", [1e-300, 1e-100, 1e-15, 1e-11, 1e-8])
def test_near_level_pose_follows_the_expansion(size: float) -> None:
    """To order w: omega = w' + w x w'/2, alpha = w'' + w x w''/2 + w' x (w x w')/6, and
    P_xy' from P_x = h (w_x^2 - w_y^2)/4, P_y = -h w_x w_y/2.
    """
    robot = random_robot(np.random.default_rng(4))
    h = robot.platform_radius
    w, dw, ddw = size * np.array([0.6, -0.8, 0.0]), np.array([2.0, -3.0, 0]), np.array([5.0, 11, 0])
    k = ne.kinematics(robot, [0.9, *w[:2]], [0.3, *dw[:2]], [0.7, *ddw[:2]])
    omega = dw + np.cross(w, dw) / 2
    alpha = ddw + np.cross(w, ddw) / 2 + np.cross(dw, np.cross(w, dw)) / 6
    velocity = h * np.array([(w[0] * dw[0] - w[1] * dw[1]) / 2, -(w[0] * dw[1] + w[1] * dw[0]) / 2])
    np.testing.assert_allclose(k.angular_velocity, omega, rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(k.angular_acceleration, alpha, rtol=2e-15, atol=1e-14)
    np.testing.assert_allclose(k.velocity[:2], velocity, rtol=0, atol=1e-15)


def closed_form_angular_velocity(pose: Array, rate: Array) -> Array:
    """omega = w' + (1 - cos x)/x^2 w x w' + (x - sin x)/x^3 w x (w x w'), x = |w|."""
    zero = np.zeros_like(pose[..., :1])
    w, dw = (np.concatenate([y[..., 1:], zero], axis=-1) for y in (pose, rate))
    x = np.sqrt(dot(w, w))[..., None]
    turn = np.cross(w, dw)
    return dw + (1 - np.cos(x)) / x**2 * turn + (x - np.sin(x)) / x**3 * np.cross(w, turn)


def test_angular_velocity_and_acceleration() -> None:
    for robot, state in samples(5, 20, 50):
        pose, rate, acceleration = state
        size = np.linalg.norm(pose[:, 1:], axis=-1, keepdims=True)
        pose[:, 1:] *= (0.3 + 1.2 * size) / size  # the closed form is poor at small angles
        k = ne.kinematics(robot, *state)
        assert gap(k.angular_velocity, closed_form_angular_velocity(pose, rate)) < 1e-14
        alpha = along((pose, rate, acceleration), closed_form_angular_velocity)
        assert gap(k.angular_acceleration, alpha) < 1e-13


@pytest.mark.parametrize("part", ["position", "rotation", "length", "direction"])
def test_jets_are_derivatives(part: str) -> None:
    for robot, state in samples(6, 20, 50):
        jet = getattr(ne.motion(robot, *state), part)
        for order, got in (("value", jet.first), ("first", jet.second)):

            def lower(q: Array, v: Array, r: Any = robot, order: str = order) -> Array:
                moved = getattr(ne.motion(r, q, v, np.zeros(3)), part)
                return getattr(moved, order)

            expected = along(state, lower)
            assert np.max(np.abs(got - expected)) < 1e-13 * np.max(np.abs(expected))


def test_leg_rates_are_those_of_the_rigid_platform() -> None:
    """B' = P' + omega x b and B'' = P'' + alpha x b + omega x (omega x b), in polar form."""
    for robot, state in samples(7, 20, 50):
        k = ne.kinematics(robot, *state)
        omega, alpha = k.angular_velocity, k.angular_acceleration
        for i, angle in enumerate(np.deg2rad([0.0, 120.0, -120.0])):
            radial = np.array([np.cos(angle), np.sin(angle), 0.0])
            arm = robot.platform_radius * k.rotation @ radial
            tip_rate = k.velocity + np.cross(omega, arm)
            centripetal = np.cross(omega, np.cross(omega, arm))
            tip_acceleration = k.acceleration + np.cross(alpha, arm) + centripetal
            d, dd, ddd = (
                x[:, i] for x in (k.leg_lengths, k.leg_length_rates, k.leg_length_accelerations)
            )
            phi, dphi, ddphi = (
                x[:, i] for x in (k.leg_angles, k.leg_angle_rates, k.leg_angle_accelerations)
            )
            s = -np.cos(phi)[:, None] * radial + np.sin(phi)[:, None] * np.array([0.0, 0.0, 1.0])
            t = np.sin(phi)[:, None] * radial + np.cos(phi)[:, None] * np.array([0.0, 0.0, 1.0])
            rate = dd[:, None] * s + (d * dphi)[:, None] * t
            outward, across = ddd - d * dphi**2, d * ddphi + 2 * dd * dphi
            assert gap(tip_rate, rate) < 1e-13
            assert gap(tip_acceleration, outward[:, None] * s + across[:, None] * t) < 1e-13


# --- dynamics: principles ------------------------------------------------------------------


def power_error(robot: ne.ReferenceRobot, state: State) -> Array:
    """sum F_i d_i' against dE/dt."""
    forces = ne.inverse_dynamics(robot, *state).forces
    work = forces * ne.kinematics(robot, *state).leg_length_rates
    gain = ne.power(robot, *state)
    return np.abs(work.sum(axis=-1) - gain) / (np.abs(work).sum(axis=-1) + np.abs(gain))


def test_power_balance() -> None:
    error = worst(*(power_error(*sample) for sample in samples(10, 100, 100)))
    cross_check("power balance, 10000 states", error, 1e-12)


def test_power_is_the_rate_of_energy() -> None:
    """Against five-point central differences of the real energy along the curve."""
    robot, (pose, rate, acceleration) = next(samples(11, 1, 20))

    def energy_at(t: float) -> Array:
        moved = pose + rate * t + acceleration * t * t / 2
        return ne.energy(robot, moved, rate + acceleration * t)

    h = 1e-4
    slope = 8 * (energy_at(h) - energy_at(-h)) - (energy_at(2 * h) - energy_at(-2 * h))
    power = ne.power(robot, pose, rate, acceleration)
    np.testing.assert_allclose(slope / (12 * h), power, rtol=1e-8, atol=1e-6)


def generalized_forces(robot: ne.ReferenceRobot, state: State) -> Array:
    """Q_j = d/dt dL/dv_j - dL/dq_j of the 3 pose coordinates, from `energy` alone.

    T is quadratic in the rate v, so dL/dv_j = (T(v + e_j) - T(v - e_j)) / 2 exactly and
    L = T - V = E(v) - 2 E(0); the derivatives in time and in q_j are by complex step.
    """
    pose, rate, _ = state
    parts = []
    for unit in np.eye(3):

        def momentum(q: Array, v: Array, e: Array = unit) -> Array:
            return (ne.energy(robot, q, v + e) - ne.energy(robot, q, v - e)) / 2

        moved = pose + 1j * STEP * unit
        lagrangian = ne.energy(robot, moved, rate) - 2 * ne.energy(robot, moved, 0 * rate)
        parts.append(along(state, momentum) - np.imag(lagrangian) / STEP)
    return np.stack(parts, axis=-1)


def length_jacobian(robot: ne.ReferenceRobot, pose: Array) -> Array:
    """J_ij = d d_i / d pose_j by complex step."""
    columns = [
        np.imag(ne.motion(robot, pose + 1j * STEP * unit, unit * 0, unit * 0).length.value)
        for unit in np.eye(3)
    ]
    return np.stack(columns, axis=-1) / STEP


def lagrange_error(robot: ne.ReferenceRobot, state: State) -> Array:
    """F against the solution of J^T F = d/dt dL/dv - dL/dq."""
    J = length_jacobian(robot, state[0])
    right = generalized_forces(robot, state)[..., None]
    expected = np.linalg.solve(np.swapaxes(J, -1, -2), right)[..., 0]
    return relative(ne.inverse_dynamics(robot, *state).forces, expected)


def test_lagrange() -> None:
    error = worst(*(lagrange_error(*sample) for sample in samples(12, 50, 40)))
    cross_check("Lagrange, 2000 states", error, 1e-11)


def momentum(robot: ne.ReferenceRobot, pose: Array, rate: Array) -> Array:
    """Linear momentum, and angular momentum about P without omega or an inertia tensor.

    Of particles r_k with S = sum m_k r_k r_k^T = tr(I)/2 - I (body axes):
    H = sum m_k (R r_k) x (R' r_k), so H_i = eps_ijk (R S R'^T)_jk.
    """
    now = ne.motion(robot, pose, rate, np.zeros(3))
    inertia = robot.platform_inertia
    spread = np.trace(inertia) / 2 * np.eye(3) - inertia
    stir = now.rotation.value @ spread @ np.swapaxes(now.rotation.first, -1, -2)
    turning = [stir[..., j, k] - stir[..., k, j] for j, k in ((1, 2), (2, 0), (0, 1))]
    linear = robot.platform_mass * now.position.first
    return np.concatenate([linear, np.stack(turning, axis=-1)], axis=-1)


def test_reactions_change_the_platforms_momentum() -> None:
    """sum f_i + m G = p' and sum b_i x f_i = (R I R^T omega)', by complex step."""
    errors, residuals = [], []
    for robot, state in samples(13, 50, 40):
        k = ne.kinematics(robot, *state)
        solved = ne.inverse_dynamics(robot, *state)
        change = along(state, lambda q, v, r=robot: momentum(r, q, v))
        change[..., :3] -= robot.platform_mass * robot.gravity
        arms = robot.platform_radius * np.einsum("...ij,kj->...ki", k.rotation, ne.RADIAL)
        moments = np.cross(arms, solved.reactions)
        wrench = np.concatenate([solved.reactions, moments], axis=-1)
        size = np.sum(np.linalg.norm(solved.reactions, axis=-1), axis=-1)[..., None]
        errors.append((wrench.sum(axis=-2) - change) / size)
        residuals.append(solved.residual / size)
    cross_check("momentum", worst(*errors), 1e-13)
    cross_check("residual", worst(*residuals), 1e-13)


def test_each_leg_obeys_its_polar_lagrange_equations() -> None:
    """With k = d - r, and the weights along s and t = ds/dphi:

    (I1 + I2 + m1 c^2 + m2 k^2) phi'' + 2 m2 k d' phi' - (m1 c + m2 k) G.t = -d f.t
    m2 (d'' - k phi'^2) - m2 G.s = F - f.s
    """
    errors = []
    for robot, state in samples(14, 50, 40):
        k = ne.kinematics(robot, *state)
        solved = ne.inverse_dynamics(robot, *state)
        cos, sin = np.cos(k.leg_angles)[..., None], np.sin(k.leg_angles)[..., None]
        s, t = -cos * ne.RADIAL + sin * ne.VERTICAL, sin * ne.RADIAL + cos * ne.VERTICAL
        reach = k.leg_lengths - robot.rod_com
        first_moment = robot.leg_mass * robot.leg_com + robot.rod_mass * reach
        inertia = robot.leg_inertia_about_com + robot.rod_inertia
        inertia = inertia + robot.leg_mass * robot.leg_com**2 + robot.rod_mass * reach**2
        coriolis = 2 * robot.rod_mass * reach * k.leg_length_rates * k.leg_angle_rates
        turning = (
            inertia * k.leg_angle_accelerations + coriolis - first_moment * (t @ robot.gravity)
        )
        sliding = k.leg_length_accelerations - reach * k.leg_angle_rates**2 - s @ robot.gravity
        left = np.stack([turning / k.leg_lengths, robot.rod_mass * sliding], axis=-1)
        f = solved.reactions
        right = np.stack([-dot(f, t), solved.forces - dot(f, s)], axis=-1)
        size = np.linalg.norm(f, axis=-1)[..., None] + np.abs(left)
        errors.append((left - right) / size)
    cross_check("leg equations", worst(*errors), 1e-13)


# --- dynamics: limits and symmetries -------------------------------------------------------


def level_robot(**changes: Any) -> ne.ReferenceRobot:
    robot = ne.ReferenceRobot(0.5, 0.3, 7.0, np.diag([0.1, 0.15, 0.2]))
    return replace(robot, **changes)


def test_static_level_massless_legs() -> None:
    """Vertical balance of the platform: 3 F sin(phi) = m g; the reactions are along the legs."""
    robot, height = level_robot(), np.linspace(0.2, 2.0, 30)
    pose = np.stack([height, 0 * height, 0 * height], axis=-1)
    solved = ne.inverse_dynamics(robot, pose, np.zeros(3), np.zeros(3))
    length = np.hypot(height, 0.2)
    np.testing.assert_allclose(
        solved.forces, (7.0 * 9.81 / 3 * length / height)[:, None] * np.ones(3), rtol=1e-14
    )
    across = (
        solved.reactions
        - solved.forces[..., None]
        * (height[:, None, None] * ne.VERTICAL - 0.2 * ne.RADIAL)
        / length[:, None, None]
    )
    assert np.max(np.abs(across)) < 1e-12


def test_static_level_heavy_legs() -> None:
    """Virtual work of dz: d' = sin(phi), phi' = cos(phi) / d."""
    robot = level_robot(leg_mass=3.0, leg_com=0.15, rod_mass=2.0, rod_com=0.25, rod_inertia=0.3)
    height = np.linspace(0.2, 2.0, 30)
    length = np.hypot(height, 0.2)
    sin, cos = height / length, 0.2 / length
    cylinder = 3.0 * 0.15 * cos**2 / length
    rod = 2.0 * (sin**2 + (length - 0.25) * cos**2 / length)
    expected = 9.81 / sin * (7.0 / 3 + cylinder + rod)
    pose = np.stack([height, 0 * height, 0 * height], axis=-1)
    forces = ne.inverse_dynamics(robot, pose, np.zeros(3), np.zeros(3)).forces
    np.testing.assert_allclose(forces, expected[:, None] * np.ones(3), rtol=1e-13)


def test_free_fall_needs_no_force() -> None:
    """Massless legs, the platform falling level from rest."""
    solved = ne.inverse_dynamics(level_robot(), [0.9, 0, 0], [0, 0, 0], [-9.81, 0, 0])
    assert np.max(np.abs(solved.reactions)) < 1e-13


def test_point_masses_at_the_tips_belong_to_the_platform() -> None:
    """Rods that are points at B_i: the same forces as a platform with those points added."""
    errors = []
    for robot, state in samples(20, 20, 50):
        legs = replace(robot, rod_com=0.0, rod_inertia=0.0)
        points = robot.platform_radius * ne.RADIAL
        added = np.sum(points**2) * np.eye(3) - points.T @ points
        platform = replace(
            legs,
            rod_mass=0.0,
            platform_mass=robot.platform_mass + 3 * robot.rod_mass,
            platform_inertia=robot.platform_inertia + robot.rod_mass * added,
        )
        forces = [ne.inverse_dynamics(r, *state).forces for r in (legs, platform)]
        errors.append(gap(*forces))
    cross_check("tip masses", worst(*errors), 1e-13)


def test_turning_everything_by_120_degrees_permutes_the_legs() -> None:
    """Leg 1's plane becomes leg 2's, 2's becomes 3's, 3's becomes 1's."""
    turn = Rotation.from_rotvec([0.0, 0.0, 2.0 * np.pi / 3.0]).as_matrix()
    tilt = np.eye(3)
    tilt[1:, 1:] = turn[:2, :2]
    errors = []
    for robot, state in samples(21, 20, 50):
        turned = replace(
            robot,
            gravity=turn @ robot.gravity,
            platform_inertia=turn @ robot.platform_inertia @ turn.T,
        )
        before = ne.inverse_dynamics(robot, *state)
        pose, rate, acceleration = (x @ tilt.T for x in state)
        after = ne.inverse_dynamics(turned, pose, rate, acceleration)
        errors.append(gap(after.forces, np.roll(before.forces, 1, axis=-1)))
        reactions = np.roll(before.reactions @ turn.T, 1, axis=-2)
        errors.append(gap(*(x.reshape(50, 9) for x in (after.reactions, reactions))))
    cross_check("symmetry", worst(*errors), 1e-12)


def test_massless_legs_and_rods_are_legal() -> None:
    for robot, state in samples(22, 5, 20):
        for names in (("rod_mass", "rod_inertia"), ("leg_mass", "leg_inertia_about_com")):
            light = replace(robot, **dict.fromkeys(names, 0.0))
            assert np.max(power_error(light, state)) < 1e-11


def test_batches() -> None:
    robot, state = next(samples(23, 1, 6))
    pose, rate, acceleration = state
    together = ne.inverse_dynamics(robot, *(x.reshape(2, 3, 3) for x in state))
    assert together.forces.shape == (2, 3, 3)
    assert together.reactions.shape == (2, 3, 3, 3)
    assert together.residual.shape == (2, 3, 6)
    for i in range(6):
        alone = ne.inverse_dynamics(robot, pose[i], rate[i], acceleration[i])
        assert alone.forces.shape == (3,)
        np.testing.assert_allclose(alone.forces, together.forces.reshape(6, 3)[i], rtol=1e-12)
    spread = ne.inverse_dynamics(robot, pose[0], rate[0], acceleration).forces
    twin = ne.inverse_dynamics(robot, pose[0], rate[0], acceleration[5]).forces
    np.testing.assert_allclose(spread[5], twin, rtol=1e-12)
    assert ne.inverse_dynamics(robot, pose[:0], rate[:0], acceleration[:0]).forces.shape == (0, 3)


def test_gravity_may_be_a_tuple_and_pose_integers() -> None:
    robot = level_robot(
        gravity=(0.0, 0.0, -9.81), platform_inertia=((1, 0, 0), (0, 1, 0), (0, 0, 1))
    )
    arguments = ([1, 0, 0], [0, 0, 0], [0, 0, 0])
    forces = ne.inverse_dynamics(robot, *arguments).forces
    np.testing.assert_allclose(forces, 7.0 * 9.81 / 3 * np.hypot(1, 0.2), rtol=1e-14)
    assert ne.power(robot, *arguments) == 0.0
    np.testing.assert_allclose(ne.energy(robot, [1, 0, 0], [0, 0, 0]), 7.0 * 9.81, rtol=1e-14)


# --- dynamics: another program -------------------------------------------------------------


def mujoco_leg(robot: ne.ReferenceRobot, i: int) -> str:
    """Frame of leg i: x = e_i, y = n_i, z = Z; at phi = 0 the leg points along -x."""
    half = ne.ANGLES[i] / 2
    inertias = [f"{x:.17g} " * 3 for x in (robot.leg_inertia_about_com, robot.rod_inertia)]
    return f"""
    <body pos="{robot.base_radius * np.cos(2 * half):.17g}
               {robot.base_radius * np.sin(2 * half):.17g} 0"
          quat="{np.cos(half):.17g} 0 0 {np.sin(half):.17g}">
      <joint type="hinge" axis="0 1 0"/>
      <inertial pos="{-robot.leg_com:.17g} 0 0" mass="{robot.leg_mass:.17g}"
                diaginertia="{inertias[0]}"/>
      <body name="rod{i}">
        <joint type="slide" axis="-1 0 0"/>
        <inertial pos="{robot.rod_com:.17g} 0 0" mass="{robot.rod_mass:.17g}"
                  diaginertia="{inertias[1]}"/>
      </body>
    </body>"""


def mujoco_tree(robot: ne.ReferenceRobot) -> str:
    """The three legs and the free platform, not joined: 6 + 6 degrees of freedom."""
    inertia = robot.platform_inertia
    entries = [inertia[j, k] for j, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return f"""
    <mujoco>
      <option gravity="{" ".join(f"{x:.17g}" for x in robot.gravity)}">
        <flag energy="enable"/>
      </option>
      <worldbody>
        {"".join(mujoco_leg(robot, i) for i in range(3))}
        <body name="platform">
          <freejoint/>
          <inertial pos="0 0 0" mass="{robot.platform_mass:.17g}"
                    fullinertia="{" ".join(f"{x:.17g}" for x in entries)}"/>
        </body>
      </worldbody>
    </mujoco>"""


def interleave(angles: Array, lengths: Array) -> Array:
    return np.stack([angles, lengths], axis=-1).ravel()


def test_mujoco_tree_with_these_forces_is_in_balance() -> None:
    """M q'' + c = (0, F_1, 0, F_2, 0, F_3, 0...) + sum of J_B^T (+- f_i): all 12 equations.

    And the energies are the same.
    """
    mujoco = pytest.importorskip("mujoco")
    errors = []
    for robot, states in samples(30, 10, 10):
        model = mujoco.MjModel.from_xml_string(mujoco_tree(robot))
        data = mujoco.MjData(model)
        for state in zip(*states, strict=True):
            k = ne.kinematics(robot, *state)
            solved = ne.inverse_dynamics(robot, *state)
            quaternion = Rotation.from_matrix(k.rotation).as_quat()[[3, 0, 1, 2]]
            legs = interleave(k.leg_angles, k.leg_lengths)
            leg_rates = interleave(k.leg_angle_rates, k.leg_length_rates)
            data.qpos = np.concatenate([legs, k.position, quaternion])
            data.qvel = np.concatenate([leg_rates, k.velocity, k.rotation.T @ k.angular_velocity])
            data.qacc = np.concatenate(
                [
                    interleave(k.leg_angle_accelerations, k.leg_length_accelerations),
                    k.acceleration,
                    k.rotation.T @ k.angular_acceleration,
                ]
            )
            mujoco.mj_inverse(model, data)
            mujoco.mj_energyPos(model, data)
            mujoco.mj_energyVel(model, data)
            total = ne.energy(robot, *state[:2])
            assert abs(sum(data.energy) - total) < 1e-12 * np.sum(np.abs(data.energy))
            left = data.qfrc_inverse.copy()
            right = np.concatenate([interleave(np.zeros(3), solved.forces), np.zeros(6)])
            size = np.abs(left) + np.abs(right)
            for i in range(3):
                tip = k.position + robot.platform_radius * k.rotation @ ne.RADIAL[i]
                for name, sign in (("platform", 1.0), (f"rod{i}", -1.0)):
                    jacobian = np.zeros((3, model.nv))
                    mujoco.mj_jac(model, data, jacobian, None, tip, model.body(name).id)
                    right += sign * jacobian.T @ solved.reactions[i]
                    size += np.abs(jacobian.T) @ np.abs(solved.reactions[i])
            errors.append((left - right) / size)
    cross_check("MuJoCo, 100 states", worst(*errors), 1e-13)


# --- the tests can fail --------------------------------------------------------------------


def without_coriolis(robot: ne.ReferenceRobot, now: ne.Motion) -> Array:
    d, s = now.length.map(lambda x: x[..., None]), now.direction
    return d.second * s.value + (d.value - robot.rod_com) * s.second


def without_centripetal(robot: ne.ReferenceRobot, now: ne.Motion) -> Array:
    d, s = now.length.map(lambda x: x[..., None]), now.direction
    centripetal = -dot(s.first, s.first)[..., None] * s.value
    turning = (d.value - robot.rod_com) * (s.second - centripetal)
    return d.second * s.value + 2 * d.first * s.first + turning


def without_gyroscopic(robot: ne.ReferenceRobot, now: ne.Motion) -> Array:
    R = now.rotation.value
    inertia = R @ robot.platform_inertia @ np.swapaxes(R, -1, -2)
    return np.einsum("...ij,...j->...i", inertia, ne._angular_acceleration(now.rotation))


def body_axes_inertia(robot: ne.ReferenceRobot, now: ne.Motion) -> Array:
    omega, alpha = ne._angular_velocity(now.rotation), ne._angular_acceleration(now.rotation)
    spin = omega @ robot.platform_inertia
    return alpha @ robot.platform_inertia + np.cross(omega, spin)


def bent_leibniz(op: Callable[[Array, Array], Array], f: ne.Jet, g: ne.Jet) -> ne.Jet:
    return ne.Jet(
        op(f.value, g.value),
        op(f.first, g.value) + op(f.value, g.first),
        op(f.second, g.value) + op(f.first, g.first) + op(f.value, g.second),
    )


MUTATIONS = {
    "rod Coriolis": ("_rod_acceleration", without_coriolis),
    "rod centripetal": ("_rod_acceleration", without_centripetal),
    "cylinder acceleration": ("_cylinder_acceleration", lambda robot, now: np.zeros(3)),
    "gyroscopic moment": ("_platform_moment", without_gyroscopic),
    "inertia not turned": ("_platform_moment", body_axes_inertia),
    "Leibniz factor": ("bilinear", bent_leibniz),
}


@pytest.mark.parametrize("check", [power_error, lagrange_error])
@pytest.mark.parametrize("name", MUTATIONS)
def test_the_checks_notice(
    name: str, check: Callable[..., Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All but one: the gyroscopic moment does no work, so the power balance is blind to it."""
    target, mutant = MUTATIONS[name]
    monkeypatch.setattr(ne, target, mutant)
    errors = np.concatenate([check(*sample) for sample in samples(40, 10, 20)])
    print(f"{name}, {check.__name__}: median {np.median(errors):.1e}, least {np.min(errors):.1e}")
    if (name, check) == ("gyroscopic moment", power_error):
        assert np.max(errors) < 1e-11
    else:
        assert np.median(errors) > 1e-4
        assert np.min(errors) > 1e-9


@pytest.mark.parametrize("name", ["leg_inertia_about_com", "rod_inertia", "rod_com", "leg_com"])
def test_power_balance_notices_a_wrong_parameter(name: str) -> None:
    """Forces of a robot 1 percent off in one parameter do not balance the energy."""
    errors = []
    for robot, state in samples(41, 20, 50):
        off = replace(robot, **{name: 1.01 * getattr(robot, name)})
        work = ne.inverse_dynamics(off, *state).forces
        work = work * ne.kinematics(robot, *state).leg_length_rates
        gain = ne.power(robot, *state)
        errors.append(np.abs(work.sum(axis=-1) - gain) / (np.abs(work).sum(axis=-1) + np.abs(gain)))
    assert np.median(np.concatenate(errors)) > 1e-6


def test_forces_change_along_a_path_as_smoothly_as_the_path() -> None:
    """No jump through the level pose: steps of the forces shrink with the step of the path."""
    robot, (_, rate, acceleration) = next(samples(42, 1, 1))
    steps = []
    for count in (101, 1001):
        tilt = np.linspace(-1e-3, 1e-3, count)
        pose = np.stack([0 * tilt + 2 * robot.base_radius, tilt, -0.5 * tilt], axis=-1)
        forces = ne.inverse_dynamics(robot, pose, rate, acceleration).forces
        steps.append(worst([np.linalg.norm(b - a) for a, b in pairwise(forces)]))
    np.testing.assert_allclose(steps[0] / steps[1], 10.0, rtol=0.01)
