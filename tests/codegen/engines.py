"""The Pinocchio engine and generated code on the same states, and how far the answers differ.

Both compute in double precision, by factorisations that are stable without luck, so that answers
differ by rounding errors times the state's condition number: 1e-14 to 1e-11 here. What is promised
is 1e-10, relative to the largest number of a result (`ACCEPTED`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, RPSPinError
from rps_pin.arrays import Array
from rps_pin.codegen import CompiledMechanism
from rps_pin.codegen.build import tcc
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.proofs import common
from tests.worst import worst

#: TinyCC builds in milliseconds; where it is missing, the system's compiler has to.
QUICK = "tcc" if tcc.is_here() else "auto"
#: Results that are all smaller may be rounding errors of zero; robots here have masses, lengths and
#: speeds of about 1 SI unit.
ZERO = 1e-3


class State(NamedTuple):
    """A closed motion, actuator forces, and a guess near it."""

    q: Array
    v: Array
    a: Array
    tau: Array
    u: Array
    """Velocities of the actuated joints."""
    w: Array
    """Accelerations of the actuated joints."""
    near: Array


def states(
    mechanism: ClosedLoopModel, count: int = 3, seed: int = 0, spread: float = 0.1
) -> Iterator[State]:
    """States about home, for mechanisms whose actuated joints determine the motion."""
    rng = np.random.default_rng(seed)
    na = mechanism.actuated_indices.size
    for guess in common.guesses(mechanism, spread, count, seed):
        q = mechanism.close(guess, within_limits=False)
        u, w, tau = rng.normal(size=(3, na))
        v = mechanism.velocity(q, u)
        near = pin.integrate(mechanism.model, q, 1e-3 * rng.normal(size=mechanism.model.nv))
        yield State(q, v, mechanism.acceleration(q, v, w), tau, u, w, near)


def free_states(mechanism: ClosedLoopModel, count: int = 3, seed: int = 0) -> Iterator[State]:
    """The same for any mechanism: motions in directions that its closures allow."""
    rng = np.random.default_rng(seed)
    na, model = mechanism.actuated_indices.size, mechanism.model
    rows, columns = mechanism.row_scale, mechanism.velocity_scale
    for guess in common.guesses(mechanism, 0.1, count, seed):
        q = mechanism.close(guess, within_limits=False)
        motions = mechanism.allowed_motions(q)
        v, a = (motions @ rng.normal(size=(motions.shape[1], 2))).T
        bias = rows * mechanism.loop_errors(q, v).acceleration
        scaled = rows[:, None] * mechanism.jacobian(q) * columns
        a = a - columns * np.linalg.lstsq(scaled, bias, rcond=1e-9)[0]
        near = pin.integrate(model, q, 1e-3 * rng.normal(size=model.nv))
        u, w, tau = rng.normal(size=(3, na))
        yield State(q, v, a, tau, u, w, near)


Call = Callable[[Any, State], Any]
#: What both engines are asked, by the group of functions that is built for it.
CALLS: Mapping[str, Mapping[str, Call]] = {
    "dynamics": {
        "tau": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).tau,
        "multipliers": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).constraint_forces,
        "condition": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).condition,
        "orientation": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).orientation,
        "forward_dynamics": lambda e, s: e.forward_dynamics(s.q, s.v, s.tau),
    },
    "kinematics": {
        "loop_gap": lambda e, s: e.loop_gap(s.near),
        "jacobian": lambda e, s: e.jacobian(s.q),
        "motion_basis": lambda e, s: e.motion_basis(s.q),
        "velocity": lambda e, s: e.velocity(s.q, s.u),
        "acceleration": lambda e, s: e.acceleration(s.q, s.v, s.w),
    },
    "closing": {
        # Near the guess, but the Pinocchio engine's steps are damped: it ends elsewhere.
        "gap of close": lambda e, s: e.loop_gap(e.close(s.near, within_limits=False)),
    },
    "forces": {
        "generalised_force": lambda e, s: e.generalised_force(s.q, s.v, s.a),
        "constraint_forces": lambda e, s: e.constraint_forces(s.q, s.v, s.a, s.tau),
        "mass_matrix": lambda e, s: e.mass_matrix(s.q),
        "bias": lambda e, s: e.bias(s.q, s.v),
        "gravity_forces": lambda e, s: e.gravity_forces(s.q),
        "energy": lambda e, s: np.array(e.energy(s.q, s.v)),
    },
    "derivatives": {
        **{
            f"inverse by {name}": lambda e, s, name=name: getattr(
                e.inverse_dynamics_derivatives(s.q, s.v, s.a), name
            )
            for name in ("q", "v", "a", "position", "velocity", "acceleration")
        },
        **{
            f"forward by {name}": lambda e, s, name=name: getattr(
                e.forward_dynamics_derivatives(s.q, s.v, s.tau), name
            )
            for name in ("q", "v", "tau", "position", "velocity", "actuation")
        },
        "A": lambda e, s: e.linearize(s.q, s.v, s.tau).A,
        "B": lambda e, s: e.linearize(s.q, s.v, s.tau).B,
    },
}
ALL = tuple(CALLS)


def difference(found: Any, wanted: Any) -> float:
    """The largest difference over the largest number; NaN where shapes or NaNs differ."""
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    if found.shape != wanted.shape:
        return float("nan")
    if not found.size:
        return 0.0
    return worst(found - wanted) / max(worst(wanted), ZERO)


def check(fast: CompiledMechanism, states: Iterator[State], groups: tuple[str, ...] = ALL) -> int:
    """Compare both engines in all calls; return how many calls that were."""
    exact, count, differences = fast.mechanism, 0, {}
    for state in states:
        for group in groups:
            for name, call in CALLS[group].items():
                error = difference(call(fast, state), call(exact, state))
                differences[name] = worst(error, differences.get(name, 0.0))
                count += 1
    bad = {name: error for name, error in differences.items() if not error <= ACCEPTED}
    assert not bad, bad
    assert count
    return count


def same_outcome(fast: CompiledMechanism, call: Callable[[Any], Any]) -> bool:
    """Both engines answer the same, which is returned as True, or raise the same."""
    try:
        with np.errstate(all="ignore"):
            wanted = call(fast.mechanism)
    except RPSPinError as error:
        with pytest.raises(type(error)) as caught:
            call(fast)
        assert str(caught.value) == str(error)
        return False
    with np.errstate(all="ignore"):
        found = call(fast)
        if np.isfinite(wanted).all():
            assert difference(found, wanted) <= ACCEPTED
        else:
            np.testing.assert_array_equal(np.isfinite(found), np.isfinite(wanted))
    return True


@cache
def of_file(name: str) -> CompiledMechanism:
    """The mechanism of a file in urdf/, in generated code; one for each test process."""
    return common.loaded(name).compile(compiler=QUICK)


def answered_by_pinocchio(fast: CompiledMechanism, patch: pytest.MonkeyPatch) -> list[str]:
    """Note the functions whose samples are handed to the Pinocchio engine from now on."""
    handed: list[str] = []
    settle = type(fast)._settled

    def noting(self: CompiledMechanism, name: str, found: Any, status: Any, *rest: Any) -> Any:
        if np.any(status):
            handed.append(name)
        return settle(self, name, found, status, *rest)

    patch.setattr(type(fast), "_settled", noting)
    return handed
