"""Panel of a mechanism, without a front end: sliders, a handle, a trajectory, readings."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError, RPSPinError
from rps_pin.panel.frame_handle import FrameHandle
from rps_pin.panel.recording import Recording
from rps_pin.panel.slider import Slider, quantity, slider_values
from rps_pin.task import Task
from rps_pin.task.maps import TaskState
from rps_pin.task.sizing.motion_run import sample_times
from rps_pin.trajectories.path import Trajectory
from rps_pin.viewer.motion import Motion

_RATE, _MOST_SAMPLES = 100.0, 3000
"""A trajectory is followed at so many samples a second, and at most so many."""
_ROWS = 300
"""Samples of forces and conditioning, at most: a plot is about as many pixels wide."""


class Actuator(NamedTuple):
    """How an actuator is shown."""

    name: str
    scale: float
    """Shown units of its position per SI unit."""
    unit: str
    """Of its position."""
    force_unit: str


class Panel(ABC):
    """Sliders and readings of a mechanism, in SI units; moving it raises nothing.

    What cannot be followed leaves the mechanism where it is, and `trouble` says what was asked and
    why not. Positions beyond limits are followed; `trouble` says which limits are broken, and
    `outside` which joints.

    Attributes
    ----------
    mechanism : ClosedLoopModel
        The mechanism.
    task : Task or None
        Its task.
    groups : dict of str to tuple of Slider
        Sliders that are moved together, by the group's name.
    actuators : tuple of Actuator
        The actuators, in order.
    handle : FrameHandle or None
        The task's frame, which can be dragged; None where the task is none of a frame.
    trouble : list of str
        Sentences: each limit that is broken, and what was not followed.
    outside : frozenset of str
        Joints that break a limit of position or force.
    recording : Recording or None
        The trajectory that was loaded.
    velocity, acceleration : ndarray, shape (nv,)
        Of the moment of the trajectory that is shown; else zero.
    """

    task_group, actuator_group = "task", "joints"

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        task: Task | None,
        actuators: tuple[Actuator, ...],
        q: Array,
    ) -> None:
        self.mechanism, self.task, self.actuators = mechanism, task, actuators
        framed = task is not None and task.frame is not None
        self.handle = FrameHandle(task) if framed and task is not None else None
        self.trouble: list[str] = []
        self.outside: frozenset[str] = frozenset()
        self.recording: Recording | None = None
        self._trajectory: Trajectory | None = None
        model = mechanism.model
        joints = [model.joints[model.getJointId(name)] for name in mechanism.actuated]
        self._actuated = np.array([joint.idx_q for joint in joints])
        self._x: Array | None = None
        self._held: Array | str = ""
        self._take(q)
        self._home = self._q
        self.groups = self._sliders()

    # Moving ---------------------------------------------------------------------------------------

    @property
    def configuration(self) -> Array:
        """Configuration of the mechanism, shape (nq,)."""
        return self._q

    def values(self, group: str = "joints") -> Array:
        """Return the task's coordinates, or the actuators' positions, m or rad."""
        if group == self.task_group and self._x is not None:
            return self._x.copy()
        return self._position.copy()

    def move(self, group: str, values: Any) -> bool:
        """Go where a group's sliders say; return whether the mechanism can."""
        try:
            asked = slider_values(self.groups, group, values)
            if group == self.task_group:
                self._take(self._of_task(asked, self._q), asked)
            else:
                self._take(self._of_actuators(asked))
        except RPSPinError as error:
            return self._refuse(group, values, error)
        return True

    def drag(self, placement: Array) -> bool:
        """Go where the task's frame is at a placement (4, 4) in the world, as far as it can be.

        What is no coordinate of the task does not count.
        """
        if self.handle is None or self._x is None:
            raise InputError("the task has no frame that can be dragged")
        return self.move(self.task_group, self.handle.coordinates(placement, self._q, self._x))

    def home(self) -> None:
        """Go to the first configuration."""
        self._take(self._home)

    def refuse(self, sentence: str) -> None:
        """Say that something was not followed."""
        self.trouble = [*self._limits(), f"not followed: {sentence}"]

    # Trajectories ---------------------------------------------------------------------------------

    def load(self, trajectory: str | os.PathLike[str] | Trajectory) -> Recording:
        """Load a trajectory of the task, for `show`.

        Parameters
        ----------
        trajectory
            A file, CSV or YAML, as ``rps-pin check`` takes it; or a trajectory.

        Returns
        -------
        Recording
            Positions, forces and conditioning along it.

        Raises
        ------
        RPSPinError
            If it cannot be read, does not fit the task, or cannot be followed; says when.
        """
        if isinstance(trajectory, (str, os.PathLike)):
            trajectory = self.read(trajectory)
        self._require_task()
        self.recording = self._recorded(trajectory)
        self._trajectory = trajectory
        return self.recording

    def read(self, path: str | os.PathLike[str]) -> Trajectory:
        """Return the trajectory of a file, as `load` takes it.

        Raises
        ------
        RPSPinError
            As `load`.
        """
        self._require_task()
        return self._read(path)

    def show(self, elapsed: float) -> bool:
        """Go where the trajectory is after `elapsed` seconds, moving as it does.

        Returns whether the mechanism can.
        """
        if self._trajectory is None or self.recording is None:
            raise InputError("no trajectory is loaded")
        time = min(max(elapsed, 0.0), self._trajectory.duration)
        x, rate, acceleration = (row[0] for row in self._trajectory.sample([time]))
        try:
            q = self._of_task(x, self.recording.near(time))
            self._take(q, x, self._moving(q, x, rate, acceleration))
        except RPSPinError as error:
            self.refuse(f"t = {time:.4g} s: {error}")
            return False
        return True

    @property
    def motion(self) -> Motion:
        """The trajectory that was loaded, or the present configuration at rest, to be drawn."""
        model, recording = self.mechanism.model, self.recording
        if recording is None:
            return Motion(model, [0.0], self._q[None])
        return Motion(model, recording.sample_time, recording.configuration, *recording.rates)

    # Readings -------------------------------------------------------------------------------------

    @property
    def position(self) -> Array:
        """Positions of the actuators, shape (na,), m or rad."""
        return self._position

    @property
    def forces(self) -> Array:
        """Forces of the actuators, shape (na,), N or N m; NaN where they are not determined."""
        return np.full(len(self.actuators), np.nan) if isinstance(self._held, str) else self._held

    @property
    def conditioning(self) -> float:
        """1 / condition number of the passive Jacobian: 0 at a singularity, 1 at best."""
        return 1.0 / self.mechanism.condition(self._q)

    def readings(self) -> list[tuple[str, str]]:
        """Return the readings: names and values with units."""
        return [*self.coordinates(), *self.of_actuators(), *self.remarks()]

    @abstractmethod
    def coordinates(self) -> list[tuple[str, str]]:
        """Return readings that the sliders show too."""

    @abstractmethod
    def of_actuators(self) -> list[tuple[str, str]]:
        """Return readings of positions and forces."""

    def remarks(self) -> list[tuple[str, str]]:
        """Return the other readings."""
        words = f"{self.conditioning:.4f} (0 singular, 1 best)"
        found = [("conditioning of the passive joints", words)]
        if isinstance(self._held, str):
            found.append(("forces", self._held))
        return found

    def visual_model(self) -> pin.GeometryModel | None:
        """Return its visual geometry; None for bars between its joints."""
        return None

    # Of each kind of mechanism --------------------------------------------------------------------

    @abstractmethod
    def _sliders(self) -> dict[str, tuple[Slider, ...]]:
        """Return the groups of sliders."""

    @abstractmethod
    def _read(self, path: str | os.PathLike[str]) -> Trajectory:
        """Read a trajectory from a file."""

    @abstractmethod
    def _of_task(self, x: Array, near: Array) -> Array:
        """Return the configuration of task coordinates, in the mode of `near`."""

    @abstractmethod
    def _of_actuators(self, position: Array) -> Array:
        """Return the configuration of actuators' positions, in the present mode."""

    @abstractmethod
    def _moving(self, q: Array, x: Array, rate: Array, acceleration: Array) -> TaskState:
        """Return q, v and a of a moment of a trajectory."""

    @abstractmethod
    def _dynamics(self, state: TaskState) -> Array:
        """Return the actuators' forces in a state."""

    @abstractmethod
    def _broken(self) -> Iterable[tuple[str, str]]:
        """Give a sentence for each limit of position that is broken, and the joint."""

    @abstractmethod
    def _too_weak(self) -> Iterable[tuple[str, str]]:
        """Give a sentence for each actuator that would need too much, and its joint."""

    def _recorded(self, trajectory: Trajectory) -> Recording:
        """Follow a trajectory from home, in its assembly mode, within limits or not."""
        rate = min(_RATE, _MOST_SAMPLES / trajectory.duration)
        times = sample_times(trajectory.duration, rate)
        motion = trajectory.sample(times)
        rows = np.unique(np.linspace(0, len(times) - 1, min(len(times), _ROWS)).astype(int))
        model = self.mechanism.model
        q, v, a = (np.empty((len(times), size)) for size in (model.nq, model.nv, model.nv))
        near = self._home
        for k, (elapsed, x, *rates) in enumerate(zip(times, *motion, strict=True)):
            try:
                near = self._of_task(x, near)
                q[k], v[k], a[k] = self._moving(near, x, *rates)
            except RPSPinError as error:
                error.args = (f"at t = {elapsed:.4g} s: {error}", *error.args[1:])
                raise
        forces = np.full((len(rows), len(self.actuators)), np.nan)
        for row, k in enumerate(rows):
            with suppress(RPSPinError):  # where they are not determined
                forces[row] = self._dynamics(TaskState(q[k], v[k], a[k]))
        condition = np.array([self.mechanism.condition(one) for one in q[rows]])
        position = self._positions(q[rows])
        return Recording(times[rows], position, forces, 1.0 / condition, times, q, (v, a))

    def _require_task(self) -> None:
        if self.task is None:
            raise InputError("a trajectory is one of a task, and this mechanism has none")

    def _take(self, q: Array, x: Array | None = None, state: TaskState | None = None) -> None:
        """Go to a closed configuration, whose task coordinates may be known."""
        still = np.zeros(self.mechanism.model.nv)
        state = TaskState(q, still, still) if state is None else state
        if self.task is not None:
            x = self.task.at(q, near=self._x) if x is None else x.copy()
        try:
            held: Array | str = self._dynamics(state)
        except RPSPinError as error:
            held = str(error)
        self._q, self.velocity, self.acceleration, self._held = q, state.v, state.a, held
        self._x, self._position = x, self._positions(q)
        self.trouble = self._limits()

    def _positions(self, q: Array) -> Array:
        """Return the actuators' positions in configurations (..., nq)."""
        return np.asarray(q[..., self._actuated])

    def _limits(self) -> list[str]:
        """Return a sentence for each limit that is broken, and note the joints."""
        weak = () if isinstance(self._held, str) else self._too_weak()
        found = [*self._broken(), *weak]
        self.outside = frozenset(joint for _, joint in found)
        return [sentence for sentence, _ in found]

    def _refuse(self, group: str, values: Any, error: RPSPinError) -> bool:
        """Say what was asked, of the sliders that were moved, and why it is not followed."""
        said = str(error)
        asked = np.ravel(values) if np.ndim(values) == 1 else np.empty(0)
        if group in self.groups and len(asked) == len(self.groups[group]):
            moved = [
                f"{one.label} {quantity(new, one.scale, one.unit)}"
                for one, new, old in zip(self.groups[group], asked, self.values(group), strict=True)
                if abs(one.scale * (new - old)) > 1e-6 * one.step
                and "beyond its slider" not in said
            ]
            said = f"{', '.join(moved)}: {said}" if moved else said
        self.refuse(said)
        return False
