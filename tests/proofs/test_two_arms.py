"""Two Panda arms that hold a bar: 20 velocities, 12 rows, mobility 8, 14 actuators.

The answers are checked body by body: the bar by Newton and Euler, each arm on its own with what
the bar does to its hand. Neither knows of closures.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import minimize

from rps_pin import ClosedLoopModel, InfeasibleError, LoopClosure
from rps_pin.closed_loop.dynamics.force_bounds import ForceBound
from rps_pin.closed_loop.dynamics.force_distribution import ForceDistribution
from rps_pin.closed_loop.editing.compose import Part, body, compose
from tests.closed_loop import mechanisms
from tests.proofs import common, optima, robot_data
from tests.worst import worst

Array = NDArray[np.float64]

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
HAND = "panda_hand_tcp"
ARMS = {"left": 0.35, "right": -0.35}
MASS, INERTIA, COM = 3.0, np.diag([0.13, 0.002, 0.13]), np.array([0.0, 0.03, 0.01])
GRAVITY = np.array([0.0, 0.0, -9.81])
#: Seven of one arm and one of the other: with the bar between, they move independently.
INDEPENDENT = [*(f"left/panda_joint{i}" for i in range(1, 8)), "right/panda_joint1"]


@cache
def panda() -> pin.Model:
    """One arm, its fingers shut."""
    path = robot_data.path_of("panda_description/urdf/panda.urdf")
    model = pin.buildModelFromUrdf(str(path))
    fingers = [model.getJointId(f"panda_finger_joint{i}") for i in (1, 2)]
    return pin.buildReducedModel(model, fingers, pin.neutral(model))


def base(side: str) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([0.0, ARMS[side], 0.0]))


def hand(side: str, q: Array) -> pin.SE3:
    """Where an arm's hand stands, by that arm alone."""
    data = panda().createData()
    pin.framesForwardKinematics(panda(), data, q)
    return base(side) * data.oMf[panda().getFrameId(HAND)]


@cache
def bar_place() -> pin.SE3:
    """The bar at rest: half way between the hands."""
    middle = (hand("left", READY).translation + hand("right", READY).translation) / 2
    return pin.SE3(np.eye(3), middle)


@cache
def two_arms() -> ClosedLoopModel:
    ends = {side: bar_place().actInv(hand(side, READY)) for side in ARMS}
    parts = {side: Part(panda(), base(side)) for side in ARMS}
    bar = body("bar", MASS, INERTIA, COM, ends)
    model = compose({**parts, "bar": Part(bar)})
    closures = [
        LoopClosure(f"{side}/{HAND}", f"bar/{side}", "rigid", name=f"{side} grip") for side in ARMS
    ]
    actuated = [f"{side}/panda_joint{i}" for side in ARMS for i in range(1, 8)]
    home = np.concatenate([READY, READY, bar_place().translation, [0, 0, 0, 1]])
    return ClosedLoopModel(model, closures, actuated, home=home)


def closed_state(seed: int, speed: float = 1.0) -> common.State:
    """A closed configuration near home, and a motion of it."""
    mechanism, rng = two_arms(), np.random.default_rng(seed)
    (guess,) = common.guesses(mechanism, 0.15, 1, seed)
    q = mechanism.close(guess)
    v = mechanism.velocity(q, speed * rng.normal(size=8), INDEPENDENT)
    return q, v, mechanism.acceleration(q, v, speed * rng.normal(scale=4.0, size=8), INDEPENDENT)


def least_norm(q: Array, v: Array, a: Array, weights: Array | float = 1.0) -> Array:
    """Torques that minimise |W tau|, by the textbook: (S N)' tau = N' rnea."""
    motions, right = reduced_equations(q, v, a)
    scale = np.broadcast_to(1 / np.asarray(weights), 14)
    return scale * (np.linalg.pinv((motions[:14] * scale[:, None]).T) @ right)


def reduced_equations(q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """N, shape (20, 8), and N' rnea, shape (8,); J is made of Pinocchio's frame Jacobians."""
    mechanism = two_arms()
    jacobian = mechanisms.loop_jacobian(mechanism, q)
    motions = null_space(jacobian, rcond=1e-10)
    assert motions.shape == (20, 8)
    data = mechanism.model.createData()
    return motions, motions.T @ pin.rnea(mechanism.model, data, q, v, a)


def check_balance(q: Array, v: Array, a: Array, tau: Array, forces: Array) -> None:
    """The bar by Newton and Euler, each arm alone with the bar's wrench on its hand."""
    mechanism = two_arms()
    wrenches = mechanism.closure_wrenches(q, forces)
    force, moment, centre = bar_needs(q, v, a)
    size = max(np.abs(w).max() for w in wrenches.values())
    for i, side in enumerate(ARMS):
        own = slice(7 * i, 7 * i + 7)
        place = hand(side, q[own])
        wrench = wrenches[f"{side} grip"]
        force += wrench[:3]  # the bar feels the opposite of what it does to the hand
        moment += wrench[3:] + np.cross(place.translation - centre, wrench[:3])
        data = panda().createData()
        needed = pin.rnea(panda(), data, q[own], v[own], a[own])
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(panda(), data, q[own], panda().getFrameId(HAND), axes)
        np.testing.assert_allclose(
            tau[own], needed - jacobian.T @ wrench, rtol=0, atol=1e-9 * np.abs(tau).max()
        )
    np.testing.assert_allclose(force, 0.0, atol=1e-9 * size)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9 * size)


def bar_needs(q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    """m (c'' - g), I alpha + omega x I omega, and c, in world axes.

    From the free-flyer's body-axes velocity (V, w) and acceleration (A, dw), p'' = R (A + w x V).
    """
    R = pin.Quaternion(q[17:21]).matrix()
    (linear, spin), (pull, spin_rate) = v[14:].reshape(2, 3), a[14:].reshape(2, 3)
    of_origin = pull + np.cross(spin, linear)
    of_com = of_origin + np.cross(spin_rate, COM) + np.cross(spin, np.cross(spin, COM))
    force = MASS * (R @ of_com - GRAVITY)
    moment = R @ (INERTIA @ spin_rate + np.cross(spin, INERTIA @ spin))
    return force, moment, q[14:17] + R @ COM


@common.both_engines
def test_closes_from_rough_guesses(engine: str) -> None:
    """Both hands are where the bar's ends are, each found by its arm alone."""
    mechanism = common.through(engine, two_arms())
    for guess in common.guesses(mechanism, 0.3, 8):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        bar = pin.XYZQUATToSE3(q[14:])
        for i, side in enumerate(ARMS):
            end = bar * bar_place().actInv(hand(side, READY))
            gap = pin.log6(end.actInv(hand(side, q[7 * i : 7 * i + 7]))).vector
            assert np.abs(gap).max() <= 1e-11


def test_bar_moves_as_either_arm_moves_it() -> None:
    """Its twist is that of each hand, by the Jacobian of that arm alone."""
    mechanism = two_arms()
    for seed in range(5):
        q, v, _ = closed_state(seed)
        bar, R = q[14:17], pin.Quaternion(q[17:21]).matrix()
        spin, linear = R @ v[17:], R @ v[14:17]
        for i, side in enumerate(ARMS):
            own = slice(7 * i, 7 * i + 7)
            data, index = panda().createData(), panda().getFrameId(HAND)
            axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            twist = pin.computeFrameJacobian(panda(), data, q[own], index, axes) @ v[own]
            arm = hand(side, q[own]).translation - bar
            expected = np.concatenate([linear + np.cross(spin, arm), spin])
            np.testing.assert_allclose(twist, expected, rtol=0, atol=1e-11 * np.abs(v).max())
    assert mechanism.allowed_motions(q).shape == (20, 8)


@common.both_engines
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_forward_dynamics_of_the_least_norm_torques(speed: float, engine: str) -> None:
    """Static and moving; and whatever the torques, the bodies balance in the motion they give."""
    mechanism = common.through(engine, two_arms())
    rng = np.random.default_rng(7)
    for seed in range(5):
        q, v, a = closed_state(seed, speed)
        tau = least_norm(q, v, a)
        back = mechanism.forward_dynamics(q, v, tau)
        np.testing.assert_allclose(back, a, rtol=0, atol=1e-9 * max(1.0, np.abs(a).max()))
        check_balance(q, v, a, tau, mechanism.constraint_forces(q, v, a, tau))
        other = tau + rng.normal(scale=5.0, size=14)
        moved = mechanism.forward_dynamics(q, v, other)
        check_balance(q, v, moved, other, mechanism.constraint_forces(q, v, moved, other))


@common.both_engines
def test_six_ways_to_squeeze_the_bar(engine: str) -> None:
    """14 - 8 torques do no work: the arms press against each other, and nothing moves."""
    mechanism = common.through(engine, two_arms())
    rng = np.random.default_rng(8)
    q, v, a = closed_state(3)
    motions, _ = reduced_equations(q, v, a)
    squeezes = null_space(motions[:14].T, rcond=1e-10)
    assert squeezes.shape == (14, 6)
    tau = least_norm(q, v, a)
    before = mechanism.closure_wrenches(q, mechanism.constraint_forces(q, v, a, tau))
    pressed = tau + squeezes @ rng.normal(scale=10.0, size=6)
    np.testing.assert_allclose(mechanism.forward_dynamics(q, v, pressed), a, rtol=0, atol=1e-9 * 30)
    forces = mechanism.constraint_forces(q, v, a, pressed)
    check_balance(q, v, a, pressed, forces)
    after = mechanism.closure_wrenches(q, forces)
    more = [after[f"{side} grip"][:3] - before[f"{side} grip"][:3] for side in ARMS]
    assert np.linalg.norm(more[0]) > 1.0
    np.testing.assert_allclose(more[0], -more[1], rtol=0, atol=1e-8)


def test_describes_redundant_actuation() -> None:
    common.check_description(two_arms(), rows=12, rank=12, mobility=8, actuation="redundant")


# Shared between the actuators ---------------------------------------------------------------------


def test_unlimited_forces_are_the_least() -> None:
    """By the pseudo-inverse; with weights too."""
    plain = ForceDistribution(two_arms())
    weights = np.tile([1.0, 1, 1, 1, 5, 5, 5], 2)
    weighted = ForceDistribution(two_arms(), weights=weights)
    for seed in range(5):
        q, v, a = closed_state(seed)
        for solver, by in ((plain, 1.0), (weighted, weights)):
            found, expected = solver.solve(q, v, a), least_norm(q, v, a, by)
            error = np.abs(found.tau - expected).max() / np.abs(expected).max()
            assert error < 1e-9
            check_balance(q, v, a, found.tau, found.constraint_forces)


def test_scipy_finds_no_smaller_torques() -> None:
    """SLSQP over all 14 torques, from a start where the arms squeeze hard."""
    q, v, a = closed_state(1)
    motions, right = reduced_equations(q, v, a)
    start = least_norm(q, v, a) + null_space(motions[:14].T, rcond=1e-10) @ np.full(6, 20.0)
    found = ForceDistribution(two_arms()).solve(q, v, a)
    best = minimize(
        lambda tau: tau @ tau,
        start,
        jac=lambda tau: 2 * tau,
        constraints={
            "type": "eq",
            "fun": lambda tau: motions[:14].T @ tau - right,
            "jac": lambda tau: motions[:14].T,
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.success
    np.testing.assert_allclose(found.tau, best.x, rtol=0, atol=1e-5 * np.abs(best.x).max())
    assert found.tau @ found.tau <= best.fun * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_torque_limits_hold_and_the_rest_is_the_best_there_is(seed: int) -> None:
    """Limits half way from the least possible peak to the peak of the unlimited answer."""
    q, v, a = closed_state(seed)
    problem = optima.Distribution(two_arms(), q, v, a)
    peak, free = problem.least_peak(), np.abs(least_norm(q, v, a)).max()
    assert peak < free
    limit = (peak + free) / 2
    problem.limit_torques(limit)
    found = ForceDistribution(two_arms(), torque_limits=limit).solve(q, v, a)
    assert np.abs(found.tau).max() <= limit * (1 + 1e-9)
    assert found.at_limit
    assert worst(*problem.quality(found.tau, found.constraint_forces)) < 1e-8
    check_balance(q, v, a, found.tau, found.constraint_forces)
    back = two_arms().forward_dynamics(q, v, found.tau)
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9 * np.abs(a).max())


@pytest.mark.parametrize("seed", range(4))
def test_limits_below_the_least_peak_are_refused(seed: int) -> None:
    """That peak comes from linear programming; 0.1 percent below it nothing is left."""
    q, v, a = closed_state(seed)
    peak = optima.Distribution(two_arms(), q, v, a).least_peak()
    found = ForceDistribution(two_arms(), torque_limits=1.001 * peak).solve(q, v, a)
    assert np.abs(found.tau).max() <= 1.001 * peak * (1 + 1e-9)
    with pytest.raises(InfeasibleError, match="N m beyond its") as refused:
        ForceDistribution(two_arms(), torque_limits=0.999 * peak).solve(q, v, a)
    assert refused.value.violations
    assert all("panda_joint" in one.name for one in refused.value.violations)


def test_the_arms_own_limits() -> None:
    """87 N m and 12 N m, as the file says; holding the bar takes less than that."""
    q, v, a = closed_state(0, speed=0.0)
    found = ForceDistribution(two_arms(), torque_limits="model").solve(q, v, a)
    assert (np.abs(found.tau) <= np.tile([87.0] * 4 + [12.0] * 3, 2)).all()
    np.testing.assert_allclose(found.tau, least_norm(q, v, a), rtol=0, atol=1e-8)


def test_pressing_the_bar_with_at_least_40_newton() -> None:
    """Pre-stress along the bar, y of the world: it pushes the left hand away, towards +y."""
    q, v, a = two_arms().close(two_arms().home), np.zeros(20), np.zeros(20)
    press = ForceBound("left grip", direction=(0.0, 1.0, 0.0), lower=40.0)
    found = ForceDistribution(two_arms(), bounds=[press]).solve(q, v, a)
    wrenches = two_arms().closure_wrenches(q, found.constraint_forces)
    assert wrenches["left grip"][1] == pytest.approx(40.0, rel=1e-9)
    assert wrenches["right grip"][1] == pytest.approx(-40.0, rel=1e-9)  # at rest, weight along z
    problem = optima.Distribution(two_arms(), q, v, a)
    problem.limit_forces(np.eye(12)[two_arms().rows("left grip").start + 1], 40.0)
    assert worst(*problem.quality(found.tau, found.constraint_forces)) < 1e-8
    check_balance(q, v, a, found.tau, found.constraint_forces)


def test_the_certificate_can_fail() -> None:
    """A squeeze of a hundredth more is right in every equation, and no longer the best."""
    q, v, a = closed_state(2)
    problem = optima.Distribution(two_arms(), q, v, a)
    best = least_norm(q, v, a)
    motions, _ = reduced_equations(q, v, a)
    tau = best + 0.01 * np.abs(best).max() * null_space(motions[:14].T, rcond=1e-10)[:, 0]
    quality = problem.quality(tau, two_arms().constraint_forces(q, v, a, tau))
    assert quality.equations < 1e-9
    assert quality.stationarity > 1e-3


def test_torques_near_to_those_preferred() -> None:
    rng = np.random.default_rng(9)
    q, v, a = closed_state(2)
    wish = rng.normal(scale=10.0, size=14)
    found = ForceDistribution(two_arms(), torque_limits=60.0).solve(q, v, a, preferred=wish)
    problem = optima.Distribution(two_arms(), q, v, a)
    problem.limit_torques(60.0)
    assert worst(*problem.quality(found.tau, found.constraint_forces, preferred=wish)) < 1e-8
