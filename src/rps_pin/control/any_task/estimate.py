"""State estimate of a mechanism with a task in a control loop, without exceptions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.any_task.motion import TaskAnswers, TaskGeometry, TaskJacobian, TaskMotion
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time, floats
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.filters import SpeedFilter
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.control.loop.vectors import arrays
from rps_pin.copies import DeepCopied
from rps_pin.errors import InputError, MechanismError, RPSPinError, SingularityError, shown
from rps_pin.one_thread import TickGuard, guarded
from rps_pin.task import Task
from rps_pin.validation import numbers, positive_number, real_vector

#: What calls of a task raise where there is no answer.
REFUSED = (RPSPinError, ArithmeticError, np.linalg.LinAlgError, ValueError)
#: Of jumps and speeds where the model has no limit, per characteristic length (or rad).
_JUMP, _SPEED = 0.05, 2.0
_LARGEST = 1e6


class TaskEstimate(DeepCopied):
    """State estimate from the actuators' positions, one tick at a time.

    As `RealTimeRobot` is for the 3-RPS: no call in the loop raises for the values of its arguments.
    It returns a `Status`, and where there is no new result the last good one stays. An object is
    for one thread at a time.

    Parameters
    ----------
    task
        The task, with as many actuators as coordinates; in generated code from `Task.compile`. Its
        scratch memory is used.
    near
        The coordinates at the start, shape (m,), in the assembly mode of home.
    period
        Time between two ticks, s: for speeds that are not measured.
    cut_off
        Of the filter of such speeds, Hz; infinite for none.
    near_singular
        `SingularityMeasures.distance` below which the status has `Status.NEAR_SINGULAR`.
    largest_jump
        Largest difference of an actuator's position from its prediction, for each tick since the
        last good one: one number or na, m or rad. Default: 1.2 times what the speed limits allow,
        at most 0.05 rad or characteristic lengths.

    Attributes
    ----------
    answers : TaskAnswers
        The last good results.
    status : Status
        Of the last `estimate`.
    age : int
        Ticks since the last good result.
    elapsed : float
        Time since then, s.
    state : TaskMotion
        The last good motion.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    MechanismError
        If there are not as many actuators as coordinates.
    ClosureError, SingularityError
        If the coordinates are out of reach, or the mechanism is singular there.
    """

    def __init__(
        self,
        task: Task,
        near: ArrayLike,
        *,
        period: float = 1e-3,
        cut_off: float = 50.0,
        near_singular: float = 0.05,
        largest_jump: ArrayLike | None = None,
    ) -> None:
        mechanism = task.mechanism
        actuators = mechanism.actuated_indices
        count = self._count = actuators.size
        if count != task.size:
            raise MechanismError(
                f"{count} actuators for {task.size} coordinates: control needs as many"
            )
        self.task, self.guard = task, TickGuard()
        length = task.characteristic_length
        turning = mechanism.angular_velocities[actuators]
        #: Of the actuators: characteristic length, or 1 rad.
        self._scale = np.where(turning, 1.0, length)
        limit = np.abs(mechanism.model.velocityLimit[actuators])
        self.speed_limit: Array = np.minimum(limit, _SPEED * self._scale)
        self._fastest = limit
        self._period = positive_number(period, "period", "s")
        default = np.minimum(1.2 * limit * period, _JUMP * self._scale)
        self._jump = default if largest_jump is None else _jump(largest_jump, count)
        cut_off = positive_number(cut_off, "cut_off", "Hz", infinite=True)
        self._filter = SpeedFilter(cut_off, arrays(count))
        self._near = positive_number(near_singular, "near_singular")
        self._limits = mechanism.system.limits
        model = mechanism.model
        sizes = (task.size, task.size, count, count, model.nq)
        self.answers = TaskAnswers(*(np.zeros(size) for size in sizes))
        #: Generated code of a whole tick, which a task has not.
        self.generated: None = None
        self.reset(near)

    def reset(self, near: ArrayLike) -> None:
        """Start again from a pose, at rest. Raises as the constructor does."""
        x = real_vector(near, self.task.size, "near")
        q = self.task.configuration(x)
        still = np.zeros(self._count)
        geometry = self.geometry_of(q, x)
        self._filter.reset()
        self.age, self.elapsed = 0, 0.0
        self._length: Array | None = geometry.length
        self._why = ""
        self._accept(
            TaskMotion(geometry, np.zeros(self.task.size), still, self._jacobian(geometry))
        )
        self._filter.reset()

    @property
    def type_ii(self) -> float:
        """`SingularityMeasures.distance` of the estimated pose."""
        return self.state.geometry.distance

    @property
    def determinant(self) -> float:
        """The same, with the sign of K's determinant."""
        return self.state.jacobian.determinant

    # Each tick ------------------------------------------------------------------------------------

    @guarded("guard")
    def estimate(
        self, length: Numbers, speed: Numbers = None, *, dt: float | None = None
    ) -> Status:
        """Take a reading; write pose, rate, positions and speeds to `answers`.

        Parameters
        ----------
        length
            Positions of the actuators, shape (na,), m or rad.
        speed
            Their speeds, shape (na,); default: filtered differences of the positions.
        dt
            Time since the last call, s; default: the period.
        """
        elapsed = self.elapsed + (self._period if dt is None else elapsed_time(dt))
        if not self.elapsed < elapsed < math.inf:
            return self._keep(flags.BAD_INPUT)
        self.elapsed = elapsed
        with np.errstate(all="ignore"):  # the largest floats overflow
            return self._read(length, speed, elapsed)

    def _read(self, length: Numbers, speed: Numbers, elapsed: float) -> Status:
        self._length = d = floats(length, self._count)
        if d is None or not (np.abs(d) < _LARGEST * self._scale).all():
            return self._keep(flags.BAD_INPUT)
        last = self.state
        departure = np.abs(d - last.geometry.length - last.speed * elapsed)
        if not (departure <= self._jump * (self.age + 1)).all():
            return self._keep(flags.JUMP)
        speeds = self._filter.after(d, elapsed) if speed is None else floats(speed, self._count)
        if speeds is None or not np.isfinite(speeds).all():
            return self._keep(flags.BAD_INPUT)
        try:
            moved = self._followed(d, speeds, last.geometry)
        except REFUSED as error:
            self._why = str(error)
            singular = isinstance(error, SingularityError)
            return self._keep(flags.NOT_CONVERGED | (flags.NEAR_SINGULAR if singular else 0))
        return self._accept(moved) if moved is not None else self._keep(flags.BAD_INPUT)

    def _followed(self, d: Array, speeds: Array, last: TaskGeometry) -> TaskMotion | None:
        """Return the motion of a reading, continued from the last pose; None if it overflows."""
        task = self.task
        q = task.configuration_of(d, last.configuration, within_limits=False)
        geometry = self.geometry_of(q, last.pose)
        rate = task.rate(q, task.velocity_of(q, speeds))
        if not np.isfinite(rate).all():
            return None
        return TaskMotion(geometry, rate, speeds, self._jacobian(geometry))

    def geometry_of(self, q: Array, near: Array) -> TaskGeometry:
        """Return what follows from a configuration; of rotation vectors the one near a pose."""
        task = self.task
        measures = task.singularities(q)
        distance = float(measures.distance)
        return TaskGeometry(
            task.at(q, near),
            q[task.of_actuators],
            q,
            distance if math.isfinite(distance) else 0.0,
            math.copysign(1.0, float(measures.determinant)),
        )

    def _jacobian(self, geometry: TaskGeometry) -> TaskJacobian:
        K = self.task.jacobian(geometry.configuration)
        return TaskJacobian(K, geometry.side * geometry.distance)

    def beyond(self, q: Array) -> bool:
        """Return whether a joint is beyond its limits of position."""
        return bool(self._limits.beyond(q, 1e-9).any())

    def messages(self, q: Array) -> list[str]:
        """Return a sentence for each such joint."""
        said = self._limits.outside(q).values()
        return [f"joint {phrase}: it is beyond its limits" for phrase in said]

    # On demand ------------------------------------------------------------------------------------

    @property
    def status_text(self) -> str:
        """The reasons of `status`, as text."""
        status, state = self.status, self.state
        messages = []
        if status & Status.BAD_INPUT:
            read = "not as many finite numbers" if self._length is None else _text(self._length)
            messages.append(
                "position, speed or dt is not finite, not positive, or out of range: positions "
                f"are {read}"
            )
        if status & Status.JUMP:
            assert self._length is not None
            messages.append(
                f"positions {_text(self._length)} are more than {_text(self._jump)} a tick from "
                f"the prediction by the last good ones, {_text(state.geometry.length)}"
            )
        if status & Status.NOT_CONVERGED:
            messages.append(f"the positions cannot be followed: {self._why}")
        if status.kept:
            messages.append(f"the last good estimate is kept; it is {self.age} ticks old")
        if status & Status.NEAR_SINGULAR:
            messages.append(
                f"near a singularity: distance {self.type_ii:.3g}, at least {self._near:.3g} is "
                "required"
            )
        if status & Status.BEYOND_LIMIT:
            messages += self.messages(state.geometry.configuration)
            names = self.task.mechanism.actuated
            rows = zip(names, state.speed.tolist(), self._fastest.tolist(), strict=True)
            messages += [
                f"actuator {name}: speed is {speed:.6g}; its limit is {most:.6g}"
                for name, speed, most in rows
                if abs(speed) > most
            ]
        return "; ".join(messages) or "ok"

    # Inner workings -------------------------------------------------------------------------------

    def _accept(self, state: TaskMotion) -> Status:
        self.state = state
        geometry, rate, speed, _ = state
        number = 0
        if self.beyond(geometry.configuration) or (np.abs(speed) > self._fastest).any():
            number = flags.BEYOND_LIMIT
        if geometry.distance < self._near:
            number |= flags.NEAR_SINGULAR
        self._filter.update(geometry.length, speed)
        answers = self.answers
        answers.pose[:], answers.rate[:] = geometry.pose, rate
        answers.position[:], answers.speed[:] = geometry.length, speed
        answers.configuration[:] = geometry.configuration
        self.age, self.elapsed = 0, 0.0
        self.status = status = STATUSES[number]
        return status

    def _keep(self, number: int) -> Status:
        """Keep the last good estimate, with a status."""
        self.age += 1
        if self.type_ii < self._near:
            number |= flags.NEAR_SINGULAR
        self.status = status = STATUSES[number]
        return status


def _jump(given: ArrayLike, count: int) -> Array:
    found = numbers(given, "largest_jump", f"positive, one number or {count}")
    if found.shape not in ((), (count,)) or not (found > 0).all():
        raise InputError(f"largest_jump = {shown(given)}: it must be positive, one or {count}")
    return np.broadcast_to(found, count).copy()


def _text(values: Any) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
