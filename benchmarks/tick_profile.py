"""Times of the parts of an interpreted computed-torque tick, each measured on its own.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.tick_profile [--json FILE]

A profiler would more than double the time of code as short as this, unevenly. So each part is
called alone in a loop, with the arguments of a tick, and the smallest of many medians is reported.
The rest of a whole tick is the calls between the parts. A generated tick has four parts: arguments,
the call, direct kinematics in it, and the rest.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.latency import GAINS, PERIOD, machine, motion
from rps_pin import RPSRobot
from rps_pin.control import ComputedTorque
from rps_pin.control.estimator.loop_arguments import three_floats
from rps_pin.control.estimator.robot_state import robot_state
from rps_pin.control.estimator.state_estimate import state_estimate
from rps_pin.rps.kinematics.tracking import follow

_CALLS, _REPEATS = 2000, 15
_HALF_WAY = 300  # of the motion's ticks


def parts() -> dict[str, Callable[[], object]]:
    """Return the calls of one tick in the middle of a motion, and the whole."""
    robot = RPSRobot.from_preset("micro")
    p, rows = robot.parameters, motion()
    g, h = p.base_radius, p.platform_radius
    controller = ComputedTorque(robot, rows[0][0], GAINS, period=PERIOD, compiled=False)
    lengths = robot.inverse_kinematics(rows[0]).length
    targets = list(zip(*rows, strict=True))
    for i in range(_HALF_WAY):
        controller.tick(lengths[i], targets[i])
    loop, reading = controller.estimate, lengths[_HALF_WAY]
    geometry, rate, speed, _ = loop.state
    d = three_floats(reading)
    assert d is not None
    turned, _, _ = follow(geometry.length, geometry.direction, d, g, h, 1e6, 20)
    wanted = (1.0, 2.0, 3.0)
    state = robot_state(geometry, rate, wanted, h)
    goal = controller._setpoints.current
    motions = itertools.cycle(
        list(
            zip(
                np.roll(lengths, -_HALF_WAY, 0),
                targets[_HALF_WAY:] + targets[:_HALF_WAY],
                strict=True,
            )
        )
    )
    errors = (1e-6, 1e-6, 1e-6)
    return {
        "numbers out of NumPy arrays (4 times)": lambda: [three_floats(reading) for _ in range(4)],
        "speed filter": lambda: loop._filter.after(d, PERIOD),
        "direct kinematics, Newton's method": lambda: follow(
            geometry.length, geometry.direction, d, g, h, 1e6, 20
        ),
        "pose, rates, twist, Jacobian": lambda: state_estimate(d, turned, speed, g, h),
        "limits, answers written": lambda: (
            loop._limits.violated(geometry),
            loop._limits.too_fast(speed),
        ),
        "target: legs, limits, singularity": lambda: controller._setpoints._allowed(
            goal.geometry.pose
        ),
        "the law": lambda: controller._pid(errors, rate, rate),
        "state completion": lambda: robot_state(geometry, rate, wanted, h),
        "inverse dynamics (Pinocchio, LU)": lambda: loop.dynamics.solve(state),
        "force limits, forces written": lambda: (
            controller._limits.within(wanted),
            controller._send(wanted),
        ),
        "whole tick": lambda: controller.tick(*next(motions)),
    }


def measured(calls: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the least of several medians of each call's time, us, taken in turn.

    The least, because a machine's other work only ever adds.
    """
    clock, times = time.perf_counter_ns, np.zeros(_CALLS)
    least = dict.fromkeys(calls, np.inf)
    for _ in range(_REPEATS):
        for name, call in calls.items():
            for i in range(_CALLS):
                begin = clock()
                call()
                times[i] = clock() - begin
            least[name] = min(least[name], 1e-3 * float(np.median(times)))
    return least


def profile() -> dict[str, float]:
    """Return the time of each part, of what they leave, and of the whole, us."""
    gc.disable()
    found = measured({"nothing": lambda: None, **parts()})
    empty = found.pop("nothing")
    found = {name: value - empty for name, value in found.items()}
    whole = found.pop("whole tick")
    return {
        **found,
        "calls between them, colder caches": whole - sum(found.values()),
        "whole tick": whole,
    }


def generated() -> dict[str, float]:
    """Return the time of a generated tick's parts, and of the whole, us."""
    robot, rows = RPSRobot.from_preset("micro"), motion()
    controller = ComputedTorque(robot, rows[0][0], GAINS, period=PERIOD, compiled=True)
    lengths = robot.inverse_kinematics(rows[0]).length
    motions = itertools.cycle(list(zip(lengths, zip(*rows, strict=True), strict=True)))
    for _ in range(_HALF_WAY):
        controller.tick(*next(motions))
    tick = controller._generated
    assert tick is not None
    gc.disable()
    found = measured(
        {
            "nothing": lambda: None,
            "call of the machine code, the same tick": lambda: tick._tick(tick._x, tick._out),
            "whole tick": lambda: controller.tick(*next(motions)),
        }
    )
    empty = found.pop("nothing")
    code, whole = (value - empty for value in found.values())
    return {
        "call of the machine code, the same tick": code,
        "arguments, status, colder caches": whole - code,
        "whole tick": whole,
    }


def main() -> None:
    """Measure all parts, generated and interpreted, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures into this file too")
    asked = parser.parse_args()
    found: dict[str, object] = {"machine": machine()}
    console = Console()
    for name, times in (("generated", generated()), ("interpreted", profile())):
        table = Table(f"part of a tick, {name}", "us", "share")
        for part, value in times.items():
            table.add_row(part, f"{value:.2f}", f"{value / times['whole tick']:.0%}")
        console.print(table)
        found[name] = times
    console.print(machine(), highlight=False)
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
