"""Generated ticks are the interpreted ones, whatever comes; and which of them runs is said."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSRobot
from rps_pin.control import Answers, ComputedTorque, Gains, PDControl, RealTimeRobot, Status
from rps_pin.control.estimator import real_time_robot
from rps_pin.control.generated import engine, proof
from rps_pin.control.generated.tick import DYNAMICS, ESTIMATE, LAWS, tick_texts
from rps_pin.errors import CompileError
from rps_pin.rps import Payload
from tests import processes
from tests.worst import worst

Array = NDArray[np.float64]
PERIOD = 1e-3
LOOPS = [ESTIMATE, *LAWS]
TOLERANCE = 1e-10


def robots() -> list[RPSRobot]:
    plain = RPSRobot.from_preset("micro")
    p = plain.parameters.replace(
        prismatic_friction=0.3, prismatic_damping=4.0, revolute_friction=0.01
    )
    load = Payload(0.2, (0.01, -0.02, 0.03), np.diag([1e-4, 2e-4, 1e-4]))
    return [plain, RPSRobot(p, payload=load)]


def loop(name: str, robot: RPSRobot, compiled: Any, **settings: Any) -> Any:
    start, gains = [0.225, 0.0, 0.0], Gains.placed(15.0, integral=0.2)
    if name == ESTIMATE:
        return RealTimeRobot(robot, start, largest_jump=3e-4, compiled=compiled)
    law, _, rest = name.partition("_torque_" if "torque" in name else "_control_")
    settings |= {"compiled": compiled}
    if law == "computed":
        space: Any = rest
        return ComputedTorque(robot, start, gains, space=space, **settings)
    space, _, compensation = rest.partition("_")
    inertia = [1.0, 0.02, 0.02] if space == "task" else 1.0
    return PDControl(
        *(robot, start, gains.times(inertia)),
        space=space,
        compensation=compensation,  # type: ignore[arg-type]
        **settings,
    )


def as_given(rng: np.random.Generator, values: Array) -> Any:
    """Return three numbers in a form in which somebody might give them."""
    kind = rng.integers(0, 12)
    if kind == 0:
        return values.tolist()
    if kind == 1:
        return tuple(values)
    if kind == 2:
        return values.astype(np.longdouble)
    if kind == 3:
        return np.repeat(values, 2)[::2]
    return values


def nonsense(rng: np.random.Generator, values: Array) -> Any:
    spoilt = values.copy()
    spoilt[rng.integers(3)] = rng.choice([math.nan, math.inf, -math.inf, 1e300, 0.0, -0.2])
    others = [None, "abc", values[:2], values[:, None], [1j, 0, 0], object(), [[0.2]] * 3, b"abc"]
    return spoilt if rng.random() < 0.6 else others[rng.integers(len(others))]


class Motion:
    """Random arguments of ticks, along a motion."""

    def __init__(self, robot: RPSRobot, seed: int, faults: float) -> None:
        self.rng = np.random.default_rng(seed)
        self.faults, self.time = faults, 0.0
        self.legs = RPSRobot(robot.parameters.without_limits()).inverse_kinematics
        self.last = self.at(0.0)[0]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        w = 2 * np.pi * np.array([0.9, 1.3, 1.7])
        size = np.array([0.004, 0.15, 0.15]) * (1.0 if self.faults else 0.4)
        middle = np.array([0.225, 0.0, 0.0])
        return (
            middle + size * np.sin(w * t),
            size * w * np.cos(w * t),
            -size * w**2 * np.sin(w * t),
        )

    def next(self) -> tuple[Any, Any, Any, Any]:
        """Return length, target, speed and dt."""
        rng = self.rng
        dt = PERIOD * rng.uniform(0.7, 1.3) if rng.random() < 0.1 else None
        self.time += dt or PERIOD
        rows = self.at(self.time)
        exact = self.legs(rows[0]).length
        length: Any = exact + 1e-8 * rng.normal(size=3)
        target: Any = tuple(as_given(rng, row + 1e-5 * rng.normal(size=3)) for row in rows)
        speed: Any = None
        if rng.random() < 0.3:
            speed = (self.legs(self.at(self.time + 1e-6)[0]).length - exact) / 1e-6
        length = as_given(rng, length)
        fault = rng.random() / self.faults if self.faults else 1.0
        if fault < 0.3:
            length = nonsense(rng, exact)
        elif fault < 0.5:
            length = exact + rng.normal(scale=1e-3, size=3)
        elif fault < 0.7:
            parts = [*rows]
            parts[rng.integers(3)] = nonsense(rng, rows[0])
            target = rng.choice([0, 1, 2]) and (tuple(parts) if rng.random() < 0.8 else parts[:2])
        elif fault < 0.8:
            speed = nonsense(rng, exact)
        elif fault < 0.9:
            dt = [0.0, -1.0, math.nan, math.inf, "x", 0.02, -1e9][rng.integers(7)]
        if rng.random() < 0.1:
            target = None
        return length, target, speed, dt


def ticked(one: Any, length: Any, target: Any, speed: Any, dt: Any) -> int:
    if isinstance(one, RealTimeRobot):
        return int(one.estimate(length, speed, dt=dt))
    return int(one.tick(length, target, speed, dt=dt))


def arrays(one: Any) -> list[Array]:
    estimate = one if isinstance(one, RealTimeRobot) else one.estimate
    forces = [] if isinstance(one, RealTimeRobot) else [one.forces]
    return [*estimate.answers[:5], *forces]


def more(one: Any) -> list[float]:
    """Numbers that are there to be read, which generated code has to tell."""
    estimate = one if isinstance(one, RealTimeRobot) else one.estimate
    pace = [] if isinstance(one, RealTimeRobot) else [one.pace]
    return [estimate.determinant, estimate.type_ii, estimate.age, estimate.elapsed, *pace]


def compared(ours: Any, theirs: Any, motion: Motion, ticks: int) -> int:
    """Compare two loops' ticks; return how many of the first's were generated."""
    estimate = ours if isinstance(ours, RealTimeRobot) else ours.estimate
    generated = 0
    for k in range(ticks):
        arguments = motion.next()
        assert ticked(ours, *arguments) == ticked(theirs, *arguments), (k, arguments)
        generated += estimate.generated.ahead
        for found, expected in zip(arrays(ours), arrays(theirs), strict=True):
            size = max(1e-2, np.abs(expected).max())
            assert worst(found - expected) < TOLERANCE * size, (k, arguments)
        if k % 17 == 0:
            np.testing.assert_allclose(more(ours), more(theirs), rtol=1e-9, atol=1e-12)
        if k % 29 == 0:
            assert ours.status_text == theirs.status_text
        stopped = int(ours.status) & int(Status.STOPPED)
        if stopped and motion.rng.random() < 0.1:
            near = motion.at(motion.time)[0]
            ours.reset(near)
            theirs.reset(near)
    return generated


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("faults", [0.0, 0.02])
def test_ticks_are_the_interpreted_ones(name: str, faults: float) -> None:
    ticks = 250 if "pd" in name else 1000
    for seed, robot in enumerate(robots()):
        ours, theirs = loop(name, robot, True), loop(name, robot, False)
        generated = compared(ours, theirs, Motion(robot, seed, faults), ticks)
        assert generated > (0.95 if not faults else 0.1) * ticks


def test_thousands_of_ticks_at_the_limits() -> None:
    """Forces at their limits come and go; so do faults."""
    robot = RPSRobot.from_preset("micro")
    weight = np.abs(loop("computed_torque_task", robot, False).forces).max()
    settings = {"force_limit": 1.15 * float(weight)}
    ours, theirs = (
        loop("computed_torque_task", robot, compiled, **settings) for compiled in (True, False)
    )
    motion = Motion(robot, 7, 0.002)
    generated = compared(ours, theirs, motion, 3_000)
    assert 600 < generated < 2970


def test_the_state_of_a_generated_tick_is_there() -> None:
    robot = robots()[1]
    ours, theirs = (RealTimeRobot(robot, [0.223, 0, 0], compiled=c) for c in (True, False))
    motion = Motion(robot, 3, 0.0)
    for _ in range(200):
        length, _, speed, dt = motion.next()
        for one in (ours, theirs):
            one.estimate(length, speed, dt=dt)
            assert one.forces_for([0.1, 0.2, 0.3]) & ~Status.BEYOND_LIMIT == 0
        np.testing.assert_allclose(ours.answers.forces, theirs.answers.forces, rtol=1e-10)
        np.testing.assert_allclose(ours.answers.reactions, theirs.answers.reactions, atol=1e-9)
        assert ours._forces_generated
    assert ours.state.geometry.pose == pytest.approx(theirs.state.geometry.pose, rel=1e-12)


def test_inverse_dynamics_are_the_interpreted_ones() -> None:
    rng = np.random.default_rng(12)
    for robot in robots():
        ours, theirs = (RealTimeRobot(robot, [0.225, 0, 0], compiled=c) for c in (True, False))
        generated = 0
        for _ in range(2000):
            size = [0.02, 0.4, 0.4] if rng.random() < 0.8 else [0.3, 3.0, 3.0]
            x = np.array([0.225, 0.0, 0.0]) + rng.normal(size=3) * size
            motion: list[Any] = [x, rng.normal(size=3), 10 * rng.normal(size=3)]
            motion = [as_given(rng, row) for row in motion]
            if rng.random() < 0.1:
                motion[rng.integers(3)] = nonsense(rng, x)
            assert ours.inverse_dynamics(*motion) == theirs.inverse_dynamics(*motion)
            generated += ours._forces_generated
            for one in ("forces", "reactions"):
                found, expected = getattr(ours.answers, one), getattr(theirs.answers, one)
                error = worst(found - expected) / max(1.0, np.abs(expected).max())
                assert error < TOLERANCE / min(1.0, abs(theirs.force_determinant) + 1e-9), motion
            assert ours.force_determinant == pytest.approx(theirs.force_determinant, abs=1e-12)
            assert ours.force_age == theirs.force_age
            if ours.force_status:
                assert ours.force_status_text == theirs.force_status_text
        assert generated > 1000


def test_an_estimate_of_a_controller_may_be_called_on_its_own() -> None:
    robot = robots()[0]
    ours, theirs = (loop("computed_torque_task", robot, c) for c in (True, False))
    motion = Motion(robot, 5, 0.0)
    for k in range(100):
        length, target, speed, dt = motion.next()
        for one in (ours, theirs):
            if k % 5 == 2:
                one.estimate.estimate(length, speed, dt=dt)
            elif k == 51:
                one.estimate.reset(motion.at(motion.time)[0])
            else:
                one.tick(length, target, speed, dt=dt)
        np.testing.assert_allclose(ours.forces, theirs.forces, rtol=1e-10)
        np.testing.assert_allclose(ours.estimate.answers.rate, theirs.estimate.answers.rate)


def test_results_may_be_written_to_arrays_of_the_caller() -> None:
    robot, start = robots()[0], np.array([0.223, 0.0, 0.0])
    answers = Answers(*(np.zeros(size) for size in (3, 3, 6, 3, 3, 3, 9)))
    ours = RealTimeRobot(robot, start, answers=answers, compiled=True)
    length = robot.inverse_kinematics(start).length
    assert ours.estimate(length, [1e-3, 0.0, 0.0]) == Status.OK
    assert ours.generated is not None
    assert ours.generated.ahead
    np.testing.assert_allclose(answers.speed, [1e-3, 0.0, 0.0])
    spread = answers._replace(pose=np.zeros(6)[::2])
    scattered = RealTimeRobot(robot, start, answers=spread)
    assert not scattered.compiled
    assert "contiguous" in scattered.engine
    with pytest.raises(CompileError, match="contiguous"):
        RealTimeRobot(robot, start, answers=spread, compiled=True)


# Which engine runs --------------------------------------------------------------------------------


def test_the_engine_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robots()[0]
    for name in (ESTIMATE, "computed_torque_task"):
        fast, slow = loop(name, robot, "auto"), loop(name, robot, False)
        assert fast.compiled
        assert "generated code, by " in fast.engine
        assert not slow.compiled
        assert slow.engine == "interpreted, as asked for"
        with pytest.raises(InputError, match='it must be "auto", True or False'):
            loop(name, robot, "yes")
    assert loop("computed_torque_task", robot, True).estimate.compiled

    def fails(name: str, make: object) -> None:
        raise CompileError("gcc was killed\nand more", "gcc")

    monkeypatch.setattr(engine, "built", fails)
    for name in (ESTIMATE, "computed_torque_task"):
        interpreted = loop(name, robot, "auto")
        assert not interpreted.compiled
        assert interpreted.engine == "interpreted: gcc was killed"
        with pytest.raises(CompileError, match="gcc was killed"):
            loop(name, robot, True)


class Own(ComputedTorque):
    """A law of somebody's own."""

    def _law(self, *arguments: Any) -> Any:
        force = super()._law(*arguments)
        return force and tuple(0.5 * one for one in force)


def test_another_law_is_interpreted() -> None:
    own = Own(robots()[0], [0.223, 0, 0], Gains(100.0, 10.0))
    assert own.engine == "interpreted: this law has no generated code"
    theirs = ComputedTorque(robots()[0], [0.223, 0, 0], Gains(100.0, 10.0))
    length = robots()[0].inverse_kinematics([0.223, 0, 0]).length
    for one in (own, theirs):
        assert one.tick(length) == Status.OK
    np.testing.assert_allclose(own.forces, 0.5 * theirs.forces, rtol=1e-12)


def test_it_can_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "from rps_pin import RPSRobot; from rps_pin.control import RealTimeRobot\n"
        "import sys; print(RealTimeRobot(RPSRobot.from_preset('micro'), [0.22, 0, 0]).engine)\n"
        "print('casadi' in sys.modules)"
    )
    monkeypatch.setenv("RPS_PIN_COMPILE", "0")
    told = processes.run([sys.executable, "-c", code])
    assert told.stdout.splitlines() == [
        "interpreted: generated code is switched off by RPS_PIN_COMPILE=0",
        "False",
    ]


@pytest.mark.parametrize("name", [ESTIMATE, DYNAMICS, "computed_torque_task"])
def test_wrong_code_is_refused(name: str) -> None:
    from rps_pin.codegen.build import Library, Source
    from rps_pin.codegen.build.tcc import compile_library

    (text,) = tick_texts(name)
    right, wrong = "return (int)y[1];", "return (int)y[1] + 8;"

    make = {
        ESTIMATE: real_time_robot._proven_estimate,
        DYNAMICS: real_time_robot._proven_dynamics,
    }.get(name) or loop(name, robots()[0], False)._proven

    def library(words: str) -> Library:
        return compile_library(Source(f"test {name}", (f"{name}_tick",), (words,)))

    found = proof.prove(name, library(text), make)
    assert found["worst"] < TOLERANCE
    with pytest.raises(CompileError, match="the status is"):
        proof.prove(name, library(text.replace(right, wrong)), make)
    with pytest.raises(CompileError, match="it must be"):
        proof.prove(name, library(text.replace(right, "answers[0][1] *= 1.000001; " + right)), make)
    with pytest.raises(CompileError, match="at least half"):
        proof.prove(name, library(text.replace("if (y[0] != 1.0)", "")), make)
