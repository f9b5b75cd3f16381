"""A controller against a plant, tick by tick, and all that happened as arrays."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.simulation.faults import Fault, Faults
from rps_pin.control.simulation.plant import Plant
from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.rps.parameters import RPSParameters
from rps_pin.trajectories.path import Trajectory

Speeds = Literal["filtered", "measured"]

#: How often `progress` is called, about.
_PROGRESS_CALLS = 200
_MOST_EVENTS = 1000


class LoopEvent(NamedTuple):
    """A status that is another than a tick before."""

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
        Of the robot as the controller believes it to be.
    time : (n,) array
        Of each tick, s.
    target, target_rate : (n, 3) arrays
        The trajectory's pose and rate (not what faults made of them), at its pace: m, rad, rad and
        per second.
    pace : (n,) array
        Of the target after each tick: `Controller.pace`.
    pose, rate : (n, 3) arrays
        The plant's true ones.
    configuration : (n, 13) array
        The plant's.
    reading : (n, 3) array
        Lengths that reached the controller, m; NaN where none did.
    length : (n, 3) array
        True lengths, m.
    estimate : (n, 3) array
        The pose as the controller knew it.
    command, applied : (n, 3) arrays
        Forces sent, and forces of the actuators until the next tick, N.
    status : (n,) array of int
        `Status` of each tick.
    distance : (n,) array
        To a singularity as the controller knew it: `RealTimeRobot.distance`.
    gap : (n,) array
        Largest gap of the plant's loops, m.
    events : tuple of LoopEvent
        The changes of the status, in words; the first thousand.
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
    distance: Array
    pace: Array
    gap: Array
    events: tuple[LoopEvent, ...]


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
    """Return what a controller makes of a plant along a trajectory.

    Parameters
    ----------
    controller
        As it is: `reset` it first if it has run.
    plant
        Likewise; its period must be the controller's.
    trajectory
        Targets.
    faults
        See `Fault`; their times count from the start of the run.
    duration
        s; that of `settle` and trajectory if left out. After the trajectory its end is held, at
        rest.
    settle
        For how long the trajectory's start is held, at rest, before it begins, s.
    speeds
        ``"filtered"``: the controller has lengths alone. ``"measured"``: it has true speeds too.
    paced
        Whether targets go on at the controller's pace (see `PacedTrajectory`); the run then ends
        `duration` after its start all the same.
    progress
        Called with the fraction done, 0 to 1, about two hundred times.

    Returns
    -------
    LoopRun
        The motion. Where it breaks off, the ticks until then are in the error's attribute
        ``partial``: of the plant's errors, and of whatever else passes through, Ctrl-C too.

    Raises
    ------
    InputError
        If an argument does not fit.
    RPSPinError
        If the plant's motion is not determined any more.
    """
    if plant.period != controller.period:
        raise InputError(
            f"the plant's period is {plant.period} s, the controller's {controller.period} s"
        )
    if speeds not in ("filtered", "measured"):
        raise InputError(f"speeds = {speeds!r}; it must be 'filtered' or 'measured'")
    whole = settle + trajectory.duration if duration is None else duration
    if not 0.0 < whole < np.inf:
        raise InputError(f"duration = {whole}: it must be positive and finite")
    ticks = max(1, round(whole / plant.period))
    record = _Record(controller, ticks)
    targets = PacedTrajectory(trajectory, plant.period, settle=settle)
    spoilt, done = Faults(faults), 0
    try:
        for k in range(ticks):
            time = k * plant.period
            reading = spoilt.reading(time, plant.reading())
            target = targets.target()
            speed = plant.speed if speeds == "measured" and reading is not None else None
            controller.tick(reading, spoilt.target(time, target), speed)
            record.before(k, time, target, reading, plant)
            plant.step(controller.forces)
            record.applied[k] = plant.applied
            targets.advance(controller.pace if paced else 1.0)
            done = k + 1
            if progress and (done * _PROGRESS_CALLS) % ticks < _PROGRESS_CALLS:
                progress(done / ticks)
    except BaseException as error:
        vars(error)["partial"] = record.run(done)
        raise
    return record.run(done)


class _Record:
    """Arrays that a run fills, allocated before it."""

    def __init__(self, controller: Controller, ticks: int) -> None:
        self._controller = controller
        self._rows = {
            name: np.zeros((ticks, width))
            for name, width in (
                *(("target", 3), ("target_rate", 3), ("pose", 3), ("rate", 3)),
                *(("configuration", 13), ("reading", 3), ("length", 3), ("estimate", 3)),
                *(("command", 3), ("applied", 3)),
            )
        }
        self._numbers = {name: np.zeros(ticks) for name in ("time", "distance", "pace", "gap")}
        self._status = np.zeros(ticks, dtype=np.int64)
        self._events: list[LoopEvent] = []
        self._ticks: list[int] = []
        self._last = 0
        self.applied = self._rows["applied"]

    def before(
        self,
        k: int,
        time: float,
        target: tuple[Array, Array, Array],
        reading: Array | None,
        plant: Plant,
    ) -> None:
        """Note a tick before the plant moves on."""
        controller, rows, numbers = self._controller, self._rows, self._numbers
        rows["target"][k], rows["target_rate"][k], _ = target
        rows["pose"][k], rows["rate"][k] = plant.pose, plant.rate
        rows["configuration"][k], rows["length"][k] = plant.configuration, plant.length
        rows["reading"][k] = np.nan if reading is None else reading
        rows["estimate"][k] = controller.estimate.answers.pose
        rows["command"][k] = controller.forces
        numbers["time"][k], numbers["gap"][k] = time, plant.gap
        numbers["distance"][k] = controller.estimate.distance
        numbers["pace"][k] = controller.pace
        self._status[k] = status = int(controller.status)
        if status != self._last and len(self._events) < _MOST_EVENTS:
            self._events.append(LoopEvent(time, status, controller.status_text))
            self._ticks.append(k)
        self._last = status

    def run(self, ticks: int) -> LoopRun:
        """Return the first ticks."""
        return LoopRun(
            parameters=self._controller.robot.parameters,
            status=self._status[:ticks],
            events=tuple(self._events[: bisect_left(self._ticks, ticks)]),
            **{name: rows[:ticks] for name, rows in (self._rows | self._numbers).items()},
        )


def write_loop_csv(path: str | os.PathLike[str], run: LoopRun) -> None:
    """Write a run as CSV, a row for each tick, units in the header.

    Parameters
    ----------
    path
        The file; it appears whole or not at all.
    run
        The run.
    """
    poses = ("z_m", "tilt_x_rad", "tilt_y_rad")
    columns: list[tuple[list[str], Any]] = [(["time_s"], run.time[:, None])]
    for name, rows in (
        ("target", run.target),
        ("pose", run.pose),
        ("estimate", run.estimate),
    ):
        columns.append(([f"{name}_{pose}" for pose in poses], rows))
    for name, unit, rows in (
        ("reading", "m", run.reading),
        ("length", "m", run.length),
        ("command", "N", run.command),
        ("applied", "N", run.applied),
    ):
        columns.append(([f"{name}_{leg}_{unit}" for leg in (1, 2, 3)], rows))
    columns.append((["distance", "status"], np.column_stack([run.distance, run.status])))
    header = ",".join(name for names, _ in columns for name in names)
    table = np.hstack([rows for _, rows in columns])
    with whole_file(path) as scratch:
        np.savetxt(scratch, table, fmt="%.12g", delimiter=",", header=header, comments="")
