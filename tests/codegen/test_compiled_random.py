"""Random mechanisms through both engines: every kind of closure and joint, forces of every sort."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from rps_pin.codegen import CompiledMechanism
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.closed_loop.random_mechanisms import ALL_KINDS, EVERY_KIND, Case, case
from tests.codegen.engines import ALL, QUICK, Call, State, check, difference, states
from tests.quick import quick
from tests.worst import worst

#: Every joint that the package takes, the rare ones more often than elsewhere.
JOINTS = (
    *("revolute", "revolute", "prismatic", "turn", "helical", "ball", "zyx"),
    *("planar", "translation", "universal"),
)
#: Of small trees that have them all.
SEEDS = (40, 44, 51)
#: Whose derivatives, which take long to build, are not left to the slow tests: a rigid closure, a
#: distance and a polynomial coupling.
DERIVED = (1, 9, 11)
#: Functions that wrenches act on.
UNDER_WRENCHES: Mapping[str, Call] = {
    "tau": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).tau,
    "multipliers": lambda e, s: e.inverse_dynamics(s.q, s.v, s.a).constraint_forces,
    "acceleration": lambda e, s: e.forward_dynamics(s.q, s.v, s.tau),
    "force": lambda e, s: e.generalised_force(s.q, s.v, s.a),
    "constraint_forces": lambda e, s: e.constraint_forces(s.q, s.v, s.a, s.tau),
}


class Pushed:
    """An engine whose dynamics is under wrenches."""

    def __init__(self, engine: Any, wrenches: Mapping[str, Any]) -> None:
        self._engine, self._wrenches = engine, wrenches

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._engine, name)
        return lambda *given: method(*given, wrenches=self._wrenches)


def motions(c: Case) -> Iterator[State]:
    """The case's own motion, and one beside it."""
    own = next(states(c.mechanism, 1))
    taken = c.mechanism.actuated_indices
    yield own._replace(q=c.q, v=c.v, a=c.a, u=c.v[taken], w=c.a[taken], near=c.q)
    yield own


def compiled(c: Case) -> CompiledMechanism:
    """Nothing is built before it is called."""
    frames = sorted(c.wrenches)
    return c.mechanism.compile(compiler=QUICK, wrench_frames=frames, functions=["dynamics"])


def check_under_wrenches(fast: CompiledMechanism, c: Case) -> None:
    differences = []
    for wrenches in (c.wrenches, dict(list(c.wrenches.items())[:1])):  # all, and one of them
        pushed, wanted = Pushed(fast, wrenches), Pushed(c.mechanism, wrenches)
        for s in motions(c):
            differences += [difference(f(pushed, s), f(wanted, s)) for f in UNDER_WRENCHES.values()]
    assert worst(differences) <= ACCEPTED


@pytest.mark.parametrize(
    ("seed", "kind", "derivatives"),
    [(seed, kind, seed in DERIVED) for seed, kind in enumerate(EVERY_KIND)]
    + [
        pytest.param(seed, kind, True, marks=pytest.mark.slow)
        for seed, kind in enumerate(EVERY_KIND)
        if seed % 2 and seed not in DERIVED
    ],
)
def test_spatial(seed: int, kind: str, derivatives: bool) -> None:
    """With springs, friction, armature and massless links by turns."""
    options = {"effects": seed % 2 == 0, "armature": seed % 3 == 0, "massless": seed % 2 == 1}
    c = case(seed, kinds=[kind], **options)
    fast = compiled(c)
    groups = ALL if derivatives else tuple(g for g in ALL if g != "derivatives")
    assert check(fast, motions(c), groups) > 20
    check_under_wrenches(fast, c)


@pytest.mark.parametrize(
    ("seed", "kind"),
    quick(
        [(seed, kind) for seed, kind in enumerate(ALL_KINDS) if kind != "planar"],
        [(seed, ALL_KINDS[seed]) for seed in (0, 1, 2, 3, 10)],
    ),
)
def test_planar(seed: int, kind: str) -> None:
    """Most rows are redundant."""
    c = case(20 + seed, kinds=[kind], planar=True)
    fast = compiled(c)
    assert check(fast, motions(c), ("dynamics", "kinematics", "forces")) > 20


@pytest.mark.parametrize("seed", SEEDS)
def test_every_joint(seed: int) -> None:
    c = case(seed, joints=JOINTS, effects=True, armature=True)
    fast = compiled(c)
    assert check(fast, motions(c), tuple(g for g in ALL if g != "derivatives")) > 20
    check_under_wrenches(fast, c)


def test_these_mechanisms_are_of_every_sort() -> None:
    names = {
        name.rsplit("_", 1)[0]
        for seed in SEEDS
        for name in list(case(seed, joints=JOINTS).mechanism.model.names)[1:]
    }
    assert names == set(JOINTS)
    rows = [case(20 + s, kinds=[k], planar=True) for s, k in enumerate(ALL_KINDS) if s != 6]
    redundant = [
        np.linalg.matrix_rank(c.mechanism.jacobian(c.q)) < c.mechanism.constraint_size for c in rows
    ]
    assert sum(redundant) > 5


def test_moving_bodies_that_carry_both_ends_of_a_closure() -> None:
    """The rows are in that body's axes then; derivatives are the package's all the same."""
    for seed, kind in ((30, "spherical"), (31, "rigid"), (21, "rigid")):
        c = case(seed, kinds=[kind], planar=seed == 21)
        check(compiled(c), motions(c), ("derivatives",))


@pytest.mark.parametrize("seed", quick([0, 2], [0]))
def test_springs_of_balls_and_free_joints(seed: int) -> None:
    c = case(seed, effects=True, joints=("ball", "free", "revolute"))
    springs = c.mechanism.system.springs
    assert springs is not None and springs.turns and springs.shifts
    assert check(compiled(c), motions(c), ALL) > 20
