"""A minimal control loop: a 3-RPS tracks a trajectory at 1 kHz in real time.

    OPENBLAS_NUM_THREADS=1 python examples/control_loop.py --duration 3

The platform's tilt describes a circle once per second. The robot is simulated and differs from
the controller's model: its masses are 20 % larger, its encoders have a resolution of 50 nm and
noise, and forces are delayed by one tick. Prints the tracking errors, the controller's status
and the clock's report.

Exit status: 0 done, Ctrl-C too; 1 the controller stopped; 2 wrong usage.

The simulated robot moves by one period per tick. At a skipped deadline it waits, unlike a real
robot; `drive_over_socket.py` simulates a robot with its own clock.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections import Counter

import numpy as np
import rich
from numpy.typing import NDArray

from rps_pin import RPSRobot
from rps_pin.control import (
    ComputedTorque,
    Encoders,
    Gains,
    LoopClock,
    Plant,
    Status,
    wrong_parameters,
)
from rps_pin.errors import RPSPinError
from rps_pin.trajectories import circle

PERIOD = 1e-3  # s
REST = 0.5  # s at the start, before it moves: the integral learns the weight


def main() -> int:
    """Run the loop; return the exit status."""
    parser = argparse.ArgumentParser(description="Hold a simulated 3-RPS on its path at 1 kHz.")
    parser.add_argument("--duration", type=float, default=3.0, help="of the path, s (default 3)")
    duration = parser.parse_args().duration
    if not 0 < duration < np.inf:
        parser.error(f"--duration {duration}: it must be a positive time, in s")

    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.1, turns=duration, duration=duration)
    # All targets before the loop: one sample in it would take longer than the controller.
    time = PERIOD * np.arange(round((REST + duration) / PERIOD))
    targets = path.sample(np.maximum(time - REST, 0.0))
    start = targets.pose[0]

    controller = ComputedTorque(robot, start, Gains.placed(15.0, integral=0.2), period=PERIOD)
    machine = RPSRobot(wrong_parameters(robot.parameters, masses=1.2))
    encoders = Encoders(resolution=50e-9, noise=20e-9)
    plant = Plant(machine, start, period=PERIOD, substeps=1, delay=1, encoders=encoders)

    reached = np.full_like(targets.pose, np.nan)  # where the platform was, in each tick
    statuses: Counter[Status] = Counter()
    clock = LoopClock(PERIOD)
    with contextlib.suppress(KeyboardInterrupt), clock:  # Ctrl-C ends it
        # One target a tick. The clock has no end: the targets have.
        for k, (*target, _) in enumerate(zip(*targets, clock.ticks(), strict=False)):
            reached[k] = plant.pose  # known in a simulation only
            status = controller.tick(plant.reading(), target)
            statuses[status] += 1
            plant.step(controller.forces)  # yours: send them to the drives
            if status & Status.STOPPED:
                print(controller.status_text)
                break

    moving = (time >= REST) & np.isfinite(reached[:, 0])
    is_at, should_be = reached[moving], targets.pose[moving]
    if moving.any():
        centre = robot.platform_placement(is_at)[0] - robot.platform_placement(should_be)[0]
        print(f"centre error: {in_words(centre)} um")
        print(f"tilt error: {in_words((is_at - should_be)[:, 1:])} urad")
    for status, count in statuses.items():
        print(f"{status.name}: {count} ticks")
    rich.print(clock.report().table())
    return 1 if controller.status & Status.STOPPED else 0


def in_words(error: NDArray[np.float64]) -> str:
    """Return the size of errors, shape (n, 2 or 3), in millionths."""
    size = 1e6 * np.linalg.norm(error, axis=1)
    return f"RMS {np.sqrt(np.mean(size**2)):.3g}, at most {size.max():.3g}"


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RPSPinError as error:
        sys.exit(f"error: {error}")
