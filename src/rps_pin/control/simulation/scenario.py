"""Control scenarios from YAML files: a robot, a controller, a plant that may differ, and faults.

    robot: micro
    trajectory: {kind: helix, radius: 0.0005, pitch: 0.00033, height: 0.223, duration: 1.0}
    controller: {law: computed_torque, bandwidth: 15.0, integral: 0.2}
    plant: {masses: 1.2, delay: 1, encoder_resolution: 5.0e-8}
    faults: [{kind: lost, start: 1.5, duration: 0.0005}]

With ``mechanism: FILE`` in place of ``robot`` it is that of a mechanism with a task: see
`task_scenario`. `rps_pin.control.simulation.scenario_schema` lists all keys; those of the
controller and the plant are arguments of their classes.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import Faults, Schema, YamlFile, read_yaml
from rps_pin.control.drive_control import DriveControl
from rps_pin.control.estimator.effective_inertia import effective_inertia
from rps_pin.control.loop.computed_torque import ComputedTorque
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.pd_control import PDControl
from rps_pin.control.margins import LoopMargins, loop_margins
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.faults import Fault
from rps_pin.control.simulation.loop_run import LoopRun, run_loop
from rps_pin.control.simulation.plant import Plant
from rps_pin.control.simulation.scenario_schema import DrivesEntry, Machine, ScenarioEntry
from rps_pin.control.simulation.servo_drives import ServoDrives
from rps_pin.control.simulation.task_scenario import (
    TaskScenarioEntry,
    changed,
    refuse_parameters,
    task_of_file,
    task_trajectory,
)
from rps_pin.control.simulation.wrong_parameters import wrong_parameters
from rps_pin.errors import CompileError, InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.motion.trajectory_file import described_trajectory, load_trajectory
from rps_pin.rps.motion.trajectory_schema import validated
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.robot_file import load_robot
from rps_pin.task import Task
from rps_pin.task.trajectory_file import validated_task_trajectory
from rps_pin.trajectories.path import Trajectory

_OF_LAW = {"law", "bandwidth", "damping", "integral", "gains", "model", "speeds", "paced"}
_OF_PLANT = {
    "payload",
    "drives",
    "delay",
    "substeps",
    "encoder_resolution",
    "encoder_noise",
    "seed",
}


@dataclass(frozen=True)
class Scenario:
    """A scenario, ready to run; each run starts from the beginning.

    Attributes
    ----------
    entry : ScenarioEntry
        The file's values.
    model : RPSRobot or Task
        The controller's model of the robot.
    machine : RPSRobot or Task
        The plant's robot.
    trajectory : Trajectory
        The setpoints.
    gains : Gains
        Of the controller, in its law's units.
    faults : tuple of Fault
        In the file's order.
    """

    entry: ScenarioEntry | TaskScenarioEntry
    model: RPSRobot | Task
    machine: RPSRobot | Task
    trajectory: Trajectory
    gains: Gains
    faults: tuple[Fault, ...]

    @property
    def begin(self) -> Any:
        """The trajectory's first pose, shape (m,)."""
        return self.trajectory.sample(0.0).pose

    @property
    def duration(self) -> float:
        """Of a run, s."""
        given = self.entry.duration
        return self.entry.settle + self.trajectory.duration if given is None else given

    def controller(self) -> Controller:
        """Return a new controller."""
        entry = self.entry.controller
        settings = entry.model_dump(exclude=_OF_LAW, exclude_none=True)
        if entry.law == "drives":
            drives = cast("DrivesEntry", self.entry.plant.drives)
            gains = None if drives.command == "position" else self.gains
            return DriveControl(
                *(self._loop_model, self.begin, gains),
                command=drives.command,
                period=self.entry.period,
                **settings,
            )
        law = ComputedTorque if entry.law == "computed_torque" else PDControl
        return law(self._loop_model, self.begin, self.gains, period=self.entry.period, **settings)

    @cached_property
    def _loop_model(self) -> RPSRobot | Task:
        """The controller's model, of a task in generated code if that can be had."""
        if isinstance(self.model, RPSRobot):
            return self.model
        try:
            return self.model.compile(functions=("kinematics", "closing", "dynamics"))
        except (CompileError, ImportError):
            return self.model

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of coordinates and of actuators."""
        return len(self.begin), self.machine.mechanism.actuated_indices.size

    @property
    def subject(self) -> RPSRobot | ClosedLoopModel:
        """What moves: the plant's robot or mechanism."""
        machine = self.machine
        return machine if isinstance(machine, RPSRobot) else machine.mechanism

    @property
    def name(self) -> str:
        """Of the robot."""
        if isinstance(self.model, RPSRobot):
            return self.model.parameters.name
        return self.model.mechanism.name or "mechanism"

    def plant(self) -> Plant:
        """Return a new plant."""
        entry = self.entry.plant
        some = {"delay", "substeps", "force_limit"}
        settings = entry.model_dump(include=some, exclude_none=True)
        encoders = Encoders(entry.encoder_resolution, entry.encoder_noise, entry.seed)
        if entry.drives is not None:
            settings["drives"] = ServoDrives(**entry.drives.model_dump(exclude_none=True))
        return Plant(
            self.machine, self.begin, period=self.entry.period, encoders=encoders, **settings
        )

    def run(self, progress: Callable[[float], object] | None = None) -> LoopRun:
        """Return a run of the controller with the plant; see `run_loop`."""
        settings = self.entry.model_dump(include={"settle"}) | {"duration": self.duration}
        settings |= self.entry.controller.model_dump(include={"speeds", "paced"})
        loop = self.controller(), self.plant(), self.trajectory
        return run_loop(*loop, faults=self.faults, progress=progress, **settings)

    def margins(self) -> LoopMargins:
        """Return the margins of an axis with the inertia of the controller's model.

        With computed torque they are those of all three axes, in every pose. With PD control they
        hold at the start, where the gains were multiplied by the inertia.

        Raises
        ------
        InputError
            If gains differ from axis to axis, or are given in units of force.
        """
        entry = self.entry.controller
        if entry.law == "drives":
            raise InputError("the loops are those of the drives")
        gains = _placed(self.entry)
        if gains is None and entry.law == "pd":
            raise InputError("margins of gains in N/m need an inertia, which is not given")
        (kp, *_), (kd, *_), (ki, *_) = rows = (gains or self.gains).rows
        if any(len(set(row)) > 1 for row in rows):
            all_ = "three" if len(rows[0]) == 3 else str(len(rows[0]))
            raise InputError(f"the margins of one axis need gains that are equal for all {all_}")
        period, delay = self.entry.period, self.entry.plant.delay or 0
        cut_off = None if entry.speeds == "measured" else entry.cut_off or 100.0
        return loop_margins(kp, kd, ki, period=period, delay=delay, cut_off=cut_off)


@refuses_other_kinds
def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Read a scenario; file names in it are relative to its folder.

    Raises
    ------
    InputError
        If the file cannot be read or does not describe a scenario; with the line.
    RPSPinError
        If the robot or the trajectory cannot be made.
    """
    file = read_yaml(path, "scenario file")
    folder = Path(path).parent
    if "mechanism" in file.values:
        return _of_mechanism(file, folder)
    entry = _entry(file, ScenarioEntry, validated)
    with file.at("robot"):
        nominal = load_robot(entry.robot, folder)
        nominal.parameters.require_bodies()
    _check_drives(file, entry)
    model = _changed(file, nominal, entry.controller.model, ("controller", "model"))
    machine = _changed(file, nominal, entry.plant, ("plant",))
    if entry.plant.payload is not None:
        machine = machine.with_payload(Payload(entry.plant.payload))
    if isinstance(entry.trajectory, str):
        trajectory = load_trajectory(folder / entry.trajectory, nominal)
    else:
        trajectory = described_trajectory(file.part("trajectory"), folder, nominal)
    gains = _gains(entry, model, trajectory)
    return Scenario(entry, model, machine, trajectory, gains, _faults(file, entry, 3, 3))


def _entry(
    file: YamlFile, schema: type[Schema], validated_trajectory: Callable[[YamlFile], object]
) -> Schema:
    """Return what a file holds, or tell its faults and those of its trajectory at once."""
    faults = Faults(file.origin)
    with faults:
        entry = file.validated(schema, "a scenario")
    if isinstance(file.values.get("trajectory"), Mapping):
        with faults:
            validated_trajectory(file.part("trajectory"))
    faults.tell()
    return entry


def _of_mechanism(file: YamlFile, folder: Path) -> Scenario:
    """Return the scenario of a mechanism with a task."""
    refuse_parameters(file, folder)
    entry = _entry(file, TaskScenarioEntry, validated_task_trajectory)
    nominal = task_of_file(file, folder, entry.mechanism)
    _check_drives(file, entry)
    model = changed(nominal, entry.controller.model.masses)
    machine = changed(nominal, entry.plant.masses)
    trajectory = task_trajectory(file, folder, nominal)
    actuators = nominal.mechanism.actuated_indices.size
    with file.at("controller"):
        gains = _gains(entry, model, trajectory).of(nominal.size)
    return Scenario(
        entry, model, machine, trajectory, gains, _faults(file, entry, actuators, nominal.size)
    )


def _check_drives(file: YamlFile, entry: ScenarioEntry | TaskScenarioEntry) -> None:
    """Raise `InputError` unless the law and the plant's drives go together."""
    given, drives = entry.controller, entry.plant.drives
    if drives is None and given.law == "drives":
        with file.at("controller", "law"):
            raise InputError("law: drives is for a plant with drives; give plant.drives")
    if drives is not None and given.law != "drives":
        with file.at("plant", "drives"):
            raise InputError(
                f"drives take positions or speeds, and law: {given.law} commands forces; give "
                "controller: {law: drives}"
            )
    if drives is not None and drives.command == "position":
        for name in ("bandwidth", "gains"):
            if getattr(given, name) is not None:
                with file.at("controller", name):
                    raise InputError(f"{name} is for drives that take speeds")


def _faults(
    file: YamlFile, entry: ScenarioEntry | TaskScenarioEntry, actuators: int, coordinates: int
) -> tuple[Fault, ...]:
    faults = []
    for number, one in enumerate(entry.faults):
        with file.at("faults", number):
            faults.append(Fault(**one.model_dump(exclude_none=True)))
            faults[-1].check(actuators, coordinates)
    return tuple(faults)


def _changed(
    file: YamlFile, nominal: RPSRobot, machine: Machine, path: tuple[str, ...]
) -> RPSRobot:
    changes = machine.model_dump(exclude=_OF_PLANT, exclude_none=True)
    with file.at(*path):
        return RPSRobot(wrong_parameters(nominal.parameters, **changes))


def _placed(entry: ScenarioEntry | TaskScenarioEntry) -> Gains | None:
    """Return the gains placed by a bandwidth, which command accelerations."""
    given = entry.controller
    if given.bandwidth is None:
        return None
    settings = given.model_dump(include={"damping", "integral"}, exclude_none=True)
    return Gains.placed(given.bandwidth, **settings)


def _gains(
    entry: ScenarioEntry | TaskScenarioEntry, model: RPSRobot | Task, trajectory: Trajectory
) -> Gains:
    given, placed = entry.controller, _placed(entry)
    if given.law == "drives" and given.gains is None:
        return Gains(2 * math.pi * (given.bandwidth or 0.0), 0.0)
    if placed is None:
        assert given.gains is not None  # by the schema
        return Gains(**given.gains.model_dump())
    if given.law == "computed_torque":
        return placed
    space = given.space or "actuator"
    return placed.times(effective_inertia(model, trajectory.sample(0.0).pose, space=space))
