"""Forward dynamics against Pinocchio's own, Gauss's principle, limits of masses, and by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, LoopClosure, MechanismError, SingularityError
from tests.closed_loop import mechanisms, random_mechanisms
from tests.closed_loop.mechanisms import derivative, joint, link, robot
from tests.closed_loop.random_mechanisms import (
    EVERY_KIND,
    Case,
    body_jacobians,
    case,
    external_force,
    force_of_bodies,
    gap_slope,
    inertia_wrenches,
    mass_of_bodies,
    pooled,
    random_inertia,
    resisting_force,
    worst_error,
)

Array = NDArray[np.float64]

seeds = random_mechanisms.pool
yes_or_no = st.booleans()
every_kind = pytest.mark.parametrize("kind", EVERY_KIND)


def forces(c: Case, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    return np.asarray(10 * rng.normal(size=c.mechanism.actuated_indices.size))


def full(c: Case, tau: Array) -> Array:
    """S' tau."""
    force = np.zeros(c.mechanism.model.nv)
    force[c.mechanism.actuated_indices] = tau
    return force


# Round trips --------------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize("seed", range(3))
def test_motion_comes_back_from_its_forces(kind: str, seed: int) -> None:
    c = case(seed, kinds=[kind], massless=bool(seed % 2), effects=True, armature=True)
    found = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    a = c.mechanism.forward_dynamics(c.q, c.v, found.tau, wrenches=c.wrenches)
    assert worst_error(a, c.a) < 1e-9


@given(seeds, yes_or_no)
def test_forces_come_back_from_their_motion(seed: int, planar: bool) -> None:
    """And the loops stay closed under them, whatever they are."""
    c = pooled(seed, planar=planar, massless=True)
    tau = forces(c, seed)
    a = c.mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    errors = c.mechanism.loop_errors(c.q, c.v, a)
    np.testing.assert_allclose(errors.acceleration, 0, atol=1e-11 * max(1, np.abs(a).max()))
    found = c.mechanism.inverse_dynamics(c.q, c.v, a, wrenches=c.wrenches)
    assert worst_error(found.tau, tau) < 1e-9


@given(seeds, yes_or_no)
def test_constraint_forces_are_those_of_inverse_dynamics(seed: int, planar: bool) -> None:
    """Of least norm both, once forces and moments have one unit; and they balance."""
    c = pooled(seed, planar=planar, effects=True)
    found = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    other = c.mechanism.constraint_forces(c.q, c.v, c.a, found.tau, wrenches=c.wrenches)
    size = np.abs(force_of_bodies(c, c.v, c.a)).max()
    np.testing.assert_allclose(other, found.constraint_forces, rtol=0, atol=1e-9 * size)
    rest = force_of_bodies(c, c.v, c.a) - full(c, found.tau) - c.mechanism.jacobian(c.q).T @ other
    np.testing.assert_allclose(rest, 0, rtol=0, atol=1e-11 * size)


# Pinocchio's constraintDynamics -------------------------------------------------------------------


def pinocchio_s(c: Case, force: Array, mu: float = 1e-8) -> Array:
    """Its acceleration, with constraint models made here."""
    model = c.mechanism.model
    data = model.createData()
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
            pin.ReferenceFrame.LOCAL,
        )
        constraints.append(constraint)
        scratch.append(constraint.createData())
    pin.initConstraintDynamics(model, data, constraints, scratch)
    settings_ = pin.ProximalSettings(1e-14, mu, 500)
    return np.array(
        pin.constraintDynamics(model, data, c.q, c.v, force, constraints, scratch, settings_)
    )


@pytest.mark.parametrize("kinds", [["spherical"], ["rigid"], ["spherical", "rigid"]])
@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_equals_pinocchio_where_masses_are_regular(
    kinds: list[str], planar: bool, seed: int
) -> None:
    """Redundant rows among them, which its proximal iterations take."""
    c = case(seed, kinds=kinds, planar=planar, armature=bool(seed % 2))
    tau = forces(c, seed)
    expected = pinocchio_s(c, full(c, tau))
    assert worst_error(c.mechanism.forward_dynamics(c.q, c.v, tau), expected) < 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_equals_pinocchio_with_effects_and_wrenches(seed: int) -> None:
    c = case(seed, kinds=["spherical", "rigid"], effects=True, armature=True)
    mechanism, tau = c.mechanism, forces(c, seed)
    assert mechanism.effects is not None
    resisting = resisting_force(mechanism.model, mechanism.effects, c.q, c.v)
    expected = pinocchio_s(c, full(c, tau) - resisting + external_force(c))
    found = mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    assert worst_error(found, expected) < 1e-9


# Gauss's principle, and the KKT equations ---------------------------------------------------------


@given(seeds, yes_or_no)
@settings(max_examples=40)
def test_acceleration_is_the_least_constrained_one(seed: int, planar: bool) -> None:
    """Gauss: (a - a_free)' M (a - a_free) is least among all a with J a + J' v = 0.

    M is summed over the bodies, J is the gaps' slope, J' v its rate: all by differences or by hand.
    """
    c = pooled(seed, planar=planar, effects=True, armature=True)
    model = c.mechanism.model
    tau = forces(c, seed)
    mass = mass_of_bodies(model, c.q)
    rest = force_of_bodies(c, c.v, np.zeros(model.nv))
    free = np.linalg.solve(mass, full(c, tau) - rest)
    jacobian = gap_slope(c.mechanism, c.q)
    drift = derivative(lambda t: c.mechanism.jacobian(pin.integrate(model, c.q, t * c.v)) @ c.v)
    root = np.linalg.inv(np.linalg.cholesky(mass)).T  # M = root^-T root^-1
    correction, *_ = np.linalg.lstsq(jacobian @ root, -drift - jacobian @ free, rcond=1e-7)
    expected = free + root @ correction
    found = c.mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    assert worst_error(found, expected, np.abs(free).max()) < 1e-7


@given(seeds)
@settings(max_examples=40)
def test_no_allowed_change_of_the_acceleration_is_less_constrained(seed: int) -> None:
    """The first-order condition: N' (M a + h - S' tau) = 0, term by term from the bodies."""
    c = pooled(seed, massless=True, effects=True)
    tau = forces(c, seed)
    a = c.mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    rest = force_of_bodies(c, c.v, a) - full(c, tau)
    motions = c.mechanism.allowed_motions(c.q)
    size = np.abs(motions).max() * max(np.abs(rest).max(), np.abs(tau).max())
    np.testing.assert_allclose(motions.T @ rest, 0, rtol=0, atol=1e-10 * size)


# Masses, rotors, resistances ----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_massless_links_are_the_limit_of_light_ones(seed: int) -> None:
    """The error falls with the mass, in proportion."""
    c = case(seed, massless=True)
    tau = forces(c, seed)
    exact = c.mechanism.forward_dynamics(c.q, c.v, tau)
    rng = np.random.default_rng(seed)
    bodies = {
        index: random_inertia(rng)
        for index in range(1, c.mechanism.model.njoints)
        if c.mechanism.model.inertias[index].mass == 0
    }
    errors = []
    for share in (1e-4, 1e-5, 1e-6):
        model = c.mechanism.model.copy()
        for index, inertia in bodies.items():
            matrix = share * inertia.inertia
            model.inertias[index] = pin.Inertia(share * inertia.mass, inertia.lever, matrix)
        light = ClosedLoopModel(model, c.mechanism.closures, c.mechanism.actuated)
        errors.append(np.abs(light.forward_dynamics(c.q, c.v, tau) - exact).max())
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.05)
    assert errors[2] == pytest.approx(errors[1] / 10, rel=0.05)
    assert errors[0] > 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_rotors_and_resistances_are_what_their_equations_say(seed: int) -> None:
    """The same tree without any of them, its equations of motion extended by hand."""
    c = case(seed, effects=True, armature=True)
    model, effects = c.mechanism.model, c.mechanism.effects
    tau = forces(c, seed)
    bare = model.copy()
    bare.armature = np.zeros(model.nv)
    data = bare.createData()
    mass = np.array(pin.crba(bare, data, c.q)) + np.diag(model.armature)
    rest = pin.rnea(bare, data, c.q, c.v, np.zeros(model.nv))
    rest = rest + resisting_force(model, effects, c.q, c.v) - full(c, tau) - external_force(c)
    jacobian = c.mechanism.jacobian(c.q)
    drift = c.mechanism.loop_errors(c.q, c.v, np.zeros(model.nv)).acceleration
    rows = jacobian.shape[0]
    matrix = np.block([[mass, jacobian.T], [jacobian, np.zeros((rows, rows))]])
    solution, *_ = np.linalg.lstsq(matrix, -np.concatenate([rest, drift]), rcond=1e-11)
    found = c.mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    assert worst_error(found, solution[: model.nv]) < 1e-9


@given(seeds, yes_or_no)
def test_reduced_mass_bias_and_gravity_make_the_equation_of_motion(seed: int, planar: bool) -> None:
    c = pooled(seed, planar=planar, massless=True, effects=True, armature=True)
    mechanism, at = c.mechanism, c.mechanism.actuated_indices
    mass, bias = mechanism.mass_matrix(c.q), mechanism.bias(c.q, c.v)
    tau = mechanism.inverse_dynamics(c.q, c.v, c.a).tau
    assert worst_error(mass @ c.a[at] + bias, tau) < 1e-9
    np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-12 * np.abs(mass).max())
    kinetic = c.v @ mass_of_bodies(mechanism.model, c.q) @ c.v / 2
    assert c.v[at] @ mass @ c.v[at] / 2 == pytest.approx(kinetic, rel=1e-10)
    still = np.zeros(mechanism.model.nv)
    weights = inertia_wrenches(mechanism.model, c.q, still, still)
    pairs = zip(body_jacobians(mechanism.model, c.q), weights, strict=True)
    weight = sum(jacobian.T @ wrench for jacobian, wrench in pairs)
    expected = mechanism.motion_basis(c.q).T @ weight
    assert worst_error(mechanism.gravity_forces(c.q), expected) < 1e-9


@pytest.mark.parametrize("sort", ["revolute", "prismatic", "turn", "translation", "planar", "ball"])
def test_rotors_of_every_joint_count_once_in_the_kinetic_energy(sort: str) -> None:
    c = case(2, joints=[sort, sort, "revolute"], armature=True)
    expected = c.v @ mass_of_bodies(c.mechanism.model, c.q) @ c.v / 2
    assert c.mechanism.energy(c.q, c.v)[0] == pytest.approx(expected, rel=1e-12)


@given(seeds)
@settings(max_examples=20)
def test_reduced_quantities_of_other_joints_are_the_same_motion(seed: int) -> None:
    """u = S_i v: the kinetic energy does not depend on which joints describe it."""
    c = pooled(seed, effects=True)
    order = list(c.mechanism.actuated)[::-1]
    joints = [c.mechanism.model.joints[c.mechanism.model.getJointId(name)] for name in order]
    at = np.concatenate([np.arange(j.idx_v, j.idx_v + j.nv) for j in joints])
    mass = c.mechanism.mass_matrix(c.q, order)
    kinetic = c.mechanism.energy(c.q, c.v)[0]
    assert c.v[at] @ mass @ c.v[at] / 2 == pytest.approx(kinetic, rel=1e-10)
    force = mass @ c.a[at] + c.mechanism.bias(c.q, c.v, order)
    expected = full(c, c.mechanism.inverse_dynamics(c.q, c.v, c.a).tau)[at]
    assert worst_error(force, expected) < 1e-9


# Refusals -----------------------------------------------------------------------------------------


def test_motion_without_mass_is_refused() -> None:
    c = case(0)
    for index in range(1, c.mechanism.model.njoints):
        c.mechanism.model.inertias[index] = pin.Inertia.Zero()
    with pytest.raises(SingularityError, match="moves no mass"):
        c.mechanism.forward_dynamics(c.q, c.v, forces(c))
    c.mechanism.model.armature = np.ones(c.mechanism.model.nv)
    assert np.isfinite(c.mechanism.forward_dynamics(c.q, c.v, forces(c))).all()


def test_a_motion_without_mass_is_told_by_its_joints() -> None:
    """A flag without mass at the end of two bars: it alone turns freely."""
    urdf = robot(
        link("one", 1.0, "0.1 0 0", 0.01),
        link("two", 1.0, "0.1 0 0", 0.01),
        link("flag"),
        joint("revolute", "base", "one"),
        joint("revolute", "one", "two"),
        joint("revolute", "two", "flag"),
    )
    mechanism = ClosedLoopModel.from_urdf(urdf, [], ["one_joint"])
    with pytest.raises(SingularityError, match=r"moves the joints flag_joint \(give the links"):
        mechanism.forward_dynamics(np.zeros(3), np.zeros(3), np.zeros(1))


def test_proximal_method_is_deprecated_and_computes_the_same() -> None:
    """Of a massless tree too, which it did not take."""
    mechanism = mechanisms.three_rps()
    q, v, _ = mechanisms.state(mechanism)
    with pytest.warns(DeprecationWarning, match="method='proximal' is deprecated"):
        found = mechanism.forward_dynamics(q, v, np.ones(3), method="proximal")
    np.testing.assert_array_equal(found, mechanism.forward_dynamics(q, v, np.ones(3)))


def test_wrong_arguments_are_refused_by_name() -> None:
    c = case(0)
    mechanism, tau = c.mechanism, forces(c)
    with pytest.raises(InputError, match="method = 'sparse': it must be 'reduced' or 'proximal'"):
        mechanism.forward_dynamics(c.q, c.v, tau, method="sparse")
    with pytest.raises(InputError, match="tau has shape"):
        mechanism.forward_dynamics(c.q, c.v, [*tau, 1.0])
    with pytest.raises(InputError, match="tau is not finite: entry 0 is nan"):
        mechanism.forward_dynamics(c.q, c.v, np.nan * tau)
    with pytest.raises(InputError, match="v has shape"):
        mechanism.forward_dynamics(c.q, c.v[1:], tau)
    with pytest.raises(InputError, match="the wrench at frame 'body_0' has shape"):
        mechanism.forward_dynamics(c.q, c.v, tau, wrenches={"body_0": [1.0, 2.0, 3.0]})
    with pytest.raises(MechanismError, match="no frame 'hand'; there are: universe"):
        mechanism.forward_dynamics(c.q, c.v, tau, wrenches={"hand": np.zeros(6)})
    with pytest.raises(MechanismError, match="no frame 'hand'; there are: universe"):
        mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches={"hand": np.zeros(6)})


def test_trees_that_are_not_built_branch_by_branch_are_refused() -> None:
    """Pinocchio's mass matrix is wrong for them, without a word.

    Two arms of two links, their joints added in turn: 1 and 2 at the base, 3 on 1, 4 on 2.
    """
    model = pin.Model()
    for index, parent in enumerate([0, 0, 1, 2]):
        placement = pin.SE3(np.eye(3), np.array([0.3 * (index % 2), 0.0, 0.5 * (parent > 0)]))
        joint = model.addJoint(parent, pin.JointModelRY(), placement, f"joint_{index}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
        model.addFrame(pin.Frame(f"tip_{index}", joint, 0, tip, pin.FrameType.OP_FRAME))
    q = np.array([0.3, -0.4, 0.5, 0.2])
    by_hand = mass_of_bodies(model, q)
    assert np.abs(np.array(pin.crba(model, model.createData(), q)) - by_hand).max() > 1e-3
    with pytest.raises(MechanismError, match="joint_2"):
        ClosedLoopModel(model, [LoopClosure("tip_2", "tip_3")], ["joint_0", "joint_1"])


def test_open_chains_are_pinocchio_s() -> None:
    mechanism = mechanisms.five_bar()
    model = mechanism.model
    opened = ClosedLoopModel(model, [], list(model.names)[1:])
    rng = np.random.default_rng(0)
    q, v, tau = rng.normal(size=(3, model.nv))
    expected = pin.aba(model, model.createData(), q, v, tau)
    np.testing.assert_allclose(opened.forward_dynamics(q, v, tau), expected, rtol=1e-10)
