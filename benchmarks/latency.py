"""Latency of the control loop's stages, median, p99, p99.9 and maximum, and growth of memory.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.latency [--ticks 1000000] [--json FILE]

One thread, tick after tick without waiting. Python's garbage collector is frozen and off during the
loop, as with `LoopClock`. Each stage's time includes reading the clock.
Stages that generated code computes are measured interpreted too.

The machine's own delays (interrupts, other programs, the host) are measured by sums that are always
the same and take about as long as a tick. Compare the other tails with that one, and with p99.9 of
the quietest tenth of the run.

Interpreted stages and peers run a tenth of the ticks. Peers are the same law written with Pinocchio
and NumPy, with a quadratic program built in each tick, and with MuJoCo. Their forces must agree to
1e-8 N before anything is measured. Linux only (it reads /proc/self/statm).
"""

from __future__ import annotations

import argparse
import gc
import json
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
from benchmarks.tick_peers import MujocoTick, PlainTick, QPTick
from rps_pin import LoopClosure, RPSRobot
from rps_pin.control import ComputedTorque, Gains, RealTimeRobot, Status
from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.control.estimator.effective_inertia import TaskSpaceInertia
from rps_pin.control.estimator.leg_geometry import leg_geometry
from rps_pin.control.estimator.leg_jacobian import leg_jacobian
from rps_pin.control.estimator.robot_state import robot_state
from rps_pin.control.loop.force_limits import ForceLimits
from rps_pin.rps.kinematics.rates import leg_jacobians

Array = NDArray[np.float64]

PERIOD = 1e-3
GAINS = Gains(400.0, 40.0)
STATES = 1000
"""The motion is repeated after so many ticks."""
SAME_WORK, MORE_WORK = range(300), range(5000)
"""To add these takes about as long as a whole tick, generated or interpreted."""
GENERATED = "whole tick, computed torque"
"""The stage that is compared with `SAME_SUM`."""
SAME_SUM = "the same sum each tick: the machine's tail"


def motion() -> tuple[Array, Array, Array]:
    """Return one second of a motion through the micro robot's workspace, (STATES, 3) each."""
    w = 2 * np.pi * np.array([2.0, 3.0, 5.0])
    size = np.array([0.004, 0.05, 0.04])
    phase = w * PERIOD * np.arange(STATES)[:, None]
    pose = np.array([0.225, 0.0, 0.0]) + size * np.sin(phase)
    return pose, size * w * np.cos(phase), -size * w**2 * np.sin(phase)


def stages(robot: RPSRobot) -> dict[str, Callable[[int], object]]:
    """Return what a tick of each stage calls, by its number."""
    rows = motion()
    pose, rate = rows[:2]
    p = robot.parameters
    legs = leg_jacobians(p, pose)
    speed = np.einsum("nij,nj->ni", legs.length_jacobian, rate)
    length, targets = legs.length, list(zip(*rows, strict=True))
    loop, slow = (RealTimeRobot(robot, pose[0], period=PERIOD, compiled=c) for c in (True, False))
    states = [robot.state(*row) for row in targets]
    triples = [tuple(tuple(one.tolist()) for one in row) for row in targets]
    poses = [leg_geometry(row[0], p.base_radius, p.platform_radius) for row in triples]
    solve, peer = ConstrainedForces(robot).solve_state, plain(robot)

    def controller(compiled: bool, force_limit: float | None = None, **settings: str):
        settings |= {"force_limit": force_limit, "compiled": compiled}
        return ComputedTorque(robot, pose[0], GAINS, **settings)

    def tick(one: ComputedTorque) -> Callable[[int], object]:
        return lambda i: one.tick(length[i], targets[i])

    # Of the weak one the weight alone takes more.
    by_pose, by_legs, weak = {"space": "task"}, {"space": "actuator"}, {"force_limit": 4.0}
    return {
        "clock alone": lambda i: None,
        SAME_SUM: lambda i: sum(SAME_WORK),
        "a longer sum": lambda i: sum(MORE_WORK),
        "direct kinematics: estimate": lambda i: loop.estimate(length[i]),
        "direct kinematics: estimate, interpreted": lambda i: slow.estimate(length[i]),
        "inverse dynamics, from a pose": lambda i: loop.inverse_dynamics(*targets[i]),
        "inverse dynamics, from a pose, interpreted": lambda i: slow.inverse_dynamics(*targets[i]),
        "estimate, and forces of an acceleration": lambda i: (
            loop.estimate(length[i]),
            loop.forces_for(targets[i][2]),
        ),
        "state completion, interpreted": lambda i: robot_state(
            poses[i], *triples[i][1:], p.platform_radius
        ),
        "inverse dynamics, state given, interpreted": lambda i: solve(*states[i]),
        "QP: force limits, interpreted": limited(robot, poses),
        GENERATED: tick(controller(True, **by_pose)),
        f"{GENERATED}, interpreted": tick(controller(False, **by_pose)),
        "the same in actuator space": tick(controller(True, **by_legs)),
        "the same in actuator space, interpreted": tick(controller(False, **by_legs)),
        "the same, always saturated, interpreted": tick(controller(True, **weak)),
        "peer, dynamics: plain Pinocchio": lambda i: peer(*states[i]),
        "peer, dynamics: bare Pinocchio calls": bare_calls(robot, states),
        **whole_peers(robot, length, speed, states, targets),
    }


def limited(robot: RPSRobot, poses: list) -> Callable[[int], object]:
    """Return what limits forces that are half as much again as the actuators allow."""
    reduced, limits = TaskSpaceInertia(robot), ForceLimits((4.0, 4.0, 4.0))
    h = robot.parameters.platform_radius
    cases = [(reduced.of(one), leg_jacobian(one, h)) for one in poses]
    path = (0.01, 0.1, 0.1)
    return lambda i: limits.nearest((6.0, -3.0 + 0.006 * i, 1.0), *cases[i], path)


def whole_peers(
    robot: RPSRobot, length: Array, speed: Array, states: list, targets: list
) -> dict[str, Callable[[int], object]]:
    """Return the peers' whole ticks, having shown that they are ours."""
    rows = [
        (q[[1, 3, 5]], v[[1, 3, 5]], a[[1, 3, 5]])  # the legs' target, from the pose's
        for q, v, a in states
    ]
    kp, kd = float(GAINS.rows[0][0]), float(GAINS.rows[1][0])
    ours = ComputedTorque(robot, targets[0][0], GAINS, space="actuator")
    peers = {
        "peer, whole tick: plain Pinocchio": PlainTick(robot, targets[0][0], kp, kd),
        "peer, whole tick: QP at each tick": QPTick(robot, targets[0][0], kp, kd),
        "peer, whole tick: MuJoCo": MujocoTick(robot, targets[0][0], kp, kd),
    }
    for i in range(STATES):
        ahead = (i + 3) % STATES  # so that there are errors to feed back
        assert ours.tick(length[i], targets[ahead], speed[i]) & ~Status.BEYOND_LIMIT == Status.OK
        for peer in peers.values():
            found = peer(length[i], speed[i], rows[ahead])
            np.testing.assert_allclose(found, ours.forces, rtol=0, atol=1e-8)
    return {
        name: lambda i, call=call: call(length[i], speed[i], rows[i])
        for name, call in peers.items()
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


def measure_all(ticks: int, console: Console) -> dict[str, dict[str, float]]:
    """Return each stage's percentiles, us, and the memory by which the process grew, kB."""
    times = np.ones(ticks)  # touched now, so that it does not grow later
    robot, found = RPSRobot.from_preset("micro"), {}
    for name, call in track(stages(robot).items(), console=console, transient=True):
        count = max(ticks // 10, 1) if "peer" in name or "interpreted" in name else ticks
        measured(call, min(count, 20_000), times)
        before = resident()
        measured(call, count, times)
        grew = resident() - before
        median, p99, p999 = np.percentile(times[:count], [50, 99, 99.9]).tolist()
        tenths = [np.percentile(part, 99.9) for part in np.array_split(times[:count], 10)]
        found[name] = {
            "ticks": count,
            "median": median,
            "p99": p99,
            "p99.9": p999,
            "quiet": float(min(tenths)),
            "maximum": float(times[:count].max()),
            "grew_kB": grew / 1024,
        }
    return found


def engine() -> str:
    """Return what computes generated ticks."""
    return RealTimeRobot(RPSRobot.from_preset("micro"), [0.225, 0.0, 0.0]).engine


def machine() -> str:
    """Return where this was measured."""
    return (
        f"{engine()}; {platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; "
        f"Python {platform.python_version()}, Pinocchio {pin.__version__}, NumPy {np.__version__}"
    )


def main() -> None:
    """Measure all stages and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=1_000_000, help="of each stage")
    parser.add_argument("--json", type=Path, help="write the figures into this file too")
    asked = parser.parse_args()
    console = Console(width=110)  # for the table, in a pipe too
    found = measure_all(asked.ticks, console)
    table = Table(
        "stage", title=f"us a tick, {asked.ticks:,} ticks a stage, a tenth interpreted or of peers"
    )
    for column in ("median", "p99", "p99.9", "quietest tenth", "maximum", "grew, kB"):
        table.add_column(column, justify="right")
    for name, row in found.items():
        figures = [row[key] for key in ("median", "p99", "p99.9", "quiet", "maximum")]
        table.add_row(name, *(f"{value:.2f}" for value in figures), f"{row['grew_kB']:.0f}")
    console.print(table)
    console.print(machine(), highlight=False)
    if asked.json:
        asked.json.write_text(json.dumps({"machine": machine(), "stages": found}, indent=2) + "\n")


if __name__ == "__main__":
    main()
