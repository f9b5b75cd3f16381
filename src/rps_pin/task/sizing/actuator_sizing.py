"""Demands on actuators from their forces, speeds and positions: peaks, means, energies, margins.

Between samples, force and power are taken as linear in time; averages, energies and shares of time
are exact for that. Peaks are those of the samples. The sheet itself is in `sizing_sheet`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, ActuatorSizing, Margin, SizingSheet
from rps_pin.validation import real, real_array

#: Units of force, speed and position of actuators that slide, and of those that turn.
UNITS = (("N", "m/s", "m"), ("N m", "rad/s", "rad"))


def size_actuators(
    time: ArrayLike,
    force: ArrayLike,
    speed: ArrayLike,
    length: ArrayLike,
    limits: ActuatorLimits | Sequence[ActuatorLimits],
    threshold: float = 0.5,
    *,
    names: Sequence[str] = ("", "", ""),
    angular: Sequence[bool] = (False, False, False),
) -> SizingSheet:
    """Return the sheet of known forces, speeds and positions, shape (n, na) each.

    Parameters
    ----------
    time
        Increasing, shape (n,), s.
    force, speed, length
        Of each actuator: N, m/s and m, or N m, rad/s and rad.
    limits
        Of all actuators, or of each.
    threshold
        Share of the peak force that counts for the duty.
    names, angular
        Of each actuator: its name, and whether it turns. Left out: the three legs of a 3-RPS.

    Raises
    ------
    InputError
        If times do not increase, shapes do not fit, or the threshold is not between 0 and 1.
    """
    times = checked_time(time)
    if not 0 < real(threshold) < 1:
        raise InputError(f"threshold = {shown(threshold)}: it must be between 0 and 1")
    count = len(names)
    given = (("force", force), ("speed", speed), ("length", length))
    arrays = [samples(value, name, len(times), count) for name, value in given]
    each = limits_of_each(limits, count)
    actuators = tuple(
        _sizing(k, times, [array[:, k] for array in arrays], each[k], threshold, names[k], turns)
        for k, turns in enumerate(angular)
    )
    kept = limits if isinstance(limits, ActuatorLimits) else each
    return SizingSheet(actuators, kept, threshold, times, arrays[0], arrays[1])


def limits_of_each(
    limits: ActuatorLimits | Sequence[ActuatorLimits], count: int
) -> tuple[ActuatorLimits, ...]:
    """Return the limits of each actuator, given once for all of them, or of each.

    Raises
    ------
    InputError
        If they are of another number of actuators.
    """
    each = (limits,) * count if isinstance(limits, ActuatorLimits) else tuple(limits)
    if len(each) != count:
        raise InputError(f"limits of {len(each)} actuators; there are {count}")
    return each


def _sizing(
    index: int,
    time: Array,
    series: list[Array],
    limits: ActuatorLimits,
    threshold: float,
    name: str,
    turns: bool,
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
    lowest, highest = limits.position_names
    of_force, of_speed, of_position = UNITS[int(turns)]
    margins = (
        Margin("force", peaks[0], limits.force, limits.force - peaks[0], of_force),
        Margin("speed", peaks[1], limits.speed, limits.speed - peaks[1], of_speed),
        Margin("power", peaks[2], limits.power, limits.power - peaks[2], "W"),
        Margin(lowest, shortest, low, shortest - low, of_position),
        Margin(highest, longest, high, high - longest, of_position),
    )
    # The square of a linear function has the mean (a^2 + a b + b^2) / 3.
    a, b = force[:-1], force[1:]
    square = float((np.diff(time) * (a * a + a * b + b * b)).sum() / 3 / duration)
    return ActuatorSizing(
        actuator=index + 1,
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
        name=name,
        angular=turns,
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


def samples(value: ArrayLike, name: str, count: int, size: int) -> Array:
    """Return finite numbers of shape (count, size)."""
    array = real_array(value, name, (size,))
    if array.shape != (count, size):
        raise InputError(
            f"{name} has shape {array.shape}; with these times it must be {count, size}"
        )
    return array


def checked_time(time: ArrayLike) -> Array:
    """Return increasing times, two or more, s."""
    times = real_array(time, "time")
    if times.ndim != 1 or len(times) < 2:
        raise InputError(f"time has shape {times.shape}; it must be (n,), with n of 2 or more")
    if not (np.diff(times) > 0).all():
        first = int(np.argmin(np.diff(times) > 0))
        raise InputError(
            f"times must increase: {times[first]:.9g} s, then {times[first + 1]:.9g} s"
        )
    return times
