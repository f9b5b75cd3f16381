"""Simulation in generated code: the motion, energy and errors of the Pinocchio engine's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, ClosureError, InputError, LoopClosure, SingularityError
from rps_pin.arrays import Array
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.codegen.expressions.routines import BLOCK
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import joint, link, robot
from tests.codegen.engines import QUICK, answered_by_pinocchio, difference, of_file, states
from tests.each import each

ARRAYS = ("time", "q", "v", "a", "tau", "kinetic", "potential", "work")


def pushed(mechanism: ClosedLoopModel) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    q = mechanism.home
    return q, mechanism.velocity(q, 0.2 * rng.normal(size=mechanism.actuated_indices.size))


class Held:
    """A controller of springs and dampers about home, on top of the weight."""

    def __init__(self, mechanism: ClosedLoopModel) -> None:
        self.q, still = mechanism.home, np.zeros(mechanism.model.nv)
        self.weight = mechanism.inverse_dynamics(self.q, still, still).tau
        self.mass = mechanism.mass_matrix(self.q)
        self.at = mechanism.actuated_indices
        joints = list(mechanism.model.joints)[1:]
        self.coordinate = [next(j.idx_q for j in joints if j.idx_v == i) for i in self.at]
        self.calls: list[tuple[float, Array, Array]] = []

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        self.calls.append((t, q.copy(), v.copy()))
        away = q[self.coordinate] - self.q[self.coordinate]
        return np.asarray(self.weight - self.mass @ (50.0 * away + 2.0 * v[self.at]))


@pytest.mark.parametrize("name", ["four_bar", "rps", "stewart", "delta_rods"])
def test_ten_seconds_at_one_millisecond(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Swinging freely, or held; and the Pinocchio engine's first second of it."""
    fast = of_file(name)
    exact, handed = fast.mechanism, answered_by_pinocchio(fast, monkeypatch)
    q, v = pushed(exact)

    def options() -> dict[str, Any]:
        if name == "delta_rods":
            return {"tau": 0.9 * Held(exact).weight}
        return {} if name == "four_bar" else {"controller": Held(exact)}

    found = fast.simulate(q, v, duration=10.0, **options())
    assert found.gap.max() <= 1e-12
    assert len(found.time) == 10001
    wanted = exact.simulate(q, v, duration=1.0, **options())
    first = {one: getattr(found, one)[:1001] for one in ARRAYS}
    for one in ARRAYS:  # the same method: rounding errors apart, which grow as the motion does
        assert difference(first[one], getattr(wanted, one)) <= 1e-8, one
    # The integration's error, 10 times that of the first second at most in 10.
    swing = np.ptp(found.kinetic)
    error = np.abs(wanted.energy_balance).max()
    assert np.abs(found.energy_balance).max() <= 10 * error + 1e-12 * swing + 1e-12
    assert np.abs(found.energy_balance[:1001]).max() <= 1.01 * error + 1e-12 * swing + 1e-12
    assert found.limits_passed == wanted.limits_passed
    assert not handed


@pytest.mark.parametrize("record_every", [1, 3, 200])
@pytest.mark.parametrize("controlled", [False, True])
def test_recorded_rows(record_every: int, controlled: bool) -> None:
    """An odd duration, whose last step is shorter; with constraint forces."""
    fast = of_file("five_bar")
    exact = fast.mechanism
    q, v = pushed(exact)
    options: dict[str, Any] = {"duration": 0.1503, "record_every": record_every, "forces": True}
    driven = (lambda: {"controller": Held(exact)}) if controlled else (lambda: {"tau": [0.1, -0.2]})
    found = fast.simulate(q, v, **options, **driven())
    wanted = exact.simulate(q, v, **options, **driven())
    assert found.time[-1] == 0.1503
    np.testing.assert_array_equal(found.time, wanted.time)
    for one in (*ARRAYS, "constraint_forces"):
        assert difference(getattr(found, one), getattr(wanted, one)) <= 1e-9, one
    assert found.gap.max() <= 1e-12
    for one in ("q_names", "v_names", "tau_names"):
        assert getattr(found, one) == getattr(wanted, one)


def test_the_controller_is_called_once_a_step_and_at_the_end() -> None:
    fast = of_file("five_bar")
    exact = fast.mechanism
    mine, theirs = Held(exact), Held(exact)
    options = {"duration": 0.02, "step": 2e-3}
    found = fast.simulate(exact.home, controller=mine, **options)
    exact.simulate(exact.home, controller=theirs, **options)
    assert [call[0] for call in mine.calls] == [call[0] for call in theirs.calls]
    assert len(mine.calls) == 11
    np.testing.assert_array_equal([call[1] for call in mine.calls], found.q)
    np.testing.assert_array_equal([call[2] for call in mine.calls], found.v)

    def spoiling(t: float, q: Array, v: Array) -> Array:
        q[:], v[:] = np.nan, np.nan
        return np.zeros(2)

    spoiled = fast.simulate(exact.home, controller=spoiling, **options)
    np.testing.assert_array_equal(spoiled.q, fast.simulate(exact.home, **options).q)


def test_one_array_that_the_controller_returns_each_time() -> None:
    fast = of_file("five_bar")
    kept = np.zeros(2)

    def controller(t: float, q: Array, v: Array) -> Array:
        kept[:] = [t, -t]
        return kept

    found = fast.simulate(fast.mechanism.home, duration=0.01, controller=controller)
    np.testing.assert_array_equal(found.tau[:, 0], found.time)


@pytest.mark.parametrize("steps", [0, 3, 2 * BLOCK + 5])
@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt, [1.0], [np.nan, 0.0]])
def test_a_controller_that_fails(failure: Any, steps: int) -> None:
    """The rows until then are kept; errors say when."""
    fast = of_file("five_bar")
    exact = fast.mechanism

    def controller(t: float, q: Array, v: Array) -> Any:
        if t < (steps - 0.5) * 1e-3:
            return [0.1, 0.2]
        if isinstance(failure, type):
            raise failure("mine")
        return failure

    caught = []
    for engine in (fast, exact):
        kind = failure if isinstance(failure, type) else InputError
        with pytest.raises(kind) as raised:
            engine.simulate(exact.home, duration=1.0, controller=controller)
        caught.append(raised.value)
    mine, theirs = caught
    assert str(mine) == str(theirs)
    same_rows(mine.partial, theirs.partial)
    assert len(mine.partial.time) == steps


def same_rows(found: Simulation, wanted: Simulation) -> None:
    for one in ARRAYS:
        assert difference(getattr(found, one), getattr(wanted, one)) <= 1e-9, one


def test_ctrl_c_between_blocks() -> None:
    fast = of_file("five_bar")

    def interrupted(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        fast.simulate(fast.mechanism.home, duration=1.0, progress=interrupted)
    partial = caught.value.partial
    assert 500 <= len(partial.time) <= 500 + 2 * BLOCK
    assert partial.gap.max() <= 1e-12


def test_progress() -> None:
    fast = of_file("five_bar")
    home = fast.mechanism.home
    for options, most in (({}, 210), ({"controller": lambda t, q, v: [0.0, 0.0]}, 210)):
        shown: list[float] = []
        fast.simulate(home, duration=1.0, progress=shown.append, **options)
        assert shown == sorted(shown)
        assert shown[-1] == 1.0
        assert 10 < len(shown) <= most


def test_motions_that_break_off() -> None:
    """A parallelogram that comes to lie in a line, and a motion without bounds."""
    flat, start = parallelogram(), np.array([-1.0, 1.0, -1.0])
    fast = flat.compile(compiler=QUICK, functions="dynamics")
    v = flat.velocity(start, [1.0])
    errors = []
    for engine in (fast, flat):
        with pytest.raises(SingularityError, match=r"^at t = (1|0\.9) s: ") as caught:
            engine.simulate(start, v, duration=2.0, step=0.1)
        errors.append(caught.value)
    mine, theirs = errors
    assert str(mine).partition(" number is ")[0] == str(theirs).partition(" number is ")[0]
    assert abs(len(mine.partial.time) - len(theirs.partial.time)) <= 1
    fast = of_file("five_bar")
    exact = fast.mechanism
    errors = []
    for engine in (fast, exact):
        with pytest.raises((SingularityError, ClosureError), match=r"^at t = 0\.\d+ s: ") as caught:
            engine.simulate(
                *pushed(exact),
                duration=1.0,
                step=0.01,
                controller=lambda t, q, v: 20 * v[exact.actuated_indices],
            )
        errors.append(caught.value)
    mine, theirs = errors  # which of the errors, rounding errors decide
    assert min(len(mine.partial.time), len(theirs.partial.time)) > 8
    assert np.isfinite(mine.partial.energy).all()
    # Both close the loops by least-norm steps; what these leave, the gap's square, differently.
    assert difference(mine.partial.q[:5], theirs.partial.q[:5]) <= 1e-8


def parallelogram() -> ClosedLoopModel:
    urdf = robot(
        link("left", 1.0, "0.1 0 0", 0.01),
        link("top", 1.0, "0.2 0 0", 0.01),
        link("right", 1.0, "0.1 0 0", 0.01),
        link("top_tip"),
        link("right_tip"),
        joint("revolute", "base", "left"),
        joint("revolute", "left", "top", "0.2 0 0"),
        joint("revolute", "base", "right", "0.4 0 0"),
        joint("fixed", "top", "top_tip", "0.4 0 0"),
        joint("fixed", "right", "right_tip", "0.2 0 0"),
    )
    closure = LoopClosure("top_tip", "right_tip", name="tips")
    home = np.array([-1.0, 1.0, -1.0])
    options = {"gravity": (0, 0, 0), "home": home}
    return ClosedLoopModel.from_urdf(urdf, [closure], ["left_joint"], **options)


def test_wrenches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constant ones in generated code; functions of time by the Pinocchio engine."""
    fast = of_file("five_bar")
    exact, handed = fast.mechanism, answered_by_pinocchio(fast, monkeypatch)
    q, v = pushed(exact)
    frame = exact.closures[0].frame_a
    constant = {frame: np.array([1.0, -2.0, 3.0, 0.1, 0.2, 0.3])}
    options = {"duration": 0.15, "forces": True}
    found = fast.simulate(q, v, wrenches=constant, **options)
    wanted = exact.simulate(q, v, wrenches=constant, **options)
    same_rows(found, wanted)
    assert difference(found.constraint_forces, wanted.constraint_forces) <= 1e-9
    assert not handed
    for wrenches in (lambda t, q, v: {frame: constant[frame] * np.sin(9 * t)}, {}, None):
        found = fast.simulate(q, v, wrenches=wrenches, **options)
        same_rows(found, exact.simulate(q, v, wrenches=wrenches, **options))


@pytest.mark.parametrize(
    "options",
    [
        {"method": "adaptive"},
        {"closing": "baumgarte"},
        {"closing": "baumgarte", "baumgarte_gain": 5.0},
        {"method": "adaptive", "tolerance": 1e-9},
        {"tolerance": 1e-9},
    ],
    ids=str,
)
def test_what_the_pinocchio_engine_does(options: dict[str, Any]) -> None:
    fast = of_file("five_bar")
    q, v = pushed(fast.mechanism)
    found = fast.simulate(q, v, duration=0.05, **options)
    np.testing.assert_array_equal(
        found.q, fast.mechanism.simulate(q, v, duration=0.05, **options).q
    )


@each(
    "options",
    [
        {"duration": 0.0},
        {"duration": np.nan},
        {"duration": 1.0, "step": 0.0},
        {"duration": 1.0, "record_every": 0},
        {"duration": 1.0, "method": "euler"},
        {"duration": 1.0, "closing": "no"},
        {"duration": 1.0, "tolerance": -1.0},
        {"duration": 1.0, "tau": [1.0]},
        {"duration": 1.0, "tau": [1.0, 2.0], "controller": lambda t, q, v: [0.0, 0.0]},
        {"duration": 1.0, "wrenches": {"nowhere": np.zeros(6)}},
        {"duration": 1.0, "wrenches": {"left_tip": np.zeros(5)}},
        {"duration": 1.0, "v": np.ones(4)},
        {"duration": 1.0, "q": np.ones(3)},
        {"duration": 1.0, "typo": 3},
    ],
)
def test_bad_options(options: dict[str, Any]) -> None:
    """The errors of the Pinocchio engine."""
    rough = mechanisms.five_bar()
    exact = mechanisms.five_bar(home=rough.close(mechanisms.guess(rough)))
    fast = exact.compile(compiler=QUICK, functions="dynamics")
    given = {"q": exact.home} | options
    with pytest.raises((InputError, ClosureError, TypeError, ValueError, RuntimeError)) as wanted:
        exact.simulate(**given)
    with pytest.raises(type(wanted.value)) as found:
        fast.simulate(**given)
    if "wrenches" not in options:
        assert str(found.value) == str(wanted.value)


# Single steps -------------------------------------------------------------------------------------


def test_single_steps_are_those_of_a_stepper() -> None:
    fast = of_file("rps")
    for s in states(fast.mechanism):
        stepper = Stepper(fast.mechanism, s.q, s.v)
        stepper.advance(s.tau, 1e-3)
        q, v = fast.step(s.q, s.v, s.tau, 1e-3)
        assert difference(q, stepper.q) <= 1e-12
        assert difference(v, stepper.v) <= 1e-12
        assert fast.loop_gap(q) <= 1e-12


def test_a_batch_of_steps() -> None:
    """Each of its own length."""
    fast = of_file("five_bar")
    some = list(states(fast.mechanism, 5))
    lengths = np.array([1e-4, 1e-3, 2e-3, 5e-4, 1e-3])
    q, v = fast.step(*(np.array([getattr(s, n) for s in some]) for n in ("q", "v", "tau")), lengths)
    for i, s in enumerate(some):
        one = fast.step(s.q, s.v, s.tau, lengths[i])
        assert difference(q[i], one[0]) <= 1e-12
        assert difference(v[i], one[1]) <= 1e-12
    open_ = np.array([some[0].q, some[0].q + 0.01])
    q, v = fast.step(open_, some[0].v, some[0].tau, 1e-3, errors="mask")
    np.testing.assert_array_equal(np.isnan(q).any(axis=1), [False, True])
    np.testing.assert_array_equal(np.isnan(v).any(axis=1), [False, True])


def test_too_long_a_step() -> None:
    fast = of_file("five_bar")
    s = next(states(fast.mechanism))
    with pytest.raises((ClosureError, SingularityError)) as found:
        fast.step(s.q, 1e3 * s.v, s.tau, 1.0)
    stepper = Stepper(fast.mechanism, s.q, 1e3 * s.v)
    with pytest.raises(type(found.value)) as wanted:
        stepper.advance(s.tau, 1.0)
    assert str(found.value) == str(wanted.value)
