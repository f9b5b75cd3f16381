"""Scenarios of a mechanism with a task: what differs from those of the 3-RPS.

    mechanism: delta.yaml
    trajectory: {kind: point_to_point, start: [0, 0, -0.5], end: [0.1, 0, -0.45], duration: 0.5}
    controller: {law: computed_torque, bandwidth: 15.0}
    plant: {masses: 1.2, delay: 1}

Trajectories are in the task's coordinates: a CSV file, or ``point_to_point``, ``spline`` or ``csv``
with the keys that they have for the 3-RPS.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import pinocchio as pin
from pydantic import Field

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import Entry, Finite, NonNegative, Positive, Text, YamlFile
from rps_pin.control.simulation.scenario_schema import (
    ControllerEntry,
    Count,
    FaultEntry,
    GainsEntry,
)
from rps_pin.errors import InputError
from rps_pin.task import Task
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.path import Trajectory
from rps_pin.trajectories.point_to_point import point_to_point
from rps_pin.trajectories.spline import spline
from rps_pin.trajectories.time_laws import Profile

Row = Annotated[list[Finite], Field(min_length=1)]
OneOrMore = NonNegative | Annotated[list[NonNegative], Field(min_length=1)]


class TaskMachine(Entry):
    """A factor of all masses and inertias of the mechanism."""

    masses: Positive | None = None


class TaskPlantEntry(TaskMachine):
    """See `Plant` and `Encoders`."""

    delay: Count | None = None
    substeps: Annotated[int, Field(ge=1)] | None = None
    encoder_resolution: NonNegative = 0.0
    encoder_noise: NonNegative = 0.0
    seed: Count = 0
    force_limit: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None


class TaskGainsEntry(GainsEntry):
    """See `Gains`."""

    proportional: OneOrMore
    derivative: OneOrMore
    integral: OneOrMore = 0.0


class TaskControllerEntry(ControllerEntry):
    """See `ControllerEntry`."""

    gains: TaskGainsEntry | None = None
    model: TaskMachine = TaskMachine()  # type: ignore[assignment]
    force_limit: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None


class TaskFaultEntry(FaultEntry):
    """See `Fault`; `leg` is the number of an actuator."""

    leg: Annotated[int, Field(ge=1)] | None = None  # type: ignore[assignment]
    offset: Row | None = None


class TaskScenarioEntry(Entry):
    """A control scenario of a mechanism; its file is named from the scenario's folder."""

    mechanism: Text
    trajectory: Text | dict[str, Any]
    controller: TaskControllerEntry
    plant: TaskPlantEntry = TaskPlantEntry()
    faults: list[TaskFaultEntry] = Field(default_factory=list)
    period: Positive = 1e-3
    settle: NonNegative = 1.0
    duration: Positive | None = None


class _Timed(Entry):
    duration: Positive | None = None
    profile: Profile | None = None


class TaskPointToPoint(_Timed):
    """See `rps_pin.trajectories.point_to_point`."""

    kind: Literal["point_to_point"]
    start: Row
    end: Row


class TaskSpline(_Timed):
    """See `rps_pin.trajectories.spline`."""

    kind: Literal["spline"]
    poses: list[Row]
    times: list[Finite] | None = None


class TaskCsv(Entry):
    """See `rps_pin.trajectories.read_csv`; the file is named from the scenario's folder."""

    kind: Literal["csv"]
    file: Text


_KINDS: dict[str, type[Entry]] = {
    "point_to_point": TaskPointToPoint,
    "spline": TaskSpline,
    "csv": TaskCsv,
}


def task_of_file(file: YamlFile, folder: Path, name: str) -> Task:
    """Return the task of the mechanism that a scenario names.

    Raises
    ------
    InputError
        If there is no such file.
    RPSPinError
        If it does not describe a mechanism with a task.
    """
    path = folder / name
    if not path.exists():
        raise InputError(
            f"{file.place(('mechanism',))}: mechanism = {name!r}: there is no such file"
        )
    with file.at("mechanism"):
        task: Task = ClosedLoopModel.load(path).task
    return task


def changed(task: Task, masses: float | None) -> Task:
    """Return the task of a mechanism whose masses and inertias are multiplied."""
    if masses is None:
        return task
    old = task.mechanism
    model = pin.Model(old.model)
    for i, inertia in enumerate(model.inertias):
        model.inertias[i] = pin.Inertia(
            masses * inertia.mass, inertia.lever, masses * inertia.inertia
        )
    heavier = ClosedLoopModel(
        model,
        old.closures,
        old.actuated,
        home=old.home,
        effects=old.effects,
        name=old.name,
        characteristic_length=old.characteristic_length,
        max_condition=old.max_condition,
        accuracy=old.accuracy,
    )
    return task.with_mechanism(heavier)


def task_trajectory(file: YamlFile, folder: Path, task: Task) -> Trajectory:
    """Return the trajectory that a scenario describes or names.

    Raises
    ------
    InputError
        If it describes none; with the line.
    """
    given = file.values["trajectory"]
    if isinstance(given, str):
        with file.at("trajectory"):
            return _fitting(read_csv(folder / given, task), task)
    part = file.part("trajectory")
    kind = part.values.get("kind")
    if kind not in _KINDS:
        raise InputError(
            f"{part.place(('kind',))}: kind = {kind!r}: of a mechanism's trajectory it is one of: "
            f"{', '.join(_KINDS)}"
        )
    keys = part.validated(_KINDS[kind], "a trajectory").model_dump(exclude_none=True)
    with part.at("kind"):
        return _fitting(_made(kind, keys, folder, task), task)


def _made(kind: str, keys: dict[str, Any], folder: Path, task: Task) -> Trajectory:
    del keys["kind"]
    if kind == "csv":
        return read_csv(folder / keys["file"], task)
    if kind == "spline":
        return spline(**keys)
    return point_to_point(**keys)


def _fitting(trajectory: Trajectory, task: Task) -> Trajectory:
    count = len(trajectory.sample(0.0).pose)
    if count != task.size:
        raise InputError(
            f"poses of {count} numbers; the task has {task.size} coordinates: "
            f"{', '.join(task.coordinates)}"
        )
    return trajectory
