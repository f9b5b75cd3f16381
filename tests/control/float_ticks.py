"""Ticks over all float64 numbers, as many as asked: ``python -m tests.control.float_ticks``.

With ``--robots delta stewart ankle`` those of controllers of a task, by generated ticks and without
(the maps and the dynamics are generated code in both).

A run of some ticks is drawn as `test_every_float` draws it: bit patterns, special numbers, powers
of ten, and numbers near a good reading. It starts from a reset; then a good tick must give the bits
that it gave first, whatever came before. NumPy raises where it would warn.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import math
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from rps_pin import RPSRobot
from rps_pin.control import ComputedTorque, PDControl, RealTimeRobot, Status
from rps_pin.control.generated import engine
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.gains import Gains
from rps_pin.rps.dynamics.loads import Payload
from tests.control.conftest import none_built
from tests.control.tasks import start, task
from tests.worst import worst

START = (0.223, 0.02, -0.01)
ROBOT = RPSRobot(
    RPSRobot.from_preset("micro").parameters.replace(prismatic_damping=3.0, prismatic_friction=0.5),
    Payload(0.1, [0.0, 0.01, 0.02], np.diag([2e-5, 3e-5, 4e-5])),
)
LENGTH = tuple(ROBOT.inverse_kinematics(START).length.tolist())
TASKS = ("delta", "stewart", "ankle")

SPECIAL_NUMBERS = [
    *(0.0, -0.0, 5e-324, -5e-324, 2.0**-1022, 1e-162, 1e154, -1e154, 1.4e154, 1e300, -1e300),
    *(float(np.finfo(float).max), -float(np.finfo(float).max), math.inf, -math.inf, math.nan),
]
NO_JUMP = {"largest_jump": math.inf}
LAWS: dict[str, tuple[type[Controller], dict[str, Any]]] = {
    "computed torque": (ComputedTorque, {}),
    "actuator space": (ComputedTorque, {"space": "actuator", **NO_JUMP, "cut_off": math.inf}),
    "PD": (PDControl, NO_JUMP),
    "PD in task space": (PDControl, {"space": "task", "compensation": "feed_forward", **NO_JUMP}),
}
ENGINES = ("generated", "interpreted")
#: Ticks of a run, and how many runs are drawn at once.
RUN, BLOCK = 8, 500


class Subject(NamedTuple):
    """A robot whose controllers are asked."""

    robot: Any
    start: tuple[float, ...]
    length: tuple[float, ...]
    """Positions of the actuators there."""
    limit: tuple[float, ...]
    """Of the actuators' forces."""


RPS = Subject(ROBOT, START, LENGTH, (ROBOT.parameters.actuator_force_limit,) * 3)


@cache
def subject(name: str) -> Subject:
    """Return a robot of `TASKS`, in generated code."""
    one, x = task(name), start(name)
    q, actuated = one.configuration(x), one.mechanism.actuated_indices
    limit = one.mechanism.model.effortLimit[actuated]
    length = q[one.of_actuators]
    return Subject(one, tuple(x.tolist()), tuple(length.tolist()), tuple(limit.tolist()))


class Draws:
    """Random numbers of every kind, drawn in blocks."""

    def __init__(self, seed: int, of: Subject = RPS) -> None:
        self._rng, self._of = np.random.default_rng(seed), of
        self.exponents = np.zeros(2048, dtype=bool)

    def runs(self) -> Iterator[list[tuple[Any, Any, Any, float | None]]]:
        """Yield the arguments of runs of ticks without end."""
        count = len(self._of.start)
        while True:
            size = BLOCK, RUN, 5 * count + 2
            rng, kind = self._rng, self._rng.integers(0, 8, size)
            bits = rng.integers(0, 2**64, size, dtype=np.uint64, endpoint=False)
            found = bits.view(np.float64)
            with np.errstate(all="ignore"):
                powers = rng.uniform(-9, 9, size) * 10.0 ** rng.integers(-320, 308, size)
            found = np.where(kind == 0, rng.choice(SPECIAL_NUMBERS, size), found)
            found = np.where((kind == 1) | (kind == 2), powers, found)
            found = np.where(kind == 3, rng.uniform(-1, 1, size), found)
            patterns = found.view(np.uint64) >> np.uint64(52) & np.uint64(2047)
            self.exponents[patterns.astype(int).ravel()] = True
            # What follows good readings meets the law; in some runs all are.
            near = rng.random((BLOCK, RUN, 5)) < rng.choice([0.3, 0.8, 1.0], (BLOCK, 1, 1))
            left_out = rng.random((BLOCK, RUN, 4))
            shift = rng.uniform(-1e-4, 1e-4, (BLOCK, RUN, 5 * count))
            for values, close, missing, small in zip(found, near, left_out, shift, strict=True):
                rows = zip(values, close, missing, small, strict=True)
                yield [_tick(self._of, *one) for one in rows]


def _tick(
    of: Subject, values: Any, close: Any, missing: Any, small: Any
) -> tuple[Any, Any, Any, float | None]:
    """Return length, target, speed and dt: each any numbers, good ones, or left out."""
    count = len(of.start)
    rows = [values[count * k : count * (k + 1)] for k in range(5)]
    centres = (of.length, of.start, None, None, None)
    for k, centre in enumerate(centres):
        if close[k]:
            offset = small[count * k : count * (k + 1)]
            rows[k] = offset + (0.0 if centre is None else np.array(centre))
    length, pose, rate, acceleration, speed = (tuple(row.tolist()) for row in rows)
    return (
        None if missing[0] < 0.05 else length,
        None if missing[1] < 0.4 else (pose, rate, acceleration),
        None if missing[2] < 0.4 else speed,
        None if missing[3] < 0.4 else 1e-3 if missing[3] < 0.7 else float(values[5 * count]),
    )


@dataclass
class Report:
    """What a loop's ticks gave."""

    name: str
    ticks: int = 0
    generated: int = 0
    """Ticks that generated code computed."""
    statuses: Counter[str] = field(default_factory=Counter)
    largest: float = 0.0
    """Largest force over its limit."""
    faults: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def __str__(self) -> str:
        flags = ", ".join(f"{name} {count}" for name, count in sorted(self.statuses.items()))
        return (
            f"{self.name}: {self.ticks} ticks in {self.seconds:.0f} s, {self.generated} by "
            f"generated code; {flags}; largest force {self.largest:.6g} of its limit; "
            f"{len(self.faults)} faults"
        )


def ticks_of(
    controller: Controller, name: str, count: int, draws: Draws, of: Subject = RPS
) -> Report:
    """Compute ticks of a controller, in runs from a reset each."""
    report, begin = Report(name), time.perf_counter()
    flags = list(Status)
    controller.reset(of.start)
    controller.tick(of.length)
    first, code = controller.forces.tobytes(), controller._generated
    for run in draws.runs():
        if report.ticks >= count:
            break
        for number, (length, target, speed, dt) in enumerate(run):
            given = f"{length!r}, {target!r}, {speed!r}, dt={dt!r} (tick {number} of {run!r})"
            report.ticks += 1
            try:
                status = controller.tick(length, target, speed, dt=dt)
                report.generated += code is not None and code.ahead
                text = controller.status_text if report.ticks % 5 == 0 else "ok"
            except BaseException as error:
                report.faults.append(f"{name}: {error!r} of tick({given})")
                if isinstance(error, KeyboardInterrupt):
                    raise
                continue
            report.statuses.update([flag.name for flag in flags if flag in status] or ["OK"])
            share = worst(np.abs(controller.forces) / of.limit)
            report.largest = worst(report.largest, share)
            finite = all(np.isfinite(one).all() for one in controller.estimate.answers)
            if not (share <= 1.0 and finite and 0.05 <= controller.pace <= 1.0 and text):
                report.faults.append(f"{name}: forces {controller.forces} after tick({given})")
        controller.reset(of.start)
        controller.tick(of.length)
        if controller.forces.tobytes() != first:
            report.faults.append(f"{name}: other forces of a good tick after {run!r}")
        controller.reset(of.start)
    report.seconds = time.perf_counter() - begin
    return report


def estimates_of(loop: RealTimeRobot, name: str, count: int, draws: Draws) -> Report:
    """Compute estimates and forces of a `RealTimeRobot` likewise."""
    report, begin = Report(name), time.perf_counter()
    flags = list(Status)
    for run in draws.runs():
        if report.ticks >= count:
            break
        loop.reset(START)
        for length, target, speed, dt in run:
            report.ticks += 1
            try:
                status = loop.estimate(length, speed, dt=dt)
                report.generated += loop.generated is not None and loop.generated.ahead
                status |= loop.forces_for((target or (None, None, speed))[2])
                if target is not None:
                    status |= loop.inverse_dynamics(*target)
                texts = loop.status_text, loop.force_status_text
            except BaseException as error:
                report.faults.append(f"{name}: {error!r} of {(length, target, speed, dt)!r}")
                if isinstance(error, KeyboardInterrupt):
                    raise
                continue
            report.statuses.update([flag.name for flag in flags if flag in status] or ["OK"])
            if not (all(np.isfinite(one).all() for one in loop.answers) and all(texts)):
                report.faults.append(f"{name}: {loop.answers} of {(length, target, speed, dt)!r}")
    report.seconds = time.perf_counter() - begin
    return report


@contextlib.contextmanager
def _engine(name: str) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        if name == "interpreted":
            stack.enter_context(mock.patch.object(engine, "built", none_built))
        stack.enter_context(np.errstate(all="raise"))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("error")
        yield


def run(count: int, *, seed: int = 0) -> Iterator[Report]:
    """Yield reports: of each engine `count` ticks, of all laws and of the estimate, in turn."""
    for name in ENGINES:
        with _engine(name):
            draws = Draws(seed)
            share = math.ceil(count / (len(LAWS) + 1))
            for law, (kind, options) in LAWS.items():
                made = kind(ROBOT, START, Gains.placed(15.0, integral=0.2), **options)
                yield ticks_of(made, f"{name}, {law}", share, draws)
            yield estimates_of(RealTimeRobot(ROBOT, START), f"{name}, estimate", share, draws)
            assert draws.exponents.all() or count < 10_000  # every exponent that there is


def run_task(name: str, count: int, *, seed: int = 0) -> Iterator[Report]:
    """Yield reports of the controllers of a task: of each engine `count` ticks, of all laws."""
    of, share = subject(name), math.ceil(count / len(LAWS))
    for engine_name in ENGINES:
        with _engine(engine_name):
            draws = Draws(seed, of)
            for law, (kind, options) in LAWS.items():
                made = kind(of.robot, of.start, Gains.placed(15.0, integral=0.2), **options)
                if engine_name == "interpreted":
                    made._generated = made.estimate.generated = None
                yield ticks_of(made, f"{name}, {engine_name}, {law}", share, draws, of)


def main() -> int:
    """Print the reports; return 1 if there is a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=1_000_000, help="of each engine")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robots", nargs="+", choices=TASKS, help="controllers of these tasks")
    given, faults, ticks = parser.parse_args(), 0, 0
    reports = run(given.ticks, seed=given.seed)
    if given.robots:
        each = (run_task(name, given.ticks, seed=given.seed) for name in given.robots)
        reports = itertools.chain.from_iterable(each)
    for report in reports:
        print(report, flush=True)
        for fault in report.faults[:5]:
            print("   ", fault)
        faults, ticks = faults + len(report.faults), ticks + report.ticks
    print(f"{ticks} ticks, {faults} faults")
    return faults > 0


if __name__ == "__main__":
    raise SystemExit(main())
