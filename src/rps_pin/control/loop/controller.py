"""What every controller does in a tick, whatever its law.

    reading -> estimate -> target -> law -> force limits -> forces

Nothing in it raises for its numbers, and the forces it leaves are always finite and within limits:

- A reading that is lost, not finite, or jumps is not believed; for a few ticks the robot is taken
  to move on at its last rate. After `most_lost` of them in a row the controller stops.
- A target that cannot be gone to is refused, the last good one held, and the next good one come
  back to without a step (`rps_pin.control.loop.setpoints`).
- Forces beyond the limits are replaced by those nearest in effect
  (`rps_pin.control.loop.force_limits`), and the law's integral gives way by what they miss.
- Where the robot is too near a singularity for its forces to be known, the controller stops.

Stopped, it goes nowhere any more: with readings that can be believed the law holds the pose that
was seen first; without them, or too near a singularity, the forces only bear the weight. It stays
so until `reset`; brakes that hold without current are the drives' business.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.estimator.effective_inertia import ReducedMass
from rps_pin.control.estimator.numbers import Numbers, elapsed_time
from rps_pin.control.estimator.place import place_of, turning_determinant
from rps_pin.control.estimator.real_time_robot import Known, RealTimeRobot
from rps_pin.control.estimator.scalar_rates import leg_gains
from rps_pin.control.estimator.scalar_state import RobotState, state_at
from rps_pin.control.loop.force_limits import ForceLimits
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.limit_check import LimitCheck
from rps_pin.control.loop.matched_rate import MatchedRate
from rps_pin.control.loop.setpoints import Goal, Targets
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.errors import InputError, SingularityError
from rps_pin.rps.checks import finite_entries
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.robot import RPSRobot

Space = Literal["actuator", "task"]

_NOT_CONVERGED, _NEAR_SINGULAR, _BEYOND_LIMIT = 4, 8, 16
_SATURATED, _TARGET_HELD, _STOPPED, _KEPT = 32, 64, 128, 1 | 2 | 4
_STILL = (0.0, 0.0, 0.0)
#: Least pace, and the time in which it comes back to 1, s.
_SLOWEST, _RECOVERY = 0.05, 0.2


class Controller(ABC):
    """The part of a controller that all laws share; see `ComputedTorque` and `PDControl`.

    Parameters
    ----------
    robot
        The robot as it is believed to be, with its payload and friction.
    near
        The pose it starts in, shape (3,), m and rad; also the first target, at rest.
    gains
        Of the law; their units are the law's.
    space
        What errors are of: ``"actuator"`` (leg lengths) or ``"task"`` (the pose).
    period
        Time between two ticks, s.
    cut_off
        Of the filter of the legs' speeds where none are measured, Hz; infinite for none.
    force_limit
        Of the actuators, N: one or three; the robot's own if left out.
    near_singular
        Distance to a singularity (0 to 1) below which the status says so, and targets are refused.
    stop_singular
        Distance below which the controller stops; less than `near_singular`.
    largest_jump
        By how much a leg's reading may differ from the last good one, m a tick since; if left out,
        1.2 times what the actuators' speed limit allows. An encoder that is off by more than
        most_lost + 1 times this, and stays so, stops the controller; one that is off by less is
        believed in the end, after `Status.JUMP`.
    most_lost
        Readings in a row that may be lost, or jump, before the controller stops.

    Attributes
    ----------
    forces : (3,) array
        What to send to the actuators, N: of the last tick. Before the first, those that hold the
        robot still.
    robot : RPSRobot
        As given.
    estimate : RealTimeRobot
        What is known of the robot: pose, rate, distance to a singularity.
    pace : float
        How fast the target should go on, 0.05 to 1 of its own speed: less than 1 while and shortly
        after actuators are at their limits. `PacedTrajectory` follows it; without, the robot falls
        behind and cuts corners.
    status : Status
        Of the last tick.
    period : float
        As given.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError
        If a leg has no length in the pose.
    SingularityError
        If the pose is nearer to a singularity than `near_singular`.
    """

    def __init__(
        self,
        robot: RPSRobot,
        near: ArrayLike,
        gains: Gains,
        *,
        space: Space,
        period: float = 1e-3,
        cut_off: float = 100.0,
        force_limit: ArrayLike | None = None,
        near_singular: float = 0.05,
        stop_singular: float = 0.01,
        largest_jump: float | None = None,
        most_lost: int = 3,
    ) -> None:
        p = robot.parameters
        if not isinstance(gains, Gains):
            raise InputError(f"gains must be Gains, not {type(gains).__name__}")
        if space not in ("actuator", "task"):
            raise InputError(f"space = {space!r}; it must be 'actuator' or 'task'")
        if not 0.0 < stop_singular < near_singular:
            raise InputError(
                f"stop_singular = {stop_singular}: it must be positive and less than "
                f"near_singular = {near_singular}"
            )
        if not (isinstance(most_lost, int) and most_lost >= 0):
            raise InputError(f"most_lost = {most_lost!r}: it must be a number of ticks, 0 or more")
        jump = 1.2 * p.actuator_speed_limit * period if largest_jump is None else largest_jump
        self.robot = robot
        self.estimate = RealTimeRobot(
            robot,
            near,
            period=period,
            cut_off=cut_off,
            near_singular=near_singular,
            largest_jump=jump,
        )
        self.period, self.gains, self.space = period, gains, space
        self._kp, self._kd, self._ki = gains.rows
        self._give = tuple(1.0 / time for time in gains.tracking_time)
        self._g, self._h = float(p.base_radius), float(p.platform_radius)
        self._targets = Targets(
            LimitCheck(p),
            self._g,
            self._h,
            near_singular,
            1e6 * (self._g + self._h),
            p.actuator_speed_limit,
        )
        self._limits = ForceLimits(_limit(robot, force_limit))
        self._mass = ReducedMass(robot)
        self._matched = MatchedRate(cut_off)
        self._near, self._stop, self._most_lost = near_singular, stop_singular, most_lost
        self.forces: Array = np.zeros(3)
        self.reset(near)

    def reset(self, near: ArrayLike) -> None:
        """Start anew from a pose, at rest. Raises what the constructor does."""
        self.estimate.reset(near)
        place = self.estimate.known.place
        determinant = turning_determinant(place, self._g, self._h)
        nearest = min(abs(determinant), self.estimate.distance)
        if nearest < self._near:
            raise SingularityError(
                f"the pose to start from is too near a singularity: distance {nearest:.3g}, at "
                f"least {self._near:.3g} is asked for",
                1 / max(nearest, 1e-300),
                1 / self._near,
            )
        self._targets.reset(place)
        self._integral: Triple = _STILL
        self._matched.reset()
        self._measured = False
        self._why = ""
        self._rest: Goal | None = None
        self.pace = 1.0
        self.status = Status.OK
        self._wanted: Triple = _STILL
        self._send(self._limits.cut(self._weight()))

    # Each tick ------------------------------------------------------------------------------------

    def tick(
        self,
        length: Numbers,
        target: Any = None,
        speed: Numbers = None,
        *,
        dt: float | None = None,
    ) -> Status:
        """Take a reading and a target, and put the forces to send in `forces`.

        Parameters
        ----------
        length
            Leg lengths, shape (3,), m; None if the sample was lost.
        target
            Pose, rate and acceleration, (3,) each, as `Trajectory.sample` returns them; None for
            the last one again.
        speed
            The legs' speeds, shape (3,), m/s; if left out, filtered differences of the lengths.
        dt
            Time since the last call, s, if not the period.

        Returns
        -------
        Status
            See `status_text` for its words.
        """
        estimate = self.estimate
        number = int(estimate.estimate(length, speed, dt=dt))
        time = self.period if dt is None else elapsed_time(dt)
        if not self._targets.take(target, time):
            number |= _TARGET_HELD
        # Of a reading that is not believed nothing is integrated.
        fresh = not number & _KEPT
        elapsed = time if fresh else 0.0
        if self._why:
            return self._stopped(number, elapsed)
        self._measured = speed is not None
        known: Known | None = estimate.known
        if not fresh:
            if estimate.age > self._most_lost:
                why = f"{estimate.age} readings in a row were not good"
                return self._stopped(number, elapsed, why)
            known = self._ahead(estimate.known, estimate.elapsed)
        if known is None or self._too_near(known):
            return self._stopped(
                number | _NEAR_SINGULAR,
                elapsed,
                f"at a distance of less than {self._stop:.3g} to a singularity",
            )
        force = self._law(known, self._targets.goal, elapsed)
        if force is None or not math.isfinite(force[0] + force[1] + force[2]):
            why = "the law gave no finite forces"
            return self._stopped(number | _NOT_CONVERGED, elapsed, why)
        if not self._limits.within(force):
            number |= _SATURATED
            force = self._limited(force, known, elapsed)
        elif self.pace < 1.0:
            self.pace += (1.0 - self.pace) * min(1.0, elapsed / _RECOVERY)
        self._send(force)
        self.status = status = STATUSES[number]
        return status

    @abstractmethod
    def _law(self, known: Known, goal: Goal, elapsed: float) -> Triple | None:
        """Return the forces wanted, N, or None; the integral is over the time elapsed, s."""

    @abstractmethod
    def _missed(self, known: Known, force: Triple, acceleration: Triple) -> Triple:
        """Return what limits take from the command, in its unit, of force and pose acceleration."""

    @property
    def status_text(self) -> str:
        """The reasons of `status`, in words."""
        words = []
        if self.status & (Status.TARGET_HELD):
            words += self._targets.words()
        if self.estimate.status:
            words.append(self.estimate.status_text)
        if self.status & Status.SATURATED:
            words.append(
                "an actuator is at its limit: the forces wanted are "
                f"({', '.join(f'{f:.6g}' for f in self._wanted)}) N"
            )
        if self.status & Status.STOPPED:
            words.append(f"stopped: {self._why}; reset to go on")
        return "; ".join(words) or "ok"

    # Inner workings -------------------------------------------------------------------------------

    def _pid(self, e: Triple, wanted: Triple, rate: Triple, elapsed: float) -> Triple:
        """Return Kd e' + Kp e + I, having integrated I' = Ki e; e' = wanted - rate."""
        if not self._measured and elapsed > 0.0:
            wanted = self._matched.after(wanted, elapsed)
        (p1, p2, p3), (d1, d2, d3), (i1, i2, i3) = self._kp, self._kd, self._integral
        (e1, e2, e3), (w1, w2, w3), (v1, v2, v3), (k1, k2, k3) = e, wanted, rate, self._ki
        i1, i2, i3 = i1 + elapsed * k1 * e1, i2 + elapsed * k2 * e2, i3 + elapsed * k3 * e3
        self._integral = (i1, i2, i3)
        return (
            p1 * e1 + d1 * (w1 - v1) + i1,
            p2 * e2 + d2 * (w2 - v2) + i2,
            p3 * e3 + d3 * (w3 - v3) + i3,
        )

    def _solve(self, state: RobotState) -> Triple | None:
        """Return the forces of a motion through the constraint models, if they are determined."""
        solved = self.estimate.dynamics.solve(state)
        return None if solved is None else (solved[9], solved[10], solved[11])

    def _limited(self, force: Triple, known: Known, elapsed: float) -> Triple:
        """Return the forces nearest in effect, and let the integral give way by what is missed."""
        self._wanted = force
        mass = self._mass.of(known.place)
        allowed = self._limits.nearest(force, mass, known.gains, self._targets.goal.rate)
        given = allowed.force
        self.pace *= 1.0 + elapsed * allowed.hurry
        self.pace = max(_SLOWEST, min(1.0, self.pace))
        short = (given[0] - force[0], given[1] - force[1], given[2] - force[2])
        (i1, i2, i3), (w1, w2, w3) = self._integral, self._give
        m1, m2, m3 = self._missed(known, short, allowed.missing)
        # I' = Ki e + (what is missed) / T_t
        self._integral = (i1 + elapsed * w1 * m1, i2 + elapsed * w2 * m2, i3 + elapsed * w3 * m3)
        return given

    def _ahead(self, known: Known, time: float) -> Known | None:
        """Return what is known after a time at the last rate."""
        (z, wx, wy), (dz, dwx, dwy) = known.place.pose, known.rate
        pose = (z + time * dz, wx + time * dwx, wy + time * dwy)
        place = place_of(pose, self._g, self._h)
        if place is None:
            return None
        gains = leg_gains(pose, place.way, place.coefficient, self._h)
        return Known(place, known.rate, known.speed, gains)

    def _too_near(self, known: Known) -> bool:
        """Return whether forces are not to be trusted: both determinants are 1 at best."""
        turning = turning_determinant(known.place, self._g, self._h)
        return not (abs(known.gains.determinant) > self._stop < abs(turning))

    def _weight(self) -> Triple:
        """Return the forces that hold the weight at the last good pose.

        Near a singularity they grow without bound; then those at the last good target, which is not
        near one.
        """
        known = self.estimate.known
        place = self._targets.goal.place if self._too_near(known) else known.place
        held = self._solve(state_at(place, _STILL, _STILL, self._h))
        return _STILL if held is None else held

    def _stopped(self, number: int, elapsed: float, why: str = "") -> Status:
        """Stop, or stay stopped: hold the pose that was first seen since, else the weight."""
        self._why = self._why or why
        known, force = self.estimate.known, None
        if number & _KEPT or self._too_near(known):
            self._rest = None
        else:
            self._rest = self._rest or Goal(known.place, _STILL, _STILL)
            force = self._law(known, self._rest, elapsed)
        if force is None or not math.isfinite(force[0] + force[1] + force[2]):
            self._rest, force = None, self._weight()
        if not self._limits.within(force):
            number |= _SATURATED
            if self._rest is None:
                self._wanted, force = force, self._limits.cut(force)
            else:
                force = self._limited(force, known, elapsed)
        self._send(force)
        self.status = status = STATUSES[number | _STOPPED]
        return status

    def _send(self, force: Triple) -> None:
        out = self.forces
        out[0], out[1], out[2] = force


def _limit(robot: RPSRobot, given: ArrayLike | None) -> Triple:
    """Return the force limit of each actuator, N."""
    if given is None:
        own = robot.parameters.actuator_force_limit
        return own, own, own
    limit = np.asarray(given, dtype=np.float64)
    finite_entries(np.where(np.isposinf(limit), 1.0, limit), (), "force_limit")
    if limit.shape not in ((), (3,)) or not (limit > 0).all():
        raise InputError(f"force_limit = {given}: it must be one positive number of N, or three")
    one, two, three = np.broadcast_to(limit, 3).tolist()
    return one, two, three
