"""State estimate of a mechanism with a task in a control loop, without exceptions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.any_task.motion import (
    TaskAnswers,
    TaskGeometry,
    TaskJacobian,
    TaskMotion,
    departure,
)
from rps_pin.control.estimator.last_good import LastGood
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time, floats
from rps_pin.control.generated.code import GeneratedTick
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.filters import SpeedFilter
from rps_pin.control.loop.status import Status
from rps_pin.control.loop.vectors import arrays
from rps_pin.errors import (
    ClosureError,
    InputError,
    MechanismError,
    RPSPinError,
    SingularityError,
    shown,
)
from rps_pin.one_thread import TickGuard, guarded
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.plain_text import listed
from rps_pin.task import SingularityMeasures, Task
from rps_pin.validation import numbers, positive_number, real_vector

#: What calls of a task raise where there is no answer.
REFUSED = (RPSPinError, ArithmeticError, np.linalg.LinAlgError, ValueError)
#: Of jumps and speeds where the model has no limit, per characteristic length (or rad).
_JUMP, _SPEED = 0.05, 2.0
#: Of positions and of speeds, beyond which they are out of range.
_LARGEST, _LARGEST_SPEED = 1e6, 1e9
#: Largest change of a position, and of a target, that is followed in one tick: its way is followed
#: step by step. In rad or characteristic lengths.
FARTHEST = 10.0
#: Gauss-Newton steps that fit more readings than coordinates, and the size of the last, in rad or
#: characteristic lengths.
_FITTING_STEPS, _FITTED = 12, 1e-11
#: Joints are beyond their limits by more than that, m or rad.
_SLACK = 1e-9


class TaskEstimate(LastGood):
    """State estimate from the actuators' positions, one tick at a time.

    As `RealTimeRobot` is for the 3-RPS: no call in the loop raises for the values of its arguments.
    It returns a `Status`, and where there is no new result the last good one stays. An object is
    for one thread at a time.

    Parameters
    ----------
    task
        The task, with as many actuators as coordinates or more; in generated code from
        `Task.compile`. Its scratch memory is used. With more, the coordinates that fit the
        positions with the least sum of squares are taken.
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
        last good one: one number or na, m or rad; 10 rad or characteristic lengths at most.
        Default: 1.2 times what the speed limits allow, at most 0.05 rad or characteristic lengths.

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

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    MechanismError
        If there are fewer actuators than coordinates.
    ClosureError, SingularityError
        If the coordinates are out of reach, or the mechanism is singular there.
    """

    @refuses_other_kinds
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
        if count < task.size:
            raise MechanismError(
                f"{count} actuators for {task.size} coordinates: control needs as many at least"
            )
        self.task, self.guard = task, TickGuard()
        length = task.characteristic_length
        turning = mechanism.angular_velocities[actuators]
        self._position_units = ["rad" if one else "m" for one in turning]
        #: Of the actuators: characteristic length, or 1 rad.
        self._scale = np.where(turning, 1.0, length)
        limit = np.abs(mechanism.model.velocityLimit[actuators])
        self.speed_limit: Array = np.minimum(limit, _SPEED * self._scale)
        self._fastest = limit
        self._period = positive_number(period, "period", "s")
        default = np.minimum(1.2 * limit * period, _JUMP * self._scale)
        given = default if largest_jump is None else _jump(largest_jump, count)
        self._jump = np.minimum(given, FARTHEST * self._scale)
        cut_off = positive_number(cut_off, "cut_off", "Hz", infinite=True)
        self._filter = SpeedFilter(cut_off, arrays(count))
        self._near = positive_number(near_singular, "near_singular")
        self._limits = mechanism.system.limits
        model = mechanism.model
        sizes = (task.size, task.size, count, count, model.nq)
        self.answers = TaskAnswers(*(np.zeros(size) for size in sizes))
        #: Generated code of a controller's ticks.
        self.generated: GeneratedTick | None = None
        self.reset(near)

    @refuses_other_kinds
    def reset(self, near: ArrayLike) -> None:
        """Start again from a pose, at rest. Raises as the constructor does."""
        x = real_vector(near, self.task.size, "near")
        q = self.task.configuration(x)
        self._begin()
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

    # Generated code -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, Any]:
        """Return what generated code takes of this object: see `form_of_task`."""
        scale, limits = self._scale, self._limits
        bounds = {"lower": limits.lower - _SLACK, "upper": limits.upper + _SLACK}
        found = {"most": _LARGEST * scale, "most_speed": _LARGEST_SPEED * scale}
        found |= {"fastest": self._fastest, "jump": self._jump}
        found |= bounds if limits.q.size else {}
        return {name: row.tolist() for name, row in found.items()} | {"near": self._near}

    def memory(self) -> dict[str, Any]:
        """Return what the next tick starts from."""
        geometry, rate, speed, _ = self._state
        return {
            **self.place_of(geometry, ("whole", "reference", "values")),
            "pose": geometry.pose.tolist(),
            "position": geometry.length.tolist(),
            "rate": rate.tolist(),
            "speed": speed.tolist(),
            "started": 0.0 if self._filter.last is None else 1.0,
        }

    def place_of(self, geometry: TaskGeometry, names: tuple[str, str, str]) -> dict[str, Any]:
        """Return a configuration, and the Jacobian there with its first and last singular value."""
        task, q = self.task, geometry.configuration
        whole = task.joined(q, geometry.pose)
        J = task.mechanism.system.scaled(task.engines[1].jacobian(q))
        found = {names[0]: whole.tolist()}
        if J.size:
            found[names[1]] = J.ravel().tolist()
        values = np.linalg.svd(J, compute_uv=False) if J.size else np.ones(1)
        last = values[task.rank - 1] if task.rank else values[0]
        return found | {names[2]: [float(last), float(values[0])]}

    def take(self, memory: dict[str, Any]) -> None:
        """Set the state from generated code's memory."""
        x, rate, speed = (np.array(memory[name], ndmin=1) for name in ("pose", "rate", "speed"))
        q = np.array(memory["whole"], ndmin=1)[: self.task.mechanism.model.nq]
        geometry = self.geometry_of(q, x)
        self._state = TaskMotion(geometry, rate, speed, self._jacobian(geometry))
        self._filter.update(geometry.length, speed)

    @property
    def state(self) -> TaskMotion:
        """The last good motion."""
        if self.generated is not None:
            self.generated.pull()
        return self._state

    @property
    def type_ii(self) -> float:
        """`SingularityMeasures.distance` of the estimated pose."""
        if self.generated is not None and self.generated.ahead:
            return _distance(self.task.singularities(self.answers.configuration))
        return self._state.geometry.distance

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
        self._begin()
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
        away = departure(d, last.geometry.length, last.speed, elapsed)
        if not (np.abs(away) <= self._jump * (self.age + 1)).all():
            return self._keep(flags.JUMP)
        speeds = self._filter.after(d, elapsed) if speed is None else floats(speed, self._count)
        if speeds is None or not (np.abs(speeds) < _LARGEST_SPEED * self._scale).all():
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
        if self._count > task.size:
            return self._fitted(d, speeds, last)
        q = task.configuration_of(d, last.configuration, within_limits=False)
        geometry = self.geometry_of(q, last.pose)
        rate = task.rate(q, task.velocity_of(q, speeds), x=geometry.pose)
        if not np.isfinite(rate).all():
            return None
        return TaskMotion(geometry, rate, speeds, self._jacobian(geometry))

    def _fitted(self, d: Array, speeds: Array, last: TaskGeometry) -> TaskMotion:
        """Return the motion that fits more readings than coordinates best, in one unit.

        By Gauss-Newton steps in the task's coordinates, x += K^+ (d - a(x)).
        """
        task, x, q = self.task, last.pose, last.configuration
        for _ in range(_FITTING_STEPS):
            step = self.least_rate(task.jacobian(q, x=x), d - q[task.of_actuators])
            x = x + step
            q = task.configuration(x, q, within_limits=False)
            if (np.abs(step) * task.scale).max() < _FITTED * task.characteristic_length:
                geometry = self.geometry_of(q, x)
                jacobian = self._jacobian(geometry)
                return TaskMotion(geometry, self.least_rate(jacobian.K, speeds), speeds, jacobian)
        raise ClosureError("no coordinates fit the positions: the steps do not end", math.nan)

    def least_rate(self, K: Array, speed: Array) -> Array:
        """Return x' of K x' = the actuators' speeds, of the least error in one unit."""
        if len(K) == self.task.size:
            return np.asarray(np.linalg.solve(K, speed))
        return np.asarray(np.linalg.lstsq(K / self._scale[:, None], speed / self._scale)[0])

    def least_force(self, K: Array, wrench: Array) -> Array:
        """Return f of K' f = wrench, of the least norm in one unit."""
        if len(K) == self.task.size:
            return np.asarray(np.linalg.solve(K.T, wrench))
        return np.asarray(np.linalg.lstsq(K.T / self._scale, wrench)[0]) / self._scale

    def geometry_of(self, q: Array, near: Array) -> TaskGeometry:
        """Return what follows from a configuration; of rotation vectors the one near a pose."""
        task = self.task
        measures = task.singularities(q)
        return TaskGeometry(
            task.at(q, near),
            q[task.of_actuators],
            q,
            _distance(measures),
            math.copysign(1.0, float(measures.determinant)),
        )

    def _jacobian(self, geometry: TaskGeometry) -> TaskJacobian:
        K = self.task.jacobian(geometry.configuration, x=geometry.pose)
        return TaskJacobian(K, geometry.side * geometry.distance)

    def beyond(self, q: Array) -> bool:
        """Return whether a joint is beyond its limits of position."""
        return bool(self._limits.beyond(q, _SLACK).any())

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
            read = "not as many finite numbers"
            if self._length is not None:
                read = listed(self._length, self._position_units)
            messages.append(
                "position, speed or dt is not finite, not positive, or out of range: positions "
                f"are {read}"
            )
        if status & Status.JUMP:
            assert self._length is not None
            read, jump, last = (
                listed(values, self._position_units)
                for values in (self._length, self._jump, state.geometry.length)
            )
            messages.append(
                f"positions {read} are more than {jump} a tick from the prediction by the last "
                f"good ones, {last}"
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
            speeds = state.speed.tolist(), self._fastest.tolist()
            rows = zip(names, *speeds, self._position_units, strict=True)
            messages += [
                f"actuator {name}: speed is {speed:.6g} {unit}/s; its limit is {most:.6g} {unit}/s"
                for name, speed, most, unit in rows
                if abs(speed) > most
            ]
        return "; ".join(messages) or "ok"

    # Inner workings -------------------------------------------------------------------------------

    def _accept(self, state: TaskMotion) -> Status:
        self._state = state
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
        return self._renew(number)


def _distance(measures: SingularityMeasures) -> float:
    """Return the distance to a singularity, zero where it is not known."""
    distance = float(measures.distance)
    return distance if math.isfinite(distance) else 0.0


def _jump(given: ArrayLike, count: int) -> Array:
    found = numbers(given, "largest_jump", f"positive, one number or {count}")
    if found.shape not in ((), (count,)) or not (found > 0).all():
        raise InputError(f"largest_jump = {shown(given)}: it must be positive, one or {count}")
    return np.broadcast_to(found, count).copy()
