"""One tick of the control loop against the same from the library's general functions, same run.

Run with ``make bench``. Percentiles over a million ticks: ``benchmarks/latency.py``.
"""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.bench_inverse_dynamics import plain
from benchmarks.latency import motion
from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.control import ComputedTorque, Gains, RealTimeRobot, Status
from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.rps.kinematics.forward_kinematics import EncoderTracker
from rps_pin.rps.kinematics.rates import leg_jacobians, platform_twist, pose_rate
from rps_pin.rps.singularity.measures import singularity_measures


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("micro")


@pytest.mark.benchmark(group="control, two estimates", warmup=True, min_rounds=500)
@pytest.mark.parametrize("role", ["ours", "tracker and array functions"])
def bench_estimate(benchmark: BenchmarkFixture, robot: RPSRobot, role: str) -> None:
    p = robot.parameters
    pose, rate, _ = motion()
    legs = leg_jacobians(p, pose)
    speed = np.einsum("nij,nj->ni", legs.length_jacobian, rate)
    first, second = (legs.length[0], speed[0]), (legs.length[1], speed[1])
    loop = RealTimeRobot(robot, pose[0])
    tracker = EncoderTracker(pose[0], p.base_radius, p.platform_radius)

    def ours() -> None:
        loop.estimate(*first)
        loop.estimate(*second)

    def theirs() -> None:
        for length, legs_speed in (first, second):
            found = tracker.update(length)
            twist = platform_twist(p, found, pose_rate(p, found, legs_speed).value)
            assert twist.total.size == 6
            singularity_measures(p, found)

    benchmark.extra_info["role"] = role
    benchmark(ours if role == "ours" else theirs)


@pytest.mark.benchmark(group="control, inverse dynamics, state given", warmup=True, min_rounds=2000)
@pytest.mark.parametrize("role", ["ours", "RPSRobot", "plain Pinocchio and NumPy"])
def bench_forces(benchmark: BenchmarkFixture, robot: RPSRobot, role: str) -> None:
    pose, rate, acceleration = motion()
    state = robot.state(pose[7], rate[7], acceleration[7])
    ours = ConstrainedForces(robot).solve_state
    peer = robot.inverse_dynamics if role == "RPSRobot" else plain(robot)
    found = ours(*state)
    assert found is not None
    np.testing.assert_allclose(found[9:], plain(robot)(*state), rtol=1e-10)
    benchmark.extra_info["role"] = role
    benchmark(ours if role == "ours" else peer, *state)


@pytest.mark.benchmark(group="control, inverse dynamics from a pose", warmup=True, min_rounds=500)
@pytest.mark.parametrize("role", ["ours", "RPSRobot: state, inverse_dynamics"])
def bench_forces_of_a_pose(benchmark: BenchmarkFixture, robot: RPSRobot, role: str) -> None:
    pose, rate, acceleration = motion()
    loop = RealTimeRobot(robot, pose[7])
    row = (pose[7], rate[7], acceleration[7])
    benchmark.extra_info["role"] = role
    if role == "ours":
        benchmark(loop.inverse_dynamics, *row)
    else:
        benchmark(lambda: robot.inverse_dynamics(*robot.state(*row)))


@pytest.mark.benchmark(group="control, whole tick of a task", warmup=True, min_rounds=30)
@pytest.mark.parametrize("name", ["ankle", "delta", "stewart"])
@pytest.mark.parametrize("role", ["generated code", "Pinocchio"])
def bench_task_tick(benchmark: BenchmarkFixture, name: str, role: str) -> None:
    """Computed torque of any mechanism; the same forces by both engines."""
    task = ClosedLoopModel.load(f"urdf/{name}.yaml").task
    loops = [
        ComputedTorque(task, task.home, Gains.placed(15.0), compiled=compiled)
        for compiled in (True, False)
    ]
    still = np.zeros(task.size)
    reading = task.mechanism.home[task.of_actuators]
    target = task.home + 1e-4, still, still
    for loop in loops:
        assert loop.tick(reading, target) == Status.OK
    np.testing.assert_allclose(loops[0].forces, loops[1].forces, rtol=1e-8, atol=1e-8)
    benchmark.extra_info["role"] = role
    benchmark(loops[0 if role == "generated code" else 1].tick, reading, target)
