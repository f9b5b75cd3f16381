"""State estimate and inverse dynamics of the robot in a control loop, without exceptions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.control.estimator.last_good import LastGood
from rps_pin.control.estimator.leg_geometry import (
    LARGEST_LENGTH,
    LegGeometry,
    closure_determinant,
    in_range,
    leg_geometry,
)
from rps_pin.control.estimator.leg_jacobian import LeastSingularValue
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time, three_floats
from rps_pin.control.estimator.output_arrays import Answers
from rps_pin.control.estimator.robot_state import robot_state
from rps_pin.control.estimator.state_estimate import StateEstimate, departure, state_estimate
from rps_pin.control.generated.code import NOT_REGULAR, GeneratedDynamics, GeneratedTick
from rps_pin.control.generated.engine import Compiled, generated_tick
from rps_pin.control.generated.proof import Ticked
from rps_pin.control.generated.tick import DYNAMICS, ESTIMATE, form_of
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.filters import SpeedFilter
from rps_pin.control.loop.limits import RobotLimits
from rps_pin.control.loop.setpoints import LARGEST_RATE, all_below
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.one_thread import TickGuard, guarded, one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.plain_text import short
from rps_pin.rps.kinematics.forward_kinematics import CONDITION_LIMIT, start_of
from rps_pin.rps.kinematics.tracking import LegDirections, Triple, follow
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import positive_number

_ZERO = (0.0, 0.0, 0.0)
#: Below this determinant of Eq. 8 half of the forces' digits are lost.
_NO_FORCES = 1e-8


@one_thread(
    "guard",
    besides=("estimate", "forces_for", "inverse_dynamics", "memory", "numbers", "take"),
    properties=("state", "status_text", "force_status_text", "type_ii"),
)
class RealTimeRobot(LastGood):
    """State estimate from encoder lengths, and inverse dynamics, one tick at a time.

    All arrays are allocated by the constructor. No call in the loop raises for the values of its
    arguments: it returns a `Status`, and where there is no new result the last good one stays. An
    object is for one thread at a time: a second one that calls meanwhile gets a `ThreadError`.
    Objects in several threads may share one robot, whose `pin.Model` they do not change. A copy has
    the state, and arrays of its own.

    Parameters
    ----------
    robot
        The robot, with payload and friction.
    near
        The pose at the start, shape (3,), m and rad.
    answers
        Arrays for the results; default: new ones.
    period
        Time between two ticks, s: for speeds that are not measured.
    cut_off
        Of the filter of such speeds, Hz (see `rps_pin.control.loop.filters`); infinite for none.
    near_singular
        `type_ii`, or `force_determinant`, below which the status has `Status.NEAR_SINGULAR`, 0 to
        1.
    largest_jump
        Largest difference of a leg length from its prediction (the last good length and its speed),
        m for each tick since. Default: any length that can be followed is accepted.
    most_steps
        Most steps that one reading may be divided into, which bounds the time of a tick.
    compiled
        ``"auto"``: regular ticks are computed by generated code, if it is there or can be built
        (`rps_pin.control.generated`); True: `CompileError` if not; False: interpreted.

    Attributes
    ----------
    compiled : bool
        Whether generated code runs.
    engine : str
        What runs: its compiler, or why there is none.
    answers : Answers
        The last good results.
    status, force_status : Status
        Of the last `estimate` and the last inverse dynamics.
    elapsed : float
        Time since the last good estimate, s.
    age, force_age : int
        Ticks since the last good result of each: 0 if the last call gave one.
    determinant : float
        At the estimated pose, 0 at a type II singularity: `SingularityMeasures.determinant`, -1 to
        1. Its absolute value is at most `type_ii`.
    force_determinant : float
        At the pose of the last good inverse dynamics: `leg_equations.determinant`, -1 to 1, 0 at
        type II and constraint singularities.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError
        If a leg has no length in the pose.
    SingularityError
        If the pose is singular.
    CompileError
        If there is no generated code, with ``compiled=True``.
    """

    @refuses_other_kinds
    def __init__(
        self,
        robot: RPSRobot,
        near: ArrayLike,
        *,
        answers: Answers | None = None,
        period: float = 1e-3,
        cut_off: float = 50.0,
        near_singular: float = 0.05,
        largest_jump: float = math.inf,
        most_steps: int = 20,
        compiled: Compiled = "auto",
    ) -> None:
        p = robot.parameters
        self._g, self._h = float(p.base_radius), float(p.platform_radius)
        self._largest = LARGEST_LENGTH * (self._g + self._h)
        self._limits = RobotLimits(p)
        self.dynamics, self._singular_value = ConstrainedForces(robot), LeastSingularValue()
        self._period = positive_number(period, "period", "s")
        self._filter = SpeedFilter(positive_number(cut_off, "cut_off", "Hz", infinite=True))
        self._near = positive_number(near_singular, "near_singular")
        self._jump = positive_number(largest_jump, "largest_jump", "m", infinite=True)
        self._most = int(positive_number(most_steps, "most_steps"))
        self.answers = Answers.new() if answers is None else answers.checked()
        #: Of this object, or of the controller that has it.
        self.generated: GeneratedTick | None = None
        self._fast: GeneratedTick | None = None
        self._dynamics: GeneratedDynamics | None = None
        self._robot = robot
        #: Shared with the controller that has this object.
        self.guard = TickGuard()
        self.reset(near)
        self.engine = self._use_estimate(compiled)
        if self._fast is not None:
            self._use_dynamics(compiled)

    def _use_estimate(self, compiled: Compiled) -> str:
        """Let generated code compute estimates, if there is any; return what runs."""
        own = self._period, self._filter.share, self.take
        self._fast, engine = generated_tick(
            *(compiled, ESTIMATE, _proven_estimate),
            lambda library: GeneratedTick(
                ESTIMATE, form_of(ESTIMATE), library, self.answers[:5], *own
            ),
        )
        if self._fast is not None:
            self.generated = self._fast
            self._fast.set_numbers(self.numbers())
            self._fast.set_memory(self.memory())
        return engine

    def _use_dynamics(self, compiled: Compiled) -> None:
        """Let generated code compute forces, if there is any."""
        self._dynamics, _ = generated_tick(
            *(compiled, DYNAMICS, _proven_dynamics),
            lambda library: GeneratedDynamics(
                DYNAMICS, form_of(DYNAMICS), library, self.answers[5:]
            ),
        )
        if self._dynamics is not None:
            terms = self._robot.force_terms
            self._dynamics.set_numbers(
                {
                    **self.numbers(),
                    **{one.name: getattr(terms, one.name) for one in fields(terms)},
                    "force_limit": self._limits.greatest_force,
                }
            )

    @property
    def compiled(self) -> bool:
        """Whether generated code runs."""
        return self.generated is not None

    def reset(self, near: ArrayLike) -> None:
        """Start again from a pose, at rest and without forces. Raises as the constructor does."""
        _, d, directions, _ = start_of(near, self._g, self._h, CONDITION_LIMIT)
        self._begin()
        self.age, self.elapsed, self._fraction = 0, 0.0, 1.0
        self._type_ii: float | None = None
        self._determinant = 0.0
        self._length: Triple | None = d
        self._geometry_flags = 0
        self.status = self._accept(d, directions, _ZERO)
        self._filter.reset()
        self.force_status, self.force_age, self._force_determinant = Status.OK, 0, 0.0
        self._pose: Triple | None = None
        self._forces_generated = False
        self.answers.forces[:] = self.answers.reactions[:] = 0.0
        if self._fast is not None:
            self._fast.set_memory(self.memory())

    # Generated code -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, Any]:
        """Return what generated code takes of this object: `ESTIMATE_NUMBERS`."""
        return {
            "radii": (self._g, self._h),
            "bounds": self._limits.bounds,
            "speed_limit": self._limits.greatest_speed,
            "largest": self._largest,
            "near": self._near,
            "jump": self._jump,
            "condition_limit": CONDITION_LIMIT,
            "most_steps": float(self._most),
        }

    def memory(self) -> dict[str, Any]:
        """Return what the next tick starts from: `ESTIMATE_MEMORY`."""
        geometry, rate, speed, _ = self._state
        return {
            "length": geometry.length,
            "direction": geometry.direction,
            "speed": speed,
            "started": 0.0 if self._filter.last is None else 1.0,
            "determinant": self._determinant,
            "pose": geometry.pose,
            "rate": rate,
        }

    @refuses_other_kinds
    def take(self, memory: dict[str, Any]) -> None:
        """Set the state from generated code's memory."""
        d, speed = memory["length"], memory["speed"]
        found = state_estimate(d, memory["direction"], speed, self._g, self._h)
        assert found is not None  # a regular tick is far from singularities
        self._state, self._type_ii = found[0], None
        self._determinant = memory["determinant"]
        violated = self._limits.violated(self._state.geometry)
        self._geometry_flags = flags.BEYOND_LIMIT if violated else 0
        self._filter.update(d, speed)

    @property
    def state(self) -> StateEstimate:
        """The motion by the last good reading."""
        if self.generated is not None:
            self.generated.pull()
        return self._state

    @property
    def determinant(self) -> float:
        """See the class."""
        if self.generated is not None and self.generated.ahead:
            return self.generated.remembered("determinant")
        return self._determinant

    @property
    def force_determinant(self) -> float:
        """See the class."""
        if self._forces_generated and self._dynamics is not None:
            return self._dynamics.remembered("determinant")
        return self._force_determinant

    # Each tick ------------------------------------------------------------------------------------

    def estimate(
        self, length: Numbers, speed: Numbers | None = None, *, dt: float | None = None
    ) -> Status:
        """Take an encoder reading; write pose, rate, twist, angles and speeds to `answers`.

        The pose is followed from the last good one as `EncoderTracker` does, with its guarantees.

        Parameters
        ----------
        length
            Leg lengths, shape (3,), m.
        speed
            Leg speeds, shape (3,), m/s; default: filtered differences of the lengths.
        dt
            Time since the last call, s; default: the period.
        """
        fast, guard = self._fast, self.guard
        if fast is not None and fast.ready and not guard.busy:
            try:
                guard.busy = True
                number = fast.estimate(length, speed, dt)
                if number != NOT_REGULAR:
                    self.status = status = STATUSES[number]
                    return status
            finally:
                guard.busy = False
        return self._estimate(length, speed, dt)

    @guarded("guard")
    def _estimate(self, length: Numbers, speed: Numbers | None, dt: float | None) -> Status:
        """Do the same in Python."""
        status = self._estimated(length, speed, dt)
        if self._fast is not None and self.age == 0:
            self._fast.set_memory(self.memory())
        return status

    def _estimated(self, length: Numbers, speed: Numbers | None, dt: float | None) -> Status:
        self._begin()
        elapsed = self.elapsed + (self._period if dt is None else elapsed_time(dt))
        if not self.elapsed < elapsed < math.inf:
            return self._keep(flags.BAD_INPUT)
        self.elapsed = elapsed
        self._length = d = three_floats(length)
        if d is None or not (min(d) > 0.0 and max(d) < self._largest):
            return self._keep(flags.BAD_INPUT)
        last = self._state.geometry.length
        if departure(d, last, self._state.speed, elapsed) > self._jump * (self.age + 1):
            return self._keep(flags.JUMP)
        speeds = self._filter.after(d, elapsed) if speed is None else three_floats(speed)
        if speeds is None:
            return self._keep(flags.BAD_INPUT)
        directions, _, self._fraction = follow(
            last, self._state.geometry.direction, d, self._g, self._h, CONDITION_LIMIT, self._most
        )
        if self._fraction < 1.0:
            return self._keep(flags.NOT_CONVERGED)
        return self._accept(d, directions, speeds)

    def inverse_dynamics(self, pose: Numbers, rate: Numbers, acceleration: Numbers) -> Status:
        """Write the forces and reactions of a motion, in any pose, to `answers`.

        They are those of `RPSRobot.inverse_dynamics`, by the constraint models, with payload and
        friction.

        Parameters
        ----------
        pose, rate, acceleration
            Pose (m, rad, rad) and its first and second time derivatives, shape (3,) each.
        """
        dynamics, guard = self._dynamics, self.guard
        if dynamics is not None and not guard.busy:
            try:
                guard.busy = True
                number = dynamics.forces(pose, rate, acceleration)
                if number != NOT_REGULAR:
                    return self._forces_computed(number)
            finally:
                guard.busy = False
        return self._inverse_dynamics(pose, rate, acceleration)

    @guarded("guard")
    def _inverse_dynamics(self, pose: Numbers, rate: Numbers, acceleration: Numbers) -> Status:
        """Do the same in Python."""
        x, dx, ddx = three_floats(pose), three_floats(rate), three_floats(acceleration)
        self._in_python(x)
        if x is None or dx is None or ddx is None:
            return self._keep_forces(flags.BAD_INPUT)
        geometry = leg_geometry(x, self._g, self._h)
        if geometry is None:
            no_length = in_range(x, self._g, self._h)
            reason = flags.NOT_CONVERGED | flags.BEYOND_LIMIT if no_length else flags.BAD_INPUT
            return self._keep_forces(reason)
        number = flags.BEYOND_LIMIT if self._limits.violated(geometry) else 0
        return self._solve(geometry, dx, ddx, number)

    def forces_for(self, acceleration: Numbers) -> Status:
        """Write the forces that give the estimated motion an acceleration to `answers`.

        The same as `inverse_dynamics` of `answers.pose`, `answers.rate` and this acceleration, to
        rounding error, in less time.

        Parameters
        ----------
        acceleration
            The pose's second time derivative, shape (3,).
        """
        fast, dynamics, guard = self._fast, self._dynamics, self.guard
        if (
            fast is not None
            and dynamics is not None
            and (fast.ahead or fast.ready)
            and not guard.busy
        ):
            try:
                guard.busy = True
                number = dynamics.forces_at(*fast.motion(), acceleration)
                if number != NOT_REGULAR:
                    return self._forces_computed(number)
            finally:
                guard.busy = False
        return self._forces_for(acceleration)

    @guarded("guard")
    def _forces_for(self, acceleration: Numbers) -> Status:
        """Do the same in Python."""
        geometry, rate, _, _ = self.state
        self._in_python(geometry.pose)
        ddx = three_floats(acceleration)
        if ddx is None:
            return self._keep_forces(flags.BAD_INPUT)
        return self._solve(geometry, rate, ddx, self._geometry_flags)

    def _forces_computed(self, number: int) -> Status:
        """Note forces that generated code has written."""
        self._forces_generated, self.force_age = True, 0
        self.force_status = status = STATUSES[number]
        return status

    def _in_python(self, pose: Triple | None) -> None:
        """Begin inverse dynamics in Python, at a pose."""
        self._force_determinant = self.force_determinant  # of the last good forces
        self._forces_generated, self._pose = False, pose

    # On demand ------------------------------------------------------------------------------------

    @property
    def type_ii(self) -> float:
        """`SingularityMeasures.type_ii` of the estimated pose, 0 to 1."""
        state = self.state
        if self._type_ii is None:
            self._type_ii = self._singular_value.of(state.jacobian)
        return self._type_ii

    @property
    def distance(self) -> float:
        """Deprecated name of `type_ii`."""
        return self.type_ii

    @property
    def status_text(self) -> str:
        """The reasons of `status`, as text."""
        status, state = self.status, self.state
        messages = []
        if status & Status.BAD_INPUT:
            messages.append(
                "length, speed or dt is not finite, not positive, or out of range: lengths are "
                + (f"{_text(self._length)} m" if self._length else "not three finite numbers")
            )
        if status & Status.JUMP:
            messages.append(
                f"lengths {_text(self._length)} m are more than {self._jump:.6g} m a tick from "
                f"the prediction by the last good ones, {_text(state.geometry.length)} m"
            )
        if status & Status.NOT_CONVERGED:
            messages.append(
                f"lengths {_text(self._length)} m cannot be followed in {self._most} steps: "
                f"{self._fraction:.4%} of the way was done; it meets a singularity or is too long"
            )
        if status.kept:
            messages.append(f"the last good estimate is kept; it is {self.age} ticks old")
        if status & Status.NEAR_SINGULAR:
            messages.append(
                f"near a type II singularity: type_ii {self.type_ii:.3g}, "
                f"at least {self._near:.3g} is required"
            )
        if status & Status.BEYOND_LIMIT:
            messages += self._limits.messages(state.geometry)
            messages += self._limits.actuator_messages("speed", state.speed)
        return "; ".join(messages) or "ok"

    @property
    def force_status_text(self) -> str:
        """The reasons of `force_status`, as text."""
        status, pose = self.force_status, self._pose
        if self._forces_generated and self._dynamics is not None:
            pose = self._dynamics.pose
        messages = []
        if status & Status.BAD_INPUT:
            messages.append(
                "pose, rate or acceleration is not finite or out of range (a tilt of a whole turn, "
                "forces beyond the range of floats): the pose is "
                + (f"{_text(pose)} m, rad, rad" if pose else "not three finite numbers")
            )
        if status & Status.NOT_CONVERGED:
            messages.append(f"at pose {_text(pose)} m, rad, rad the forces are not determined")
        if status.kept:
            messages.append(f"the last good forces are kept; they are {self.force_age} ticks old")
        elif status & Status.NEAR_SINGULAR:
            messages.append(
                f"near a singularity: determinant {self.force_determinant:.3g}, at least "
                f"{self._near:.3g} in size is required"
            )
        if status & Status.BEYOND_LIMIT and pose:
            geometry = leg_geometry(pose, self._g, self._h)
            if geometry is None:
                return "; ".join([*messages, "the length of a leg is zero"])
            messages += self._limits.messages(geometry)
            forces = self.answers.forces.tolist()
            messages += self._limits.actuator_messages("force", forces)
        return "; ".join(messages) or "ok"

    # Inner workings -------------------------------------------------------------------------------

    def _accept(self, d: Triple, directions: LegDirections, speed: Triple) -> Status:
        """Set the state of a followed reading, unless its rates are not finite."""
        found = state_estimate(d, directions, speed, self._g, self._h)
        if found is None:
            return self._keep(flags.NOT_CONVERGED | flags.NEAR_SINGULAR)
        state, twist = found
        if not math.isfinite(sum(twist)):  # the rate is in it
            return self._keep(flags.BAD_INPUT)
        self._state = state
        geometry, rate, _, jacobian = state
        self._type_ii, self._determinant = None, jacobian.determinant
        number = self._geometry_flags = flags.BEYOND_LIMIT if self._limits.violated(geometry) else 0
        if self._limits.too_fast(speed):
            number = flags.BEYOND_LIMIT
        # No singular value of M is above 1, so none is below the determinant's absolute value.
        if not abs(jacobian.determinant) >= self._near and self.type_ii < self._near:
            number |= flags.NEAR_SINGULAR
        self._filter.update(d, speed)
        # Entry by entry: faster than by slices.
        to_pose, to_rate, to_twist, to_angle, to_speed = self.answers[:5]
        to_pose[0], to_pose[1], to_pose[2] = geometry.pose
        to_rate[0], to_rate[1], to_rate[2] = rate
        to_twist[0], to_twist[1], to_twist[2], to_twist[3], to_twist[4], to_twist[5] = twist
        to_angle[0], to_angle[1], to_angle[2] = geometry.angle
        to_speed[0], to_speed[1], to_speed[2] = speed
        return self._renew(number)

    def _solve(
        self, geometry: LegGeometry, rate: Triple, acceleration: Triple, number: int
    ) -> Status:
        """Write the forces of a motion to the results, if they are determined."""
        determinant = closure_determinant(geometry, self._g, self._h)
        if not abs(determinant) >= self._near:
            number |= flags.NEAR_SINGULAR
            if not abs(determinant) >= _NO_FORCES:
                return self._keep_forces(number & ~flags.BEYOND_LIMIT | flags.NOT_CONVERGED)
        in_range = all_below(rate, LARGEST_RATE)
        state = robot_state(geometry, rate, acceleration, self._h) if in_range else None
        solved = None if state is None else self.dynamics.solve(state)
        if solved is None:  # rates so large that forces overflow
            return self._keep_forces(flags.BAD_INPUT)
        forces = (solved[9], solved[10], solved[11])
        if self._limits.too_strong(forces):
            number |= flags.BEYOND_LIMIT
        out = self.answers.forces
        out[0], out[1], out[2] = forces
        self.answers.reactions[:] = solved[:9]
        self.force_age, self._force_determinant = 0, determinant
        self.force_status = status = STATUSES[number]
        return status

    def _keep_forces(self, number: int) -> Status:
        """Keep the last good forces, with a status."""
        self.force_age += 1
        self.force_status = status = STATUSES[number]
        return status


def _proven_estimate(
    robot: RPSRobot, start: Array, compiled: Compiled, **_: Any
) -> Callable[..., Ticked]:
    """Return what computes estimates to prove generated code with."""
    one = RealTimeRobot(robot, start, compiled=False)
    one._use_estimate(compiled)

    def ticked(length: Any, target: Any, speed: Any, dt: float | None) -> Ticked:
        status = one.estimate(length, speed, dt=dt)
        return int(status), one.answers._asdict(), one.generated is not None and one.generated.ahead

    return ticked


def _proven_dynamics(
    robot: RPSRobot, start: Array, compiled: Compiled, **_: Any
) -> Callable[..., Ticked]:
    """Return what computes forces of targets likewise."""
    one = RealTimeRobot(robot, start, compiled=False)
    one._use_dynamics(compiled)

    def ticked(length: Any, target: Any, speed: Any, dt: float | None) -> Ticked:
        status = one.inverse_dynamics(*(target or (start, start, start)))
        return int(status), one.answers._asdict(), one._forces_generated

    return ticked


def _text(values: Triple | None) -> str:
    return "(" + ", ".join(map(short, values or ())) + ")"
