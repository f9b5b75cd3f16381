"""Simulation of a controller with a plant, tick by tick, and the recorded run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array
from rps_pin.bounds import TICKS, check_size
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.robots import task_of
from rps_pin.control.simulation.faults import Fault, Faults
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.task import Task
from rps_pin.trajectories.csv_columns import table_in_degrees
from rps_pin.trajectories.path import PathSample, Trajectory
from rps_pin.validation import choice, positive_number

Speeds = Literal["filtered", "measured"]

#: Approximate number of calls of `progress`.
_PROGRESS_CALLS = 200
_MOST_EVENTS = 1000


class LoopEvent(NamedTuple):
    """A change of the status."""

    time: float
    """s."""
    status: int
    """A `Status`."""
    text: str
    """`Controller.status_text`."""


@dataclass(frozen=True, eq=False)
class LoopRun:
    """A controlled motion; n ticks. Of a task with m coordinates where it says 3, na actuators.

    Attributes
    ----------
    parameters : RPSParameters or None
        Of the controller's model, if that is a 3-RPS.
    task : Task or None
        Of the controller's model, if that is not a 3-RPS.
    commanded : str
        What the command is: ``"force"``, ``"position"`` or ``"speed"``.
    time : (n,) array
        Of each tick, s.
    target, target_rate : (n, 3) arrays
        Pose and rate of the trajectory at its pace, without faults: m, rad, rad and per second.
    pace : (n,) array
        `Controller.pace` after each tick.
    pose, rate : (n, 3) arrays
        The plant's true ones.
    configuration : (n, nq) array
        The plant's.
    reading : (n, 3) array
        Lengths that reached the controller, m; NaN where a reading was lost.
    length : (n, 3) array
        True lengths, m.
    estimate : (n, 3) array
        The controller's estimate of the pose.
    command, applied : (n, 3) arrays
        Forces commanded, and forces of the actuators until the next tick, N. Of drives that take
        positions or speeds, `command` is in m or rad, or per second.
    status : (n,) array of int
        `Status` of each tick.
    type_ii : (n,) array
        `SingularityMeasures.type_ii` of the estimated pose: `RealTimeRobot.type_ii`.
    gap : (n,) array
        Largest gap of the plant's loops, m.
    events : tuple of LoopEvent
        Changes of the status, at most a thousand.
    """

    parameters: RPSParameters | None
    time: Array
    target: Array
    target_rate: Array
    pose: Array
    rate: Array
    configuration: Array
    reading: Array
    length: Array
    estimate: Array
    command: Array
    applied: Array
    status: NDArray[np.int64]
    type_ii: Array
    pace: Array
    gap: Array
    events: tuple[LoopEvent, ...]
    task: Task | None = None
    commanded: str = "force"

    @property
    def of_pose(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each coordinate."""
        if self.task is None:
            return (("z", "m"), ("tilt_x", "rad"), ("tilt_y", "rad"))
        return tuple(zip(self.task.coordinates, _units(self.task.angular), strict=True))

    @property
    def of_actuators(self) -> tuple[tuple[str, str, str], ...]:
        """Name of each actuator, with the units of its position and of its force."""
        if self.task is None:
            return (("1", "m", "N"), ("2", "m", "N"), ("3", "m", "N"))
        mechanism = self.task.mechanism
        turning = mechanism.angular_velocities[mechanism.actuated_indices].tolist()
        forces = ("N m" if one else "N" for one in turning)
        return tuple(zip(mechanism.actuated, _units(turning), forces, strict=True))

    @property
    def distance(self) -> Array:
        """Deprecated name of `type_ii`."""
        return self.type_ii


@refuses_other_kinds
def run_loop(
    controller: Controller,
    plant: Plant,
    trajectory: Trajectory,
    *,
    faults: Iterable[Fault] = (),
    duration: float | None = None,
    settle: float = 0.0,
    speeds: Speeds = "filtered",
    paced: bool = False,
    progress: Callable[[float], object] | None = None,
) -> LoopRun:
    """Return the run of a controller with a plant along a trajectory.

    Parameters
    ----------
    controller
        In its present state: `reset` it first if it has run.
    plant
        Likewise; its period must be the controller's.
    trajectory
        Targets.
    faults
        See `Fault`; times count from the start of the run.
    duration
        s; default: that of `settle` and trajectory. After the trajectory its end is held at rest.
    settle
        Time for which the trajectory's first pose is held at rest before the start, s.
    speeds
        ``"filtered"``: the controller reads lengths only. ``"measured"``: also the true speeds.
    paced
        Whether targets follow the controller's pace (see `PacedTrajectory`); the run ends after
        `duration` all the same.
    progress
        Called with the fraction done, 0 to 1, about two hundred times.

    Returns
    -------
    LoopRun
        The motion. After an error, of the plant or any other including Ctrl-C, the ticks until then
        are in the error's attribute ``partial``.

    Raises
    ------
    InputError
        If an argument is out of range.
    RPSPinError
        If the plant's motion is no longer determined.
    """
    if plant.period != controller.period:
        raise InputError(
            f"the plant's period is {plant.period} s, the controller's {controller.period} s"
        )
    choice(speeds, "speeds", get_args(Speeds))
    total = settle + trajectory.duration if duration is None else duration
    wanted = positive_number(total, "duration", "s") / plant.period
    check_size(wanted, TICKS, f"duration / period = {wanted:.3g} ticks")
    ticks = max(1, round(wanted))
    targets = PacedTrajectory(trajectory, plant.period, settle=settle)
    record = _Record(controller, plant, targets.target(), ticks)
    injected, done = Faults(faults), 0
    for fault in injected.faults:
        fault.check(plant.length.size, plant.pose.size)
    try:
        for k in range(ticks):
            time = k * plant.period
            reading = injected.reading(time, plant.reading())
            target = targets.target()
            speed = plant.speed if speeds == "measured" and reading is not None else None
            controller.tick(reading, injected.target(time, target), speed)
            record.add(k, time, target, reading)
            plant.step(controller.forces)
            record.rows["applied"][k] = plant.applied
            targets.advance(controller.pace if paced else 1.0)
            done = k + 1
            if progress and (done * _PROGRESS_CALLS) % ticks < _PROGRESS_CALLS:
                progress(done / ticks)
    except BaseException as error:
        vars(error)["partial"] = record.run(done)
        raise
    return record.run(done)


class _Record:
    """Arrays of a run, allocated before it."""

    def __init__(self, controller: Controller, plant: Plant, first: PathSample, ticks: int) -> None:
        self._controller, self._plant = controller, plant
        self.rows = {
            name: np.zeros((ticks, *np.shape(value)), np.asarray(value).dtype)
            for name, value in self._values(0.0, first, None).items()
        }
        self._events: list[tuple[int, LoopEvent]] = []
        self._last = 0

    def add(self, k: int, time: float, target: PathSample, reading: Array | None) -> None:
        """Record a tick before the plant moves on."""
        for name, value in self._values(time, target, reading).items():
            self.rows[name][k] = value
        status = int(self._controller.status)
        if status != self._last and len(self._events) < _MOST_EVENTS:
            self._events.append((k, LoopEvent(time, status, self._controller.status_text)))
        self._last = status

    def _values(self, time: float, target: PathSample, reading: Array | None) -> dict[str, Any]:
        """Return the fields of `LoopRun` in one tick."""
        controller, plant = self._controller, self._plant
        return {
            "time": time,
            "target": target.pose,
            "target_rate": target.rate,
            "pose": plant.pose,
            "rate": plant.rate,
            "configuration": plant.configuration,
            "reading": np.full_like(plant.length, np.nan) if reading is None else reading,
            "length": plant.length,
            "estimate": controller.estimate.answers.pose,
            "command": controller.forces,
            "applied": plant.applied,
            "status": int(controller.status),
            "type_ii": controller.estimate.type_ii,
            "pace": controller.pace,
            "gap": plant.gap,
        }

    def run(self, ticks: int) -> LoopRun:
        """Return the first ticks."""
        events = tuple(event for k, event in self._events if k < ticks)
        rows: dict[str, Any] = {name: rows[:ticks] for name, rows in self.rows.items()}
        robot = self._controller.robot
        commanded = getattr(self._controller, "command", "force")
        if isinstance(robot, RPSRobot):
            return LoopRun(robot.parameters, events=events, commanded=commanded, **rows)
        return LoopRun(None, events=events, task=task_of(robot), commanded=commanded, **rows)


def columns_of(coordinates: int, actuators: int) -> int:
    """Return the number of columns of the table that `write_loop_csv` writes."""
    return 3 + 3 * coordinates + 4 * actuators


def _units(angular: Iterable[bool]) -> tuple[str, ...]:
    return tuple("rad" if one else "m" for one in angular)


@refuses_other_kinds
def write_loop_csv(path: str | os.PathLike[str], run: LoopRun, *, degrees: bool = False) -> None:
    """Write a run as CSV, one row per tick, with units in the header.

    Parameters
    ----------
    path
        The file; it is written completely or not at all.
    run
        The run.
    degrees
        Whether angles are written in degrees; else in radians.
    """
    columns = {"time_s": run.time}
    for name in ("target", "pose", "estimate"):
        axes = (f"{name}_{axis}_{unit}" for axis, unit in run.of_pose)
        columns |= zip(axes, getattr(run, name).T, strict=True)
    per = "_per_s" if run.commanded == "speed" else ""
    of_command = 2 if run.commanded == "force" else 1
    for name, which, more in (
        *(("reading", 1, ""), ("length", 1, "")),
        *(("command", of_command, per), ("applied", 2, "")),
    ):
        legs = (f"{name}_{one[0]}_{one[which].replace(' ', '')}{more}" for one in run.of_actuators)
        columns |= zip(legs, getattr(run, name).T, strict=True)
    table = np.column_stack([*columns.values(), run.type_ii, run.status])
    names = [*columns, "type_ii", "status"]
    if degrees:
        names, table = table_in_degrees(names, table)
    with whole_file(path) as scratch:
        header = ",".join(names)
        np.savetxt(scratch, table, fmt="%.12g", delimiter=",", header=header, comments="")
