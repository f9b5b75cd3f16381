"""Ticks of computed torque of tasks beside the 3-RPS, and beside the same law written by hand.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.task_ticks

One run, one core, measured in turns; medians of the processor's time of a tick along a motion, us.
By hand is the law in the actuators' positions with Pinocchio's C++ functions and NumPy: Newton's
method from the last configuration, least squares for speeds and accelerations, and rnea. Its
forces are those of the package to 1e-7 before anything is measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.latency import STATES, motion
from benchmarks.task_peers import ByHand, Pinocchio, gap_and_rows
from benchmarks.timing import medians
from rps_pin import ClosedLoopModel, RPSRobot, Task
from rps_pin.control import ComputedTorque, Gains, Status

Array = NDArray[np.float64]

URDF = Path(__file__).parent.parent / "urdf"
NAMES = ("ankle", "delta", "stewart")
TICKS, PERIOD, GAINS = 200, 1e-3, Gains(400.0, 40.0)
FUNCTIONS = ("kinematics", "closing", "dynamics")


class HandTick(ByHand):
    """Computed torque of the actuators."""

    def __init__(self, task: Task) -> None:
        super().__init__(task, Pinocchio)
        self.task, self.q, self.model = task, task.mechanism.home, task.mechanism.model
        self.data, frame = self.model.createData(), self.model.getFrameId
        self.passive = np.setdiff1d(np.arange(self.model.nv), self.driven)
        self.ends = [
            (frame(one.frame_a), frame(one.frame_b), one.distance)
            for one in task.mechanism.closures
        ]

    def __call__(self, position: Array, speed: Array, goal: tuple[Array, Array, Array]) -> Array:
        model, data, active, passive = self.model, self.data, self.driven, self.passive
        q, step = self.q.copy(), np.zeros(model.nv)
        q[self.of_actuators] = position
        while True:
            gaps, rows = self.closures(q)
            gap, J = np.concatenate(gaps), np.vstack(rows)
            if np.abs(gap).max() < 1e-12:
                break
            step[passive] = np.linalg.lstsq(J[:, passive], -gap, rcond=None)[0]
            q = pin.integrate(model, q, step)
        self.q = q
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[active] = speed
        v[passive] = np.linalg.lstsq(J[:, passive], -J[:, active] @ speed, rcond=None)[0]
        a[active] = goal[2]
        for gains, wanted, found in zip(GAINS.rows[:2], goal, (position, speed), strict=False):
            a[active] += gains[0] * (wanted - found)
        right = -J[:, active] @ a[active] - self.drift(q, v)
        a[passive] = np.linalg.lstsq(J[:, passive], right, rcond=None)[0]
        force = pin.rnea(model, data, q, v, a)  # with the rotors' inertia
        force += self.task.mechanism.effects.damping * v if self.task.mechanism.effects else 0.0
        multipliers = np.linalg.lstsq(J[:, passive].T, force[passive], rcond=None)[0]
        return force[active] - J[:, active].T @ multipliers

    def closures(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Gaps and rows of the closures at q, by Pinocchio's frames."""
        model, data, axes = self.model, self.data, pin.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        gaps, rows = [], []
        for a, b, distance in self.ends:
            e = data.oMf[a].translation - data.oMf[b].translation
            J = pin.getFrameJacobian(model, data, a, axes)[:3]
            J = J - pin.getFrameJacobian(model, data, b, axes)[:3]
            gap, row = gap_and_rows(e, J, distance)
            gaps.append(gap)
            rows.append(row)
        return gaps, rows

    def drift(self, q: Array, v: Array) -> Array:
        """The closures' acceleration where no joint accelerates."""
        model, data, axes = self.model, self.data, pin.LOCAL_WORLD_ALIGNED
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        found: list[Any] = []
        for a, b, distance in self.ends:
            of = pin.getFrameClassicalAcceleration
            drift = of(model, data, a, axes).linear - of(model, data, b, axes).linear
            if distance is not None:
                e = data.oMf[a].translation - data.oMf[b].translation
                speed = pin.getFrameVelocity(model, data, a, axes).linear
                speed = speed - pin.getFrameVelocity(model, data, b, axes).linear
                length = np.linalg.norm(e)
                along = e @ speed / length
                drift = np.array([(e @ drift + speed @ speed - along**2) / length])
            found.append(drift)
        return np.concatenate(found)


def swing(task: Task) -> tuple[list[tuple[Array, ...]], Array, Array, list[tuple[Array, ...]]]:
    """Return targets, positions, speeds and the actuators' targets along a motion about home."""
    t = PERIOD * np.arange(TICKS)[:, None]
    w = 2 * np.pi * np.linspace(1.0, 3.0, task.size)
    size = 0.02 * task.characteristic_length / task.scale
    x, rate, acceleration = (
        task.home + size * np.sin(w * t),
        size * w * np.cos(w * t),
        -size * w * w * np.sin(w * t),
    )
    q = task.follow(x)
    states = [task.motion(*row) for row in zip(q, rate, acceleration, strict=True)]
    actuated = task.mechanism.actuated_indices
    positions = q[:, task.of_actuators]
    speeds = np.array([state.v[actuated] for state in states])
    rows = zip(positions, speeds, (state.a[actuated] for state in states), strict=True)
    return list(zip(x, rate, acceleration, strict=True)), positions, speeds, list(rows)


def row(name: str) -> list[str]:
    """Return a row of the table."""
    task = ClosedLoopModel.load(URDF / f"{name}.yaml").task
    code = task.compile(functions=FUNCTIONS)
    targets, positions, speeds, goals = swing(task)
    start = targets[0][0]

    def made(robot: Task, **options: Any) -> ComputedTorque:
        return ComputedTorque(robot, start, GAINS, **options)

    hand, checked = HandTick(task), made(code, space="actuator", force_limit=1e9)
    for k in range(TICKS):
        ahead = min(k + 3, TICKS - 1)  # so that there are errors to feed back
        status = checked.tick(positions[k], targets[ahead], speeds[k])
        assert status & ~Status.BEYOND_LIMIT == Status.OK
        found = hand(positions[k], speeds[k], goals[ahead])
        np.testing.assert_allclose(found, checked.forces, rtol=1e-7, atol=1e-7)
    fast, legs, slow = (
        made(code, force_limit=1e9),
        made(code, space="actuator", force_limit=1e9),
        made(code, force_limit=1e9),
    )
    slow._generated = slow.estimate.generated = None  # generated functions, interpreted ticks
    times = medians(
        {
            "task": over(lambda k: fast.tick(positions[k], targets[k], speeds[k])),
            "legs": over(lambda k: legs.tick(positions[k], targets[k], speeds[k])),
            "slow": over(lambda k: slow.tick(positions[k], targets[k], speeds[k])),
            "hand": over(lambda k: hand(positions[k], speeds[k], goals[k])),
        }
    )
    us = {key: one / TICKS for key, one in times.items()}
    cells = [f"{us[key]:.3g}" for key in ("task", "legs", "slow", "hand")]
    return [name, *cells, f"{us['hand'] / us['legs']:.0f}"]


def over(call: Callable[[int], Any], order: Sequence[int] | None = None) -> Callable[[], None]:
    """Return what calls ticks in order; left out, of half of the motion there and back."""
    half = range(TICKS // 2)
    numbers = [*half, *half[::-1]] if order is None else order

    def all_ticks() -> None:
        for k in numbers:
            call(k)

    return all_ticks


def of_rps() -> list[str]:
    """Return the row of the 3-RPS, in closed form."""
    robot, rows = RPSRobot.from_preset("micro"), motion()
    lengths, targets = robot.inverse_kinematics(rows[0]).length, list(zip(*rows, strict=True))
    pair = [ComputedTorque(robot, rows[0][0], GAINS, space=s) for s in ("task", "actuator")]
    slow = ComputedTorque(robot, rows[0][0], GAINS, compiled=False)
    times = medians(
        {
            str(k): over(lambda i, one=one: one.tick(lengths[i], targets[i]), range(STATES))
            for k, one in enumerate((*pair, slow))
        }
    )
    cells = [f"{times[str(k)] / STATES:.3g}" for k in range(3)]
    return ["3-RPS, closed forms", *cells, "(latency)", ""]


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args()
    head = ["computed torque, us a tick", "task", "actuators", "interpreted, task"]
    head += ["by hand, actuators", "hand / ours"]
    print("| " + " | ".join(head) + " |")
    print("|:-" + "|-:" * (len(head) - 1) + "|")
    for cells in (of_rps(), *map(row, NAMES)):
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
