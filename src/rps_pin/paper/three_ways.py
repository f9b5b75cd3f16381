"""One motion's actuator forces by other ways than the constraint models: how far apart they are.

The constraint models' forces (`run_motion`) are compared with

- the closed form of `RPSRobot.actuator_forces`, which knows all that the robot has;
- Lagrange's equations of the first kind, the paper's own way, and virtual work: these know the
  bodies and gravity, and are left out where there is friction, a payload or a wrench besides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.virtual_work import virtual_work_forces
from rps_pin.rps.dynamics.friction import has_friction
from rps_pin.rps.dynamics.motion_run import MotionRun
from rps_pin.rps.robot import RPSRobot


def force_differences(
    robot: RPSRobot, run: MotionRun, wrench: ArrayLike | None = None
) -> dict[str, float]:
    """Return the largest difference of each other way to a run's forces, by the way's name.

    Each difference is relative to the largest force of its sample.

    Parameters
    ----------
    robot, run
        The robot and its motion, as `run_motion` computed it.
    wrench
        What `run_motion` was given.
    """
    motion = run.pose, run.rate, run.acceleration
    p = robot.parameters
    ways = {"closed form": robot.actuator_forces(*motion, wrench=wrench)}
    if robot.payload is None and wrench is None and not has_friction(p):
        limit = robot.mechanism.max_condition
        ways["Lagrange, first kind"] = lagrange_forces(p, *motion, max_gain=limit).force
        ways["virtual work"] = virtual_work_forces(p, *motion, max_gain=limit)
    largest = np.abs(run.force).max(axis=-1)
    scale = np.where(largest > 0, largest, 1.0)
    return {
        name: float((np.abs(force - run.force).max(axis=-1) / scale).max())
        for name, force in ways.items()
    }
