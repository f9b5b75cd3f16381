"""3-RPS robots that a design chooses from: fields of `RPSParameters` that vary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.config import Faults, YamlFile
from rps_pin.errors import InputError, did_you_mean
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.legs import cone_angles
from rps_pin.rps.leg_frames import LEGS
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.robot_file import load_robot
from rps_pin.task import Task
from rps_pin.task.design.file import DimensionEntry, dimension_of
from rps_pin.task.design.geometry.dimensions import Dimension
from rps_pin.task.design.space import Candidates, DesignSpace
from rps_pin.validation import LARGEST

_REVOLUTE = tuple(f"leg_{leg}_revolute" for leg in LEGS)
_PRISMATIC = tuple(f"leg_{leg}_prismatic" for leg in LEGS)
#: Fields that may vary, and what they move in the mechanism.
FIELDS: Mapping[str, Mapping[str, Any]] = {
    "base_radius": {"radius": _REVOLUTE},
    "platform_radius": {"radius": tuple(f"leg_{leg}.a" for leg in LEGS)},
    "leg_length_limits.lower": {"lower_limit": _PRISMATIC},
    "leg_length_limits.upper": {"upper_limit": _PRISMATIC},
    "leg_angle_limits.lower": {"lower_limit": _REVOLUTE},
    "leg_angle_limits.upper": {"upper_limit": _REVOLUTE},
}


@refuses_other_kinds
class RPSDesignSpace(DesignSpace):
    """3-RPS robots that differ in some of their parameters.

    All other parameters, masses and inertias among them, are those of the robot. A candidate is
    written as a parameter file. Its characteristic length is its own platform's radius, and the
    cones of its spherical joints are limits.

    Parameters
    ----------
    robot
        The robot, or its parameters.
    ranges
        Ends of the fields that vary, in the fields' units; equal ones hold a field. Fields are
        ``base_radius``, ``platform_radius`` and the ends of limits, ``leg_length_limits.lower`` and
        ``.upper``, ``leg_angle_limits.lower`` and ``.upper``.
    steps
        Distances of the possible values of some fields.

    Raises
    ------
    InputError
        If a field is not one of these, or its range is not possible.
    """

    def __init__(
        self,
        robot: RPSRobot | RPSParameters,
        ranges: Mapping[str, tuple[float, float]],
        steps: Mapping[str, float] | None = None,
    ) -> None:
        robot = robot if isinstance(robot, RPSRobot) else RPSRobot(robot)
        self.parameters = robot.parameters
        found = [dimension(name, ends, (steps or {}).get(name)) for name, ends in ranges.items()]
        for name in steps or {}:
            if name not in ranges:
                raise InputError(f"steps of {name!r}, which does not vary")
        super().__init__(task_of(robot), found)
        limit = self.parameters.spherical_cone_limit
        self.room_names = () if limit >= math.pi else tuple(f"ball {leg} cone" for leg in LEGS)

    def candidates(self, values: Array) -> Candidates:
        """Return what candidates of values (n, d) have in place of the robot's numbers."""
        found = super().candidates(values)
        names = [one.name for one in self.dimensions]
        if "platform_radius" not in names:
            return found
        length = values[:, names.index("platform_radius")]
        return found._replace(length=length)

    def rooms(self, values: Array, q: Array, x: Array) -> Array:
        """Return the room in the balls' cones as a share of their limit, shape (n, k, 3)."""
        if not self.room_names:
            return super().rooms(values, q, x)
        model, limit = self.task.mechanism.model, self.parameters.spherical_cone_limit
        free = model.joints[model.getJointId("platform_free")].idx_q
        angle = q[..., [model.joints[model.getJointId(name)].idx_q for name in _REVOLUTE]]
        turned = q[..., free + 3 : free + 7]
        rotation = Rotation.from_quat(turned.reshape(-1, 4)).as_matrix()
        cone = cone_angles(
            angle, rotation.reshape(*q.shape[:2], 3, 3), self.parameters.spherical_rest_angle
        )
        return np.asarray((limit - cone) / limit)

    def identity(self) -> str:
        """Return a digest of all that decides the numbers of candidates."""
        return f"{super().identity()} {self.parameters.model_dump(mode='json')}"

    def of_values(self, values: Array, name: str = "") -> RPSParameters:
        """Return the parameters of a candidate (d,)."""
        changes: dict[str, Any] = {}
        for dimension, value in zip(self.dimensions, values.tolist(), strict=True):
            field, _, end = dimension.name.partition(".")
            if not end:
                changes[field] = value
                continue
            ends = changes.get(field, getattr(self.parameters, field))
            changes[field] = (value, ends[1]) if end == "lower" else (ends[0], value)
        return self.parameters.replace(**changes, **({"name": name} if name else {}))

    def files(self, folder: Path, name: str) -> list[Path]:
        """Return the file that `write` writes: parameters."""
        return [folder / f"{name}.yaml"]

    def write(self, values: Array, q: Array, folder: Path, name: str) -> list[Path]:
        """Write a candidate (d,) as a parameter file; replace what is there."""
        (file,) = self.files(folder, name)
        self.of_values(values, name).to_yaml(file)
        return [file]


def task_of(robot: RPSRobot) -> Task:
    """Return the task of a robot's mechanism, without closed forms."""
    return Task(robot.mechanism, frame="platform", coordinates=["z", "rx", "ry"])


def dimension(name: str, ends: tuple[float, float], step: float | None) -> Dimension:
    """Return a field as a dimension, its ends possible ones.

    Raises
    ------
    InputError
        If there is no such field, or an end is not possible.
    """
    if name not in FIELDS:
        raise InputError(
            f"no field {name!r} that may vary{did_you_mean(name, FIELDS)}; there are: "
            f"{', '.join(FIELDS)}"
        )
    for end in ends:
        if not ("." in name or 0 < end < LARGEST):
            raise InputError(f"{name} = {end:g}: it must be positive")
    found = Dimension(name, *ends, step, **FIELDS[name])
    if name.startswith("leg_length_limits") and ends[0] < 0:
        raise InputError(f"{name} = {ends[0]:g}: a leg's length cannot be negative")
    return found


class _Robot:
    """A 3-RPS of a design's file."""

    def __init__(self, robot: RPSRobot) -> None:
        self._robot, self.task = robot, task_of(robot)

    def design_space(
        self, file: YamlFile, faults: Faults, entries: Mapping[str, DimensionEntry]
    ) -> RPSDesignSpace | None:
        """Return the space of a file's dimensions; None if there are faults."""
        before, ranges, steps = faults.count, {}, {}
        for name, entry in entries.items():
            with faults, file.at("dimensions", name):
                _refuse_keys(entry)
                held = dimension_of(name, entry)
                ranges[name] = (held.lower, held.upper)
                dimension(name, ranges[name], held.step)
                if held.step is not None:
                    steps[name] = held.step
        if faults.count > before:
            return None
        with faults, file.at("dimensions"):
            return RPSDesignSpace(self._robot, ranges, steps)
        return None


def _refuse_keys(entry: DimensionEntry) -> None:
    more: Sequence[str] = sorted(entry.model_fields_set - {"range", "value", "step"})
    if more:
        raise InputError(f"{', '.join(more)}: a field of a 3-RPS takes range, value and step alone")


def robot_of(name: str, folder: Path) -> _Robot:
    """Return the 3-RPS of a preset's name or of a parameter file's path."""
    return _Robot(load_robot(name, folder))
