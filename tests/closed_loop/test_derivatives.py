"""Derivatives of the dynamics against central differences, Pinocchio's own, and motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointEffects, SingularityError
from rps_pin.closed_loop.dynamics.forward_dynamics import forward_dynamics
from rps_pin.closed_loop.dynamics.inverse_dynamics import inverse_dynamics
from tests.closed_loop import mechanisms, random_mechanisms
from tests.closed_loop.mechanisms import FOUR_BAR, five_bar, values
from tests.closed_loop.random_mechanisms import EVERY_KIND, Case, case, pooled, slopes, worst_error
from tests.quick import quick

Array = NDArray[np.float64]

seeds = random_mechanisms.pool
every_kind = pytest.mark.parametrize("kind", EVERY_KIND)

#: Relative; what central differences and a well conditioned mechanism leave.
CLOSE = 1e-6


def followed(c: Case, dy: Array, du: Array, dw: Array | None = None) -> tuple[Array, ...]:
    """The state when the actuated joints deviate, the rest of the mechanism following them."""
    mechanism, at = c.mechanism, c.mechanism.actuated_indices
    start = pin.integrate(mechanism.model, c.q, mechanism.motion_basis(c.q) @ dy)
    q = mechanism.close(start, fixed=mechanism.actuated)
    v = mechanism.velocity(q, c.v[at] + du)
    if dw is None:
        return q, v
    return q, v, mechanism.acceleration(q, v, c.a[at] + dw)


def check_inverse(c: Case) -> None:
    """In the actuated joints' coordinates; and in all, where no row is redundant."""
    mechanism, count = c.mechanism, c.mechanism.actuated_indices.size

    def tau(q: Array, v: Array, a: Array) -> Array:
        return inverse_dynamics(mechanism.system, q, v, a, c.wrenches, closed=False).tau

    found = mechanism.inverse_dynamics_derivatives(c.q, c.v, c.a, wrenches=c.wrenches)
    none = np.zeros(count)
    size = np.abs(tau(c.q, c.v, c.a)).max()
    along: dict[str, Callable[[Array], Array]] = {
        "position": lambda d: tau(*followed(c, d, none, none)),
        "velocity": lambda d: tau(*followed(c, none, d, none)),
        "acceleration": lambda d: tau(*followed(c, none, none, d)),
    }
    for name, f in along.items():
        assert worst_error(getattr(found, name), slopes(f, count), size) < CLOSE, name
    if not redundant(c):
        model = mechanism.model
        fully: dict[str, Callable[[Array], Array]] = {
            "q": lambda d: tau(pin.integrate(model, c.q, d), c.v, c.a),
            "v": lambda d: tau(c.q, c.v + d, c.a),
            "a": lambda d: tau(c.q, c.v, c.a + d),
        }
        for name, f in fully.items():
            assert worst_error(getattr(found, name), slopes(f, model.nv), size) < CLOSE, name


def check_forward(c: Case) -> None:
    """The same of accelerations."""
    mechanism, at = c.mechanism, c.mechanism.actuated_indices
    tau = mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches).tau

    def a(q: Array, v: Array, force: Array = tau) -> Array:
        return forward_dynamics(mechanism.system, q, v, force, c.wrenches, closed=False)

    found = mechanism.forward_dynamics_derivatives(c.q, c.v, tau, wrenches=c.wrenches)
    none = np.zeros(at.size)
    size = np.abs(c.a).max()
    along: dict[str, Callable[[Array], Array]] = {
        "position": lambda d: a(*followed(c, d, none))[at],
        "velocity": lambda d: a(*followed(c, none, d))[at],
        "actuation": lambda d: a(c.q, c.v, tau + d)[at],
        "tau": lambda d: a(c.q, c.v, tau + d),
    }
    for name, f in along.items():
        assert worst_error(getattr(found, name), slopes(f, at.size), size) < CLOSE, name
    if not redundant(c):
        model = mechanism.model
        fully: dict[str, Callable[[Array], Array]] = {
            "q": lambda d: a(pin.integrate(model, c.q, d), c.v),
            "v": lambda d: a(c.q, c.v + d),
        }
        for name, f in fully.items():
            assert worst_error(getattr(found, name), slopes(f, model.nv), size) < CLOSE, name


def redundant(c: Case) -> bool:
    return c.mechanism.model.nv - c.mechanism.actuated_indices.size < c.mechanism.constraint_size


# Central differences ------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize("seed", quick(range(2), [0]))
@pytest.mark.parametrize("check", [check_inverse, check_forward])
def test_derivatives_are_those_of_central_differences(
    check: Callable[[Case], None], kind: str, seed: int
) -> None:
    """With effects, rotors and wrenches."""
    check(case(seed, kinds=[kind], effects=True, armature=True))


@pytest.mark.parametrize("check", [check_inverse, check_forward])
@pytest.mark.parametrize("seed", quick(range(8), range(3)))
def test_derivatives_of_overconstrained_mechanisms(
    check: Callable[[Case], None], seed: int
) -> None:
    check(case(seed, planar=True, kinds=["revolute", "rigid", "spherical", "cylindrical"]))


@pytest.mark.parametrize("check", [check_inverse, check_forward])
@pytest.mark.parametrize("seed", quick(range(4), range(2)))
def test_derivatives_with_massless_links(check: Callable[[Case], None], seed: int) -> None:
    check(case(seed, massless=True))


@pytest.mark.parametrize("check", [check_inverse, check_forward])
@pytest.mark.parametrize(
    "sort", ["ball", "free", "planar", "turn", "translation", "universal", "helical", "zyx"]
)
def test_derivatives_with_every_joint(check: Callable[[Case], None], sort: str) -> None:
    """Two of it at least, among revolute ones."""
    check(case(0, joints=[sort, sort, "revolute", "revolute"]))


@given(seeds)
@settings(max_examples=8)
def test_derivatives_of_any_mechanism(seed: int) -> None:
    c = pooled(seed, planar=bool(seed % 3 == 0), effects=True)
    check_inverse(c)
    check_forward(c)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_in_other_joints_are_the_same_motion(seed: int) -> None:
    """With x = P y, P the independent joints' motion per actuated one: a chain rule."""
    c = case(seed, effects=True)
    mechanism = c.mechanism
    tau = mechanism.inverse_dynamics(c.q, c.v, c.a).tau
    others = list(mechanism.actuated)[::-1]
    joints = [mechanism.model.joints[mechanism.model.getJointId(name)] for name in others]
    at = np.concatenate([np.arange(j.idx_v, j.idx_v + j.nv) for j in joints])
    own = mechanism.forward_dynamics_derivatives(c.q, c.v, tau)
    other = mechanism.forward_dynamics_derivatives(c.q, c.v, tau, others)
    order = [list(mechanism.actuated_indices).index(index) for index in at]
    for name in ("position", "velocity"):
        expected = getattr(own, name)[np.ix_(order, order)]
        assert worst_error(getattr(other, name), expected) < 1e-9
    assert worst_error(other.actuation, own.actuation[order]) < 1e-9
    np.testing.assert_allclose(other.q, own.q, rtol=0, atol=1e-9 * np.abs(own.q).max())


# Others' derivatives ------------------------------------------------------------------------------


class OfPinocchio:
    """Derivatives of `constraintDynamics`, by differences and by Pinocchio's own algorithm.

    Closures in world axes. In some trees the algorithm's (of pin 4.1) do not agree with the
    differences of the very function they are for.
    """

    def __init__(self, c: Case, tau: Array) -> None:
        model = c.mechanism.model
        force = np.zeros(model.nv)
        force[c.mechanism.actuated_indices] = tau
        constraints, scratch = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for closure in c.mechanism.closures:
            a, b = (model.frames[model.getFrameId(f)] for f in (closure.frame_a, closure.frame_b))
            spherical = closure.kind == "spherical"
            constraint = pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D if spherical else pin.ContactType.CONTACT_6D,
                model,
                a.parentJoint,
                a.placement,
                b.parentJoint,
                b.placement,
                pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
            )
            constraints.append(constraint)
            scratch.append(constraint.createData())
        data = model.createData()
        pin.initConstraintDynamics(model, data, constraints, scratch)
        limits = pin.ProximalSettings(1e-14, 1e-12, 100)

        def a_of(q: Array, v: Array) -> Array:
            return np.array(
                pin.constraintDynamics(model, data, q, v, force, constraints, scratch, limits)
            )

        self.by_q = slopes(lambda d: a_of(pin.integrate(model, c.q, d), c.v), model.nv)
        self.by_v = slopes(lambda d: a_of(c.q, c.v + d), model.nv)
        a_of(c.q, c.v)
        pin.computeConstraintDynamicsDerivatives(model, data, constraints, scratch, limits)
        self.own = [np.array(part) for part in (data.ddq_dq, data.ddq_dv, data.ddq_dtau)]

    def is_right(self) -> bool:
        """Whether the algorithm agrees with the differences."""
        differences = (self.by_q, self.by_v)
        return all(worst_error(x, y) < CLOSE for x, y in zip(self.own, differences, strict=False))


@pytest.mark.parametrize("kind", ["spherical", "rigid"])
def test_derivatives_are_pinocchio_s(kind: str) -> None:
    """No row redundant. All of its differences, and its algorithm's where that is right.

    With respect to q alone they leave the closed configurations, where closures may be extended in
    more than one way; along them, dq = T dy and dv = V dy, both have to agree.
    """
    right = 0
    for seed in range(5):
        c = _regular(kind, seed)
        mechanism, at = c.mechanism, c.mechanism.actuated_indices
        tau = np.random.default_rng(seed).normal(size=at.size)
        theirs = OfPinocchio(c, tau)
        found = mechanism.forward_dynamics_derivatives(c.q, c.v, tau)
        motions, none = mechanism.motion_basis(c.q), np.zeros(at.size)
        following = slopes(lambda dy, c=c, none=none: followed(c, dy, none)[1], at.size)
        along = theirs.by_q @ motions + theirs.by_v @ following
        assert worst_error(found.position, along[at]) < CLOSE
        assert worst_error(found.velocity, (theirs.by_v @ motions)[at]) < CLOSE
        assert worst_error(found.tau, theirs.own[2][:, at]) < CLOSE
        if theirs.is_right():
            right += 1
            along = theirs.own[0] @ motions + theirs.own[1] @ following
            assert worst_error(found.position, along[at]) < CLOSE
        if kind == "spherical":
            assert worst_error(found.q, theirs.by_q) < CLOSE
            assert worst_error(found.v, theirs.by_v) < CLOSE
    assert right >= 2


def _regular(kind: str, seed: int) -> Case:
    """The first case from a seed on that has no redundant rows."""
    for further in range(seed * 50, seed * 50 + 50):
        c = case(further, kinds=[kind])
        if not redundant(c):
            return c
    raise AssertionError("no case without redundant rows")


# What they mean -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_acceleration_slope_is_the_reduced_mass_matrix(seed: int) -> None:
    c = case(seed, massless=True, armature=True)
    found = c.mechanism.inverse_dynamics_derivatives(c.q, c.v, c.a)
    assert worst_error(found.acceleration, c.mechanism.mass_matrix(c.q)) < 1e-10


@pytest.mark.parametrize("seed", range(3))
def test_inverse_and_forward_derivatives_undo_each_other(seed: int) -> None:
    """tau(y, u, a(y, u, tau)) = tau: T_w a_tau = 1, T_y + T_w a_y = 0, T_u + T_w a_u = 0."""
    c = case(seed, effects=True)
    tau = c.mechanism.inverse_dynamics(c.q, c.v, c.a).tau
    inverse = c.mechanism.inverse_dynamics_derivatives(c.q, c.v, c.a)
    forward = c.mechanism.forward_dynamics_derivatives(c.q, c.v, tau)
    product = inverse.acceleration @ forward.actuation
    np.testing.assert_allclose(product, np.eye(tau.size), rtol=0, atol=1e-9)
    for of_tau, of_a in (
        (inverse.position, forward.position),
        (inverse.velocity, forward.velocity),
    ):
        assert worst_error(inverse.acceleration @ of_a, -of_tau) < 1e-9


def motion(
    mechanism: ClosedLoopModel, x: Array, guess: Array, tau: Array, duration: float, count: int
) -> Array:
    """Where a state of the actuated joints goes: fourth-order Runge-Kutta steps, loops closed."""
    m, step, q_near = len(x) // 2, duration / count, guess

    def rate(state: Array) -> Array:
        nonlocal q_near
        q_near = mechanism.complete(state[:m], q_near)
        v = mechanism.velocity(q_near, state[m:])
        a = mechanism.forward_dynamics(q_near, v, tau)
        return np.concatenate([state[m:], a[mechanism.actuated_indices]])

    for _ in range(count):
        k1 = rate(x)
        k2 = rate(x + step / 2 * k1)
        k3 = rate(x + step / 2 * k2)
        k4 = rate(x + step * k3)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def test_linearisation_predicts_small_deviations() -> None:
    """From rest at an equilibrium held by torques: exp(A t), with an error of second order."""
    mechanism = five_bar()
    q, _, _ = mechanisms.state(mechanism)
    still = np.zeros(mechanism.model.nv)
    tau = mechanism.inverse_dynamics(q, still, still).tau
    A, B = mechanism.linearize(q, still, tau)
    assert A.shape == (4, 4)
    assert B.shape == (4, 2)
    x = np.concatenate([q[mechanism.actuated_indices], np.zeros(2)])
    push, kick = np.array([0.3, -0.5, 0.4, 0.2]), np.array([0.7, -0.4])
    duration, count = 0.2, 40
    errors = []
    for size in (1e-2, 5e-3, 2.5e-3):
        whole = np.block([[A, (B @ kick)[:, None]], [np.zeros((1, 5))]])
        state = np.append(size * push, size)
        predicted = expm(whole * duration) @ state
        reached = motion(mechanism, x + size * push, q, tau + size * kick, duration, count)
        errors.append(np.abs(reached - x - predicted[:4]).max())
        assert errors[-1] < 0.1 * np.abs(predicted[:4]).max()
    np.testing.assert_allclose(np.divide(errors[1:], errors[:-1]), 0.25, rtol=0.1)


def expm(matrix: Array) -> Array:
    """The matrix exponential, by its series."""
    total = term = np.eye(len(matrix))
    for power in range(1, 40):
        term = term @ matrix / power
        total = total + term
    return total


def test_linearisation_about_a_motion_is_its_flow_s_slope() -> None:
    """Over a short time h about a moving point: the flow's slope is 1 + h A + O(h^2)."""
    mechanism = five_bar()
    q, v, _ = mechanisms.state(mechanism)
    tau = np.array([1.0, -2.0])
    A, B = mechanism.linearize(q, v, tau)
    at = mechanism.actuated_indices
    x = np.concatenate([q[at], v[at]])
    errors = []
    for h in (2e-3, 1e-3):
        flow = slopes(lambda d, h=h: motion(mechanism, x + d, q, tau, h, 1), 4, h=1e-3)
        errors.append(np.abs((flow - np.eye(4)) / h - A).max() / np.abs(A).max())
        driven = slopes(lambda d, h=h: motion(mechanism, x, q, tau + d, h, 1), 2, h=1e-2)
        np.testing.assert_allclose(driven / h, B, rtol=0, atol=50 * h * np.abs(B).max())
    assert errors[0] < 0.05
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.1)


def hanging() -> tuple[ClosedLoopModel, Array]:
    """The four-bar where its weight is in balance, without torque: least potential energy."""
    mechanism = FOUR_BAR.spherical_mechanism()
    low, high = -2.5, 0.0
    for _ in range(100):
        middle = (low + high) / 2
        if FOUR_BAR.torque(middle, 0.0, 0.0) < 0:
            low = middle
        else:
            high = middle
    return mechanism, values(mechanism, FOUR_BAR.joint_values(low))


def test_conservative_mechanism_swings_about_its_equilibrium() -> None:
    """Eigenvalues +-i omega, omega^2 = V'' / M from the closed form."""
    mechanism, q = hanging()
    angle, still = q[0], np.zeros(3)
    A, _ = mechanism.linearize(q, still, [0.0])
    stiffness = mechanisms.derivative(lambda x: np.array(FOUR_BAR.torque(x, 0.0, 0.0)), angle)
    omega = np.sqrt(float(stiffness) / FOUR_BAR.inertia(angle))
    found = np.linalg.eigvals(A)
    np.testing.assert_allclose(found.real, 0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.sort(found.imag), [-omega, omega], rtol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_conservative_mechanisms_have_symmetric_spectra(seed: int) -> None:
    """Held still by constant forces: A's blocks are M^-1 K with K symmetric, and no damping."""
    c = case(seed, joints=["revolute", "prismatic"])
    still = np.zeros(c.mechanism.model.nv)
    tau = c.mechanism.inverse_dynamics(c.q, still, still).tau
    A, B = c.mechanism.linearize(c.q, still, tau)
    m = tau.size
    mass = np.linalg.inv(B[m:])
    stiffness = mass @ A[m:, :m]
    assert worst_error(stiffness, stiffness.T) < 1e-8
    np.testing.assert_allclose(A[m:, m:], 0, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(A[:m], np.hstack([np.zeros((m, m)), np.eye(m)]))
    np.testing.assert_array_equal(B[:m], 0)
    squares = np.linalg.eigvals(A) ** 2
    assert np.abs(squares.imag).max() < 1e-5 * max(1, np.abs(squares).max())


def test_damping_makes_the_spectrum_decay() -> None:
    mechanism, q = hanging()
    effects = JointEffects.named(mechanism.model, damping={"crank_joint": 0.2})
    damped = ClosedLoopModel(
        mechanism.model, mechanism.closures, mechanism.actuated, effects=effects
    )
    A, _ = damped.linearize(q, np.zeros(3), [0.0])
    decay = 0.2 / FOUR_BAR.inertia(q[0])
    assert np.trace(A) == pytest.approx(-decay, rel=1e-9)
    assert (np.linalg.eigvals(A).real < 0).all()


# Refusals -----------------------------------------------------------------------------------------


def test_wrong_arguments_are_refused() -> None:
    mechanism = five_bar()
    q, v, a = mechanisms.state(mechanism)
    with pytest.raises(InputError, match="tau has shape"):
        mechanism.forward_dynamics_derivatives(q, v, [1.0])
    with pytest.raises(InputError, match="a is not finite"):
        mechanism.inverse_dynamics_derivatives(q, v, a * np.nan)
    with pytest.raises(SingularityError, match="1 independent velocities are named"):
        mechanism.linearize(q, v, np.zeros(2), ["left_joint"])
    driven = ClosedLoopModel(mechanism.model, mechanism.closures, list(mechanism.model.names)[1:4])
    with pytest.raises(SingularityError):
        driven.inverse_dynamics_derivatives(q, v, a)
