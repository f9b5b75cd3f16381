"""Signals of a path of a task: what is zero where something goes wrong.

The signals are the measures of singularities of the task (that of type II with the sign of the
determinant), the room to each limit of positions, and, of the actuators, to the limits of speed and
of force. Rates of positions and speeds are exact; those of the measures and of forces are
differences over `_STEP` of the duration.

The configurations are continued along the path, each from the sample before. Where that fails, the
assembly mode ends, in a singularity of type I or of the constraints; its time is bracketed too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import ClosureError, RPSPinError, SingularityError
from rps_pin.plain_text import short
from rps_pin.task.loads import Loads
from rps_pin.task.maps import TaskState
from rps_pin.task.paths.events import SingularityEvent
from rps_pin.task.paths.findings import Signal, checked_samples, checked_times
from rps_pin.task.paths.limits import Cone, ConeRooms
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory

#: Half the step of differences over the path's duration; and on the first samples, one-sided.
_STEP, _FIRST = 1e-5, 1e-7
#: A limit of this size is none: URDF demands one (N, N m, m/s or rad/s).
UNLIMITED = 1e6
#: Forces that do not exist, at a singularity, are beyond every limit, N or N m.
_ENDLESS = 1e15

_KINDS = (Signal("type II"), Signal("constraint"), Signal("type I"))


class TaskSignals:
    """A trajectory of a task as signals of time; `follow` it first."""

    kinds = _KINDS

    def __init__(
        self,
        task: Task,
        trajectory: Trajectory,
        tolerance: float | None,
        *,
        cones: Sequence[Cone] = (),
        loads: Loads | None = None,
        actuators: bool = True,
    ) -> None:
        self.task, self._trajectory = task, trajectory
        self._loads = Loads(task) if loads is None else loads
        self.duration, self.tolerance = checked_times(trajectory, tolerance)
        self.scale = task.scale / task.characteristic_length
        self.end: SingularityEvent | None = None
        self._positions = task.position_limits(), ConeRooms(task.mechanism, cones)
        speeds = _actuators(task, "velocityLimit", "speed", ("m/s", "rad/s"))
        forces = _actuators(task, "effortLimit", "force", ("N", "N m"))
        if not actuators:
            speeds = forces = ()
        self.limits = (*(s for one in self._positions for s in one.signals), *speeds, *forces)
        self._actuated = task.mechanism.actuated_indices
        self._speeds, self._forces = (_sides(task, signals) for signals in (speeds, forces))
        self._times = np.zeros(0)
        self._q = np.zeros((0, task.mechanism.model.nq))

    # Following ------------------------------------------------------------------------------------

    def follow(self, times: Array, near: ArrayLike | None = None) -> Array:
        """Return the times as far as the path can be followed, and where that ends.

        Raises
        ------
        RPSPinError
            If the first pose cannot be reached.
        """
        x = self.sample(times)[0]
        found = [self._begin(x[0], near)]
        for k in range(1, len(times)):
            try:
                found.append(self._continued(x[k], found[-1]))
            except (ClosureError, SingularityError):
                times = self._ending(times[:k], float(times[k]), found)
                break
        self._times, self._q = times, np.array(found)
        return times

    def _begin(self, x: Array, near: ArrayLike | None) -> Array:
        try:
            return self.task.configuration(x, near, within_limits=False)
        except RPSPinError as error:
            error.args = (f"at t = 0 s: {error}", *error.args[1:])
            raise

    def _continued(self, x: Array, near: Array) -> Array:
        return self.task.configuration(x, near, within_limits=False)

    def _ending(self, times: Array, high: float, found: list[Array]) -> Array:
        """Bracket where the assembly mode ends; return the times up to there."""
        low, q = float(times[-1]), found[-1]
        while high - low > self.tolerance and low < (middle := (low + high) / 2) < high:
            try:
                q = self._continued(self.sample(np.array([middle]))[0][0], q)
                low = middle
            except (ClosureError, SingularityError):
                high = middle
        measures = self.task.singularities(q)
        of_rows, of_input = abs(float(measures.constraint)), float(measures.type_i)
        kind = "constraint" if of_rows < of_input else "type I"
        pose = self.sample(np.array([low]))[0][0]
        self.end = SingularityEvent(
            "ends", kind, (low + high) / 2, high - low, pose, min(of_rows, of_input), 0,
            self.where(pose),
        )  # fmt: skip
        if low > times[-1]:
            found.append(q)
            return np.append(times, low)
        if len(times) == 1:
            raise SingularityError(
                f"at t = 0 s the path begins where the assembly mode ends, near a {kind} "
                f"singularity ({self.end.distance:.3g}): it cannot be followed",
                np.inf,
                self.task.mechanism.max_condition,
            )
        return times

    # Signals --------------------------------------------------------------------------------------

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return poses and rates at times (n,), shape (n, m) each, checked."""
        return self._motion(times)[:2]

    def signals(self, times: Array) -> tuple[Array, Array]:
        """Return every signal and its rate at times (n,), shape (n, signals) each."""
        motion = self.state(times)
        rooms, changes = self._exact(*motion)
        values = self._by_differences(motion[2])
        rates = self._differences(times, values)
        return self._ordered(values, rooms), self._ordered(rates, changes)

    def rates(self, times: Array) -> Array:
        """Return the rates alone at times (n,)."""
        return self._ordered(self._differences(times), self._exact(*self.state(times))[1])

    def matters(self, sizes: Array, slopes: Array, steps: Array, threshold: float) -> Bools:
        """Return which turning points may be the nearest to a singularity, or beyond a limit.

        See `lowest`.
        """
        kinds = len(self.kinds)
        near = max(float(np.abs(sizes[:, :kinds]).min()), threshold)
        bound = np.where(np.arange(sizes.shape[1]) < kinds, near, 0.0)
        least = lowest(sizes, slopes, steps)
        return np.asarray((least <= bound) | ~np.isfinite(least))

    def may_jump(self, values: Array) -> Bools:
        """Return False: the path ends before a measure could jump."""
        return np.zeros(len(values), dtype=bool)

    def where(self, pose: Array) -> str:
        """Return a pose in words."""
        return pose_in_words(self.task, pose)

    def states(self) -> tuple[Array, TaskState]:
        """Return the times that were followed, and the motion of all joints there."""
        return self._times, self.state(self._times)[2]

    def _exact(self, pose: Array, rate: Array, state: TaskState) -> tuple[Array, Array]:
        """Return the rooms of positions and speeds and their rates, (n, limits) each."""
        parts = [one.rooms(state.q, state.v, pose, rate) for one in self._positions]
        which, sign, limit = self._speeds
        v, a = (part[:, self._actuated][:, which] for part in (state.v, state.a))
        parts.append((limit - sign * v, -sign * a))
        rooms, changes = (np.concatenate(one, axis=-1) for one in zip(*parts, strict=True))
        return rooms, changes

    def _ordered(self, by_differences: Array, exact: Array) -> Array:
        kinds = len(self.kinds)
        parts = by_differences[:, :kinds], exact, by_differences[:, kinds:]
        return np.concatenate(parts, axis=-1)

    def _differences(self, times: Array, values: Array | None = None) -> Array:
        """Return the rates of what has no exact ones, (n, signals of `_by_differences`)."""
        last = self._times[-1]
        if times is self._times and values is not None:
            step = _FIRST * last
            to = np.where(times + step <= last, times + step, times - step)
            change = self._by_differences(self.state(to)[2]) - values
            return np.asarray(change / (to - times)[:, None])
        before, after = (times + sign * _STEP * last for sign in (-1, 1))
        before, after = before.clip(0.0), after.clip(None, last)
        change = self._by_differences(self.state(after)[2])
        change = change - self._by_differences(self.state(before)[2])
        return np.asarray(change / (after - before)[:, None])

    def _by_differences(self, state: TaskState) -> Array:
        """Return the measures and the rooms of forces, shape (n, 3 + forces)."""
        measures = self.task.singularities(state.q)
        # Where an input moves alone, type II is not determined.
        signed = np.where(np.isnan(measures.type_ii), 1.0, measures.signed_type_ii)
        columns = [signed, measures.constraint, measures.type_i]
        which, sign, limit = self._forces
        if not which.size:
            return np.stack(columns, axis=-1)
        tau = np.empty((len(state.q), self._actuated.size))
        for k, motion in enumerate(zip(*state, strict=True)):
            try:
                tau[k] = self._loads.dynamics(*motion).tau
            except SingularityError:
                tau[k] = np.nan
        room = np.where(np.isnan(tau[:, which]), -_ENDLESS, limit - sign * tau[:, which])
        return np.concatenate([np.stack(columns, axis=-1), room], axis=-1)

    def state(self, times: Array) -> tuple[Array, Array, TaskState]:
        """Return poses, rates, and the motion of all joints at times (n,)."""
        pose, rate, acceleration = self._motion(times)
        if times is self._times:
            q = self._q
        else:
            before = np.searchsorted(self._times, times, side="right") - 1
            q = self.task.configuration(pose, self._q[before], within_limits=False)
        return pose, rate, self.task.motion(q, rate, acceleration, x=pose)

    def _motion(self, times: Array) -> tuple[Array, Array, Array]:
        found, size = self._trajectory.sample(times), self.task.size
        pose, rate, acceleration = (
            checked_samples(getattr(found, name), times, name, size)
            for name in ("pose", "rate", "acceleration")
        )
        return pose, rate, acceleration


def lowest(sizes: Array, slopes: Array, steps: Array) -> Array:
    """Return how far signals may fall in each step, shape (n, signals).

    That is at most four times as far as the cubic with the values and slopes at both ends does; of
    signals' sizes and slopes (n + 1, signals) at samples `steps` (n,) apart, s.
    """
    first, last = sizes[:-1], sizes[1:]
    low, high = slopes[:-1] * steps[:, None], slopes[1:] * steps[:, None]
    s = np.linspace(0.0, 1.0, 33)[:, None, None]
    cubic = (1 - s) ** 2 * ((1 + 2 * s) * first + s * low)
    cubic = cubic + s**2 * ((3 - 2 * s) * last - (1 - s) * high)
    least = np.minimum(first, last)
    return np.asarray(least - 4 * np.maximum(least - cubic.min(axis=0), 0.0))


def _actuators(task: Task, field: str, quantity: str, units: tuple[str, str]) -> tuple[Signal, ...]:
    """Return the signals of limits of the actuators, two for each."""
    mechanism = task.mechanism
    limits = getattr(mechanism.model, field)[mechanism.actuated_indices]
    angular = mechanism.angular_velocities[mechanism.actuated_indices]
    return tuple(
        Signal(quantity, 0, side, factor * float(limit), units[int(turns)], name)
        for name, limit, turns in zip(mechanism.actuated, limits, angular, strict=True)
        if limit < UNLIMITED
        for side, factor in (("lower", -1.0), ("upper", 1.0))
    )


def _sides(task: Task, signals: tuple[Signal, ...]) -> tuple[Any, Array, Array]:
    """Return of each signal its actuator, its sign, and the size of its limit."""
    which = [task.mechanism.actuated.index(signal.joint) for signal in signals]
    sign = np.array([1.0 if signal.side == "upper" else -1.0 for signal in signals])
    return np.array(which, dtype=np.intp), sign, np.array([abs(s.limit) for s in signals])


def pose_in_words(task: Task, pose: Array, angle: str = "rad") -> str:
    """Return coordinates of a task by name, with their units; angles in that unit."""
    named = zip(task.coordinates, task.angular, pose, strict=True)
    return ", ".join(
        f"{name} = {short(value)} {angle if turns else 'm'}" for name, turns, value in named
    )
