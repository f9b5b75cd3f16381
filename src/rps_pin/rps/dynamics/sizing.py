"""Actuator sizing: demands of a motion on the actuators, from a trajectory or from samples.

The demands themselves are computed by `rps_pin.task.sizing.actuator_sizing`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import SingularityError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.motion_run import crossed_singularity, singular_sample
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.path_refusal import require_clear
from rps_pin.task.sizing.actuator_sizing import (
    checked_time,
    positive_area,
    samples,
    size_actuators,
    time_above,
)
from rps_pin.task.sizing.motion_run import sample_times
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.trajectories.path import Trajectory

__all__ = ["positive_area", "size_actuators", "size_motion", "size_trajectory", "time_above"]


@refuses_other_kinds
def size_trajectory(
    robot: RPSRobot,
    trajectory: Trajectory,
    sample_rate: float = 1000.0,
    *,
    limits: ActuatorLimits | None = None,
    wrench: ArrayLike | None = None,
    threshold: float = 0.5,
) -> SizingSheet:
    """Return the demands of a trajectory on a robot's actuators.

    Parameters
    ----------
    robot
        The 3-RPS, with its payload and friction.
    trajectory
        Anything with ``duration`` and ``sample(t)``.
    sample_rate
        Hz.
    limits
        Limits of the actuators; those of the robot's parameters if left out.
    wrench
        On the platform, (6,) or (n, 6); see `RPSRobot.actuator_forces`.
    threshold
        Share of the peak force that counts for the duty.

    Raises
    ------
    InputError
        If a number is not usable.
    UnreachableError, SingularityError
        If the motion is out of reach, or meets a singularity; says when.
    """
    time = sample_times(trajectory.duration, sample_rate)
    require_clear(robot, trajectory)
    motion = trajectory.sample(time)
    return size_motion(robot, time, *motion, limits=limits, wrench=wrench, threshold=threshold)


@refuses_other_kinds
def size_motion(
    robot: RPSRobot,
    time: ArrayLike,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    limits: ActuatorLimits | None = None,
    wrench: ArrayLike | None = None,
    threshold: float = 0.5,
) -> SizingSheet:
    """Return the demands of a sampled motion on a robot's actuators.

    Parameters
    ----------
    robot, limits, wrench, threshold
        As for `size_trajectory`.
    time
        Increasing, shape (n,), s.
    pose, rate, acceleration
        Shape (n, 3) each.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `size_trajectory`.
    """
    times = checked_time(time)
    x = samples(pose, "pose", len(times), 3)
    force = robot.actuator_forces(x, rate, acceleration, wrench=wrench, errors="mask")
    _refuse_bad_samples(robot, times, x, np.ma.getmaskarray(force)[:, 0])
    legs = robot.motion(x, rate, acceleration)[1]
    limits = ActuatorLimits.of(robot.parameters) if limits is None else limits
    return size_actuators(times, np.asarray(force), legs.speed, legs.length, limits, threshold)


def _refuse_bad_samples(robot: RPSRobot, time: Array, pose: Array, refused: Bools) -> None:
    """Refuse a motion with a refused sample, or with a singularity between two samples."""
    if refused.any():
        first = int(np.argmax(refused))
        still = np.zeros(3)
        try:
            robot.actuator_forces(pose[first], still, still)
        except UnreachableError as error:
            raise UnreachableError(
                f"at t = {time[first]:.6g} s: {error}", error.violations
            ) from None
        except SingularityError as error:
            raise singular_sample(time[first], error) from None
    sign = np.sign(singularity_measures(robot.parameters, pose).determinant)
    crossing = sign[:-1] * sign[1:] < 0
    if crossing.any():
        i = int(np.argmax(crossing))
        raise crossed_singularity(time[i], time[i + 1], robot)
