"""Actuator sizing: demands of a motion on the actuators, from a trajectory or from samples.

Between samples, force and power are taken as linear in time; averages, energies and shares of time
are exact for that. Peaks are those of the samples. The sheet itself is in `sizing_sheet`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, SingularityError, UnreachableError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.motion_run import crossed_singularity, sample_times, singular_sample
from rps_pin.rps.dynamics.sizing_sheet import ActuatorLimits, ActuatorSizing, Margin, SizingSheet
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.path_refusal import require_clear
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import real, real_array


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
    times = _checked_time(time)
    x = _samples(pose, "pose", len(times))
    force = robot.actuator_forces(x, rate, acceleration, wrench=wrench, errors="mask")
    _refuse_bad_samples(robot, times, x, np.ma.getmaskarray(force)[:, 0])
    legs = robot.motion(x, rate, acceleration)[1]
    limits = ActuatorLimits.of(robot.parameters) if limits is None else limits
    return size_actuators(times, np.asarray(force), legs.speed, legs.length, limits, threshold)


def size_actuators(
    time: ArrayLike,
    force: ArrayLike,
    speed: ArrayLike,
    length: ArrayLike,
    limits: ActuatorLimits,
    threshold: float = 0.5,
) -> SizingSheet:
    """Return the sheet of known forces (N), speeds (m/s) and lengths (m), shape (n, 3) each.

    Raises
    ------
    InputError
        If times do not increase, shapes do not fit, or the threshold is not between 0 and 1.
    """
    times = _checked_time(time)
    if not 0 < real(threshold) < 1:
        raise InputError(f"threshold = {shown(threshold)}: it must be between 0 and 1")
    given = (("force", force), ("speed", speed), ("length", length))
    arrays = [_samples(value, name, len(times)) for name, value in given]
    actuators = tuple(
        _sizing(leg, times, [array[:, leg] for array in arrays], limits, threshold)
        for leg in range(3)
    )
    return SizingSheet(actuators, limits, threshold, times, arrays[0], arrays[1])


# Inner workings -----------------------------------------------------------------------------------


def _sizing(
    leg: int, time: Array, series: list[Array], limits: ActuatorLimits, threshold: float
) -> ActuatorSizing:
    """Return one actuator's demands from its force, speed and length, shape (n,) each."""
    force, speed, length = series
    duration = float(time[-1] - time[0])
    power = force * speed
    driven, regenerated = positive_area(power, time), positive_area(-power, time)
    peak = int(np.abs(force).argmax())
    peaks = [float(np.abs(values).max()) for values in (force, speed, power)]
    shortest, longest = float(length.min()), float(length.max())
    low, high = limits.length
    margins = (
        Margin("force", peaks[0], limits.force, limits.force - peaks[0], "N"),
        Margin("speed", peaks[1], limits.speed, limits.speed - peaks[1], "m/s"),
        Margin("power", peaks[2], limits.power, limits.power - peaks[2], "W"),
        Margin("shortest leg", shortest, low, shortest - low, "m"),
        Margin("longest leg", longest, high, high - longest, "m"),
    )
    # The square of a linear function has the mean (a^2 + a b + b^2) / 3.
    a, b = force[:-1], force[1:]
    square = float((np.diff(time) * (a * a + a * b + b * b)).sum() / 3 / duration)
    return ActuatorSizing(
        actuator=leg + 1,
        force_peak=peaks[0],
        force_peak_time=float(time[peak]),
        force_min=float(force.min()),
        force_max=float(force.max()),
        force_rms=math.sqrt(square),
        speed_peak=peaks[1],
        power_peak=peaks[2],
        power_mean=(driven + regenerated) / duration,
        energy_driven=driven,
        energy_regenerated=regenerated,
        duty=time_above(np.abs(force), threshold * peaks[0], time) / duration,
        length_min=shortest,
        length_max=longest,
        margins=margins,
    )


def positive_area(values: Array, time: Array) -> float:
    """Return the integral of the positive part of a function that is linear between samples."""
    a, b = values[:-1], values[1:]
    apart = np.abs(a) + np.abs(b)
    mixed = a * b < 0
    top = np.maximum(a, b)
    # Where the sign changes: a triangle of height top over top / apart of the interval.
    triangle = top * top / np.where(mixed, 2 * apart, 1.0)
    both = (np.maximum(a, 0.0) + np.maximum(b, 0.0)) / 2
    return float((np.diff(time) * np.where(mixed, triangle, both)).sum())


def time_above(values: Array, level: float, time: Array) -> float:
    """Return how long a function that is linear between samples is above a level, s."""
    a, b = values[:-1] - level, values[1:] - level
    mixed = a * b < 0
    share = np.maximum(a, b) / np.where(mixed, np.abs(a) + np.abs(b), 1.0)
    return float((np.diff(time) * np.where(mixed, share, (a + b > 0))).sum())


def _samples(value: ArrayLike, name: str, count: int) -> Array:
    array = real_array(value, name, (3,))
    if array.shape != (count, 3):
        raise InputError(f"{name} has shape {array.shape}; with these times it must be {count, 3}")
    return array


def _checked_time(time: ArrayLike) -> Array:
    times = real_array(time, "time")
    if times.ndim != 1 or len(times) < 2:
        raise InputError(f"time has shape {times.shape}; it must be (n,), with n of 2 or more")
    if not (np.diff(times) > 0).all():
        first = int(np.argmin(np.diff(times) > 0))
        raise InputError(
            f"times must increase: {times[first]:.9g} s, then {times[first + 1]:.9g} s"
        )
    return times


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
