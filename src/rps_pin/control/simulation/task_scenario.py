"""Scenarios of a mechanism with a task: what differs from those of the 3-RPS.

    mechanism: delta.yaml
    trajectory: {kind: point_to_point, start: [0, 0, -0.5], end: [0.1, 0, -0.45], duration: 0.5}
    controller: {law: computed_torque, bandwidth: 15.0}
    plant: {masses: 1.2, delay: 1}

Trajectories are those of ``rps_pin.task.trajectory_file``: a file's name, or its keys.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pinocchio as pin
from pydantic import Field

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import Entry, Finite, NonNegative, Positive, Text, YamlFile
from rps_pin.control.simulation.scenario_schema import (
    ControllerEntry,
    Count,
    DrivesEntry,
    FaultEntry,
    GainsEntry,
)
from rps_pin.errors import InputError
from rps_pin.files import is_there
from rps_pin.rps.robot_file import kind_of_file
from rps_pin.task import Task
from rps_pin.task.trajectory_file import described_task_trajectory, load_task_trajectory
from rps_pin.trajectories.path import Trajectory

Row = Annotated[list[Finite], Field(min_length=1)]
OneOrMore = NonNegative | Annotated[list[NonNegative], Field(min_length=1)]


class TaskMachine(Entry):
    """A factor of all masses and inertias of the mechanism."""

    masses: Positive | None = None


class TaskPlantEntry(TaskMachine):
    """See `Plant` and `Encoders`."""

    drives: DrivesEntry | None = None
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

    leg: Annotated[int, Field(ge=1)] | None = None
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
    if not is_there(path):
        raise InputError(
            f"{file.place(('mechanism',))}: mechanism = {name!r}: there is no such file"
        )
    with file.at("mechanism"):
        task: Task = ClosedLoopModel.load(path).task
    return task


def refuse_parameters(file: YamlFile, folder: Path) -> None:
    """Refuse the parameters of a 3-RPS as a scenario's mechanism: they are a robot.

    Raises
    ------
    InputError
        If they are; with the line.
    """
    name = file.values["mechanism"]
    if isinstance(name, str) and kind_of_file(folder / name) == "parameters":
        with file.at("mechanism"):
            raise InputError(f"{name} holds the parameters of a 3-RPS: write robot: {name}")


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
        return load_task_trajectory(folder / given, task)
    return described_task_trajectory(file.part("trajectory"), folder, task)
