"""A mechanism in generated code answers as the Pinocchio engine does: calls, batches, threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosureError, InputError, MechanismError
from rps_pin.codegen import CompiledMechanism
from rps_pin.codegen.build import compilers, tcc
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.closed_loop import mechanisms
from tests.codegen.engines import (
    ALL,
    CALLS,
    QUICK,
    Call,
    State,
    answered_by_pinocchio,
    check,
    difference,
    of_file,
    same_outcome,
    states,
)

#: The derivatives of large ones take seconds to build; their proof compares them.
LARGE = ("delta_rods", "stewart", "rotary_stewart")


@pytest.mark.parametrize(
    "name",
    [
        *("four_bar", "five_bar", "slider_crank", "rps", "delta", "delta_rods", "stewart"),
        *("linear_delta", "planar_rrr"),
        pytest.param("rotary_stewart", marks=pytest.mark.slow),
    ],
)
def test_every_mechanism_of_the_package(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And generated code answers all of it: nothing is handed to the Pinocchio engine."""
    fast = of_file(name)
    handed = answered_by_pinocchio(fast, monkeypatch)
    groups = tuple(group for group in ALL if group != "derivatives" or name not in LARGE)
    assert check(fast, states(fast.mechanism), groups) > 50
    assert not handed


def stacked(some: Iterable[State]) -> State:
    return State(*(np.array(one) for one in zip(*some, strict=True)))


def test_what_completes_is_what_pinocchio_completes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Values of the actuated joints, by order and by name, and of others."""
    fast = of_file("delta")
    exact, handed = fast.mechanism, answered_by_pinocchio(fast, monkeypatch)
    for s in states(exact):
        values = s.q[exact.actuated_indices]
        wanted = exact.complete(values, s.near)
        assert difference(fast.complete(values, s.near), wanted) <= 1e-12
        named = dict(zip(exact.actuated, values, strict=True))
        np.testing.assert_array_equal(fast.complete(named, s.near), fast.complete(values, s.near))
        assert difference(fast.complete(values), exact.complete(values)) <= 1e-12
        other = {list(exact.model.names)[2]: s.q[1]}
        assert difference(fast.complete(other, s.near), exact.complete(other, s.near)) <= 1e-12
        assert difference(fast.project(s.near), exact.project(s.near)) <= 1e-12
        fixed = [exact.actuated[0]]
        found = fast.close(s.near, fixed=fixed)
        assert difference(found, exact.close(s.near, fixed=fixed)) <= 1e-12
    assert not handed


def test_frames() -> None:
    fast = of_file("delta")
    exact = fast.mechanism
    for s in states(exact):
        for frame in ("platform", exact.closures[0].frame_a):
            found = fast.frame_placement(s.q, frame)
            assert difference(found, exact.frame_placement(s.q, frame)) <= 1e-14
            for axes in ("world", "frame"):
                found = fast.frame_jacobian(s.q, frame, axes=axes)
                wanted = exact.frame_jacobian(s.q, frame, axes=axes)
                assert difference(found, wanted) <= ACCEPTED
    for engine in (fast, exact):
        with pytest.raises(
            MechanismError, match=r"no frame 'plattform' \(did you mean platform\?\); there are: "
        ):
            engine.frame_placement(exact.home, "plattform")


def test_wrenches_and_errors_of_motions() -> None:
    fast = of_file("delta")
    exact = fast.mechanism
    some = list(states(exact))
    batch = stacked(some)
    pushed = {"platform": np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])}
    forces = fast.inverse_dynamics(batch.q, batch.v, batch.a, wrenches=pushed)
    many = [
        fast.closure_wrenches(batch.q, forces.constraint_forces),
        fast.joint_wrenches(
            batch.q, batch.v, batch.a, forces.constraint_forces, wrenches=pushed, axes="world"
        ),
        fast.loop_errors(batch.q, batch.v, batch.a)._asdict(),
        {"condition": fast.condition(batch.q)},
    ]
    for i, s in enumerate(some):
        multipliers = forces.constraint_forces[i]
        motion = (s.q, s.v, s.a)
        wanted = [
            exact.closure_wrenches(s.q, multipliers),
            exact.joint_wrenches(*motion, multipliers, wrenches=pushed, axes="world"),
            exact.loop_errors(*motion)._asdict(),
            {"condition": exact.condition(s.q)},
        ]
        for found, expected in zip(many, wanted, strict=True):
            assert list(found) == list(expected)
            for name in expected:
                assert difference(found[name][i], expected[name]) <= ACCEPTED
    alone = fast.joint_wrenches(*motion, multipliers, wrenches=pushed)
    expected = exact.joint_wrenches(*motion, multipliers, wrenches=pushed)
    assert all(difference(alone[name], expected[name]) <= ACCEPTED for name in expected)
    assert isinstance(fast.condition(s.q), float)
    same_outcome(fast, lambda e: e.loop_errors(s.q).velocity)


def test_other_independent_joints() -> None:
    """The Pinocchio engine answers."""
    fast = of_file("five_bar")
    exact = fast.mechanism
    joints = [list(exact.model.names)[2], exact.actuated[0]]
    calls: list[Call] = [
        lambda e, s: e.motion_basis(s.q, joints),
        lambda e, s: e.velocity(s.q, s.u, joints),
        lambda e, s: e.acceleration(s.q, s.v, s.w, joints),
        lambda e, s: e.mass_matrix(s.q, joints),
        lambda e, s: e.bias(s.q, s.v, joints),
        lambda e, s: e.gravity_forces(s.q, joints),
        lambda e, s: e.linearize(s.q, s.v, s.tau, joints).A,
        lambda e, s: e.frame_jacobian(s.q, exact.closures[0].frame_a, joints),
    ]
    some = list(states(exact))
    for call in calls:
        wanted = np.array([call(exact, s) for s in some])
        np.testing.assert_array_equal([call(fast, s) for s in some], wanted)
        np.testing.assert_array_equal(call(fast, stacked(some)), wanted)
        nothing = State(*(one[:0] for one in stacked(some)))
        assert call(fast, nothing).shape == (0, *wanted.shape[1:])


def test_later_changes_of_the_mechanism_do_not_count() -> None:
    """Neither in generated code nor in what the Pinocchio engine answers for it."""
    exact = mechanisms.five_bar(
        home=mechanisms.five_bar().close(mechanisms.guess(mechanisms.five_bar()))
    )
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    s = next(states(exact))
    tau, gravity = exact.inverse_dynamics(s.q, s.v, s.a).tau, exact.gravity_forces(s.q)
    joints = [list(exact.model.names)[2], exact.actuated[0]]
    others = exact.gravity_forces(s.q, joints)
    exact.model.gravity.linear = np.zeros(3)
    assert difference(fast.inverse_dynamics(s.q, s.v, s.a).tau, tau) <= ACCEPTED
    assert difference(fast.gravity_forces(s.q), gravity) <= ACCEPTED  # built now
    np.testing.assert_array_equal(fast.gravity_forces(s.q, joints), others)


# Arguments ----------------------------------------------------------------------------------------


def test_lists_and_integers_are_numbers_too() -> None:
    fast = of_file("five_bar")
    s = next(states(fast.mechanism))
    found = fast.forward_dynamics(s.q.tolist(), [0, 0, 0, 0], np.array([1, -2]))
    wanted = fast.mechanism.forward_dynamics(s.q, np.zeros(4), [1.0, -2.0])
    assert difference(found, wanted) <= ACCEPTED
    np.testing.assert_array_equal(fast.jacobian(s.q.tolist()), fast.jacobian(s.q))
    tau = fast.inverse_dynamics(s.q.tolist(), [0] * 4, (0, 0, 0, 0)).tau
    np.testing.assert_array_equal(tau, fast.inverse_dynamics(s.q, 0 * s.v, 0 * s.v).tau)
    strided = np.repeat(s.q, 2)[::2]
    np.testing.assert_array_equal(fast.jacobian(strided), fast.jacobian(s.q))


def test_results_are_new_arrays() -> None:
    fast = of_file("five_bar")
    first, second = states(fast.mechanism, 2)
    for group in ALL:
        for name, call in CALLS[group].items():
            found = call(fast, first)
            if not isinstance(found, np.ndarray):
                continue
            kept = found.copy()
            call(fast, second)
            np.testing.assert_array_equal(found, kept, err_msg=name)
            found[...] = np.nan
            np.testing.assert_array_equal(call(fast, first), kept, err_msg=name)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e49])
@pytest.mark.parametrize("argument", ["q", "v", "a", "tau"])
def test_numbers_that_are_not_finite(argument: str, value: float) -> None:
    """The same error as the Pinocchio engine's, or the same numbers."""
    fast = of_file("five_bar")
    s = next(states(fast.mechanism))
    broken = getattr(s, argument).copy()
    broken[-1] = value
    s = s._replace(**{argument: broken})
    same_outcome(fast, lambda e: e.inverse_dynamics(s.q, s.v, s.a).tau)
    same_outcome(fast, lambda e: e.forward_dynamics(s.q, s.v, s.tau))
    same_outcome(fast, lambda e: e.jacobian(s.q))
    same_outcome(fast, lambda e: e.motion_basis(s.q))
    same_outcome(fast, lambda e: e.acceleration(s.q, s.v, s.w))
    same_outcome(fast, lambda e: e.generalised_force(s.q, s.v, s.a))
    same_outcome(fast, lambda e: e.constraint_forces(s.q, s.v, s.a, s.tau))
    same_outcome(fast, lambda e: e.close(s.q))
    same_outcome(fast, lambda e: e.project(s.q))
    same_outcome(fast, lambda e: e.loop_gap(s.q))
    same_outcome(fast, lambda e: e.linearize(s.q, s.v, s.tau).A)


def test_open_configurations() -> None:
    fast = of_file("five_bar")
    s = next(states(fast.mechanism))
    s = s._replace(q=s.q + 0.01)
    for group in ("dynamics", "kinematics", "forces", "derivatives"):
        for call in CALLS[group].values():
            same_outcome(fast, lambda e, call=call: call(e, s))
    with pytest.raises(ClosureError):
        fast.inverse_dynamics(s.q, s.v, s.a)
    with pytest.raises(ClosureError):
        fast.step(s.q, s.v, s.tau, 1e-3)
    with pytest.raises(ClosureError):
        fast.simulate(s.q, duration=0.01)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda f, s: f.jacobian(s.q[1:]),
            r"q of jacobian has shape \(3,\); it must be \(..., 4\)",
        ),
        (lambda f, s: f.inverse_dynamics(s.q, s.v, s.a[None, :-1]), r"has shape \(1, 3\)"),
        (lambda f, s: f.forward_dynamics(s.q, s.v, 1.0), r"tau .* shape \(\)"),
        (lambda f, s: f.forward_dynamics(s.q, s.v, ["a", "b"]), "tau"),
        (lambda f, s: f.forward_dynamics(s.q, s.v, [1j, 0]), "tau"),
        (lambda f, s: f.jacobian(None), "q"),
        (lambda f, s: f.jacobian([[1, 2, 3, 4], [1, 2, 3]]), "q"),
        (
            lambda f, s: f.velocity([s.q] * 2, [s.u] * 3),
            r"together: q \(2, 4\), .* \(3, 2\)",
        ),
        (lambda f, s: f.jacobian(s.q, threads=0), "threads = 0"),
        (lambda f, s: f.jacobian(s.q, threads=1.5), "threads = 1.5"),
        (lambda f, s: f.project(s.q, threads="2"), "threads = '2'"),
        (lambda f, s: f.jacobian(s.q, errors="ignore"), "errors = 'ignore'"),
        (lambda f, s: f.project(s.q, errors="ignore"), "errors = 'ignore'"),
        (lambda f, s: f.inverse_dynamics(s.q, s.v, s.a, errors="ignore"), "errors = 'ignore'"),
        (lambda f, s: f.forward_dynamics(s.q, s.v, s.tau, errors=1), "errors = 1"),
        (lambda f, s: f.jacobian(s.q, parameters=[1.0]), "compiled without parameters"),
        (lambda f, s: f.frame_jacobian(s.q, "base", axes="wrold"), "axes = 'wrold'"),
        (lambda f, s: f.complete([0.1], s.q), r"values has shape \(1,\); expected \(..., 2\)"),
        (lambda f, s: f.close(s.q[1:]), "q_guess"),
        (lambda f, s: f.project(s.q[1:]), "q_guess"),
        (lambda f, s: f.step(s.q, s.v, s.tau, -1e-3), "duration = -0.001"),
        (lambda f, s: f.step(s.q, s.v, s.tau, np.nan), "duration"),
        (lambda f, s: f.step(s.q, s.v, s.tau, [1e-3, 0.0]), "duration"),
        (lambda f, s: f.simulate(s.q, duration=-1), "duration = -1"),
    ],
)
def test_bad_arguments(call: Callable[[Any, State], Any], words: str) -> None:
    fast = of_file("five_bar")
    s = next(states(fast.mechanism))
    with pytest.raises(InputError, match=words):
        call(fast, s)


# Batches and threads ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["five_bar", "rps"])
def test_a_batch_is_its_samples(name: str) -> None:
    """11 samples: a group of lanes and a remainder; numbers are the same up to rounding."""
    fast = of_file(name)
    some = list(states(fast.mechanism, 11))
    batch = stacked(some)
    for group in ALL:
        for name_, call in CALLS[group].items():
            found = call(fast, batch)
            wanted = np.array([call(fast, s) for s in some])
            if name_ == "energy":
                found = np.moveaxis(found, 0, -1)
            assert difference(found, wanted) <= 1e-11, name_
    forces = fast.inverse_dynamics(batch.q, batch.v, batch.a)
    assert forces.tau.shape == (11, len(fast.actuated))
    assert forces.unproduced is None
    assert forces.residual.shape == forces.condition.shape == forces.orientation.shape == (11,)
    placed = fast.frame_placement(batch.q, fast.closures[0].frame_a)
    assert placed.shape == (11, 4, 4)


def test_leading_dimensions_are_broadcast() -> None:
    fast = of_file("five_bar")
    some = list(states(fast.mechanism, 3))
    q, v = stacked(some).q, stacked(some).v  # (3, 4)
    tau = np.random.default_rng(1).normal(size=(2, 1, 2))
    found = fast.forward_dynamics(q, v, tau)
    assert found.shape == (2, 3, 4)
    for i, j in np.ndindex(2, 3):
        one = fast.forward_dynamics(q[j], v[j], tau[i, 0])
        assert difference(found[i, j], one) <= 1e-12
    assert fast.forward_dynamics(q[0], v[0], tau).shape == (2, 1, 4)
    assert fast.motion_basis(np.broadcast_to(q, (5, 3, 4))).shape == (5, 3, 4, 2)
    kinetic, potential = fast.energy(q[:, None], v)
    assert kinetic.shape == potential.shape == (3, 3)
    assert fast.loop_gap(q[None]).shape == (1, 3)
    nothing = np.empty((0, 4))
    assert fast.jacobian(nothing).shape == (0, 3, 4)
    assert fast.forward_dynamics(nothing, v[0], tau[0, 0]).shape == (0, 4)
    assert fast.loop_gap(nothing).shape == (0,)
    assert fast.close(nothing).shape == (0, 4)
    assert fast.project(nothing).shape == (0, 4)
    forces = fast.inverse_dynamics(np.empty((2, 0, 4)), v[0], v[0])
    assert forces.tau.shape == (2, 0, 2)
    assert forces.condition.shape == (2, 0)
    assert fast.linearize(nothing, v[0], tau[0, 0]).A.shape == (0, 4, 4)


def test_samples_without_an_answer() -> None:
    """An open one and one that is not finite, in a batch of five."""
    fast = of_file("five_bar")
    batch = stacked(states(fast.mechanism, 5))
    q, tau = batch.q.copy(), batch.tau.copy()
    q[1] += 0.01
    tau[3, 0] = np.nan
    good = np.array([0, 2, 4])
    with pytest.raises(ClosureError, match=r"sample \(1,\): ") as caught:
        fast.forward_dynamics(q, batch.v, tau)
    np.testing.assert_array_equal(caught.value.failed, [0, 1, 0, 1, 0])
    found = fast.forward_dynamics(q, batch.v, tau, errors="mask")
    assert np.isnan(found[[1, 3]]).all()
    wanted = fast.forward_dynamics(batch.q, batch.v, batch.tau)
    np.testing.assert_array_equal(found[good], wanted[good])
    forces = fast.inverse_dynamics(q, batch.v, batch.a, errors="mask")
    assert np.isnan(forces.tau[1]).all()
    assert np.isfinite(forces.tau[[0, 2, 3, 4]]).all()
    broken = np.where(np.arange(5)[:, None] == 2, np.nan, batch.q)
    forces = fast.inverse_dynamics(broken, batch.v, batch.a, errors="mask")
    np.testing.assert_array_equal(np.isnan(forces.condition), np.arange(5) == 2)
    np.testing.assert_array_equal(forces.orientation, [0] * 5)  # more rows than passive joints
    with pytest.raises(InputError, match=r"sample \(0, 3\): .*tau"):
        fast.linearize(batch.q, batch.v, tau[None])
    A = fast.linearize(batch.q, batch.v, tau, errors="mask").A
    np.testing.assert_array_equal(np.isnan(A).any(axis=(1, 2)), [0, 0, 0, 1, 0])
    # A single sample, masked too.
    assert np.isnan(fast.forward_dynamics(q[1], batch.v[1], tau[1], errors="mask")).all()
    # What the Pinocchio engine computes.
    q[1] = np.nan
    np.testing.assert_array_equal(
        np.isnan(fast.project(q, errors="mask")).any(axis=1), [0, 1, 0, 0, 0]
    )
    every = np.full((2, 4), np.nan)
    assert np.isnan(fast.forward_dynamics(every, batch.v[0], tau[0], errors="mask")).all()
    with pytest.raises(InputError, match=r"sample \(0,\): "):
        fast.project(every)
    assert fast.project(every, errors="mask").shape == (2, 4)


def test_threads_of_a_batch() -> None:
    fast = of_file("rps")
    some = list(states(fast.mechanism, 5))
    batch = stacked([some[i % 5] for i in range(101)])
    for call in (
        lambda **o: fast.forward_dynamics(batch.q, batch.v, batch.tau, **o),
        lambda **o: fast.inverse_dynamics(batch.q, batch.v, batch.a, **o).tau,
        lambda **o: fast.step(batch.q, batch.v, batch.tau, 1e-3, **o)[1],
        lambda **o: fast.mass_matrix(batch.q, **o),
    ):
        np.testing.assert_array_equal(call(threads=2), call())
        np.testing.assert_array_equal(call(threads=7), call())
    assert fast.mass_matrix(some[0].q, threads=3).shape == (3, 3)


def test_one_object_serves_any_number_of_threads() -> None:
    """Single calls, batches, and samples that the Pinocchio engine answers, all at once."""
    fast = of_file("rps")
    some = list(states(fast.mechanism, 8))
    wanted = [fast.forward_dynamics(s.q, s.v, s.tau) for s in some]
    projected = [fast.project(s.near) for s in some]

    def work(index: int) -> None:
        for k in range(60):
            i = (index + k) % 8
            s = some[i]
            np.testing.assert_array_equal(fast.forward_dynamics(s.q, s.v, s.tau), wanted[i])
            if k % 20 == 0:
                assert difference(fast.project(s.near), projected[i]) <= 1e-12
                with pytest.raises(ClosureError):
                    fast.forward_dynamics(s.near + 0.01, s.v, s.tau)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))


# Compilers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_lanes_of_other_compilers(compiler: str) -> None:
    """A whole batch in vector registers: 13 samples are one group of lanes and a remainder."""
    if not list(compilers.find(compiler)):
        pytest.skip(f"{compiler} is not here")
    exact = of_file("five_bar").mechanism
    groups = ("dynamics", "closing")
    fast = exact.compile(compiler=compiler, batches=True, functions=groups)
    assert all(compiler in words for words in fast.compilers.values())
    some = list(states(exact, 13))
    batch = stacked(some)
    for group in groups:
        for name, call in CALLS[group].items():
            wanted = np.array([call(exact, s) for s in some])
            found = call(fast, batch)
            found = np.moveaxis(found, 0, -1) if name == "energy" else found
            assert difference(found, wanted) <= ACCEPTED, name
    q = batch.q.copy()
    q[5] += 0.01
    found = fast.forward_dynamics(q, batch.v, batch.tau, errors="mask")
    np.testing.assert_array_equal(np.isnan(found).any(axis=1), np.arange(13) == 5)
    assert difference(np.delete(found, 5, 0), np.delete(call_of(fast, batch), 5, 0)) <= 1e-13


def call_of(fast: CompiledMechanism, batch: State) -> np.ndarray:
    return fast.forward_dynamics(batch.q, batch.v, batch.tau)


def test_a_better_compiler_takes_over() -> None:
    """Numbers stay the same to rounding; calls go on meanwhile."""
    if not tcc.is_here() or not list(compilers.find("auto")):
        pytest.skip("there are not two compilers")
    exact = of_file("slider_crank").mechanism
    fast = exact.compile(functions="dynamics")
    some = list(states(exact))
    before = [fast.forward_dynamics(s.q, s.v, s.tau) for s in some]
    fast.wait()
    assert fast.compilers["dynamics"] != "tcc"
    for s, one in zip(some, before, strict=True):
        assert difference(fast.forward_dynamics(s.q, s.v, s.tau), one) <= 1e-12
    large = np.repeat(stacked(some).q, 500, axis=0), some[0].v, some[0].tau
    found = fast.forward_dynamics(*large, errors="mask")
    fast.wait()  # for the code for several samples at once
    again = fast.forward_dynamics(*large, errors="mask")
    assert difference(again[np.isfinite(again)], found[np.isfinite(found)]) <= 1e-12
