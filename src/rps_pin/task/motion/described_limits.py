"""Limits of a motion in a YAML file: the key `fastest` of a trajectory.

fastest:
force: 40                           # one number for all, both ways
speed: [3.0, 3.0, 2.0]              # in order
jerk: {arm_1_joint: 300}            # by name; the others are the model's, or none
acceleration: [[-20, -20, -20], [30, 30, 30]]     # the least and the largest
"""

from __future__ import annotations

from itertools import chain
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from rps_pin.arrays import Array
from rps_pin.config import Entry, YamlFile
from rps_pin.errors import InputError, shown
from rps_pin.task.motion.limits import MotionLimits
from rps_pin.task.task import Task
from rps_pin.validation import LARGEST


def _are_ranges(value: Any) -> bool:
    """Return whether a value is two lists, the least and the largest."""
    return isinstance(value, list) and len(value) == 2 and all(isinstance(v, list) for v in value)


def _limit(value: Any) -> Any:
    ranges = _are_ranges(value)
    if isinstance(value, dict):
        each = list(value.values())
    else:
        each = list(chain(*value)) if ranges else value if isinstance(value, list) else [value]
    if not each:
        raise ValueError("it must be a number, numbers by name or in order, or two lists")
    for number in each:
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise ValueError(f"{shown(number)} is no number")
        if not (abs(number) < LARGEST if ranges else 0 < number < LARGEST):
            wanted = "finite" if ranges else "positive"
            raise ValueError(f"{shown(number)} is not {wanted}")
    return value


Limit = Annotated[Any, AfterValidator(_limit)]


class LimitsEntry(Entry):
    """See `MotionLimits`."""

    force: Limit = None
    speed: Limit = None
    acceleration: Limit = None
    jerk: Limit = None
    coordinate_speed: Limit = None
    coordinate_acceleration: Limit = None
    coordinate_jerk: Limit = None


def limits_of(file: YamlFile, entry: LimitsEntry, task: Task) -> MotionLimits:
    """Return the limits that a file has under `fastest`.

    Raises
    ------
    InputError
        If an actuator or coordinate is unknown, or there are too many or too few numbers; with the
        line.
    """
    model, index = task.mechanism.model, task.mechanism.actuated_indices
    own = {"force": model.effortLimit[index], "speed": model.velocityLimit[index]}
    limits = {}
    for name, value in entry.model_dump(exclude_none=True).items():
        limits[name] = value
        if isinstance(value, (list, dict)) and not _are_ranges(value):
            of_task = name.startswith("coordinate")
            names = task.coordinates if of_task else task.mechanism.actuated
            others = np.array(own.get(name, np.full(len(names), np.inf)), dtype=np.float64)
            what = "coordinates" if of_task else "actuators"
            limits[name] = numbers_by_name(file, ("fastest", name), value, names, others, what)
    return MotionLimits(**limits)


def numbers_by_name(
    file: YamlFile,
    place: tuple[str | int, ...],
    given: Any,
    names: tuple[str, ...],
    otherwise: Array,
    what: str = "coordinates",
) -> Array:
    """Return numbers of a file in the order of names; those that are not named are others.

    Raises
    ------
    InputError
        If a name is unknown, or there are too many or too few numbers; with the line.
    """
    told = ", ".join(names)
    if isinstance(given, list):
        if len(given) != len(names):
            raise InputError(
                f"{file.place(place)}: {len(given)} numbers for the {len(names)} {what} {told}"
            )
        return np.array(given, dtype=np.float64)
    values = otherwise.copy()
    for name, value in given.items():
        if name not in names:
            raise InputError(
                f"{file.place((*place, name))}: the task has no {name!r}; it has: {told}"
            )
        values[names.index(name)] = value
    return values
