"""Simulation of a controller with a plant, tick by tick, and the recorded run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.simulation.faults import Fault, Faults
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.rps.parameters import RPSParameters
from rps_pin.trajectories.path import PathSample, Trajectory
from rps_pin.validation import choice, positive_number

Speeds = Literal["filtered", "measured"]

#: Approximate number of calls of `progress`.
_PROGRESS_CALLS = 200
_MOST_EVENTS = 1000
_ROWS = (
    *("target", "target_rate", "pose", "rate", "reading", "length", "estimate", "command"),
    "applied",
)


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
    """A controlled motion; n ticks.

    Attributes
    ----------
    parameters : RPSParameters
        Of the controller's model.
    time : (n,) array
        Of each tick, s.
    target, target_rate : (n, 3) arrays
        Pose and rate of the trajectory at its pace, without faults: m, rad, rad and per second.
    pace : (n,) array
        `Controller.pace` after each tick.
    pose, rate : (n, 3) arrays
        The plant's true ones.
    configuration : (n, 13) array
        The plant's.
    reading : (n, 3) array
        Lengths that reached the controller, m; NaN where a reading was lost.
    length : (n, 3) array
        True lengths, m.
    estimate : (n, 3) array
        The controller's estimate of the pose.
    command, applied : (n, 3) arrays
        Forces commanded, and forces of the actuators until the next tick, N.
    status : (n,) array of int
        `Status` of each tick.
    type_ii : (n,) array
        `SingularityMeasures.type_ii` of the estimated pose: `RealTimeRobot.type_ii`.
    gap : (n,) array
        Largest gap of the plant's loops, m.
    events : tuple of LoopEvent
        Changes of the status, at most a thousand.
    """

    parameters: RPSParameters
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

    @property
    def distance(self) -> Array:
        """Deprecated name of `type_ii`."""
        return self.type_ii


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
    ticks = max(1, round(positive_number(total, "duration", "s") / plant.period))
    targets = PacedTrajectory(trajectory, plant.period, settle=settle)
    record = _Record(controller, ticks)
    injected, done = Faults(faults), 0
    try:
        for k in range(ticks):
            time = k * plant.period
            reading = injected.reading(time, plant.reading())
            target = targets.target()
            speed = plant.speed if speeds == "measured" and reading is not None else None
            controller.tick(reading, injected.target(time, target), speed)
            record.add(k, time, target, reading, plant)
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

    def __init__(self, controller: Controller, ticks: int) -> None:
        self._controller = controller
        self.rows: dict[str, Array] = {name: np.zeros((ticks, 3)) for name in _ROWS}
        self.rows["configuration"] = np.zeros((ticks, 13))
        self.rows |= {name: np.zeros(ticks) for name in ("time", "type_ii", "pace", "gap")}
        self._status = np.zeros(ticks, dtype=np.int64)
        self._events: list[tuple[int, LoopEvent]] = []
        self._last = 0

    def add(
        self, k: int, time: float, target: PathSample, reading: Array | None, plant: Plant
    ) -> None:
        """Record a tick before the plant moves on."""
        controller, estimate = self._controller, self._controller.estimate
        values: dict[str, ArrayLike] = {
            "time": time,
            "target": target.pose,
            "target_rate": target.rate,
            "pose": plant.pose,
            "rate": plant.rate,
            "configuration": plant.configuration,
            "reading": np.nan if reading is None else reading,
            "length": plant.length,
            "estimate": estimate.answers.pose,
            "command": controller.forces,
            "type_ii": estimate.type_ii,
            "pace": controller.pace,
            "gap": plant.gap,
        }
        for name, value in values.items():
            self.rows[name][k] = value
        self._status[k] = status = int(controller.status)
        if status != self._last and len(self._events) < _MOST_EVENTS:
            self._events.append((k, LoopEvent(time, status, controller.status_text)))
        self._last = status

    def run(self, ticks: int) -> LoopRun:
        """Return the first ticks."""
        return LoopRun(
            parameters=self._controller.robot.parameters,
            status=self._status[:ticks],
            events=tuple(event for k, event in self._events if k < ticks),
            **{name: rows[:ticks] for name, rows in self.rows.items()},
        )


def write_loop_csv(path: str | os.PathLike[str], run: LoopRun) -> None:
    """Write a run as CSV, one row per tick, with units in the header.

    Parameters
    ----------
    path
        The file; it is written completely or not at all.
    run
        The run.
    """
    names, rows = ["time_s"], [run.time[:, None]]
    for name in ("target", "pose", "estimate"):
        names += [f"{name}_{axis}" for axis in ("z_m", "tilt_x_rad", "tilt_y_rad")]
        rows.append(getattr(run, name))
    for name, unit in (("reading", "m"), ("length", "m"), ("command", "N"), ("applied", "N")):
        names += [f"{name}_{leg}_{unit}" for leg in (1, 2, 3)]
        rows.append(getattr(run, name))
    names += ["type_ii", "status"]
    table = np.hstack([*rows, np.column_stack([run.type_ii, run.status])])
    with whole_file(path) as scratch:
        header = ",".join(names)
        np.savetxt(scratch, table, fmt="%.12g", delimiter=",", header=header, comments="")
