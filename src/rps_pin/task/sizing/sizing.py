"""Sizing: demands of a motion of a task on the actuators and on every joint.

`rps_pin.task.sizing.actuator_sizing` has the demands on the actuators, and
`rps_pin.task.sizing.sizing_sheet` the sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from rich.table import Table
from rich.text import Text

from rps_pin.arrays import Array
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.paths.signals import UNLIMITED
from rps_pin.task.sizing.actuator_sizing import UNITS, checked_time, samples, size_actuators
from rps_pin.task.sizing.motion_run import TaskMotion, run_motion, solved
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, DriveLimits, SizingSheet
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory

#: Loads of this share of the largest are rounding errors.
_ROUNDING = 1e-12


class JointLoad(NamedTuple):
    """The largest loads of a joint, or of a closure, in a motion."""

    name: str
    kind: str
    """``"joint"`` or ``"closure"``."""
    force_peak: float
    """Largest force, N."""
    force_time: float
    """When, s."""
    moment_peak: float
    """Largest moment about the joint's origin, N m."""
    moment_time: float
    """When, s."""


@dataclass(frozen=True)
class TaskSizing(SizingSheet):
    """A motion's demands on a mechanism: on its actuators, and on every joint."""

    motion: TaskMotion
    """Everything computed along it."""
    joints: tuple[JointLoad, ...]
    """The largest loads of all joints and closures; for each sample, see `motion`."""

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, strings, lists and dictionaries, as JSON has them."""
        return super().as_dict() | {"joints": [one._asdict() for one in self.joints]}

    def table(self) -> Table:
        """Return the sheet as a table for a terminal, a row for each actuator."""
        force, speed, _ = self._units()
        headings = f"peak force ({force})", f"RMS force ({force})", f"peak speed ({speed})"
        table = _table("Actuator sizing", *headings, "peak power (W)", "limits")
        for one in self.actuators:
            numbers = one.force_peak, one.force_rms, one.speed_peak, one.power_peak
            broken = [margin.quantity for margin in one.margins if not margin.kept]
            limits = Text(f"BROKEN: {', '.join(broken)}", style="bold red") if broken else "kept"
            table.add_row(one.name, *(f"{value:.4g}" for value in numbers), limits)
        return table

    def tables(self) -> tuple[Table, ...]:
        """Return the tables for a terminal: actuators, their energies, joints."""
        return self.table(), self.energy_table(), self.joint_table()

    def energy_table(self) -> Table:
        """Return energies and strokes as a table for a terminal, a row for each actuator."""
        headings = "driven (J)", "regenerated (J)", f"stroke ({self._units()[2]})"
        table = _table("Energy and stroke", *headings)
        for one in self.actuators:
            numbers = one.energy_driven, one.energy_regenerated, one.stroke
            table.add_row(one.name, *(f"{value:.4g}" for value in numbers))
        return table

    def joint_table(self) -> Table:
        """Return the loads of the joints as a table for a terminal."""
        headings = "peak force (N)", "at (s)", "peak moment (N m)", "at (s)"
        table = _table("Joint loads", *headings)
        numbers = np.array([one[2:] for one in self.joints], dtype=np.float64).reshape(-1, 4)
        numbers[numbers < _ROUNDING * numbers.max(axis=0, initial=0.0)] = 0.0
        for one, row in zip(self.joints, numbers.tolist(), strict=True):
            table.add_row(one.name, *(f"{value:.4g}" for value in row))
        return table

    def _units(self) -> tuple[str, ...]:
        """Return the units of the actuators' forces, speeds and positions."""
        turning = sorted({actuator.angular for actuator in self.actuators})
        unit = self.actuators[0].angle_unit
        return tuple(
            ", ".join(UNITS[int(turns)][k] for turns in turning).replace("rad", unit)
            for k in range(3)
        )


def _table(title: str, *headings: str) -> Table:
    """Return an empty table with a first column of names, units below the other headings.

    Where a terminal is too small for it, it folds cells rather than cut numbers off.
    """
    table = Table(title=title)
    table.add_column("", overflow="fold")
    for heading in headings:
        table.add_column(heading.replace(" (", "\n("), justify="right", overflow="fold")
    return table


@refuses_other_kinds
def size_trajectory(
    task: Task,
    trajectory: Trajectory,
    sample_rate: float = 1000.0,
    *,
    near: ArrayLike | None = None,
    limits: ActuatorLimits | Sequence[ActuatorLimits] | None = None,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    threshold: float = 0.5,
) -> TaskSizing:
    """Return the demands of a trajectory of a task on the actuators and the joints.

    Parameters
    ----------
    task
        The task; a compiled one is followed in a fraction of the time.
    trajectory
        Of the task's coordinates; anything with ``duration`` and ``sample(t)``.
    sample_rate
        Hz.
    near
        Closed configuration whose assembly mode the motion begins in, shape (nq,); home if left
        out.
    limits
        Limits of all actuators, or of each; those of the mechanism's model if left out (limits of
        1e6 or more are none).
    payload, wrench
        Fixed to, and exerted on, the output frame: see `Loads`.
    threshold
        Share of the peak force that counts for the duty.

    Raises
    ------
    InputError
        If a number is not usable.
    UnreachableError, SingularityError
        If a joint leaves its limits, or the path meets a singularity; says when.
    """
    motion = run_motion(task, trajectory, sample_rate, near=near, payload=payload, wrench=wrench)
    return sheet_of(task, motion, limits, threshold)


@refuses_other_kinds
def size_motion(
    task: Task,
    time: ArrayLike,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    near: ArrayLike | None = None,
    limits: ActuatorLimits | Sequence[ActuatorLimits] | None = None,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    threshold: float = 0.5,
) -> TaskSizing:
    """Return the demands of a sampled motion of a task.

    Parameters
    ----------
    task, near, limits, payload, wrench, threshold
        As for `size_trajectory`.
    time
        Increasing, shape (n,), s.
    pose, rate, acceleration
        Shape (n, m) each.

    Raises
    ------
    InputError, ClosureError, SingularityError
        As `size_trajectory`; samples that cannot be reached, within limits, by their number.
    """
    loads = Loads(task, payload, wrench)
    times = checked_time(time)
    given = {"pose": pose, "rate": rate, "acceleration": acceleration}
    x, dx, ddx = (samples(one, name, len(times), task.size) for name, one in given.items())
    loads.refuse_other_count(len(times))
    state = task.motion(task.follow(x, near), dx, ddx, x=x)
    motion = solved(task, times, (x, dx, ddx), state, loads, None)
    return sheet_of(task, motion, limits, threshold)


def sheet_of(
    task: Task,
    motion: TaskMotion,
    limits: ActuatorLimits | Sequence[ActuatorLimits] | None = None,
    threshold: float = 0.5,
) -> TaskSizing:
    """Return the sheet of a motion that is computed; see `size_trajectory`."""
    given = limits_of(task) if limits is None else limits
    angular = task.mechanism.angular_velocities[task.mechanism.actuated_indices]
    sheet = size_actuators(
        motion.time,
        motion.force,
        motion.speed,
        motion.position,
        given,
        threshold,
        names=task.mechanism.actuated,
        angular=[bool(one) for one in angular],
    )
    joints = [
        _load(name, kind, wrench, motion.time)
        for kind, found in (("joint", motion.joint_wrenches), ("closure", motion.closure_wrenches))
        for name, wrench in found.items()
    ]
    whole = {field.name: getattr(sheet, field.name) for field in fields(sheet)}
    return TaskSizing(**whole, motion=motion, joints=tuple(joints))


def limits_of(task: Task) -> tuple[DriveLimits, ...]:
    """Return the limits that a task's mechanism has of its actuators; of power it has none."""
    model, actuated = task.mechanism.model, task.mechanism.actuated_indices
    positions = task.of_actuators

    def of(values: Array, where: int) -> float:
        value = float(values[where])
        return value if value < UNLIMITED else np.inf

    return tuple(
        DriveLimits(
            of(model.effortLimit, iv),
            of(model.velocityLimit, iv),
            length=(float(model.lowerPositionLimit[iq]), float(model.upperPositionLimit[iq])),
        )
        for iq, iv in zip(positions, actuated, strict=True)
    )


def _load(name: str, kind: str, wrench: Array, time: Array) -> JointLoad:
    force, moment = (np.linalg.norm(wrench[:, part], axis=-1) for part in (slice(3), slice(3, 6)))
    f, m = int(force.argmax()), int(moment.argmax())
    return JointLoad(
        name, kind, float(force[f]), float(time[f]), float(moment[m]), float(time[m])
    )  # fmt: skip
