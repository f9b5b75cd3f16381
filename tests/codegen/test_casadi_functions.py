"""A mechanism's CasADi functions against the Pinocchio engine, and their derivatives."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.codegen import CasadiFunctions
from rps_pin.codegen.engine.applied import with_parameters
from rps_pin.errors import InputError, MechanismError
from tests.closed_loop.mechanisms import derivative
from tests.closed_loop.random_mechanisms import case
from tests.each import each
from tests.worst import worst

FOLDER = Path(__file__).parent.parent.parent / "urdf"
FILES = ("five_bar", "delta", "four_bar", "rps", "slider_crank", "stewart")
#: Options of random mechanisms, by seed.
DRAWN: dict[int, dict[str, Any]] = {
    0: {},
    1: {"effects": True, "armature": True},
    2: {"kinds": ("rigid",), "effects": True},
    3: {"planar": True},
    4: {"planar": True, "armature": True},
    5: {"kinds": ("universal",)},
}
NAMES = (*FILES, *DRAWN)


class State(NamedTuple):
    """A mechanism, its functions, and a motion that keeps its loops closed."""

    mechanism: ClosedLoopModel
    functions: CasadiFunctions
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    u: np.ndarray
    w: np.ndarray
    tau: np.ndarray


@cache
def state(name: str | int) -> State:
    """One of a file's mechanism or of a random one."""
    rng = np.random.default_rng(7)
    if isinstance(name, int):
        mechanism, q, *_ = case(name, **DRAWN[name])
    else:
        mechanism = ClosedLoopModel.load(FOLDER / f"{name}.yaml")
        q = pin.integrate(
            mechanism.model, mechanism.home, 0.05 * rng.normal(size=mechanism.model.nv)
        )
        q = mechanism.close(q)
    count = mechanism.actuated_indices.size
    u, w, tau = rng.normal(size=(3, count))
    v = mechanism.velocity(q, u)
    a = mechanism.acceleration(q, v, w)
    functions = mechanism.to_casadi()
    np.testing.assert_array_equal(functions.independent, mechanism.actuated_indices)
    return State(mechanism, functions, q, v, a, u, w, tau)


def relative(found: Any, expected: Any) -> float:
    """Largest error, over the largest entry if that is above one."""
    found = found.full() if isinstance(found, ca.DM) else found
    expected = np.asarray(expected)
    return worst(np.reshape(found, expected.shape) - expected) / max(1.0, worst(expected, 0.0))


def values(s: State) -> Iterator[tuple[str, Any, Any]]:
    """Yield functions' names, their results and those of the Pinocchio engine."""
    m, f, q, v, a = s.mechanism, s.functions, s.q, s.v, s.a
    rng = np.random.default_rng(8)
    free, move = rng.normal(size=(2, m.model.nv))  # opens the loops
    errors = m.loop_errors(q, free, a)
    yield "gaps", f.gaps(q), errors.position
    yield "jacobian", f.jacobian(q), m.jacobian(q)
    yield "rates", f.jacobian(q) @ free, errors.velocity
    yield (
        "gap_accelerations",
        f.gap_accelerations(q, v, free),
        m.loop_errors(q, v, free).acceleration,
    )
    yield "integrate", f.integrate(q, move), pin.integrate(m.model, q, move)
    yield "motion_basis", f.motion_basis(q), m.motion_basis(q)
    yield "velocity", f.velocity(q, s.u), v
    yield "acceleration", f.acceleration(q, v, s.w), a
    yield "projected_velocity", f.projected_velocity(q, v), v
    inverse = m.inverse_dynamics(q, v, a)
    yield "tau", f.inverse_dynamics(q, v, a)[0], inverse.tau
    if m.describe(q).redundant_rows == 0:
        yield "multipliers", f.inverse_dynamics(q, v, a)[1], inverse.constraint_forces
    forward = m.forward_dynamics(q, v, s.tau)
    yield "forward_dynamics", f.forward_dynamics(q, v, s.tau), forward
    multipliers = f.constraint_forces(q, v, forward, s.tau)
    zero = np.zeros(m.model.nv)
    error = f.equations_of_motion(q, v, forward, s.tau, multipliers)
    yield "equations_of_motion", error, zero
    yield "generalised_force", f.generalised_force(q, v, a), m.generalised_force(q, v, a)
    whole = pin.crba(m.model, m.model.createData(), q)
    yield "tree_mass_matrix", f.tree_mass_matrix(q), np.triu(whole) + np.triu(whole, 1).T
    yield "mass_matrix", f.mass_matrix(q), m.mass_matrix(q)
    yield "bias", f.bias(q, v), m.bias(q, v)
    yield "gravity_forces", f.gravity_forces(q), m.gravity_forces(q)
    yield "energy", f.energy(q, v), m.energy(q, v)
    for found in (f.closing_step(q=q), f.projection(q=q, v=v)):
        yield "closing", found["step"], zero
        yield "squared_gap", found["squared_gap"], 0.0
    yield "projection", found["projected"], v
    if lengths := m.model.nq - m.model.nv:
        yield "unit_lengths", f.unit_lengths(q), np.zeros(lengths)
    frame = m.model.frames[m.model.nframes - 1].name
    placement, jacobian = f.frame(frame)(q)
    yield "placement", placement, m.frame_placement(q, frame)
    yield "frame's jacobian", jacobian, m.frame_jacobian(q, frame)


@each("name", NAMES)
def test_values_are_those_of_the_pinocchio_engine(name: str | int) -> None:
    for what, found, expected in values(state(name)):
        assert relative(found, expected) < 1e-10, what


@each("name", NAMES)
def test_the_tangent_is_the_derivative_of_integrate(name: str | int) -> None:
    _, f, q, *_ = state(name)
    move = ca.SX.sym("move", f.integrate.size1_in(1))
    slope = ca.Function("slope", [move], [ca.jacobian(f.integrate(q, move), move)])
    assert relative(slope(np.zeros(move.numel())).full(), f.tangent(q).full()) < 1e-13


def test_lengths_are_not_one_where_q_is_not_normal() -> None:
    s = state("delta")  # a free platform: q ends with a quaternion
    q = s.q.copy()
    q[-4:] *= 2
    np.testing.assert_allclose(s.functions.unit_lengths(q), 3.0, rtol=1e-14)


@each("name", NAMES)
def test_the_closing_step_closes_the_loops(name: str | int) -> None:
    """It converges quadratically, moves dependent coordinates only, and vanishes when closed."""
    s = state(name)
    move = np.zeros(s.mechanism.model.nv)
    move[s.functions.dependent] = 1e-3
    q = pin.integrate(s.mechanism.model, s.q, move)
    gaps = [s.mechanism.loop_gap(q)]
    for _ in range(3):
        step = s.functions.closing_step(q=q)["step"].full().ravel()
        assert not step[s.functions.independent].any()
        q = pin.integrate(s.mechanism.model, q, step)
        gaps.append(s.mechanism.loop_gap(q))
    assert gaps[0] > 1e-6
    assert gaps[-1] < 1e-13


@each("name", FILES)
def test_closing_steps_and_lengths_determine_the_dependent_coordinates(name: str) -> None:
    """Also where rows of the closures are redundant: as many equations as unknowns."""
    m, f, q, *_ = state(name)
    x = ca.SX.sym("q", q.size)
    equations = ca.vertcat(f.closing_step(q=x)["step"][f.dependent.tolist()], f.unit_lengths(x))
    coordinates = np.concatenate([j.idx_q + np.arange(j.nv) for j in list(m.model.joints)[1:]])
    unknown = np.setdiff1d(np.arange(q.size), coordinates[f.independent])
    slopes = ca.Function("slopes", [x], [ca.jacobian(equations, x)[:, unknown.tolist()]])(q).full()
    assert slopes.shape[0] == slopes.shape[1]
    assert np.linalg.cond(slopes) < 1e3


# Derivatives --------------------------------------------------------------------------------------


@each("name", NAMES)
def test_derivatives_are_those_of_the_pinocchio_engine(name: str | int) -> None:
    """By velocities and forces; by q along motions that keep the loops closed."""
    m, f, q, v, a, *_, tau = state(name)
    allowed = f.tangent(q) @ f.motion_basis(q)
    given = [ca.SX.sym("q", q.size), ca.SX.sym("v", v.size), ca.SX.sym("last", v.size)]
    by = ca.Function("by", given, [ca.jacobian(f.inverse_dynamics(*given)[0], x) for x in given])
    found, basis = by(q, v, a), f.motion_basis(q).full()
    expected = m.inverse_dynamics_derivatives(q, v, a)
    generated = f.inverse_dynamics_derivatives(q=q, v=v, a=a)
    assert relative((found[0] @ allowed).full(), expected.q @ basis) < 1e-9
    assert relative((generated["by_q"] @ basis).full(), expected.q @ basis) < 1e-9
    assert relative(found[1].full(), expected.v) < 1e-10
    assert relative(found[2].full(), expected.a) < 1e-10
    given[2] = ca.SX.sym("tau", tau.size)
    by = ca.Function("by", given, [ca.jacobian(f.forward_dynamics(*given), x) for x in given])
    slopes, forward = by(q, v, tau), m.forward_dynamics_derivatives(q, v, tau)
    assert relative((slopes[0] @ allowed).full(), forward.q @ basis) < 1e-9
    assert relative(slopes[1].full(), forward.v) < 1e-9
    assert relative(slopes[2].full(), forward.tau) < 1e-9


@each("name", ("five_bar", "delta", *DRAWN))
def test_first_and_second_derivatives_are_finite(name: str | int) -> None:
    """At rest and at zero rotation too, in calls of MX that leave some results unused."""
    s = state(name)
    f, model = s.functions, s.mechanism.model
    q, move = ca.MX.sym("q", model.nq), ca.MX.sym("move", model.nv)
    v, last = ca.MX.sym("v", model.nv), ca.MX.sym("last", model.nv)
    results = [
        f.closing_step(q=q)["step"],
        f.integrate(q, move),
        f.inverse_dynamics(q=q, v=v, a=last)["tau"],
        f.energy(q, v),
        f.projected_velocity(q, v),
        f.gap_accelerations(q, v, last),
    ]
    total, x = sum(map(ca.sumsqr, results)), ca.veccat(q, move, v, last)
    at = ca.Function("at", [q, move, v, last], list(ca.hessian(total, x)))
    still = np.zeros(model.nv)
    for given in ((s.q, s.v, s.v, s.a), (s.mechanism.home, still, still, still)):
        assert all(np.isfinite(part.full()).all() for part in at(*given))


def test_the_energy_changes_by_the_power_of_the_actuators() -> None:
    """Exact derivatives of several functions together, at a motion under actuator forces."""
    for name in FILES:
        m, f, q, v, *_, tau = state(name)
        given = [ca.SX.sym("q", q.size), ca.SX.sym("v", v.size)]
        energy = ca.sum1(f.energy(*given))
        rate = ca.jtimes(energy, given[0], f.tangent(given[0]) @ given[1])
        rate += ca.jtimes(energy, given[1], f.forward_dynamics(*given, tau))
        power = tau @ v[m.actuated_indices]
        assert relative(ca.Function("rate", given, [rate])(q, v), power) < 1e-9


# Plans --------------------------------------------------------------------------------------------


def least_effort(s: State, goal: np.ndarray, variables: list[Any], node: list[Any]) -> np.ndarray:
    """Return the configurations (n, nq) of least effort between two closed ones, by collocation.

    The variables of a node begin with all coordinates, speeds and accelerations; of these, the
    independent ones are integrated by the trapezoidal rule. A node gives zeros and the forces.
    """
    n, h, own = 9, 0.05, s.functions.independent.tolist()
    unknown = [ca.MX.sym("x", x.numel(), n) for x in variables]
    zeros, tau = ca.Function("node", variables, ca.cse(node)).map(n)(*unknown)
    speeds = [x[own, :] if x.size1() > len(own) else x for x in unknown[1:3]]
    rates = [(unknown[0][own, :], speeds[0]), (speeds[0], speeds[1])]
    defects = [x[:, 1:] - x[:, :-1] - h / 2 * (r[:, 1:] + r[:, :-1]) for x, r in rates]
    ends = ca.vertcat(
        unknown[0][own, 0] - s.q[own], unknown[0][own, -1] - goal[own], speeds[0][:, [0, -1]][:]
    )
    problem = {
        "x": ca.veccat(*unknown),
        "f": ca.sumsqr(tau),
        "g": ca.veccat(*defects, zeros, ends),
    }
    options = {"ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}, "print_time": False}
    solver = ca.nlpsol("plan", "ipopt", problem, options)
    first = np.zeros((n, solver.size1_in(0) // n))
    guess = np.concatenate([np.tile(s.q, n), first.ravel()[n * s.q.size :]])
    found = solver(x0=guess, lbg=0, ubg=0)["x"].full().ravel()
    assert solver.stats()["success"]
    return found[: n * s.q.size].reshape(n, -1)


def test_a_plan_is_the_same_with_and_without_elimination() -> None:
    """The Delta's, whose platform has a quaternion; closed at every node, and at the goal."""
    s = state("delta")
    m, f = s.mechanism, s.functions
    goal = m.complete(s.q[m.actuated_indices] + [0.3, -0.2, 0.2], s.q)
    q, v, a = (ca.SX.sym(name, x.size) for name, x in (("q", s.q), ("v", s.v), ("a", s.a)))
    tau, multipliers = ca.SX.sym("tau", 3), ca.SX.sym("multipliers", m.constraint_size)
    closed = ca.vertcat(f.gaps(q), f.unit_lengths(q))
    moving = ca.vertcat(f.jacobian(q) @ v, f.gap_accelerations(q, v, a))
    error = f.equations_of_motion(q, v, a, tau, multipliers)
    whole = least_effort(
        s, goal, [q, v, a, tau, multipliers], [ca.vertcat(closed, moving, error), tau]
    )
    u, w = ca.SX.sym("u", 3), ca.SX.sym("w", 3)
    speed = f.velocity(q, u)
    force = f.inverse_dynamics(q, speed, f.acceleration(q, speed, w))[0]
    closing = ca.vertcat(f.closing_step(q)[0][f.dependent.tolist()], f.unit_lengths(q))
    reduced = least_effort(s, goal, [q, u, w], [closing, force])
    assert worst(*(m.loop_gap(x) for x in (*whole, *reduced))) < 1e-9
    assert worst(whole - reduced) < 1e-7
    assert worst(reduced[-1] - goal) < 1e-8


# Kinds of arguments -------------------------------------------------------------------------------


def test_arguments_are_numbers_or_symbols_in_order_or_by_name() -> None:
    _, f, q, v, a, *_ = state("delta")
    numbers = f.inverse_dynamics(q, v, a)[0].full()
    for kind in (ca.SX, ca.MX):
        given = [kind.sym("q", q.size), kind.sym("v", v.size), kind.sym("a", v.size)]
        named = dict(zip("qva", given, strict=True))
        for tau in (f.inverse_dynamics(*given)[0], f.inverse_dynamics(**named)["tau"]):
            assert isinstance(tau, kind)
            np.testing.assert_array_equal(ca.Function("f", given, [tau])(q, v, a), numbers)
    many = f.inverse_dynamics.map(3)
    three = [np.stack([x, x, x], axis=1) for x in (q, v, a)]
    np.testing.assert_array_equal(many(*three)[0], np.tile(numbers, 3))


@each("name", ("five_bar", "delta", 0))
def test_the_list_says_what_the_functions_take_and_give(name: str | int) -> None:
    m, f, *_ = state(name)
    text = str(f)
    assert m.name in repr(f)
    assert f"nq = {m.model.nq}, nv = {m.model.nv}" in text.splitlines()[0]
    assert set(f.names) <= set(dir(f))
    for function in f.names:
        made = getattr(f, function)
        assert made is getattr(f, function)  # made once
        line = next(line for line in text.splitlines() if line.startswith(f"{function}("))
        arguments, results = line.removeprefix(f"{function}(").split(") -> ")
        assert made.name_in() == arguments.split(", ")
        assert all(result in results for result in made.name_out())
        sizes = {"nq": m.model.nq, "nv": m.model.nv, "nc": m.constraint_size, "nq - nv": 0}
        sizes |= {"m": f.independent.size, "na": m.actuated_indices.size, "2": 2}
        sizes["nq - nv"] = m.model.nq - m.model.nv
        for part in filter(None, results.replace(";", ",").split(", ")):
            result, _, shape = part.partition(" (")
            shape = shape.partition(")")[0]
            if shape in sizes and result in made.name_out():
                assert made.size_out(result) == (sizes[shape], 1)
            elif shape and result in made.name_out():
                assert made.size_out(result) == tuple(sizes[size] for size in shape.split())


# Wrenches and parameters --------------------------------------------------------------------------


@each("seed", (0, 1, 3))
def test_wrenches(seed: int) -> None:
    m, q, v, a, wrenches = case(seed, **DRAWN[seed])
    f = m.to_casadi(wrench_frames=list(wrenches))
    assert f.wrench_frames == tuple(wrenches)
    assert "inverse_dynamics(q, v, a, wrenches)" in str(f)
    acting = np.concatenate(list(wrenches.values()))
    expected = m.inverse_dynamics(q, v, a, wrenches=wrenches)
    found = f.inverse_dynamics(q=q, v=v, a=a, wrenches=acting)["tau"]
    assert relative(found, expected.tau) < 1e-10
    forward = m.forward_dynamics(q, v, expected.tau, wrenches=wrenches)
    assert relative(f.forward_dynamics(q, v, expected.tau, acting), forward) < 1e-10
    required = m.generalised_force(q, v, a, wrenches=wrenches)
    assert relative(f.generalised_force(q, v, a, acting), required) < 1e-10


GROUPS = ("gravity", "inertia:left_joint", "mass:right_joint", "payload:left_tip")


def test_inertial_parameters_and_derivatives_by_them() -> None:
    m, _, q, v, a, *_, tau = state("five_bar")
    f = m.to_casadi(parameters=GROUPS)
    assert len(f.parameters) == f.nominal_parameters.size == 24
    changed = f.parameter_vector({"gravity": [1.0, 2.0, -5.0], "payload:left_tip.mass": 0.5})
    p = ca.SX.sym("p", changed.size)
    tau_of, a_of = (
        ca.Function("by", [p], [result, ca.jacobian(result, p)])
        for result in (f.inverse_dynamics(q, v, a, p)[0], f.forward_dynamics(q, v, tau, p))
    )
    for at in (f.nominal_parameters, changed):
        other = with_parameters(m, GROUPS, at)
        assert relative(tau_of(at)[0], other.inverse_dynamics(q, v, a).tau) < 1e-10
        assert relative(a_of(at)[0], other.forward_dynamics(q, v, tau)) < 1e-10
    for index in range(changed.size):

        def moved(h: float, index: int = index) -> ClosedLoopModel:
            return with_parameters(m, GROUPS, changed + h * np.eye(changed.size)[index])

        slope = derivative(lambda h: moved(h).inverse_dynamics(q, v, a).tau)
        assert relative(tau_of(changed)[1][:, index], slope) < 1e-9
        slope = derivative(lambda h: moved(h).forward_dynamics(q, v, tau))
        assert relative(a_of(changed)[1][:, index], slope) < 1e-7


def test_lengths_as_parameters() -> None:
    """The gaps open by what the links grow; closed again, the dynamics is the longer robot's."""
    m, _, q, *_ = state("five_bar")
    groups = ("placement:left_arm_joint", "closure:tips")
    f = m.to_casadi(parameters=groups)
    changed = f.parameter_vector({"placement:left_arm_joint.x": 0.02, "closure:tips.b.x": 0.01})
    longer = with_parameters(m, groups, changed)
    assert relative(f.gaps(q, changed), longer.loop_errors(q).position) < 1e-12
    p = ca.SX.sym("p", changed.size)
    slopes = ca.Function("slopes", [p], [ca.jacobian(f.gaps(q, p), p)])(changed)
    for index in range(changed.size):
        unit = np.eye(changed.size)[index]
        slope = derivative(
            lambda h, unit=unit: (
                with_parameters(m, groups, changed + h * unit).loop_errors(q).position
            )
        )
        assert relative(slopes[:, index], slope) < 1e-9
    q = longer.complete(q[m.actuated_indices], q)
    v = longer.velocity(q, [0.3, -0.7])
    a = longer.acceleration(q, v, [2.0, 1.0])
    assert relative(f.velocity(q, [0.3, -0.7], changed), v) < 1e-10
    tau = f.inverse_dynamics(q, v, a, changed)[0]
    assert relative(tau, longer.inverse_dynamics(q, v, a).tau) < 1e-10


# Other mechanisms ---------------------------------------------------------------------------------


def test_fewer_and_more_actuators_than_motions() -> None:
    whole = state("five_bar").mechanism
    x = [ca.MX.sym(name, whole.model.nv) for name in "qva"]
    for actuated in (["left_joint"], list(whole.model.names)[1:]):
        m = ClosedLoopModel(whole.model, whole.closures, actuated, home=whole.home)
        f = m.to_casadi()
        q, v = m.home, np.zeros(m.model.nv)
        found, expected = f.inverse_dynamics(q=q, v=v, a=v), m.inverse_dynamics(q, v, v)
        assert relative(found["tau"], expected.tau) < 1e-10
        if expected.unproduced is not None:
            assert relative(found["unproduced"], expected.unproduced) < 1e-10
        forward = m.forward_dynamics(q, v, expected.tau)
        assert relative(f.forward_dynamics(q, v, expected.tau), forward) < 1e-10
        total = sum(map(ca.sumsqr, f.inverse_dynamics(*x)))
        second = ca.Function("second", x, [ca.hessian(total, ca.veccat(*x))[0]])(q, v, v)
        assert np.isfinite(second.full()).all()


# Bad input ----------------------------------------------------------------------------------------


def test_names_that_are_not_there() -> None:
    m, f, *_ = state("five_bar")
    with pytest.raises(AttributeError, match=r"no function 'inverse_dynamic' \(did you mean inv"):
        _ = f.inverse_dynamic
    with pytest.raises(AttributeError, match="there are: gaps, jacobian"):
        _ = f.stage  # a function of generated code that is not for planning
    with pytest.raises(MechanismError, match="nowhere"):
        f.frame("nowhere")
    with pytest.raises(MechanismError, match="nowhere"):
        m.to_casadi(wrench_frames=["nowhere"])
    with pytest.raises(MechanismError, match="wrench frame 'left_tip' is named twice"):
        m.to_casadi(wrench_frames=["left_tip", "left_tip"])
    with pytest.raises(InputError, match=r"no parameter 'masses'"):
        m.to_casadi(parameters=["masses"])
    with pytest.raises(InputError, match=r"no parameter 'gravity'; there are: none"):
        f.parameter_vector({"gravity": [0, 0, 0]})


def test_one_name_need_not_be_in_a_list() -> None:
    f = state("five_bar").mechanism.to_casadi(wrench_frames="left_tip", parameters="gravity")
    assert f.wrench_frames == ("left_tip",)
    assert f.inverse_dynamics.size_in("wrenches") == (6, 1)
    assert f.inverse_dynamics.name_in() == ["q", "v", "a", "wrenches", "parameters"]
    assert f.gaps.name_in() == ["q", "parameters"]


def test_a_copy_has_the_same_functions() -> None:
    _, f, q, *_ = state("five_bar")
    np.testing.assert_array_equal(copy.copy(f).gaps(q), f.gaps(q))


def test_a_body_without_mass_for_the_pinocchio_engine() -> None:
    m, _, q, v, a, *_ = state("five_bar")
    nothing = np.zeros(10)
    same = with_parameters(m, ["payload:left_tip"], nothing)
    assert relative(same.inverse_dynamics(q, v, a).tau, m.inverse_dynamics(q, v, a).tau) < 1e-14
    nothing[2] = 0.1
    with pytest.raises(InputError, match=r"payload:left_tip: first moment .* without mass"):
        with_parameters(m, ["payload:left_tip"], nothing)
