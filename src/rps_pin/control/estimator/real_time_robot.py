"""The robot as a control loop sees it: encoders in, pose, twist and forces out, no exceptions."""

from __future__ import annotations

import math
from typing import NamedTuple

from numpy.typing import ArrayLike

from rps_pin.control.estimator.constrained_forces import ConstrainedForces
from rps_pin.control.estimator.numbers import Numbers, elapsed_time, three_floats
from rps_pin.control.estimator.output_arrays import Answers
from rps_pin.control.estimator.place import Place, place_of, turning_determinant
from rps_pin.control.estimator.reading import reading_of
from rps_pin.control.estimator.scalar_rates import LeastGain, LegGains, Twist
from rps_pin.control.estimator.scalar_state import RobotState, state_at
from rps_pin.control.estimator.warm_up import warm_up
from rps_pin.control.loop.limit_check import LimitCheck
from rps_pin.control.loop.speed_filter import SpeedFilter
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.rps.kinematics.forward_kinematics import CONDITION_LIMIT, start_of
from rps_pin.rps.kinematics.leg_equations import checked_positive
from rps_pin.rps.kinematics.tracking import (
    Triple,
    Way,
    follow,
)
from rps_pin.rps.robot import RPSRobot

# As plain numbers: operations on enumerations take microseconds.
_BAD_INPUT, _JUMP, _NOT_CONVERGED = 1, 2, 4
_NEAR_SINGULAR, _BEYOND_LIMIT = 8, 16
#: Readings longer than so many radii are no lengths: their powers would leave the range of floats.
_BEYOND_SENSE = 1e6
#: Below this determinant of Eq. 8 half of the forces' digits are lost.
_NO_FORCES = 1e-8
#: Below a whole turn (tilt_x, tilt_y) are coordinates; see `rps_pin.rps.singularity.measures`.
_LARGEST_TILT_SQUARED = (2 * math.pi * (1 - 1e-6)) ** 2


class Known(NamedTuple):
    """What the last good reading said."""

    place: Place
    rate: Triple
    """Of the pose."""
    speed: Triple
    """Of the legs."""
    gains: LegGains


class RealTimeRobot:
    """One robot's state from its encoders, and its inverse dynamics, tick by tick.

    Made once; all arrays are allocated then. No call in the loop raises, whatever its numbers: it
    returns a `Status`, and where there is no new answer the last good one stays. An object serves
    one thread; several, in several threads, may be made of one robot, whose `pin.Model` they share
    and do not change.

    Parameters
    ----------
    robot
        The robot, with its payload and friction.
    near
        The pose to start from, shape (3,), m and rad.
    answers
        Arrays for the answers; new ones if left out.
    period
        Time between two ticks, s: for speeds where none are given.
    cut_off
        Of the filter of such speeds, Hz (see `rps_pin.control.loop.speed_filter`); infinite for
        none.
    near_singular
        `distance`, or `force_determinant`, below which the status says so, 0 to 1.
    largest_jump
        By how much a leg's reading may differ from where the last good one and its speed lead, m,
        for each tick since. With the default any reading that can be followed is believed.
    most_steps
        Steps that one reading may be divided into: what bounds the time of a tick.

    Attributes
    ----------
    answers : Answers
        The last good answers.
    status, force_status : Status
        Of the last `estimate` and the last `inverse_dynamics`.
    elapsed : float
        Time since the last good estimate, s.
    age, force_age : int
        Ticks since the last good answer of each: 0 if the last call gave one.
    determinant : float
        Of the last good pose, 0 at a type II singularity: `SingularityMeasures.determinant`, -1 to
        1. `distance` is never less than its size.
    force_determinant : float
        Of the last good `inverse_dynamics`: `leg_equations.determinant`, -1 to 1, which vanishes at
        type II and constraint singularities.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError
        If a leg has no length in the pose.
    SingularityError
        If the pose is singular.
    """

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
    ) -> None:
        p = robot.parameters
        self._g, self._h = float(p.base_radius), float(p.platform_radius)
        self._longest = _BEYOND_SENSE * (self._g + self._h)
        self._limits = LimitCheck(p)
        self.dynamics, self._least = ConstrainedForces(robot), LeastGain()
        self._period = checked_positive(period, "period")
        self._filter = SpeedFilter(_positive(cut_off, "cut_off"))
        self._near = checked_positive(near_singular, "near_singular")
        self._jump = _positive(largest_jump, "largest_jump")
        self._most = int(checked_positive(most_steps, "most_steps"))
        self.answers = Answers.new() if answers is None else answers.checked()
        self.reset(near)
        warm_up(self.known.place, self.known.gains, self._g, self._h)

    def reset(self, near: ArrayLike) -> None:
        """Start anew from a pose, at rest and without forces. Raises what the constructor does."""
        _, d, way, _ = start_of(near, self._g, self._h, CONDITION_LIMIT)
        self.age, self.elapsed, self._fraction = 0, 0.0, 1.0
        self._distance: float | None = None
        self.determinant = 0.0
        self._asked: Triple | None = d
        self._place_number = 0
        self.status = self._accept(d, way, (0.0, 0.0, 0.0))
        self._filter.reset()
        self.force_status, self.force_age, self.force_determinant = Status.OK, 0, 0.0
        self._wanted: Triple | None = None
        self.answers.forces[:] = self.answers.reactions[:] = 0.0

    # Each tick ------------------------------------------------------------------------------------

    def estimate(
        self, length: Numbers, speed: Numbers | None = None, *, dt: float | None = None
    ) -> Status:
        """Take a reading of the encoders; put pose, rate, twist, angles and speeds in `answers`.

        The pose is followed from the last good one as `EncoderTracker` does, with its guarantees.

        Parameters
        ----------
        length
            Leg lengths, shape (3,), m.
        speed
            Their speeds, shape (3,), m/s; if left out, filtered differences of the lengths.
        dt
            Time since the last call, s, if not the period.
        """
        elapsed = self.elapsed + (self._period if dt is None else elapsed_time(dt))
        if not self.elapsed < elapsed < math.inf:
            return self._keep(_BAD_INPUT)
        self.elapsed = elapsed
        self._asked = d = three_floats(length)
        if d is None or not (min(d) > 0.0 and max(d) < self._longest):
            return self._keep(_BAD_INPUT)
        last, (v1, v2, v3) = self.known.place.length, self.known.speed
        jump = max(
            abs(d[0] - last[0] - v1 * elapsed),
            abs(d[1] - last[1] - v2 * elapsed),
            abs(d[2] - last[2] - v3 * elapsed),
        )
        if jump > self._jump * (self.age + 1):
            return self._keep(_JUMP)
        rates = self._filter.after(d, elapsed) if speed is None else three_floats(speed)
        if rates is None:
            return self._keep(_BAD_INPUT)
        way, _, self._fraction = follow(
            last, self.known.place.way, d, self._g, self._h, CONDITION_LIMIT, self._most
        )
        if self._fraction < 1.0:
            return self._keep(_NOT_CONVERGED)
        return self._accept(d, way, rates)

    def inverse_dynamics(self, pose: Numbers, rate: Numbers, acceleration: Numbers) -> Status:
        """Put the forces and reactions of a motion, `answers.pose` or any other, in `answers`.

        They are those of `RPSRobot.inverse_dynamics`, through the constraint models, with payload
        and friction.

        Parameters
        ----------
        pose, rate, acceleration
            Pose (m, rad, rad) and its first and second time derivatives, shape (3,) each.
        """
        x, dx, ddx = three_floats(pose), three_floats(rate), three_floats(acceleration)
        self._wanted = x
        if x is None or dx is None or ddx is None:
            return self._keep_forces(_BAD_INPUT)
        if not (x[1] * x[1] + x[2] * x[2] < _LARGEST_TILT_SQUARED and abs(x[0]) < self._longest):
            return self._keep_forces(_BAD_INPUT)
        place = place_of(x, self._g, self._h)
        if place is None:
            return self._keep_forces(_NOT_CONVERGED | _BEYOND_LIMIT)
        number = _BEYOND_LIMIT if self._limits.broken(place) else 0
        return self._answer(state_at(place, dx, ddx, self._h), number)

    def forces_for(self, acceleration: Numbers) -> Status:
        """Put the forces that give the last good estimate an acceleration in `answers`.

        The same as `inverse_dynamics` of `answers.pose`, `answers.rate` and this acceleration, to
        rounding error, in less time.

        Parameters
        ----------
        acceleration
            The pose's second time derivative, shape (3,).
        """
        place, rate, _, _ = self.known
        self._wanted = place.pose
        ddx = three_floats(acceleration)
        if ddx is None:
            return self._keep_forces(_BAD_INPUT)
        return self._answer(state_at(place, rate, ddx, self._h), self._place_number)

    # On demand ------------------------------------------------------------------------------------

    @property
    def distance(self) -> float:
        """Of the last good pose to a type II singularity: `SingularityMeasures.type_ii`, 0 to 1."""
        if self._distance is None:
            self._distance = self._least.of(self.known.gains)
        return self._distance

    @property
    def status_text(self) -> str:
        """The reasons of `status`, in words."""
        status, known = self.status, self.known
        words = []
        if status & Status.BAD_INPUT:
            words.append(
                "length, speed or dt is not finite, not positive, or beyond all sense: lengths are "
                + (f"{_shown(self._asked)} m" if self._asked else "not three finite numbers")
            )
        if status & Status.JUMP:
            words.append(
                f"lengths {_shown(self._asked)} m are more than {self._jump:.6g} m a tick from "
                f"where the last good ones, {_shown(known.place.length)} m, were going"
            )
        if status & Status.NOT_CONVERGED:
            words.append(
                f"lengths {_shown(self._asked)} m cannot be followed in {self._most} steps: "
                f"{self._fraction:.4%} of the way was gone; it meets a singularity or is too long"
            )
        if status.kept:
            words.append(f"the last good answer is kept; it is {self.age} ticks old")
        if status & Status.NEAR_SINGULAR:
            words.append(
                f"near a type II singularity: distance {self.distance:.3g}, "
                f"{self._near:.3g} is asked for"
            )
        if status & Status.BEYOND_LIMIT:
            words += self._limits.words(known.place)
            words += self._limits.words_of_speeds(known.speed)
        return "; ".join(words) or "ok"

    @property
    def force_status_text(self) -> str:
        """The reasons of `force_status`, in words."""
        status, wanted = self.force_status, self._wanted
        words = []
        if status & Status.BAD_INPUT:
            words.append(
                "pose, rate or acceleration is not finite or beyond all sense (a tilt of a whole "
                "turn, forces beyond the range of floats): the pose is "
                + (f"{_shown(wanted)} m, rad, rad" if wanted else "not three finite numbers")
            )
        if status & Status.NOT_CONVERGED:
            words.append(f"at pose {_shown(wanted)} m, rad, rad the forces are not determined")
        if status.kept:
            words.append(f"the last good answer is kept; it is {self.force_age} ticks old")
        elif status & Status.NEAR_SINGULAR:
            words.append(
                f"near a singularity: determinant {self.force_determinant:.3g}, in size "
                f"{self._near:.3g} is asked for"
            )
        if status & Status.BEYOND_LIMIT and wanted:
            words += self._words_of_motion(wanted)
        return "; ".join(words) or "ok"

    # Inner workings -------------------------------------------------------------------------------

    def _accept(self, d: Triple, way: Way, speed: Triple) -> Status:
        """Put what a followed reading says in the answers, unless its rates are not finite."""
        reading = reading_of(d, way, speed, self._g, self._h)
        if reading is None:
            return self._keep(_NOT_CONVERGED | _NEAR_SINGULAR)
        place, rate, twist, gains = reading
        if not math.isfinite(sum(twist)):  # the rate is in it
            return self._keep(_BAD_INPUT)
        self._distance, self.determinant = None, gains.determinant
        number = self._place_number = _BEYOND_LIMIT if self._limits.broken(place) else 0
        if self._limits.too_fast(speed):
            number = _BEYOND_LIMIT
        self.known = Known(place, rate, speed, gains)
        # No singular value of M is above 1: none is below the determinant's size.
        if not abs(gains.determinant) >= self._near and self.distance < self._near:
            number |= _NEAR_SINGULAR
        self._filter.follow(d, speed)
        self._write(place.pose, rate, twist, place.angle, speed)
        self.age, self.elapsed = 0, 0.0
        self.status = status = STATUSES[number]
        return status

    def _answer(self, state: RobotState, number: int) -> Status:
        """Put the forces of a motion in the answers, if they are determined."""
        determinant = turning_determinant(state.place, self._g, self._h)
        if not abs(determinant) >= self._near:
            number |= _NEAR_SINGULAR
            if not abs(determinant) >= _NO_FORCES:
                return self._keep_forces(number & ~_BEYOND_LIMIT | _NOT_CONVERGED)
        solved = self.dynamics.solve(state)
        if solved is None:  # rates so large that forces overflow
            return self._keep_forces(_BAD_INPUT)
        forces = solved[9:]
        if self._limits.too_strong(forces):
            number |= _BEYOND_LIMIT
        out = self.answers.forces
        out[0], out[1], out[2] = forces
        self.answers.reactions[:] = solved[:9]
        self.force_age, self.force_determinant = 0, determinant
        self.force_status = status = STATUSES[number]
        return status

    def _write(
        self, pose: Triple, rate: Triple, twist: Twist, angle: Triple, speed: Triple
    ) -> None:
        """Put an estimate in the answers: number by number, faster than by slices."""
        to_pose, to_rate, to_twist, to_angle, to_speed = self.answers[:5]
        to_pose[0], to_pose[1], to_pose[2] = pose
        to_rate[0], to_rate[1], to_rate[2] = rate
        to_twist[0], to_twist[1], to_twist[2], to_twist[3], to_twist[4], to_twist[5] = twist
        to_angle[0], to_angle[1], to_angle[2] = angle
        to_speed[0], to_speed[1], to_speed[2] = speed

    def _words_of_motion(self, pose: Triple) -> list[str]:
        place = place_of(pose, self._g, self._h)
        if place is None:
            return ["a leg has no length, and so no direction"]
        words = self._limits.words(place)
        f1, f2, f3 = self.answers.forces.tolist()
        return words + self._limits.words_of_forces((f1, f2, f3))

    def _keep(self, number: int) -> Status:
        """Keep the last good estimate, and say why."""
        self.age += 1
        if self.distance < self._near:
            number |= _NEAR_SINGULAR
        self.status = status = STATUSES[number]
        return status

    def _keep_forces(self, number: int) -> Status:
        """Keep the last good forces, and say why."""
        self.force_age += 1
        self.force_status = status = STATUSES[number]
        return status


def _positive(value: float, name: str) -> float:
    """Return a positive float, which may be infinite."""
    return value if value == math.inf else checked_positive(value, name)


def _shown(values: Triple | None) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values or ()) + ")"
