"""Generated code beside singularities, and where an elimination without a choice would fail."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import lu

from rps_pin import ClosedLoopModel, RPSPinError, SingularityError
from rps_pin.arrays import Array
from rps_pin.codegen.engine.proof import ACCEPTED
from rps_pin.numerics.linear_algebra import condition_number
from tests.codegen.engines import CALLS, QUICK, State, difference, of_file, same_outcome
from tests.codegen.test_compiled_simulation import parallelogram
from tests.worst import worst

GROUPS = ("dynamics", "kinematics", "forces")


def state_at(mechanism: ClosedLoopModel, q: Array, seed: int = 0) -> State:
    """A slow motion at a closed configuration; v and a by the closures' null space."""
    rng = np.random.default_rng(seed)
    na = mechanism.actuated_indices.size
    rows, columns = mechanism.row_scale, mechanism.velocity_scale
    motions = mechanism.allowed_motions(q)
    v, a = (motions @ rng.normal(size=(motions.shape[1], 2))).T
    scaled = rows[:, None] * mechanism.jacobian(q) * columns
    bias = rows * mechanism.loop_errors(q, v).acceleration
    a = a - columns * np.linalg.lstsq(scaled, bias, rcond=1e-9)[0]
    tau = rng.normal(size=na)
    return State(q, v, a, tau, v[mechanism.actuated_indices], a[mechanism.actuated_indices], q)


# Fixed pivots that vanish -------------------------------------------------------------------------


def pivots(matrix: Array, order: Array) -> Array:
    """The pivots of an LU elimination whose rows are in a fixed order."""
    left = matrix[order]
    with np.errstate(divide="ignore", invalid="ignore"):  # one that vanishes exactly
        for k in range(len(left) - 1):
            left[k + 1 :] -= np.outer(left[k + 1 :, k] / left[k, k], left[k])
    return np.diag(left)


def walk(mechanism: ClosedLoopModel, seed: int, count: int = 60) -> Iterator[Array]:
    """Closed configurations along a curve, small steps apart."""
    rng = np.random.default_rng(seed)
    q, direction = mechanism.home, rng.normal(size=mechanism.model.nv)
    for _ in range(count):
        motions = mechanism.allowed_motions(q)
        step = motions @ (motions.T @ (direction / mechanism.velocity_scale))
        step *= 0.03 * mechanism.characteristic_length / np.linalg.norm(step)
        q = mechanism.close(pin.integrate(mechanism.model, q, step), within_limits=False)
        yield q


def test_poses_where_a_fixed_pivot_vanishes() -> None:
    """Between two regular poses a pivot of J_d changes sign; where it is zero, found by halving.

    In generated code with the rows and columns in a fixed order LU would lose all digits there.
    """
    fast = of_file("stewart")
    exact, dependent = fast.mechanism, fast.code.partition.dependent

    home = exact.system.scaled(exact.jacobian(exact.home))[:, dependent]
    order = lu(home, p_indices=True)[0]  # what pivoting chooses at home
    order = np.argsort(order)

    def values(q: Array) -> Array:
        jacobian = exact.system.scaled(exact.jacobian(q))[:, dependent]
        regular = condition_number(jacobian) < 100
        return pivots(jacobian, order) if regular else np.full(len(dependent), np.nan)

    found = 0
    for seed in range(20):
        before: tuple[Array, Array] | None = None
        for q in walk(exact, seed):
            now = values(q)
            if before is not None:
                for k in np.flatnonzero(before[1] * now < 0):
                    place = halved(exact, lambda q, k=k: values(q)[k], before[0], q)
                    if place is None:
                        continue
                    least = np.abs(values(place)[k])
                    if least > 1e-9:
                        continue
                    found += 1
                    s = state_at(exact, place)
                    jacobian = exact.system.scaled(exact.jacobian(place))[:, dependent]
                    assert condition_number(jacobian) < 1e3  # regular all the same
                    check_calls(fast, s)
            before = (q, now)
            if found >= 3:
                return
    raise AssertionError(f"{found} poses only, of a Stewart platform")


def halved(mechanism, value, one: Array, other: Array) -> Array | None:  # type: ignore[no-untyped-def]
    """Return a closed configuration between two, where a value changes its sign; None at a pole."""
    sign = np.sign(value(one))
    for _ in range(60):
        middle = pin.interpolate(mechanism.model, one, other, 0.5)
        middle = mechanism.close(middle, within_limits=False)
        if not np.isfinite(value(middle)):
            return None
        if np.sign(value(middle)) == sign:
            one = middle
        else:
            other = middle
    return one


def check_calls(fast, s: State) -> None:  # type: ignore[no-untyped-def]
    differences = {}
    for group in GROUPS:
        for name, call in CALLS[group].items():
            if name not in ("loop_gap",):
                differences[name] = difference(call(fast, s), call(fast.mechanism, s))
    assert worst(*differences.values()) <= ACCEPTED, differences


# Singular poses -----------------------------------------------------------------------------------


def towards(mechanism: ClosedLoopModel, name: str, step: float) -> Iterator[Array]:
    """Poses nearer and nearer to where a joint cannot be moved any farther: dead centre."""
    joint = mechanism.model.joints[mechanism.model.getJointId(name)].idx_q
    q = mechanism.home
    while abs(step) > 1e-13:
        guess = q.copy()
        guess[joint] += step
        try:
            q = mechanism.close(guess, fixed=[name], within_limits=False, restarts=0)
        except RPSPinError:
            step /= 2
            yield q


def driven_at_the_rocker() -> ClosedLoopModel:
    four_bar = of_file("four_bar").mechanism
    return ClosedLoopModel(
        four_bar.model, four_bar.closures, ["rocker_joint"], home=four_bar.home, name="by rocker"
    )


def test_towards_a_dead_centre() -> None:
    """Answers, until the Pinocchio engine refuses, and the same words then."""
    exact = driven_at_the_rocker()
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    outcomes, conditions = [], []
    for q in towards(exact, "rocker_joint", 0.2):
        s = state_at(exact, q)
        conditions.append(exact.condition(q))
        for group in GROUPS:
            for name, call in CALLS[group].items():
                if name not in ("condition", "orientation"):  # of rounding errors, in the end
                    outcomes.append(same_outcome(fast, lambda e, s=s, call=call: call(e, s)))
    assert conditions[0] < 100
    assert sum(1e4 < one < 1e6 for one in conditions) > 3
    assert conditions[-1] > 2e6
    assert any(outcomes)


def test_where_rows_are_lost() -> None:
    """A parallelogram that lies in a line: beside it, and there."""
    exact = parallelogram()
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    answered = []
    for angle in (-0.3, -1e-2, -1e-3, -1e-4, -1e-5, -1e-6, -1e-7, -1e-9, 0.0):
        s = state_at(exact, np.array([angle, -angle, angle]))
        kept = [n for n in CALLS["dynamics"] if n not in ("condition", "orientation")]
        for name in kept:
            call = CALLS["dynamics"][name]
            answered.append(same_outcome(fast, lambda e, s=s, call=call: call(e, s)))
    assert answered[0]
    assert not all(answered)
    # There it has two motions, of which one actuator cannot tell: refused, as next to it.
    s, beside = state_at(exact, np.zeros(3)), state_at(exact, np.array([-0.3, 0.3, -0.3]))
    for engine in (exact, fast):
        with pytest.raises(SingularityError, match=r"rank 1 .* 2 and 1 next to it"):
            engine.inverse_dynamics(s.q, s.v, s.a)
    # One sample of a batch has no answer.
    batch = np.array([[one.q, one.v, one.a] for one in (beside, s)]).swapaxes(0, 1)
    found = fast.inverse_dynamics(*batch, errors="mask")
    np.testing.assert_array_equal(np.isnan(found.tau[:, 0]), [False, True])
    assert found.unproduced is None or not found.unproduced[0].any()
    found = fast.motion_basis(batch[0], errors="mask")
    np.testing.assert_array_equal(np.isnan(found).any(axis=(1, 2)), [False, True])


def test_a_motion_that_moves_no_mass() -> None:
    """The links that move have none."""
    exact = parallelogram()
    for i in range(1, 4):
        exact.model.inertias[i] = pin.Inertia.Zero()
    exact.model.inertias[2] = pin.Inertia(1e-9, np.zeros(3), 1e-12 * np.eye(3))
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    s = state_at(exact, exact.home)
    same_outcome(fast, lambda e: e.forward_dynamics(s.q, s.v, s.tau))
