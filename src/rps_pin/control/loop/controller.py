"""Base class of controllers: the tick that all laws share.

    reading -> state estimate -> setpoint -> law -> force limits -> forces

No call raises for the values of its arguments, and the forces are always finite and within limits.
(A second thread that calls while a call runs gets a `ThreadError`.)

- A reading that is missing, not finite, or a jump is discarded; for a few ticks the state is
  extrapolated at the last rate. After `most_lost` such readings in a row the controller stops.
- A target that is not valid is refused: the last valid one is held, and the setpoint returns to the
  next valid one smoothly (`rps_pin.control.loop.setpoints`).
- Forces beyond the limits are replaced by the nearest in effect
  (`rps_pin.control.loop.force_limits`), with back-calculation of the law's integral.
- Too near a singularity, where forces are not determined, the controller stops.

A stopped controller with valid readings holds the first pose estimated since; without, or too near
a singularity, its forces only bear the weight. It stays stopped until `reset`. Brakes are for the
drives to apply.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.any_task.model import TaskModel
from rps_pin.control.estimator.leg_model import LegModel
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.generated.code import NOT_REGULAR, GeneratedTick
from rps_pin.control.generated.engine import Compiled, generated_tick
from rps_pin.control.generated.proof import Ticked
from rps_pin.control.generated.tick import Form, form_of
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.filters import SetpointRateFilter
from rps_pin.control.loop.force_limits import LEAST_PACE, ForceLimits, recovered_pace
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.setpoints import Setpoint, Setpoints
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.control.model import ControlModel
from rps_pin.control.robots import Robot, force_limits, task_of
from rps_pin.copies import DeepCopied
from rps_pin.errors import InputError, SingularityError, shown
from rps_pin.one_thread import guarded, one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.plain_text import listed
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.task import RPSTask
from rps_pin.task import Task
from rps_pin.validation import choice, positive_number, real, whole_number

Space = Literal["actuator", "task"]

_NO_RESULT = flags.BAD_INPUT | flags.JUMP | flags.NOT_CONVERGED


@one_thread("_guard", besides=("tick",), properties=("status_text",))
class Controller(DeepCopied, ABC):
    """The part of a controller that all laws share; see `ComputedTorque` and `PDControl`.

    Parameters
    ----------
    robot
        The controller's model of the robot, with payload and friction: an `RPSRobot`; or a `Task`
        with as many actuators as coordinates or more, or a `ClosedLoopModel` that has one. What is
        said of legs and of the pose holds for the actuators and the coordinates of a task. Forces
        of more actuators than coordinates are those of least norm, within the limits.
    near
        The pose at the start, shape (m,), m and rad; also the first setpoint, at rest. Of a task in
        the assembly mode of home.
    gains
        Of the law, in its units.
    space
        Space of the errors: ``"actuator"`` (leg lengths) or ``"task"`` (the pose).
    period
        Time between two ticks, s.
    cut_off
        Of the filter of leg speeds that are not measured, Hz; infinite for none.
    force_limit
        Of the actuators, N or N m: one or na; default: the robot's.
    near_singular
        `SingularityMeasures.type_ii` (of a task `distance`) below which the status has
        `Status.NEAR_SINGULAR`, and targets are refused, 0 to 1.
    stop_singular
        Distance below which the controller stops; less than `near_singular`.
    largest_jump
        Largest difference of a leg length from its prediction, m for each tick since the last good
        reading; default: 1.2 times what the actuators' speed limit allows (of a task at most 0.05
        rad, or characteristic lengths). A constant encoder error
        above most_lost + 1 times this stops the controller; a smaller one is accepted in the end,
        after `Status.JUMP`.
    most_lost
        Number of missing or refused readings in a row before the controller stops.
    compiled
        ``"auto"``: regular ticks are computed by generated code, if it is there or can be built
        (`rps_pin.control.generated`); True: `CompileError` if not; False: interpreted. Of a task:
        True: by `Task.compile`, ``"auto"``: as the task is.

    Attributes
    ----------
    compiled : bool
        Whether generated code runs.
    engine : str
        What runs: its compiler, or why there is none.
    forces : (na,) array
        Command to the actuators, N or N m, of the last tick. Before the first, the forces that hold
        the robot at rest.
    robot
        As given.
    estimate : RealTimeRobot or TaskEstimate
        The state estimate: pose, rate, `type_ii`.
    pace : float
        Pace of the target, 0.05 to 1 of its own speed: below 1 while and shortly after actuators
        are at their limits. `PacedTrajectory` follows it; otherwise the robot lags behind.
    status : Status
        Of the last tick.
    period : float
        As given.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError, ClosureError
        If the pose is out of reach.
    SingularityError
        If the pose is nearer to a singularity than `near_singular`.
    MechanismError
        If a mechanism has no task, or fewer actuators than coordinates.
    CompileError
        If there is no generated code, with ``compiled=True``.
    """

    _default_space: Space = "actuator"

    @refuses_other_kinds
    def __init__(
        self,
        robot: Robot,
        near: ArrayLike,
        gains: Gains,
        *,
        space: Space | None = None,
        period: float = 1e-3,
        cut_off: float = 100.0,
        force_limit: ArrayLike | None = None,
        near_singular: float = 0.05,
        stop_singular: float = 0.01,
        largest_jump: ArrayLike | None = None,
        most_lost: int = 3,
        compiled: Compiled = "auto",
    ) -> None:
        period = positive_number(period, "period", "s")
        if not isinstance(gains, Gains):
            raise InputError(f"gains must be Gains, not {type(gains).__name__}")
        if not 0.0 < real(stop_singular) < real(near_singular):
            raise InputError(
                f"stop_singular = {shown(stop_singular)}: it must be positive and less than "
                f"near_singular = {shown(near_singular)}"
            )
        self.space = choice(space or self._default_space, "space", get_args(Space))
        self._in_task_space = self.space == "task"
        self._most_lost = whole_number(most_lost, "most_lost", 0)
        self.robot = robot
        if isinstance(robot, RPSTask):  # which has closed forms
            robot = cast("RPSRobot", robot.robot)
        self._model: ControlModel = model_of(
            robot,
            near,
            compiled,
            period=period,
            cut_off=cut_off,
            near_singular=near_singular,
            largest_jump=largest_jump,
        )
        self._vectors, self.estimate = self._model.vectors, self._model.estimate
        self._no_force = self._vectors.of([0.0] * self._model.actuators)
        if self._model.actuators > self._model.size and not self._in_task_space:
            raise InputError(
                f"space = 'actuator': errors of {self._model.actuators} actuators are not free; "
                f"take space='task', of {self._model.size} coordinates"
            )
        self._quiet = isinstance(self._model, LegModel)  # floats overflow without a warning
        self._guard = self.estimate.guard
        self.period, self.gains = period, gains.of(self._model.size)
        of = self._vectors.of
        kp, kd, ki = self.gains.rows
        self._gains = of(kp), of(kd), of(ki)
        self._tracking_rate = of([1.0 / time for time in self.gains.tracking_time])
        self._elapsed = period
        self._setpoints = Setpoints(self._model, near_singular)
        self._limits = ForceLimits(tuple(force_limits(robot, force_limit).tolist()))
        self._rate_filter = SetpointRateFilter(cut_off, self._vectors)
        self._near, self._stop = near_singular, stop_singular
        self.forces: Array = np.zeros(self._model.actuators)
        self._generated: GeneratedTick | None = None
        self._speed_measured = False
        self.reset(near)
        self._use_generated(compiled, near)

    def _use_generated(self, compiled: Compiled, near: ArrayLike) -> None:
        """Let generated code compute regular ticks, if there is any."""
        law, model = self._generated_law, self._model
        answers = (*self.estimate.answers[:5], self.forces)
        own = self.period, self._rate_filter.share, self._take
        if isinstance(model, TaskModel):
            given = None if isinstance(compiled, str | bool) else compiled
            found = model.generated_tick(law, near, self._proven, answers, own, given)
        else:
            form = form_of(law) if law else None
            found = generated_tick(
                *(compiled, law, self._proven),
                lambda library: GeneratedTick(law, cast("Form", form), library, answers, *own),
            )
        self._generated, self.engine = found
        if self._generated is not None:
            self.estimate.generated, self.estimate.engine = self._generated, self.engine
            self._to_generated_code()

    @property
    def compiled(self) -> bool:
        """Whether generated code runs."""
        if isinstance(self._model, TaskModel):
            return self._model.task.compiled
        return self._generated is not None

    def reset(self, near: ArrayLike) -> None:
        """Start again at rest in a pose. Raises as the constructor does."""
        self.estimate.reset(near)
        geometry = self.estimate.state.geometry
        nearest = min(abs(self._model.determinant(geometry)), self.estimate.type_ii)
        if nearest < self._near:
            message = (
                f"the pose to start from is too near a singularity: type_ii {nearest:.3g}, at "
                f"least {self._near:.3g} is required"
            )
            raise SingularityError(message, 1 / max(nearest, 1e-300), 1 / self._near)
        self._setpoints.reset(geometry)
        self._integral: Any = self._vectors.zero
        self._rate_filter.reset()
        self._stop_reason = ""
        self._rest: Setpoint | None = None
        self._pace = 1.0
        self.status = Status.OK
        self._wanted: Any = self._no_force
        self._send(self._limits.clipped(self._weight()))
        self._to_generated_code()

    # Each tick ------------------------------------------------------------------------------------

    def tick(
        self,
        length: Numbers,
        target: Any = None,
        speed: Numbers = None,
        *,
        dt: float | None = None,
    ) -> Status:
        """Take a reading and a target, and write the command to `forces`.

        Parameters
        ----------
        length
            Leg lengths, shape (3,), m (positions of a task's actuators, (na,)); None if the reading
            is missing.
        target
            Pose, rate and acceleration, (m,) each, as `Trajectory.sample` returns them; None for
            the last valid one.
        speed
            Their speeds, likewise; default: filtered differences of the lengths.
        dt
            Time since the last call, s; default: the period.

        Returns
        -------
        Status
            Its text is in `status_text`.
        """
        generated, guard = self._generated, self._guard
        if generated is not None and generated.ready and not guard.busy:
            try:
                guard.busy = True
                number = generated.control(length, target, speed, dt)
                if number != NOT_REGULAR:
                    self.status = self.estimate.status = status = STATUSES[number]
                    return status
            finally:
                guard.busy = False
        return self._tick(length, target, speed, dt)

    @guarded("_guard")
    def _tick(self, length: Numbers, target: Any, speed: Numbers, dt: float | None) -> Status:
        """Do the same in Python."""
        ticked = self._ticked if self._quiet else self._quietly
        status = ticked(length, target, speed, dt)
        if self._generated is not None and self.estimate.age == 0 and not self._stop_reason:
            self._hand_over()
        return status

    def _quietly(self, length: Numbers, target: Any, speed: Numbers, dt: float | None) -> Status:
        with np.errstate(all="ignore"):  # of arrays, whose largest floats overflow
            return self._ticked(length, target, speed, dt)

    def _ticked(self, length: Numbers, target: Any, speed: Numbers, dt: float | None) -> Status:
        estimate = self.estimate
        number = int(estimate.estimate(length, speed, dt=dt))
        time = self.period if dt is None else elapsed_time(dt)
        if not self._setpoints.update(target, time):
            number |= flags.TARGET_HELD
        valid = not number & _NO_RESULT
        elapsed = time if valid else 0.0  # nothing is integrated over a refused reading
        if self._stop_reason:
            return self._stopped(number, elapsed)
        self._speed_measured = speed is not None
        state: Any = estimate.state
        if not valid:
            if estimate.age > self._most_lost:
                reason = f"{estimate.age} readings in a row were refused"
                return self._stopped(number, elapsed, reason)
            state = self._model.extrapolated(estimate.state, estimate.elapsed)
        if state is None or self._model.near_singular(state, self._stop):
            reason = f"near a type II singularity: type_ii less than {self._stop:.3g}"
            return self._stopped(number | flags.NEAR_SINGULAR, elapsed, reason)
        self._elapsed = elapsed
        force = self._law(state, self._setpoints.current)
        if force is None or not math.isfinite(sum(force)):
            reason = "the law gave no finite forces"
            return self._stopped(number | flags.NOT_CONVERGED, elapsed, reason)
        if not self._limits.within(force):
            number |= flags.SATURATED
            force = self._limited(force, state, elapsed)
        elif self._pace < 1.0:
            self._pace = recovered_pace(self._pace, elapsed)
        self._send(force)
        self.status = status = STATUSES[number]
        return status

    def _proven(
        self, robot: RPSRobot | Task, start: Array, compiled: Compiled, **settings: Any
    ) -> Callable[..., Ticked]:
        """Return what computes ticks to prove generated code with."""
        one = self._like(robot, start, space=self.space, compiled=compiled, **settings)

        def ticked(length: Any, target: Any, speed: Any, dt: float | None) -> Ticked:
            status = one.tick(length, target, speed, dt=dt)
            answers = {**one.estimate.answers._asdict(), "forces": one.forces}
            return int(status), answers, one._generated is not None and one._generated.ahead

        return ticked

    def _like(self, robot: RPSRobot | Task, start: Array, **settings: Any) -> Controller:
        """Return a controller with this law."""
        return type(self)(robot, start, Gains.placed(15.0, integral=0.2), **settings)

    @property
    def _generated_law(self) -> str:
        """Name of the law in `rps_pin.control.generated.tick.LAWS`; none of other laws."""
        return ""

    @abstractmethod
    def _law(self, state: StateEstimate, setpoint: Setpoint) -> Any:
        """Return the law's forces, N, or None; it calls `_pid` once, and `_solve`."""

    @abstractmethod
    def _command_error(self, state: StateEstimate, force: Any, acceleration: Any) -> Any:
        """Return the change of the command, in its unit, by changes of force and acceleration."""

    @property
    def status_text(self) -> str:
        """The reasons of `status`, as text."""
        messages = []
        if self.status & Status.TARGET_HELD:
            messages += self._setpoints.messages()
        if self.estimate.status:
            messages.append(self.estimate.status_text)
        if self.status & Status.SATURATED:
            messages.append(
                "an actuator is at its limit: the forces of the law are "
                f"{listed(self._wanted, self._force_units)}"
            )
        if self.status & Status.STOPPED:
            messages.append(f"stopped: {self._stop_reason}; reset to continue")
        return "; ".join(messages) or "ok"

    @property
    def pace(self) -> float:
        """See the class."""
        generated = self._generated
        if generated is not None and generated.ahead:
            return generated.remembered("pace")
        return self._pace

    # Generated code -------------------------------------------------------------------------------

    def _to_generated_code(self) -> None:
        if self._generated is not None:
            self._generated.set_numbers(self._numbers())
            self._hand_over()

    def _numbers(self) -> dict[str, Any]:
        """Return what generated code takes of this object: `CONTROL_NUMBERS`."""
        kp, kd, ki = map(tuple, self._gains)
        return {
            **self._model.numbers(),
            **{"kp": kp, "kd": kd, "ki": ki, "stop": self._stop},
            **{"side": self._setpoints.side, "force_limit": self._limits.limit},
        }

    def _hand_over(self) -> None:
        """Let generated code compute the next tick, from where this one ended."""
        generated, current = self._generated, self._setpoints.current
        if generated is None or not self._setpoints.followed:
            return
        last = self._rate_filter.last
        rows = {
            "target_rate": current.rate,
            "target_acceleration": current.acceleration,
            "integral": self._integral,
            "last_rate": self._vectors.zero if last is None else last,
            "filtered_rate": self._rate_filter.speed,
        }
        generated.set_memory(
            {
                **self.estimate.memory(),
                **self._model.setpoint_memory(current.geometry),
                **{name: tuple(row) for name, row in rows.items()},
                "pace": self._pace,
            }
        )

    def _take(self, memory: dict[str, Any]) -> None:
        """Set the state from generated code's memory."""
        assert self._generated is not None
        self.estimate.take(memory)
        geometry, of = self._model.setpoint_geometry(memory), self._vectors.of
        rate, acceleration = of(memory["target_rate"]), of(memory["target_acceleration"])
        self._setpoints.follow(Setpoint(geometry, rate, acceleration))
        self._integral, self._pace = of(memory["integral"]), memory["pace"]
        self._rate_filter.last = of(memory["last_rate"])
        self._rate_filter.speed = of(memory["filtered_rate"])
        self._speed_measured = self._generated.measured

    # Inner workings -------------------------------------------------------------------------------

    def _pid(self, e: Any, wanted: Any, rate: Any) -> Any:
        """Return `pid` with e' = wanted - rate; the wanted rate passes the speeds' filter."""
        elapsed, vectors = self._elapsed, self._vectors
        if not self._speed_measured and elapsed > 0.0:
            wanted = self._rate_filter.after(wanted, elapsed)
        e_rate = vectors.difference(wanted, rate)
        command, self._integral = vectors.pid(e, e_rate, self._integral, self._gains, elapsed)
        return command

    def _solve(self, geometry: Any, rate: Any, acceleration: Any) -> Any:
        """Return the actuator forces of a motion, None if they are not determined."""
        return self._model.forces(geometry, rate, acceleration)

    def _limited(self, force: Any, state: Any, elapsed: float) -> Any:
        """Return the limited forces nearest in effect; back-calculate integral and pace."""
        self._wanted = force
        mass = self._model.mass(state.geometry)
        limited = self._limits.nearest(force, mass, state.jacobian, self._setpoints.current.rate)
        pace = self._pace * (1.0 + elapsed * limited.pace_rate)
        self._pace = max(LEAST_PACE, min(1.0, pace))
        short = self._vectors.difference(limited.force, force)
        missing = self._command_error(state, short, limited.acceleration_error)
        self._integral = self._vectors.unwound(
            self._integral, missing, self._tracking_rate, elapsed
        )
        return limited.force

    def _weight(self) -> Any:
        """Return the forces that hold the weight at the estimated pose.

        Near a singularity, where these grow without bound, those at the setpoint.
        """
        state = self.estimate.state
        near = self._model.near_singular(state, self._stop)
        geometry = self._setpoints.current.geometry if near else state.geometry
        zero = self._vectors.zero
        force = self._solve(geometry, zero, zero)
        return self._no_force if force is None or not math.isfinite(sum(force)) else force

    def _stopped(self, number: int, elapsed: float, reason: str = "") -> Status:
        """Stop, or stay stopped: hold the first pose estimated since, else the weight."""
        self._stop_reason = self._stop_reason or reason
        state, force = self.estimate.state, None
        if number & _NO_RESULT or self._model.near_singular(state, self._stop):
            self._rest = None
        else:
            zero = self._vectors.zero
            self._rest = self._rest or Setpoint(state.geometry, zero, zero)
            self._elapsed = elapsed
            force = self._law(state, self._rest)
        if force is None or not math.isfinite(sum(force)):
            self._rest, force = None, self._weight()
        if not self._limits.within(force):
            number |= flags.SATURATED
            if self._rest is None:
                self._wanted, force = force, self._limits.clipped(force)
            else:
                force = self._limited(force, state, elapsed)
        self._send(force)
        self.status = status = STATUSES[number | flags.STOPPED]
        return status

    def _send(self, force: Any) -> None:
        out = self.forces
        for i, one in enumerate(force):  # faster than by a slice
            out[i] = one

    @property
    def _force_units(self) -> list[str]:
        if isinstance(self.robot, RPSRobot):
            return ["N"] * 3
        mechanism = task_of(self.robot).mechanism
        turning = mechanism.angular_velocities[mechanism.actuated_indices]
        return ["N m" if one else "N" for one in turning]


def model_of(robot: Robot, near: ArrayLike, compiled: Compiled, **settings: Any) -> ControlModel:
    """Return what a controller knows of a robot; raises as `Controller`."""
    if isinstance(robot, RPSRobot):
        return LegModel(robot, near, **settings)
    return TaskModel(_own(task_of(robot), compiled), near, **settings)


def _own(task: Task, compiled: Compiled) -> Task:
    """Return a task with scratch memory of its own, in generated code if that is asked for."""
    words = isinstance(compiled, str | bool) and compiled in ("auto", True, False)
    if not (words or hasattr(compiled, "address")):
        raise InputError(f'compiled = {shown(compiled)}: it must be "auto", True or False')
    if compiled is True and not task.compiled:
        return task.compile(functions=("kinematics", "closing", "dynamics"))
    return deepcopy(task) if compiled or not task.compiled else task.interpreted()
