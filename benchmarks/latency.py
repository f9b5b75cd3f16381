"""Latency of the control loop's stages: median, p99, p99.9 and maximum; and whether memory grows.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.latency [--ticks 1000000]

One thread, one tick after the other, no waiting between them. Python's garbage collector is frozen
and switched off during the loop, as a control program would do. Each stage's time includes reading
the clock. Peers, in the same run: the inverse dynamics as Pinocchio's examples would have one write
it, and the bare Pinocchio calls without any algebra. Linux only (it reads /proc/self/statm).
"""

from __future__ import annotations

import argparse
import gc
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.bench_inverse_dynamics import plain
from rps_pin import LoopClosure, RPSRobot
from rps_pin.control import RealTimeRobot
from rps_pin.control.constrained_forces import ConstrainedForces
from rps_pin.rps.rates import leg_jacobians

Array = NDArray[np.float64]

PERIOD = 1e-3
GAIN, DAMPING = 400.0, 40.0
STATES = 1000
"""The motion is repeated after so many ticks."""


def motion() -> tuple[Array, Array, Array]:
    """Return one second of a motion through the micro robot's workspace, (STATES, 3) each."""
    w = 2 * np.pi * np.array([2.0, 3.0, 5.0])
    size = np.array([0.006, 0.06, 0.05])
    phase = w * PERIOD * np.arange(STATES)[:, None]
    pose = np.array([0.225, 0.0, 0.0]) + size * np.sin(phase)
    return pose, size * w * np.cos(phase), -size * w**2 * np.sin(phase)


def stages(robot: RPSRobot) -> dict[str, Callable[[int], object]]:
    """Return what a tick of each stage calls, by its number."""
    pose, rate, acceleration = motion()
    legs = leg_jacobians(robot.parameters, pose)
    speed = np.einsum("nij,nj->ni", legs.length_jacobian, rate)
    length = legs.length
    loop = RealTimeRobot(robot, pose[0], period=PERIOD)
    bare_loop = RealTimeRobot(robot, pose[0], period=PERIOD)
    states = [robot.state(*row) for row in zip(pose, rate, acceleration, strict=True)]
    peer = plain(robot)
    answers = loop.answers
    wanted = np.stack([pose, rate, acceleration], axis=1).tolist()

    def computed_torque(i: int) -> None:
        loop.estimate(length[i], speed[i])
        z, tilt_x, tilt_y = answers.pose.tolist()
        dz, dtilt_x, dtilt_y = answers.rate.tolist()
        (x1, x2, x3), (v1, v2, v3), (a1, a2, a3) = wanted[i]
        # x'' + Kd (x' - x_now') + Kp (x - x_now)
        command = (
            a1 + DAMPING * (v1 - dz) + GAIN * (x1 - z),
            a2 + DAMPING * (v2 - dtilt_x) + GAIN * (x2 - tilt_x),
            a3 + DAMPING * (v3 - dtilt_y) + GAIN * (x3 - tilt_y),
        )
        loop.inverse_dynamics(answers.pose, answers.rate, command)

    solve = ConstrainedForces(robot).solve_state
    return {
        "clock alone": lambda i: None,
        "estimate, speeds given": lambda i: loop.estimate(length[i], speed[i]),
        "estimate, speeds filtered": lambda i: bare_loop.estimate(length[i]),
        "inverse dynamics, state given": lambda i: solve(*states[i]),
        "inverse dynamics, from the pose": lambda i: loop.inverse_dynamics(
            pose[i], rate[i], acceleration[i]
        ),
        "computed-torque tick, whole": computed_torque,
        "peer: RPSRobot.inverse_dynamics": lambda i: robot.inverse_dynamics(*states[i]),
        "peer: plain Pinocchio and NumPy": lambda i: peer(*states[i]),
        "peer: bare Pinocchio calls": bare_calls(robot, states),
    }


def bare_calls(robot: RPSRobot, states: list[tuple[Array, Array, Array]]) -> Callable[[int], None]:
    """Return what calls rnea, joint Jacobians and constraint Jacobian, and nothing else."""
    model = robot.mechanism.model
    data = model.createData()
    constraints = pin.StdVec_RigidConstraintModel()
    scratch = pin.StdVec_RigidConstraintData()
    for closure in robot.mechanism.closures:
        assert isinstance(closure, LoopClosure)
        constraint = closure.constraint_model(model)
        constraints.append(constraint)
        scratch.append(constraint.createData())
    calls = [(c.calc, d) for c, d in zip(constraints, scratch, strict=True)]

    def call(i: int) -> None:
        q, v, a = states[i]
        pin.rnea(model, data, q, v, a)
        pin.computeJointJacobians(model, data, q)
        for calc, own in calls:
            calc(model, data, own)
        pin.getConstraintsJacobian(model, data, constraints, scratch)

    return call


def resident() -> int:
    """Return the memory that this process holds, bytes."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def measured(call: Callable[[int], object], ticks: int, times: Array) -> None:
    """Put the time of each tick in `times`, us."""
    clock = time.perf_counter_ns
    for i in range(min(ticks, 5000)):
        call(i % STATES)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        for i in range(ticks):
            begin = clock()
            call(i % STATES)
            times[i] = clock() - begin
    finally:
        gc.enable()
        gc.unfreeze()
    times[:ticks] *= 1e-3


def main() -> None:
    """Measure all stages and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=1_000_000, help="of each stage")
    ticks = parser.parse_args().ticks
    console = Console()
    table = Table(title=f"us a tick, {ticks:,} ticks a stage, garbage collector off")
    table.add_column("stage")
    for column in ("median", "p99", "p99.9", "maximum", "memory grew, kB"):
        table.add_column(column, justify="right")
    robot = RPSRobot.from_preset("micro")
    times = np.ones(ticks)  # touched now, so that it does not grow later
    for name, call in track(stages(robot).items(), console=console, transient=True):
        measured(call, min(ticks, 20_000), times)
        before = resident()
        measured(call, ticks, times)
        grown = (resident() - before) / 1024
        row = [*np.percentile(times, [50, 99, 99.9]), times.max()]
        table.add_row(name, *(f"{value:.2f}" for value in row), f"{grown:.0f}")
    console.print(table)
    load = os.getloadavg()[0]
    console.print(
        f"{platform.machine()}, {os.cpu_count()} cores, load {load:.1f}; "
        f"Python {platform.python_version()}, Pinocchio {pin.__version__}, NumPy {np.__version__}"
    )


if __name__ == "__main__":
    main()
