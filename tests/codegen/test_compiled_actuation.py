"""Mechanisms with more, fewer or other actuators than motions, through both engines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, LoopClosure, MechanismError, SingularityError
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import joint, link, robot
from tests.closed_loop.test_simulation import geared_pendulums
from tests.codegen.engines import (
    ALL,
    CALLS,
    QUICK,
    check,
    difference,
    free_states,
    same_outcome,
    states,
)
from tests.proofs.test_quadruped import quadruped
from tests.proofs.test_two_arms import two_arms
from tests.worst import worst

FOUR_BAR = mechanisms.FOUR_BAR
DRIVEN: dict[str, Callable[[], ClosedLoopModel]] = {
    "a four-bar driven twice": lambda: FOUR_BAR.spherical_mechanism(
        actuated=["crank_joint", "rocker_joint"],
        home=mechanisms.closed_guess(mechanisms.spherical()),
    ),
    "a five-bar driven three times": lambda: mechanisms.five_bar(
        actuated=["left_joint", "right_joint", "left_arm_joint"]
    ),
    "a five-bar driven once": lambda: mechanisms.five_bar(actuated=["left_joint"]),
    "two arms": two_arms,
    "a quadruped": quadruped,
}
#: The derivatives of large ones take seconds to build; their proof compares them.
SMALL = list(DRIVEN)[:3]


@pytest.mark.parametrize("name", DRIVEN)
def test_actuators_that_are_not_as_many_as_motions(name: str) -> None:
    """Every call answers the same, or raises the same: those that need as many raise."""
    exact = DRIVEN[name]()
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    answered = set()
    for s in free_states(exact):
        for group in ALL:
            if group == "derivatives" and name not in SMALL:
                continue
            for key, call in CALLS[group].items():
                if same_outcome(fast, lambda e, s=s, call=call: call(e, s)):
                    answered.add(key)
        found = fast.inverse_dynamics(s.q, s.v, s.a)
        wanted = exact.inverse_dynamics(s.q, s.v, s.a)
        if wanted.unproduced is None:
            assert found.unproduced is None
        else:
            assert difference(found.unproduced, wanted.unproduced) <= ACCEPTED
        size = worst(wanted.tau, wanted.constraint_forces)
        assert worst(found.residual, wanted.residual) <= 1e-10 * size
        assert f"tau={found.tau}" in repr(found)
        assert ("unproduced" in repr(found)) == ("unproduced" in repr(wanted))
    assert {"tau", "multipliers", "forward_dynamics", "generalised_force"} <= answered
    assert not answered & {"motion_basis", "mass_matrix", "A", "inverse by q"}


def test_batches_with_and_without_a_force_that_is_not_produced() -> None:
    """At rest on its actuators a motion may be produced all the same: zero then, not None."""
    exact = DRIVEN["a five-bar driven once"]()
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    s = next(free_states(exact))
    produced = exact.forward_dynamics(s.q, s.v, [0.3])
    found = fast.inverse_dynamics(np.array([s.q, s.q]), s.v, np.array([s.a, produced]))
    wanted = exact.inverse_dynamics(s.q, s.v, s.a)
    assert difference(found.unproduced[0], wanted.unproduced) <= ACCEPTED
    np.testing.assert_array_equal(found.unproduced[1], 0.0)
    assert difference(found.tau, [wanted.tau, [0.3]]) <= ACCEPTED
    assert found.residual.shape == (2,)
    alone = fast.inverse_dynamics(s.q, s.v, produced)
    assert alone.unproduced is None
    assert exact.inverse_dynamics(s.q, s.v, produced).unproduced is None
    open_ = np.array([s.q, s.q + 0.01])
    masked = fast.inverse_dynamics(open_, s.v, s.a, errors="mask")
    assert difference(masked.unproduced[0], wanted.unproduced) <= ACCEPTED
    assert np.isnan(masked.unproduced[1]).all()


@pytest.mark.parametrize("name", ["a five-bar driven three times", "two arms"])
def test_chosen_independent_joints(name: str) -> None:
    """Those of the generated code, in its order, and others."""
    exact = DRIVEN[name]()
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    names = {exact.model.joints[i].idx_v: n for i, n in enumerate(exact.model.names) if i}
    own = [names[i] for i in fast.code.partition.independent]
    for s in free_states(exact, 2):
        for joints in (own, own[::-1]):
            u = s.v[[exact.model.joints[exact.model.getJointId(n)].idx_v for n in joints]]
            assert difference(fast.velocity(s.q, u, joints), s.v) <= ACCEPTED
            for call in (
                lambda e, s, j=joints: e.motion_basis(s.q, j),
                lambda e, s, j=joints: e.mass_matrix(s.q, j),
                lambda e, s, j=joints: e.bias(s.q, s.v, j),
                lambda e, s, j=joints: e.gravity_forces(s.q, j),
            ):
                assert difference(call(fast, s), call(exact, s)) <= ACCEPTED
    for engine in (fast, exact):
        with pytest.raises(MechanismError, match="plum"):
            engine.velocity(exact.home, [1.0], ["plum"])
        with pytest.raises(SingularityError):
            engine.motion_basis(exact.home)


def test_actuators_in_another_order_than_the_tree() -> None:
    exact = mechanisms.five_bar(actuated=["right_arm_joint", "left_joint"])
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    assert check(fast, states(exact, spread=0.05)) > 50


def structure() -> ClosedLoopModel:
    """A triangle: nothing moves, and an actuator strains it."""
    parts = [link(name, 1.0, "0.1 0 0", 0.01) for name in ("a", "b")]
    tips = [joint("fixed", name, f"{name}_tip", "0.3 0 0") for name in ("a", "b")]
    urdf = robot(
        *parts,
        link("a_tip"),
        link("b_tip"),
        joint("revolute", "base", "a"),
        joint("revolute", "base", "b", "0.3 0 0"),
        *tips,
    )
    closure = LoopClosure("a_tip", "b_tip", name="tips")
    home = [-np.pi / 3, -2 * np.pi / 3]
    return ClosedLoopModel.from_urdf(urdf, [closure], ["a_joint"], home=home)


@pytest.mark.parametrize(
    "make",
    [lambda: geared_pendulums(False), lambda: geared_pendulums(True), structure],
    ids=["a tree", "gears", "a structure"],
)
def test_without_loops_and_without_motions(make: Callable[[], ClosedLoopModel]) -> None:
    exact = make()
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    for s in free_states(exact, 2):
        for group in ALL:
            for call in CALLS[group].values():
                same_outcome(fast, lambda e, s=s, call=call: call(e, s))
    found = fast.simulate(exact.home, duration=0.1)
    wanted = exact.simulate(exact.home, duration=0.1)
    assert difference(found.q, wanted.q) <= ACCEPTED
    assert difference(found.gap, wanted.gap) <= 1e-12
    assert fast.loop_gap(found.q[:5]).shape == (5,)
