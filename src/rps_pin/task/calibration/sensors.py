"""What is measured of a mechanism with a task: readings of sensors at poses.

A sensor reads a joint that has one coordinate (an actuator's encoder, or any other joint's), or a
coordinate of the task. It reads

    reading = (value - offset) / scale + noise

with an offset and a scale that may be among the parameters of a calibration.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError, did_you_mean
from rps_pin.task.task import Task
from rps_pin.validation import numbers, positive_number


class Readings(NamedTuple):
    """Readings of sensors at poses; see `readings`."""

    sensors: tuple[str, ...]
    """What each sensor reads: names of joints, and coordinates of the task."""
    values: Array
    """Shape (poses, sensors), m or rad; NaN where nothing was read."""
    deviations: Array
    """Standard deviations of the noise, of the same shape."""

    @property
    def total(self) -> int:
        """How many readings there are."""
        return int(np.count_nonzero(np.isfinite(self.values)))

    def of_poses(self, which: ArrayLike) -> Readings:
        """Return the readings at some of the poses."""
        at = np.asarray(which)
        return Readings(self.sensors, self.values[at], self.deviations[at])


def readings(
    task: Task,
    values: Mapping[str, ArrayLike],
    deviations: Mapping[str, ArrayLike],
    more: Iterable[str] = (),
) -> Readings:
    """Return readings of sensors, checked.

    Parameters
    ----------
    task
        The task of the mechanism that was measured.
    values
        By sensor, a joint's name or a task coordinate's: its readings at the poses, shape (poses,),
        m or rad; NaN where nothing was read.
    deviations
        By sensor: the standard deviation of its noise, one number or one for each pose.
    more
        Names of sensors besides joints and coordinates: those of instruments.

    Raises
    ------
    InputError
        If a sensor reads neither a joint of one coordinate nor a coordinate of the task, sensors
        have readings at different numbers of poses, a deviation is missing or not positive, or
        a pose has no reading.
    """
    if not values:
        raise InputError("there are no readings")
    names = tuple(values)
    other = set(more)
    sensor_columns(task, [name for name in names if name not in other])
    columns = [
        numbers(values[name], f"readings of {name}", "one number for each pose") for name in names
    ]
    sizes = {name: column.shape for name, column in zip(names, columns, strict=True)}
    if any(len(shape) != 1 for shape in sizes.values()) or len(set(sizes.values())) != 1:
        told = ", ".join(f"{name} {shape}" for name, shape in sizes.items())
        raise InputError(
            f"readings must be one number of each sensor for each pose; shapes: {told}"
        )
    array = np.stack(columns, axis=-1)
    if np.isinf(array).any():
        raise InputError("a reading is infinite; NaN says that nothing was read")
    empty = np.flatnonzero(~np.isfinite(array).any(axis=1))
    if empty.size:
        raise InputError(f"pose {empty[0]} has no reading")
    unknown = [name for name in deviations if name not in names]
    missing = [name for name in names if name not in deviations]
    if unknown or missing:
        told = f"no readings of {unknown[0]!r}" if unknown else f"no deviation of {missing[0]!r}"
        raise InputError(f"deviations: there is {told}; the sensors are {', '.join(names)}")
    spread = np.empty_like(array)
    for k, name in enumerate(names):
        given = numbers(
            deviations[name], f"deviation of {name}", "a positive number, or one for each pose"
        )
        if given.ndim > 1 or (given.ndim and given.shape != array.shape[:1]):
            raise InputError(
                f"the deviation of {name} has shape {given.shape}; expected one number, or "
                f"{array.shape[:1]}"
            )
        for one in np.unique(given):
            positive_number(one, f"deviation of {name}")
        spread[:, k] = given
    return Readings(names, array, spread)


def possible_sensors(task: Task) -> dict[str, bool]:
    """Return what a sensor can read, and whether that is an angle.

    The task's coordinates first, then the joints of one coordinate.
    """
    turning = task.extended.system.equations.angular_velocities
    model = task.extended.model
    found = dict(zip(task.coordinates, map(bool, task.angular), strict=True))
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        if joint.nq == joint.nv == 1 and name not in task.extended.actuated:
            found.setdefault(name, bool(turning[joint.idx_v]))
    return found


class SensorColumns(NamedTuple):
    """Where the values that sensors read stand in the extended mechanism's q and v."""

    q: Indices
    v: Indices


def sensor_columns(task: Task, names: Sequence[str]) -> SensorColumns:
    """Return where sensors' values stand in configurations and velocities.

    Raises
    ------
    InputError
        If a name is neither a joint of one coordinate nor a coordinate of the task.
    """
    model = task.extended.model
    held = dict(zip(task.coordinates, task.extended.actuated, strict=True))
    known = possible_sensors(task)
    found = []
    for name in names:
        if name not in known:
            raise InputError(
                f"no joint of one coordinate, and no coordinate of the task, is called {name!r}"
                f"{did_you_mean(name, known)}; there are: {', '.join(known)}"
            )
        found.append(model.joints[model.getJointId(held.get(name, name))])
    return SensorColumns(
        np.array([joint.idx_q for joint in found], dtype=np.intp),
        np.array([joint.idx_v for joint in found], dtype=np.intp),
    )
