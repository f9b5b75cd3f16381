"""Generated code against its peers: one run, with what was asked and what was found.

    python -m benchmarks.generated_code_table [--markdown] [--json FILE] [--only NAME ...]

Every time is a median of processor times, the engines measured in turns on one core; the call from
Python is included. Mechanisms: `generated_cases`, `legged`. Peers: `generated_peers`, `mujoco_twin`
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.generated_cases import LOOPS, MECHANISMS, Case, case, chain_case
from benchmarks.generated_goals import (
    BATCH,
    CHAIN_BATCH,
    DIRECT,
    Figures,
    goals_table,
    table,
)
from benchmarks.generated_peers import forward_peers, inverse_peers, relative
from benchmarks.mujoco_twin import MujocoTwin
from benchmarks.timing import medians
from rps_pin import RPSRobot
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.codegen.expressions.routines import BLOCK
from rps_pin.errors import RPSPinError

Array = NDArray[np.float64]

OURS, TODAY = "generated", "Pinocchio engine"
INSIDE, CALLS = "inside C", 4
"""Columns: `ClosedLoopModel.compile()`, and the same call of `ClosedLoopModel`."""
STEPS, STEP = 1000, 1e-3
SAMPLES, CHAIN_SAMPLES = 100_000, 1000
PLANAR = (0, 2)
"""Rows of world axes that plain Pinocchio keeps of a closure in the plane x, z."""


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", action="store_true", help="print the tables alone")
    parser.add_argument("--only", nargs="*", help="names of mechanisms, or 'chains'")
    parser.add_argument("--json", type=Path, help="write the tables, by name, to a file too")
    options = parser.parse_args()
    before = machine()
    found = tables(measured(options.only)) | {"machine": f"{before} before, {machine()} after."}
    if options.json:
        options.json.write_text(json.dumps(found), "utf-8")
    for name, text in found.items():
        if name != "machine" or not options.markdown:
            print(f"\n### {name}\n\n{text}")


def machine() -> str:
    """Return the machine's load."""
    return f"load {os.getloadavg()[0]:.2f} of {os.cpu_count()} cores"


def tables(figures: Figures) -> dict[str, str]:
    """Return the table of goals, and one of each kind of figure."""
    return {"goals": goals_table(figures), **{name: table(figures, name) for name in figures}}


def measured(only: list[str] | None = None) -> Figures:
    """Measure everything: figures by kind, mechanism and engine."""
    figures = Figures()
    for one, axes in cases(only):
        print(one.name, file=sys.stderr, flush=True)
        seconds, fast = built(one)
        more, in_lanes = built(one, functions=["dynamics"], batches=True)
        seconds |= {"inverse and forward dynamics, for batches too": more[OURS]}
        figures.add("build (s)", one.name, seconds)
        add_single_calls(figures, one, fast, axes)
        if "four-bar" in one.name:
            add_batch(figures, one, in_lanes, CHAIN_SAMPLES)
            continue
        add_derivatives(figures, one, fast)
        add_steps(figures, one, fast)
        add_batch(figures, one, in_lanes, SAMPLES)
    if not only or "3-RPS" in only:
        add_direct_kinematics(figures)
    return figures


def cases(only: list[str] | None) -> Iterator[tuple[Case, tuple[int, ...]]]:
    """Make each mechanism; with the rows that plain Pinocchio needs of its closures."""
    for name in MECHANISMS:
        if not only or name in only:
            yield case(name), PLANAR if name == "five-bar" else (0, 1, 2)
    for loops in LOOPS:
        if not only or "chains" in only:
            yield chain_case(loops), PLANAR


def built(one: Case, **options: Any) -> tuple[dict[str, float], Any]:
    """Build a mechanism's code with gcc in an empty cache; return how long that takes, s.

    On the wall, and the processor's time of all processes.
    """
    with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ, RPS_PIN_CACHE=folder):
        began, spent = time.perf_counter(), processor_time()
        fast = one.mechanism.compile(compiler="gcc", **options)
        times = {OURS: time.perf_counter() - began, "processor time": processor_time() - spent}
        return times, fast


def processor_time() -> float:
    """Return the processor's time of this process and of those it waited for, s."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


# Single calls -------------------------------------------------------------------------------------


def add_single_calls(figures: Figures, one: Case, fast: Any, axes: tuple[int, ...]) -> None:
    """Measure inverse and forward dynamics at one state."""
    exact, q, v, a, tau = one.mechanism, one.q, one.v, one.a, one.tau
    same(fast.inverse_dynamics(q, v, a).tau, tau)
    calls: dict[str, Callable[[], object]] = {
        OURS: lambda: fast.inverse_dynamics(q, v, a),
        TODAY: lambda: exact.inverse_dynamics(q, v, a),
        **inverse_peers(one, axes),
    }
    figures.add("inverse dynamics (us)", one.name, medians(calls))
    found = fast.forward_dynamics(q, v, tau)
    same(found, a)
    peers, differences = forward_peers(one, axes)
    calls = {
        OURS: lambda: fast.forward_dynamics(q, v, tau),
        TODAY: lambda: exact.forward_dynamics(q, v, tau),
        **peers,
    }
    figures.add("forward dynamics (us)", one.name, medians(calls))
    differences = {OURS: relative(found, a), **differences}
    figures.add("relative difference of accelerations", one.name, differences)


def same(found: Array, expected: Array) -> None:
    """Refuse to measure what is wrong."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


def add_derivatives(figures: Figures, one: Case, fast: Any) -> None:
    """Measure the derivatives of inverse and forward dynamics, where both engines have them."""
    exact, q, v, a, tau = one.mechanism, one.q, one.v, one.a, one.tau
    names = [one.independent] if one.floating else []
    both: dict[str, Callable[[Any], Any]] = {
        "inverse": lambda engine: engine.inverse_dynamics_derivatives(q, v, a),
        "forward": lambda engine: engine.forward_dynamics_derivatives(q, v, tau, *names),
    }
    for which, call in both.items():
        try:
            expected = call(exact)
        except RPSPinError:  # the actuators do not determine the motion
            continue
        for mine, theirs in zip(call(fast), expected, strict=True):
            same(mine, theirs)
        calls = {OURS: lambda: call(fast), TODAY: lambda: call(exact)}  # noqa: B023
        figures.add(f"derivatives of {which} dynamics (us)", one.name, medians(calls))


# Steps --------------------------------------------------------------------------------------------


def add_steps(figures: Figures, one: Case, fast: Any) -> None:
    """Measure steps of 1 ms along the same motion, and the largest gap on it."""
    engines = stepped(one, fast)
    gaps = {name: largest_gap(make) for name, make in engines.items()}
    figures.add("largest gap in 1000 steps (m)", one.name, gaps)
    times = step_times(engines, one, fast)
    inside = times.pop(INSIDE)
    figures.add("step of 1 ms (us)", one.name, times)
    peers = {name: time for name, time in times.items() if name not in (OURS, TODAY)}
    figures.add("step of 1 ms, 64 in a call (us)", one.name, {OURS: inside, **peers})


Motion = tuple[Callable[[], None], Callable[[], float]]
"""Functions that take a step, and that return the gap now."""


def stepped(one: Case, fast: Any) -> dict[str, Callable[[], Motion]]:
    """Return functions that start the case's simulation in each engine."""
    q, v, tau = one.start()

    def generated() -> Motion:
        at, rate = q, v

        def step() -> None:
            nonlocal at, rate
            at, rate = fast.step(at, rate, tau, STEP)

        return step, lambda: one.mechanism.loop_gap(at)

    def today() -> Motion:
        stepper = Stepper(one.mechanism, q, v)
        return lambda: stepper.advance(tau, STEP), lambda: one.mechanism.loop_gap(stepper.q)

    def mujoco_of(integrator: str, stiff: bool) -> Motion:
        twin = MujocoTwin(one.mechanism, stiff=stiff, integrator=integrator, step=STEP)
        twin.put(q, v, tau)
        model, data = twin.model, twin.data
        return lambda: mujoco.mj_step(model, data), twin.gap

    engines: dict[str, Callable[[], Motion]] = {OURS: generated, TODAY: today}
    for integrator in ("Euler", "RK4"):
        engines[f"mj_step {integrator}"] = lambda i=integrator: mujoco_of(i, False)
        engines[f"mj_step {integrator}, stiffest"] = lambda i=integrator: mujoco_of(i, True)
    return engines


def largest_gap(make: Callable[[], Motion]) -> float:
    """Return the largest gap after any step, m."""
    step, gap = make()
    gaps = []
    for _ in range(STEPS):
        step()
        gaps.append(gap())
    return float(np.max(gaps))


def step_times(engines: dict[str, Callable[[], Motion]], one: Case, fast: Any) -> dict[str, float]:
    """Return the median time of a step in us: of each engine in turn, and inside one call of C."""
    times: dict[str, list[float]] = {name: [] for name in (*engines, INSIDE)}
    for _ in range(2):
        steps = {name: make()[0] for name, make in engines.items()}
        q, v, tau = one.start()
        for _ in range(STEPS // BLOCK):
            for name, step in steps.items():
                began = time.process_time()
                for _ in range(BLOCK):
                    step()
                times[name].append((time.process_time() - began) / BLOCK)
            began = time.process_time()
            for _ in range(CALLS):  # about as long as the others take
                qs, vs = fast.steps(q, v, tau, STEP, BLOCK)
            times[INSIDE].append((time.process_time() - began) / (CALLS * BLOCK))
            q, v = qs[-1], vs[-1]
    return {name: 1e6 * float(np.median(found)) for name, found in times.items()}


# Batches ------------------------------------------------------------------------------------------


def add_batch(figures: Figures, one: Case, fast: Any, count: int) -> None:
    """Measure inverse and forward dynamics of many states on one thread."""
    states = one.states(50, 0.02, np.random.default_rng(2))
    q, v, a, tau = (
        np.ascontiguousarray(np.tile(part, (count // len(states), 1)))
        for part in map(np.array, zip(*states, strict=True))
    )
    one_by_one = [one.mechanism.inverse_dynamics(*state[:3]).tau for state in states]
    same(fast.inverse_dynamics(q, v, a, threads=1).tau[: len(states)], np.array(one_by_one))
    same(fast.forward_dynamics(q, v, tau, threads=1)[: len(states)], a[: len(states)])
    calls = {
        "inverse dynamics": lambda: fast.inverse_dynamics(q, v, a, threads=1),
        "forward dynamics": lambda: fast.forward_dynamics(q, v, tau, threads=1),
    }
    times = {name: time / count for name, time in medians(calls, rounds=9).items()}
    figures.add(BATCH if count == SAMPLES else CHAIN_BATCH, one.name, times)


def add_direct_kinematics(figures: Figures) -> None:
    """Measure the direct kinematics of 10^5 poses of the 3-RPS, followed from one pose.

    The lengths of bench_forward_kinematics; and poses of the larger robot, farther from the one
    that they are followed from.
    """
    rng = np.random.default_rng(3)
    far = np.array([0.4, 0.0, 0.0]) + rng.uniform(-1, 1, (SAMPLES, 3)) * [0.02, 0.1, 0.1]
    with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ, RPS_PIN_CACHE=folder):
        micro, sokolov = (RPSRobot.from_preset(name) for name in ("micro", "sokolov"))
        cases = {
            "3-RPS": (micro, rng.uniform(0.2, 0.25, (SAMPLES, 3)), [0.22, 0.0, 0.0]),
            "3-RPS, far": (sokolov, sokolov.inverse_kinematics(far).length, [0.4, 0.0, 0.0]),
        }
        times: dict[str, dict[str, float]] = {case: {} for case in cases}
        found: dict[str, Array] = {}
        for name in ("NumPy", OURS):
            for case, (robot, lengths, near) in cases.items():
                if name == OURS:
                    robot.compile(compiler="gcc")
                assert (robot.engine == "Python") == (name != OURS), robot.engine
                poses = robot.forward_kinematics(lengths, near)
                same(poses, found.setdefault(case, poses))
                call = {name: lambda r=robot, d=lengths, x=near: r.forward_kinematics(d, x)}
                times[case][name] = medians(call, rounds=9)[name] / SAMPLES
    for case, engines in times.items():
        figures.add(DIRECT, case, {OURS: engines[OURS], "NumPy": engines["NumPy"]})


if __name__ == "__main__":
    main()
