"""Mechanisms that nothing drives, in generated code: every call answers, or says what it lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, JointCoupling
from rps_pin.codegen import CompiledMechanism
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.closed_loop.test_without_actuators import PASSIVE, passive_four_bar
from tests.codegen.engines import CALLS, QUICK, Call, difference, free_states, same_outcome
from tests.worst import worst

MASS = 1.5
INERTIA = pin.Inertia(MASS, np.array([0.03, -0.05, 0.02]), np.diag([0.02, 0.03, 0.04]))
AT = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.4, 0.5), np.array([0.2, 0.1, -0.3]))


def pendulum() -> ClosedLoopModel:
    return ClosedLoopModel.from_mjcf(PASSIVE)


def locked() -> ClosedLoopModel:
    """One hinge, and one row that holds it."""
    return ClosedLoopModel(pendulum().model, [JointCoupling("hinge", {}, offset=0.1)], [])


def body(*, tail: bool) -> ClosedLoopModel:
    """A body that floats, perhaps with another that hangs on a ball joint."""
    model = pin.Model()
    index = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(index, INERTIA, pin.SE3.Identity())
    if tail:
        index = model.addJoint(index, pin.JointModelSpherical(), AT, "ball")
        model.appendBodyToJoint(index, INERTIA, pin.SE3.Identity())
    model.addFrame(pin.Frame("hand", index, 0, AT, pin.FrameType.BODY))
    return ClosedLoopModel(model, [], [])


def held() -> ClosedLoopModel:
    free = body(tail=False)
    return free.with_closures([free.closure_at(free.home, "hand")])


def hanging() -> ClosedLoopModel:
    free = body(tail=True)
    return free.with_closures([free.closure_at(free.home, "hand", kind="spherical")])


MOBILITY: Mapping[Callable[[], ClosedLoopModel], int] = {
    pendulum: 1,
    passive_four_bar: 1,
    locked: 0,
    held: 0,
    hanging: 6,
}
OTHERS: Mapping[str, Call] = {
    "loop_errors": lambda e, s: np.concatenate(e.loop_errors(s.q, s.v, s.a)),
    "project": lambda e, s: e.project(s.near),
    "complete": lambda e, s: e.complete([], s.q),
    "complete by name": lambda e, s: e.complete({}, s.q),
    "complete from home": lambda e, s: e.complete([]),
    "jump": lambda e, s: e.complete([], s.q, jump=True),
    "frame_placement": lambda e, s: e.frame_placement(s.q, e.model.frames[1].name),
    "frame_jacobian": lambda e, s: e.frame_jacobian(s.q, e.model.frames[1].name),
    "closure_wrenches": lambda e, s: np.array(
        [*e.closure_wrenches(s.q, np.ones(e.constraint_size)).values()]
    ),
    "joint_wrenches": lambda e, s: np.array(
        [*e.joint_wrenches(s.q, s.v, s.a, np.ones(e.constraint_size)).values()]
    ),
    "under wrenches": lambda e, s: e.forward_dynamics(
        s.q, s.v, s.tau, wrenches={e.model.frames[1].name: np.arange(1.0, 7.0)}
    ),
    "simulate": lambda e, s: e.simulate(s.q, s.v, duration=0.01, step=1e-3).q[-1],
}
#: What needs actuators that determine the motion.
NEEDS_MOTORS = {"motion_basis", "velocity", "acceleration", "mass_matrix", "bias", "A", "B"}


@pytest.mark.parametrize("make", MOBILITY)
def test_every_call(make: Callable[[], ClosedLoopModel]) -> None:
    exact = make()
    fast = exact.compile(compiler=QUICK)
    assert exact.describe().mobility == MOBILITY[make]
    calls = {**OTHERS, **{name: call for group in CALLS.values() for name, call in group.items()}}
    for s in free_states(exact, count=2):
        answered = {
            name
            for name, call in calls.items()
            if same_outcome(fast, lambda e, s=s, call=call: call(e, s))
        }
        assert answered >= set(OTHERS) - {"frame_jacobian"}
        assert answered >= {"tau", "forward_dynamics", "jacobian", "gap of close", "energy"}
        assert answered >= NEEDS_MOTORS if not MOBILITY[make] else not NEEDS_MOTORS & answered


@pytest.mark.parametrize("make", MOBILITY)
def test_batches(make: Callable[[], ClosedLoopModel]) -> None:
    exact = make()
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    given = list(free_states(exact))
    q, v, a, tau, near = (np.array([getattr(s, name) for s in given]) for name in STATE)
    assert tau.shape == (len(given), 0)
    answers: dict[str, tuple[Any, Callable[[ClosedLoopModel, Any], Any]]] = {
        "forward": (fast.forward_dynamics(q, v, tau), lambda e, s: e.forward_dynamics(*s[:3])),
        "complete": (fast.complete(tau, q), lambda e, s: e.complete([], s[0])),
        "project": (fast.project(near), lambda e, s: e.project(s[4])),
        "tau": (fast.inverse_dynamics(q, v, a).tau, lambda e, s: np.zeros(0)),
    }
    for name, (found, call) in answers.items():
        for i, one in enumerate(found):
            wanted = call(exact, (q[i], v[i], tau[i], a[i], near[i]))
            assert difference(one, wanted) <= ACCEPTED, name
    assert fast.complete(tau[:0], q[:0]).shape == (0, exact.model.nq)
    assert worst(fast.loop_gap(fast.close(near))) < 1e-9


STATE = ("q", "v", "a", "tau", "near")


def test_a_body_that_is_held_hangs_on_its_closure() -> None:
    """The closure carries the weight, about the hand; nothing moves."""
    exact = held()
    fast: CompiledMechanism = exact.compile(compiler=QUICK)
    still = np.zeros(6)
    for engine in (exact, fast):
        assert worst(engine.forward_dynamics(exact.home, still, [])) < 1e-12
        found = engine.inverse_dynamics(exact.home, still, still)
        (wrench,) = engine.closure_wrenches(exact.home, found.constraint_forces).values()
        weight = MASS * 9.81 * np.array([0.0, 0.0, 1.0])
        moment = np.cross(INERTIA.lever - AT.translation, weight)
        assert worst(wrench - np.concatenate([weight, moment])) < 1e-12


def test_values_of_motors_that_there_are_not_are_refused() -> None:
    fast = pendulum().compile(compiler=QUICK)
    for engine in (fast, fast.mechanism):
        with pytest.raises(InputError, match=r"\(1,\)"):
            engine.complete([0.1], np.zeros(1))
        with pytest.raises(InputError, match=r"\(1,\)"):
            engine.forward_dynamics(np.zeros(1), np.zeros(1), [0.1])
