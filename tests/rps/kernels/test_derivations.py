"""Kernels against other derivations: rotation matrices, vectors in space, complex steps."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, factorial, pi, sin, sqrt, tau
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin.closed_loop.dynamics.passive_joint_forces import friction_slope
from rps_pin.numerics.stumpff import stumpff
from rps_pin.rps.kernels import forces, leg_equations, legs, placement, platform, tips
from rps_pin.rps.kernels.tilt_functions import tilt_functions
from tests import strategies
from tests.reference import newton_euler as ne

Array = NDArray[np.float64]
RNG = np.random.default_rng(8)
G, H = 0.31, 0.17
#: e_i and t_i = z x e_i.
RADIAL = np.array([[cos(a), sin(a), 0.0] for a in (0.0, tau / 3, -tau / 3)])
ACROSS = np.cross([0.0, 0.0, 1.0], RADIAL)
POSES = [(0.4, *RNG.uniform(-size, size, 2).tolist()) for size in (1e-6, 0.3, 1.0, 1.9, 2.2) * 4]
POSES.append((0.4, 0.0, 0.0))
STEP = 1e-30
#: Squares of tilts: zero, tiny, about 1 and 4, of half a turn, large.
SQUARES = [
    *(0.0, 1e-300, 1e-12, 1e-8, 1e-3, 0.3, 0.5, 1 - 1e-15, 1.0, 1.1, 1.5),
    *(3.9, 4.0, 4.1, 5.0, pi**2, 20.0, 30.0, 60.0),
]


def tilt_at(x: Any, y: Any) -> Any:
    return tilt_functions(x * x + y * y)


def change(function: Callable[..., Any], values: Any, rates: Any) -> Array:
    """The time derivative of a function of numbers, by complex step."""
    moved = [complex(v, STEP * r) for v, r in zip(values, rates, strict=True)]
    result: Array = np.imag(np.array(function(*moved), dtype=complex)) / STEP
    return result


def near(found: Any, expected: Any, tolerance: float = 1e-12) -> None:
    expected = np.asarray(expected, dtype=np.float64)
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(
        np.array(found, dtype=np.float64), expected, rtol=0, atol=tolerance * scale
    )


def rotation(x: float, y: float) -> Array:
    matrix: Array = Rotation.from_rotvec([x, y, 0.0]).as_matrix()
    return matrix


def spin_of(rotate: Callable[..., Any], tilt: Any, rates: Any) -> Array:
    """omega of [omega]x = R' dR/dt, in platform axes."""
    W = np.array(rotate(*tilt)).T @ change(rotate, tilt, rates)
    return np.array([W[2, 1], W[0, 2], W[1, 0]])


def rotate(x: Any, y: Any) -> Any:
    return platform.rotation(x, y, tilt_at(x, y))


def tip_vectors(z: float, x: float, y: float) -> Array:
    """Tips whose mean is on the axis' height z, moved sideways into the planes of their legs."""
    arms = H * RADIAL @ rotation(x, y).T
    # t_i . (P + arm_i) = 0 for all legs: three equations, two unknowns, compatible.
    centre, *_ = np.linalg.lstsq(ACROSS[:, :2], -(ACROSS * arms).sum(axis=1), rcond=None)
    vectors: Array = arms + np.array([*centre, z])
    assert np.abs((vectors * ACROSS).sum(axis=1)).max() < 1e-15
    return vectors


@pytest.mark.parametrize("s", SQUARES)
def test_stumpff_functions_are_their_series(s: float) -> None:
    # In whole numbers over 10^40: the terms cancel in floats.
    one, whole = 10**40, int(s * 10**20)
    for n, value in enumerate(stumpff(s)):
        series = sum(
            (-1) ** k * one * whole**k // (10 ** (20 * k) * factorial(2 * k + n)) for k in range(60)
        )
        assert abs(value - series / one) < 1e-15


@pytest.mark.parametrize("s", [s for s in SQUARES if s <= 30.0])
def test_slopes_of_tilt_functions(s: float) -> None:
    a, b, _, d, a_s, b_s, d_s, a_ss, b_ss = tilt_functions(s)
    slope = change(tilt_functions, [s], [1.0])
    near([a_s, b_s, d_s, a_ss, b_ss], slope[[0, 1, 3, 4, 5]], 1e-13)
    near(slope[2], -a / 2, 1e-14)  # C = cos(sqrt(s))
    near([b, d], [(1 - cos(sqrt(s))) / s, (1 - a) / s] if s > 1e-4 else [1 / 2, 1 / 6], 1e-8)


@pytest.mark.parametrize("pose", POSES)
def test_rotation_and_quaternion(pose: Any) -> None:
    _, x, y = pose
    expected = Rotation.from_rotvec([x, y, 0.0])
    near(rotate(x, y), expected.as_matrix())
    near(platform.quaternion(x, y), expected.as_quat(canonical=False)[[0, 1, 3]])
    vector = tuple(RNG.normal(size=3).tolist())
    near(platform.to_base(x, y, tilt_at(x, y), vector), expected.apply(vector))
    near(platform.to_platform(x, y, tilt_at(x, y), vector), expected.inv().apply(vector))


@pytest.mark.parametrize("pose", POSES)
def test_angular_velocity_and_acceleration(pose: Any) -> None:
    _, x, y = pose
    dx, dy, ddx, ddy = RNG.normal(size=4).tolist()
    omega = platform.angular_velocity(x, y, dx, dy, tilt_at(x, y))
    near(omega, spin_of(rotate, (x, y), (dx, dy)))
    near(rotation(x, y) @ omega, (omega[0], omega[1], -omega[2]))  # in base axes

    def velocity(x: Any, y: Any, dx: Any, dy: Any) -> Any:
        return platform.angular_velocity(x, y, dx, dy, tilt_at(x, y))

    alpha = platform.angular_acceleration(x, y, dx, dy, ddx, ddy, tilt_at(x, y))
    near(alpha, change(velocity, (x, y, dx, dy), (dx, dy, ddx, ddy)))


@pytest.mark.parametrize("pose", POSES)
def test_tips_and_their_derivatives(pose: Any) -> None:
    z, x, y = pose
    dz, dx, dy, ddz, ddx, ddy = RNG.normal(size=6).tolist()
    tilt, vectors = tilt_at(x, y), tip_vectors(z, x, y)
    radial, height = tips.tips(z, x, y, tilt, H)
    near(tips.at_legs(radial), (vectors * RADIAL).sum(axis=1))
    near(tips.at_legs(height), vectors[:, 2])
    near((radial[1] / 2, radial[2] / 2, z), vectors.mean(axis=0))

    def place(z: Any, x: Any, y: Any) -> Any:
        return tips.tips(z, x, y, tilt_at(x, y), H)

    slopes = tips.tip_slopes(x, y, tilt)
    near(H * np.array(slopes[0::2]), change(place, pose, (0, 1, 0)))
    near(H * np.array(slopes[1::2]), change(place, pose, (0, 0, 1)))
    near(tips.tip_rates(slopes, dz, H * dx, H * dy), change(place, pose, (dz, dx, dy)))

    def rates(z: Any, x: Any, y: Any, dz: Any, dx: Any, dy: Any) -> Any:
        return tips.tip_rates(tips.tip_slopes(x, y, tilt_at(x, y)), dz, H * dx, H * dy)

    moving = (x, y, dx, dy, ddx, ddy)
    near(
        tips.tip_accelerations(moving, ddz, tilt, H),
        change(rates, (z, x, y, dz, dx, dy), (dz, dx, dy, ddz, ddx, ddy)),
    )
    near(
        tips.tip_slope_rates(x, y, dx, dy, tilt),
        change(lambda x, y: tips.tip_slopes(x, y, tilt_at(x, y)), (x, y), (dx, dy)),
    )
    squares = [np.square(tips.at_legs(ring)).sum() for ring in tips.tip_rates(slopes, 0.0, dx, dy)]
    xx, xy, yy = tips.speed_form(slopes)
    near(xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy, sum(squares))


@pytest.mark.parametrize("largest", [1e-3, 1.5, 3.1, 6.0])
def test_tips_on_arrays_are_the_reference_s(largest: float) -> None:
    """The reference carries its derivatives by jets, from legs in space."""
    rng = np.random.default_rng(3)
    pose = strategies.random_poses(300, largest_tilt=largest)
    rate, acceleration = rng.normal(size=(2, 300, 3))
    robot = ne.ReferenceRobot(2 * H, H, 1.0, np.eye(3))

    def jets(acceleration: Array, rate: Array) -> tuple[ne.Jet, ne.Jet]:
        moving = ne.motion(robot, pose, rate, acceleration)
        leg = moving.length.map(lambda d: d[..., None]) * moving.direction
        radial = leg.map(lambda one: np.sum(one * ne.RADIAL, axis=-1)).shift(2 * H)
        return radial, leg.map(lambda one: one[..., 2])

    (z, x, y), (dz, dx, dy), (ddz, ddx, ddy) = (
        np.ascontiguousarray(one.T) for one in (pose, rate, acceleration)
    )
    tilt = tilt_at(x, y)
    slopes = tips.tip_slopes(x, y, tilt)
    moving = (x, y, dx, dy, ddx, ddy)
    found = (
        tips.tips(z, x, y, tilt, H),
        tips.tip_rates(slopes, dz, H * dx, H * dy),
        tips.tip_accelerations(moving, ddz, tilt, H),
    )
    expected = jets(acceleration, rate)
    for rings, order in zip(found, ("value", "first", "second"), strict=True):
        for ring, jet in zip(rings, expected, strict=True):
            assert_legs(ring, getattr(jet, order), 2e-12)
    for axis, pair in ((1, slopes[0::2]), (2, slopes[1::2])):
        alone = np.zeros_like(pose)
        alone[:, axis] = 1 / H  # slopes are by h times the tilt
        for ring, jet in zip(pair, jets(alone, alone), strict=True):
            assert_legs(ring, jet.first, 1e-12)


def assert_legs(ring: Any, expected: Array, tolerance: float) -> None:
    legs_ = np.asarray(tips.at_legs(ring)).T
    np.testing.assert_allclose(legs_, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("pose", POSES)
def test_legs_and_their_derivatives(pose: Any) -> None:
    z, x, y = pose
    dz, dx, dy, ddz, ddx, ddy = RNG.normal(size=6).tolist()
    tilt, vectors = tilt_at(x, y), tip_vectors(z, x, y)
    slopes = tips.tip_slopes(x, y, tilt)
    rates = tips.tip_rates(slopes, dz, H * dx, H * dy)
    accelerations = tips.tip_accelerations((x, y, dx, dy, ddx, ddy), ddz, tilt, H)
    for leg in range(3):

        def geometry(z: Any, x: Any, y: Any, leg: int = leg) -> Any:
            radial, height = tips.tips(z, x, y, tilt_at(x, y), H)
            return legs.leg_geometry(tips.at_legs(radial)[leg], tips.at_legs(height)[leg], G)

        d, cosine, sine = geometry(z, x, y)
        along = vectors[leg] - G * RADIAL[leg]
        near((-d * cosine, 0.0, d * sine), (along @ RADIAL[leg], along @ ACROSS[leg], along[2]))
        near(d, np.linalg.norm(along))
        d_rate, cos_rate, sin_rate = change(geometry, pose, (dz, dx, dy))
        radial, height = (tips.at_legs(ring)[leg] for ring in rates)
        speed = legs.along_leg(cosine, sine, radial, height)
        angle_rate = legs.across_leg(cosine, sine, radial, height) / d
        near((speed, angle_rate), (d_rate, cosine * sin_rate - sine * cos_rate), 1e-11)

        def speeds(z: Any, x: Any, y: Any, dz: Any, dx: Any, dy: Any, leg: int = leg) -> Any:
            d, cosine, sine = geometry(z, x, y, leg)
            slopes = tips.tip_slopes(x, y, tilt_at(x, y))
            radial, height = (
                tips.at_legs(ring)[leg] for ring in tips.tip_rates(slopes, dz, H * dx, H * dy)
            )
            return (
                legs.along_leg(cosine, sine, radial, height),
                legs.across_leg(cosine, sine, radial, height) / d,
            )

        second = change(speeds, (*pose, dz, dx, dy), (dz, dx, dy, ddz, ddx, ddy))
        velocity = radial, height
        radial, height = (tips.at_legs(ring)[leg] for ring in accelerations)
        along, across = (
            part(cosine, sine, radial, height) for part in (legs.along_leg, legs.across_leg)
        )
        near(legs.leg_acceleration(speed, angle_rate, d, along, across), second, 1e-10)
        motion = legs.leg_motion(cosine, sine, d, velocity, (radial, height))
        near(motion, (speed, angle_rate, *second), 1e-10)


@pytest.mark.parametrize("rest", [0.0, 0.7, -0.4])
@pytest.mark.parametrize("pose", POSES)
def test_cone_of_a_spherical_joint(pose: Any, rest: float) -> None:
    _, x, y = pose
    dx, dy = RNG.normal(size=2).tolist()
    cos_r, sin_r, phi = cos(rest), sin(rest), 1.1
    for radial, across in zip(RADIAL, ACROSS, strict=True):
        (e, de), (t, dt) = ((x * v[0] + y * v[1], dx * v[0] + dy * v[1]) for v in (radial, across))
        axis = rotation(x, y) @ (cos_r * np.array([0.0, 0.0, 1.0]) - sin_r * radial)
        found = legs.rest_axis(e, t, tilt_at(x, y), cos_r, sin_r)
        near(found, (axis @ radial, axis @ across, axis[2]))
        leg = -cos(phi) * radial + sin(phi) * np.array([0.0, 0.0, 1.0])
        near(legs.cone_cosine(cos(phi), sin(phi), found[0], found[2]), leg @ axis)
        near(legs.cone_sine(cos(phi), sin(phi), *found), np.linalg.norm(np.cross(leg, axis)))
        rate = change(
            lambda e, t: legs.rest_axis(e, t, tilt_at(e, t), cos_r, sin_r), (e, t), (de, dt)
        )
        near(legs.rest_axis_rate(e, t, de, dt, tilt_at(x, y), cos_r, sin_r), (rate[0], rate[2]))


def test_equation_8() -> None:
    for _ in range(20):
        d, phi = RNG.uniform(0.2, 0.5, 3), RNG.uniform(-1.0, 2.5, 3)
        lengths = tuple(d.tolist())
        w, z = tuple((d * np.cos(phi)).tolist()), tuple((d * np.sin(phi)).tolist())
        tip = G * RADIAL - (d * np.cos(phi))[:, None] * RADIAL
        tip[:, 2] = d * np.sin(phi)
        apart = np.array([np.linalg.norm(tip[i] - tip[j]) for i, j in ((0, 1), (1, 2), (2, 0))])
        constant = leg_equations.constants(lengths, G, H)
        f = leg_equations.residuals(w, z, G, constant)
        near(f, apart**2 - 3 * H * H)
        near(leg_equations.distance_errors(w, z, G, H), apart - sqrt(3) * H)

        def by_angles(*angle: Any, d: Any = lengths, constant: Any = constant) -> Any:
            w, z = (tuple(d * f(angle)) for f in (np.cos, np.sin))
            return leg_equations.residuals(w, z, G, constant)

        J = np.stack([change(by_angles, phi.tolist(), unit) for unit in np.eye(3)], axis=-1)
        slopes = leg_equations.slopes(w, z, G)
        a1, a2, b2, b3, c3, c1 = slopes
        near([[a1, a2, 0], [0, b2, b3], [c1, 0, c3]], J)
        det = leg_equations.determinant(slopes)
        near(det, np.linalg.det(J))
        adjugate = leg_equations.adjugate(slopes)
        near(np.reshape(adjugate, (3, 3)) @ J, det * np.eye(3))
        near(leg_equations.matrix_times(adjugate, f, 1 / det), np.linalg.solve(J, f), 1e-9)
        near(leg_equations.jacobian_norm(slopes), np.linalg.norm(J, np.inf))
        near(
            leg_equations.matrix_norm(adjugate),
            np.linalg.norm(np.reshape(adjugate, (3, 3)), np.inf),
        )
        near(leg_equations.largest(f), np.abs(f).max())


def test_equation_8_bends_no_more_than_its_bound() -> None:
    for _ in range(50):
        d, phi = tuple(RNG.uniform(0.05, 0.9, 3).tolist()), RNG.uniform(-pi, pi, 3)
        direction = RNG.choice([-1.0, 1.0], 3)

        def slope(s: float, d: Any = d, phi: Any = phi, direction: Any = direction) -> Array:
            angle = phi + s * direction
            w, z = tuple(d * np.cos(angle)), tuple(d * np.sin(angle))
            a1, a2, b2, b3, c3, c1 = leg_equations.slopes(w, z, G)
            return np.array([[a1, a2, 0], [0, b2, b3], [c1, 0, c3]]) @ direction

        second = (slope(1e-6) - slope(-1e-6)) / 2e-6
        assert np.abs(second).max() <= leg_equations.curvature_bound(d, G)


def test_a_turn_keeps_length_and_is_newtons_step() -> None:
    w, z, t = 0.3, 0.4, 0.05
    turned = leg_equations.turned(w, z, t)
    angle = 2 * np.arctan(t)
    near(turned, (w * cos(angle) - z * sin(angle), w * sin(angle) + z * cos(angle)))
    scaled = leg_equations.unit_length(0.6 * (1 + 1e-9), 0.8 * (1 + 1e-9))
    near(scaled, (0.6, 0.8), 1e-15)


@pytest.mark.parametrize("pose", [*POSES, (0.4, 0.0, 3.0), (0.4, -2.9, 1.0)])
def test_platform_from_its_tips(pose: Any) -> None:
    z, x, y = pose
    vectors, R = tip_vectors(z, x, y), rotation(x, y)
    rho = tuple((vectors * RADIAL).sum(axis=1).tolist())
    centre, u, v = placement.platform_axes(rho, tuple(vectors[:, 2].tolist()), H)
    near(centre, vectors.mean(axis=0))
    near((u, v), (R[:, 0], R[:, 1]))
    near(placement.tilt_of_axes(u[0], u[1], u[2], v[1], v[2]), (x, y), 1e-11)


@pytest.mark.parametrize("pose", POSES)
def test_virtual_work_is_power(pose: Any) -> None:
    _, x, y = pose
    rate = RNG.normal(size=3)
    dz, dx, dy = rate.tolist()
    tilt = tilt_at(x, y)
    slopes = tips.tip_slopes(x, y, tilt)
    radial, height = tips.tip_rates(slopes, dz, H * dx, H * dy)
    push_out, push_up, force, moment = (tuple(RNG.normal(size=3).tolist()) for _ in range(4))
    couple = forces.tilt_couple(x, y, tilt, moment)
    needed = forces.virtual_work(
        slopes,
        tips.resultant(push_out),
        tips.resultant(push_up),
        force,
        (couple[0] / H, couple[1] / H),
    )
    power = np.dot(push_out, tips.at_legs(radial)) + np.dot(push_up, tips.at_legs(height))
    power += np.dot(force, (radial[1] / 2, radial[2] / 2, dz))
    power += np.dot(moment, platform.angular_velocity(x, y, dx, dy, tilt))
    near(np.dot(needed, (dz, H * dx, H * dy)), power)


def test_rigid_body() -> None:
    inertia = (2.0, 3.0, 4.0, 0.1, -0.2, 0.3)
    xx, yy, zz, xy, xz, yz = inertia
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    omega, alpha, moment = (tuple(RNG.normal(size=3).tolist()) for _ in range(3))
    spin, spin_rate = (platform.inertia_times(inertia, v) for v in (omega, alpha))
    near(spin, matrix @ omega)
    near(
        platform.turning_moment(omega, spin, spin_rate),
        matrix @ alpha + np.cross(omega, matrix @ omega),
    )
    near(
        platform.offset_force(moment, omega, alpha),
        np.cross(alpha, moment) + np.cross(omega, np.cross(omega, moment)),
    )
    near(
        platform.principal_times((2.0, 3.0, 4.0, 0.0, 0.0, 0.0), omega), (2, 3, 4) * np.array(omega)
    )


def test_a_leg_obeys_lagrange() -> None:
    # Kinetic energy of cylinder and rod in (d, phi); gravity from (out, down) in the leg's plane.
    m, r, m_cylinder, r_cylinder, inertia = 0.7, 0.1, 1.1, 0.2, 0.05
    out, down = 0.3, -9.7
    d, phi, dd, dphi, ddd, ddphi = 0.6, 1.1, 0.4, -0.8, 2.0, 3.0
    along, across = sin(phi) * down - cos(phi) * out, sin(phi) * out + cos(phi) * down
    reach = d - r
    # d/dt dT/d(d') - dT/dd + dV/dd, and the same of phi; V = - m g . x.
    axial = m * (ddd - reach * dphi**2) - m * along
    moment = (inertia + m * reach**2) * ddphi + 2 * m * reach * dd * dphi
    moment -= (m * reach + m_cylinder * r_cylinder) * across
    near(forces.rod_force(m, r, d, (dphi, ddphi, ddd), along), axial)
    found = forces.cylinder_moment(m_cylinder * r_cylinder, inertia, ddphi, across)
    found += forces.rod_moment(m, reach, 2 * dd * dphi, ddphi, across)
    near(found, moment)


def test_matrices() -> None:
    M, v = RNG.normal(size=(3, 3)), RNG.normal(size=3)
    rows, vector = tuple(tuple(row) for row in M.tolist()), tuple(v.tolist())
    cofactors, det = forces.cofactors(rows)
    near(det, np.linalg.det(M))
    near(np.array(cofactors).T / det, np.linalg.inv(M), 1e-11)
    near(forces.row_products(rows, vector), M @ v)
    near(forces.column_products(rows, vector), M.T @ v)
    near(forces.squared_norm(rows), np.square(M).sum())


def test_friction_and_its_slope() -> None:
    for speed in (-0.3, -1e-3, 0.0, 2e-3, 5.0):
        slope = change(lambda v: (forces.friction_force(v, 0.7, 1.3, 1e-2),), [speed], [1.0])
        near([friction_slope(speed, 0.7, 1.3, 1e-2)], slope)
    near(forces.friction_force(1e-2, 0.0, 1.0, 1e-2), (np.e**2 - 1) / (np.e**2 + 1))
