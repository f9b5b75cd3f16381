"""Random mechanisms: the KKT conditions, the power balance, and the way there and back, to 1e-9.

Trees of revolute, prismatic, ball, planar, universal, free and other joints; one to three loops of
all eleven kinds; spatial, and planar ones, which are overconstrained; with and without massless
links, rotors, resistances and external wrenches. Nothing of the package's dynamics serves as a
reference: forces are summed over the bodies by Newton and Euler, closures are differences of gaps.
"""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import LoopClosure
from tests.closed_loop.mechanisms import derivative
from tests.closed_loop.random_mechanisms import (
    ALL_KINDS,
    PLANAR,
    SPATIAL,
    Case,
    case,
    external_force,
    force_of_bodies,
    gap_slope,
    mechanical_energy,
    worst_error,
)
from tests.proofs import common
from tests.quick import quick

Array = NDArray[np.float64]

SORTS = [*SPATIAL, "universal", "zyx", "helical"]
#: Mechanisms of a sort, spatial and planar, that all tests here share.
POOL = 60
seeds = st.integers(0, POOL - 1)


@cache
def drawn(seed: int, planar: bool) -> Case:
    """A mechanism of the pool; of eight seeds each has another set of options."""
    how = {"massless": seed & 1, "effects": seed & 2, "armature": seed & 4}
    options = {name: bool(bit) for name, bit in how.items()}
    return case(seed, planar=planar, joints=PLANAR if planar else SORTS, **options)


everywhere = pytest.mark.parametrize("planar", [False, True], ids=["spatial", "planar"])


#: A few are built in generated code, too: of each set of options one, half of them planar.
few = pytest.mark.parametrize(
    ("planar", "seed"),
    quick(
        product((False, True), range(8)), [(seed.bit_count() % 2 == 1, seed) for seed in range(8)]
    ),
)


@everywhere
@given(seeds)
def test_kkt_conditions(planar: bool, seed: int) -> None:
    """S' tau + J' lambda = F, J v = 0 and J a + J' v = 0, J and its derivative by differences."""
    c = drawn(seed, planar)
    check_kkt_conditions(c, c.mechanism)


@few
def test_kkt_conditions_in_generated_code(planar: bool, seed: int) -> None:
    c = drawn(seed, planar)
    check_kkt_conditions(c, generated(c))


def generated(c: Case) -> Any:
    """Its mechanism in generated code."""
    return common.through("generated", c.mechanism)


def check_kkt_conditions(c: Case, engine: Any) -> None:
    mechanism, model = c.mechanism, c.mechanism.model
    found = engine.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    jacobian = gap_slope(mechanism, c.q)
    rest = force_of_bodies(c, c.v, c.a)
    size = max(np.abs(rest).max(), np.abs(found.constraint_forces).max())
    rest[mechanism.actuated_indices] -= found.tau
    rest -= jacobian.T @ found.constraint_forces
    np.testing.assert_allclose(rest, 0, rtol=0, atol=1e-9 * size)
    assert found.residual <= 1e-9 * size

    np.testing.assert_allclose(jacobian @ c.v, 0, rtol=0, atol=1e-9 * np.abs(c.v).max())
    twice = [np.abs(_gap_along(c, t)).max() for t in (2e-3, 1e-3)]
    fast = 1 + np.abs(c.v).max() ** 3 + np.abs(c.v).max() * np.abs(c.a).max()
    assert twice[1] < max(twice[0] / 6, 1e-12 * fast)  # of third order: v and a are right
    assert model.nv - np.linalg.matrix_rank(jacobian, 1e-7) == mechanism.actuated_indices.size


def _gap_along(c: Case, t: float) -> Array:
    """The gaps at time t of the free motion with v and a, no loop closed on the way."""
    q = pin.integrate(c.mechanism.model, c.q, t * c.v + t**2 / 2 * c.a)
    position: Array = c.mechanism.loop_errors(q).position
    return position


@everywhere
@given(seeds)
def test_closures_do_no_work_and_the_rest_changes_the_energy(planar: bool, seed: int) -> None:
    """Power of actuators and wrenches, less what joints dissipate, against the energy's rate.

    The rate by differences along a motion that has q, v and a at its beginning.
    """
    c = drawn(seed, planar)
    check_power(c, c.mechanism)


@few
def test_power_in_generated_code(planar: bool, seed: int) -> None:
    c = drawn(seed, planar)
    check_power(c, generated(c))


def check_power(c: Case, engine: Any) -> None:
    mechanism, model = c.mechanism, c.mechanism.model
    found = engine.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    forces = mechanism.jacobian(c.q).T @ found.constraint_forces
    size = np.abs(found.constraint_forces).max() * max(1, np.abs(c.v).max())
    assert abs(forces @ c.v) <= 1e-9 * max(1, size)

    power = found.tau @ c.v[mechanism.actuated_indices] + external_force(c) @ c.v
    if mechanism.effects is not None:
        effects = mechanism.effects
        lost = effects.damping * c.v + effects.friction * np.tanh(c.v / effects.friction_speed)
        power -= lost @ c.v

    def energy(t: float) -> Array:
        q = pin.integrate(model, c.q, t * c.v + t**2 / 2 * c.a)
        return np.array(mechanical_energy(mechanism, q, c.v + t * c.a))

    flow = np.abs(force_of_bodies(c, c.v, c.a)) @ np.abs(c.v)  # what passes back and forth
    scale = max(abs(float(energy(0.0))), flow, 1.0)
    assert power == pytest.approx(float(derivative(energy)), rel=0, abs=1e-9 * scale)


@everywhere
@given(seeds)
def test_inverse_and_forward_dynamics_undo_each_other(planar: bool, seed: int) -> None:
    c = drawn(seed, planar)
    check_there_and_back(c, c.mechanism, seed)


@few
def test_there_and_back_in_generated_code(planar: bool, seed: int) -> None:
    c = drawn(seed, planar)
    check_there_and_back(c, generated(c), seed)


def check_there_and_back(c: Case, mechanism: Any, seed: int) -> None:
    tau = mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches).tau
    there = mechanism.forward_dynamics(c.q, c.v, tau, wrenches=c.wrenches)
    assert worst_error(there, c.a) < 1e-9
    push = np.random.default_rng(seed).normal(size=tau.size)
    a = mechanism.forward_dynamics(c.q, c.v, push, wrenches=c.wrenches)
    back = mechanism.inverse_dynamics(c.q, c.v, a, wrenches=c.wrenches)
    assert worst_error(back.tau, push) < 1e-9
    errors = mechanism.loop_errors(c.q, c.v, a)
    np.testing.assert_allclose(errors.acceleration, 0, atol=1e-10 * max(1, np.abs(a).max()))


def test_these_mechanisms_are_of_every_sort() -> None:
    """The check of the checks: kinds of closures and joints, redundant rows, loops to the world."""
    kinds, sorts, facts = Counter(), Counter(), Counter()
    for seed, planar in product(range(POOL), (False, True)):
        c = drawn(seed, planar)
        model, mechanism = c.mechanism.model, c.mechanism
        kinds.update(getattr(closure, "kind", "coupling") for closure in mechanism.closures)
        sorts.update(name.rsplit("_", 1)[0] for name in list(model.names)[1:])
        rank = model.nv - mechanism.actuated_indices.size
        facts["redundant"] += mechanism.constraint_size > rank
        facts["independent"] += mechanism.constraint_size == rank
        facts["several loops"] += len(mechanism.closures) > 1
        facts["massless"] += any(inertia.mass == 0 for inertia in list(model.inertias)[1:])
        facts["mobile"] += model.nv - rank > 1
        facts["balls driven"] += any(name.startswith("ball") for name in mechanism.actuated)
        facts["to the world"] += any(
            model.frames[model.getFrameId(frame)].parentJoint == 0
            for closure in mechanism.closures
            if isinstance(closure, LoopClosure)
            for frame in (closure.frame_a, closure.frame_b)
        )
    assert min(kinds[kind] for kind in ALL_KINDS) >= 5
    assert min(sorts[sort] for sort in SORTS) >= 3
    assert min(facts[fact] for fact in facts) >= 5
    assert len(facts) == 7


def test_a_seed_is_always_the_same_mechanism() -> None:
    first, second = case(7, effects=True), case(7, effects=True)
    np.testing.assert_array_equal(first.q, second.q)
    np.testing.assert_array_equal(first.a, second.a)
    assert first.mechanism.closures == second.mechanism.closures
