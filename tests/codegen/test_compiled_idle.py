"""Idle freedoms through both engines: where generated code has no answer, the other one has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from tests.closed_loop.idle_rods import case_with_rods
from tests.closed_loop.test_freedoms import COUNT_EQUAL, slider_crank
from tests.codegen.engines import QUICK, check, states
from tests.worst import worst

MECHANISMS: dict[str, Callable[[], ClosedLoopModel]] = {
    "a slider crank": slider_crank,
    "its rod is off its line": lambda: slider_crank(0.03),
    "random rods": lambda: case_with_rods(3)[1].mechanism,
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_both_engines_give_idle_freedoms_the_same_motion(name: str) -> None:
    exact = MECHANISMS[name]()
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    assert check(fast, states(exact, 2)) > 30
    every = list(states(exact, 3))
    q, v, a = (np.array([getattr(s, name) for s in every]) for name in "qva")
    alone = np.array([exact.condition(one) for one in q])
    assert worst(fast.condition(q) / alone - 1) < 1e-12
    assert worst(fast.inverse_dynamics(q, v, a).condition / alone - 1) < 1e-12
    assert worst(fast.velocity(q, np.array([s.u for s in every])) - v) < 1e-12


def test_a_wheel_and_two_motors_on_one_freedom() -> None:
    exact = ClosedLoopModel.from_mjcf(COUNT_EQUAL)
    fast = exact.compile(compiler=QUICK, functions=["dynamics"])
    still = np.zeros(3)
    for engine in (exact, fast):
        found = engine.inverse_dynamics(exact.home, still, still)
        np.testing.assert_allclose(found.tau, [-0.981, -0.981], rtol=1e-12)
        assert found.unproduced is None
        assert found.condition == 1.0
        np.testing.assert_allclose(
            engine.velocity(exact.home, [1.0, 1.0]), [1.0, 1.0, 0.0], atol=1e-15
        )


def test_simulations_of_a_spinning_rod_are_the_same() -> None:
    """Its spin stays: nothing acts on it but the rod's own motion."""
    exact = slider_crank()
    fast = exact.compile(compiler=QUICK, functions=["simulation"])
    motions = exact.allowed_motions(exact.home)
    v = 2.0 * motions[:, 0] + 3.0 * motions[:, 1]
    ends = [e.simulate(exact.home, v, duration=0.2, step=1e-3) for e in (exact, fast)]
    assert worst(ends[0].q[-1] - ends[1].q[-1], ends[0].v[-1] - ends[1].v[-1]) < 1e-9
    energy = ends[0].energy
    assert worst(energy - energy[0]) < 1e-8
