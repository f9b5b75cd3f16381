"""Generated code of mechanisms whose files hold rounded numbers.

It is proven against the Pinocchio engine at its build. Here it is compared with the exact file,
from which it may differ by the size of the rounding, and with conservation of energy.
"""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.codegen.engine.proof import ACCEPTED, Proof
from rps_pin.errors import CompileError
from tests.closed_loop.test_rounded_files import FIVE_BAR, KINDS, four_bar
from tests.codegen.engines import QUICK
from tests.quick import quick
from tests.worst import worst

pytestmark = pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")

QUARTER = repr(np.pi / 2)


def five_bar(turn: str) -> ClosedLoopModel:
    return ClosedLoopModel.from_mjcf(FIVE_BAR.format(turn=turn))


@pytest.mark.parametrize("turn", ["1.5708", "1.571"])
def test_five_bar_answers_as_the_exact_one(turn: str) -> None:
    rounded, exact = five_bar(turn), five_bar(QUARTER)
    fast, size = rounded.compile(compiler=QUICK), 30 * abs(float(turn) - np.pi / 2)
    rng = np.random.default_rng(0)
    for _ in range(5):
        start = exact.home + 0.2 * rng.normal(size=4)
        q = exact.close(start)
        closed = fast.close(start)
        assert fast.loop_gap(closed) < size
        drive = rounded.complete(q[exact.actuated_indices], q)
        # The engines leave out rows in ways that differ by the square of the rounding.
        found = fast.complete(q[exact.actuated_indices], q)
        assert worst(found - drive) < 1e-9 + (float(turn) - np.pi / 2) ** 2
        assert worst(drive - q) < size
        rates, tau = rng.normal(size=(2, 2))
        v = exact.velocity(q, rates)
        assert worst(fast.velocity(drive, rates) - v) < size
        a = exact.forward_dynamics(q, v, tau)
        found = fast.forward_dynamics(drive, fast.velocity(drive, rates), tau)
        assert worst(found - a) < size * max(1.0, worst(a))
        forces = fast.inverse_dynamics(drive, fast.velocity(drive, rates), found)
        assert worst(forces.tau - tau) < 1e-9
        assert forces.unproduced is None


@pytest.mark.parametrize("kind", quick(KINDS, ["revolute"]))
def test_energy_of_a_rounded_four_bar_is_kept(kind: str) -> None:
    mechanism = four_bar(kind, "1.5708")
    fast = mechanism.compile(compiler=QUICK, functions=["simulation", "forces", "closing"])
    q = fast.complete([0.9], [0.6, -0.4, 1.5])
    v = fast.velocity(q, [2.0])
    run = fast.simulate(q, v, duration=0.5)
    energy = np.sum(fast.energy(run.q[::50], run.v[::50]), axis=0)
    assert worst(energy - energy[0]) < 1e-6 * worst(energy)
    assert np.ptp(run.q[:, 0]) > 0.3
    slow = mechanism.simulate(q, v, duration=0.5)
    assert worst(run.q[-1] - slow.q[-1]) < 1e-6


def test_the_proof_refuses_more_than_the_square_of_the_rounding() -> None:
    """Of what is not a multiplier; that of an exact file is 1e-10."""
    rounded, exact = five_bar("1.5708"), five_bar(QUARTER)
    functions = rounded.compile(compiler=QUICK, functions=["dynamics"]).code
    right = Proof(rounded, functions.partition.independent, (), (), True)
    wrong = Proof(exact, functions.partition.independent, (), (), True)
    name = "forward_dynamics"
    assert right.compare(name, functions[name]) <= right.limit(name, right.samples[0]) < 1e-8
    assert wrong.limit("jacobian", wrong.samples[0]) == ACCEPTED
    with pytest.raises(CompileError, match="does not agree with the Pinocchio engine"):
        wrong.compare(name, functions[name])


def test_every_call_with_parameters() -> None:
    rounded = five_bar("1.5708")
    fast = rounded.compile(
        compiler=QUICK, parameters=["gravity", "mass:knee_a"], functions=["dynamics"]
    )
    q, v = rounded.home, np.zeros(4)
    values = fast.parameter_values({"gravity": [0.0, 0.0, 0.0]})
    assert worst(fast.forward_dynamics(q, v, [0.0, 0.0], parameters=values)) < 1e-9
