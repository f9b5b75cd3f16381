"""Laws of time from rest to rest: u grows from 0 to a distance.

All are symmetric in time. A law is made for a duration, or, by `within`, as the shortest of its
kind that keeps limits of speed u', acceleration u'' and jerk u'''.

- quintic: u = D (10 s^3 - 15 s^4 + 6 s^5), s = t / T. Smooth; jerk jumps at the ends.
- trapezoidal speed: constant acceleration, constant speed, constant deceleration. The
  shortest with limits of speed and acceleration; acceleration jumps.
- S-curve: the same with limited jerk, seven pieces of constant jerk. The shortest with limits of
  speed, acceleration and jerk.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Literal

from numpy.typing import ArrayLike

from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import LawSample, TimeLaw
from rps_pin.trajectories.path import checked_times
from rps_pin.trajectories.piecewise_law import PiecewiseLaw
from rps_pin.validation import choice, positive_number, real

Profile = Literal["quintic", "trapezoidal", "s-curve"]

#: Of the quintic: largest speed, acceleration and jerk of D = T = 1.
_QUINTIC_PEAKS = (15 / 8, 10 / sqrt(3), 60.0)

#: Without limits, the share of the duration in which the speed rises, and in which it falls.
RAMP = 0.25


@refuses_other_kinds
class QuinticLaw:
    """u = D (10 s^3 - 15 s^4 + 6 s^5), s = t / T: speed and acceleration vanish at both ends.

    Parameters
    ----------
    distance
        D, in the unit of u; positive.
    duration
        T, s; positive.

    Raises
    ------
    InputError
        If a number is not positive and finite.
    """

    def __init__(self, distance: float, duration: float) -> None:
        self.distance = positive_number(distance, "distance")
        self.duration = positive_number(duration, "duration")

    @classmethod
    def within(
        cls, distance: float, *, speed: float = inf, acceleration: float = inf, jerk: float = inf
    ) -> QuinticLaw:
        """Return the shortest law within limits, of which one at least must be finite."""
        limits = _limits(speed, acceleration, jerk)
        D = positive_number(distance, "distance")
        shortest = max(
            (peak * D / limit) ** (1 / order)
            for order, (peak, limit) in enumerate(zip(_QUINTIC_PEAKS, limits, strict=True), 1)
        )
        if shortest == 0:
            raise InputError("a quintic law needs a limit of speed, acceleration or jerk")
        return cls(D, shortest)

    def __repr__(self) -> str:
        return f"QuinticLaw(distance={self.distance:.6g}, duration={self.duration:.6g})"

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s."""
        T, D = self.duration, self.distance
        s = checked_times(t, T) / T
        r = 1 - s
        return LawSample(
            D * s**3 * (10 - 15 * s + 6 * s**2),
            D / T * 30 * s**2 * r**2,
            D / T**2 * 60 * s * r * (r - s),
        )


@refuses_other_kinds
class TrapezoidalLaw(PiecewiseLaw):
    """Trapezoidal speed: acceleration, constant speed, and a deceleration as long.

    Parameters
    ----------
    distance
        In the unit of u; positive.
    duration
        In s; positive.
    ramp
        Share of the duration in which the speed rises, above 0 and at most 1/2 (a triangle).

    Raises
    ------
    InputError
        If a number is out of its range.
    """

    def __init__(self, distance: float, duration: float, *, ramp: float = RAMP) -> None:
        D, T = positive_number(distance, "distance"), positive_number(duration, "duration")
        up = T * _ramp(ramp)
        push = D / (up * (T - up))
        super().__init__([up, T - 2 * up, up], [0.0] * 3, [push, 0.0, -push])

    @classmethod
    def within(
        cls, distance: float, *, speed: float = inf, acceleration: float = inf, jerk: float = inf
    ) -> TrapezoidalLaw:
        """Return the shortest law within limits; the acceleration's must be finite.

        Raises
        ------
        InputError
            Also if a limit of jerk is given: the jerk of this law has none.
        """
        v, a, j = _limits(speed, acceleration, jerk)
        if j < inf:
            raise InputError("trapezoidal speed cannot limit the jerk; the profile 's-curve' does")
        if a == inf:
            raise InputError("trapezoidal speed needs a limit of acceleration")
        D = positive_number(distance, "distance")
        if v * v >= D * a:  # a triangle: its top is sqrt(D a)
            return cls(D, 2 * sqrt(D / a), ramp=0.5)
        duration = D / v + v / a
        return cls(D, duration, ramp=min(v / a / duration, 0.5))


@refuses_other_kinds
class SCurveLaw(PiecewiseLaw):
    """An S-curve: up to seven pieces of constant jerk.

    While the speed rises, the acceleration rises, is constant, and falls as long as it rose.

    Parameters
    ----------
    distance
        In the unit of u; positive.
    duration
        In s; positive.
    ramp
        Share of the duration in which the speed rises, above 0 and at most 1/2. The acceleration
        rises for half of it and then falls.

    Raises
    ------
    InputError
        If a number is out of its range.
    """

    def __init__(self, distance: float, duration: float, *, ramp: float = RAMP) -> None:
        D, T = positive_number(distance, "distance"), positive_number(duration, "duration")
        push = T * _ramp(ramp)
        # After 2 r with jerk j and -j the speed is j r^2; the distance is that times T - 2 r.
        rise = push / 2
        self._build(D / (rise**2 * (T - push)), rise, 0.0, T - 2 * push)

    @classmethod
    def within(
        cls, distance: float, *, speed: float = inf, acceleration: float = inf, jerk: float = inf
    ) -> SCurveLaw:
        """Return the shortest law within limits; the jerk's must be finite.

        With rises of r and a constant acceleration for s, the speed reaches j r (r + s), and the
        distance without a piece of constant speed is j r (r + s) (2 r + s).
        """
        v, a, j = _limits(speed, acceleration, jerk)
        if j == inf:
            raise InputError("an S-curve needs a limit of jerk")
        D = positive_number(distance, "distance")
        whole = (D / (2 * j)) ** (1 / 3)  # four rises cover the distance
        rise = min(a / j, sqrt(v / j), whole)
        steady, no_cruise = 0.0, rise == whole
        if rise == a / j:
            # The longest s that the speed, and the distance without constant speed, allow.
            by_speed = v / a - rise
            # a (r + s) (2 r + s) = D, a quadratic in s
            by_distance = (-3 * rise + sqrt(rise**2 + 4 * D / a)) / 2
            steady = max(0.0, min(by_speed, by_distance))
            no_cruise = by_distance <= by_speed
        top = j * rise * (rise + steady)
        cruise = 0.0 if no_cruise else max(0.0, D / top - (2 * rise + steady))
        law = cls.__new__(cls)
        # The jerk follows from the pieces: the distance is met to rounding.
        covered = rise * (rise + steady) * (2 * rise + steady + cruise)
        law._build(D / covered, rise, steady, cruise)
        return law

    def _build(self, jerk: float, rise: float, steady: float, cruise: float) -> None:
        a = jerk * rise
        super().__init__(
            [rise, steady, rise, cruise, rise, steady, rise],
            [jerk, 0.0, -jerk, 0.0, -jerk, 0.0, jerk],
            [0.0, a, a, 0.0, 0.0, -a, -a],
        )


def time_law(
    distance: float,
    profile: Profile,
    *,
    duration: float | None = None,
    speed: float = inf,
    acceleration: float = inf,
    jerk: float = inf,
) -> TimeLaw:
    """Return a law by the name of its profile: for a duration, or the shortest within limits.

    Raises
    ------
    InputError
        If the profile is unknown, or both a duration and limits are given, or neither is, or the
        profile needs a limit that is not given.
    """
    laws: dict[str, type[QuinticLaw | TrapezoidalLaw | SCurveLaw]]
    laws = {"quintic": QuinticLaw, "trapezoidal": TrapezoidalLaw, "s-curve": SCurveLaw}
    law = laws[choice(profile, "profile", list(laws))]
    limited = any(limit != inf for limit in (speed, acceleration, jerk))
    if (duration is not None) == limited:
        given = "both are given" if limited else "neither is given"
        raise InputError(f"give a duration, or limits for the shortest one: {given}")
    if duration is not None:
        return law(distance, duration)
    return law.within(distance, speed=speed, acceleration=acceleration, jerk=jerk)


def _ramp(ramp: float) -> float:
    """Return a share of the duration above 0 and at most 1/2."""
    if not 0 < real(ramp) <= 0.5:
        raise InputError(f"ramp = {shown(ramp)}: it must be above 0 and at most 0.5")
    return positive_number(ramp, "ramp")


def _limits(speed: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    """Return limits that are positive; infinity is none."""
    v, a, j = (
        inf if real(value) == inf else positive_number(value, f"limit of {name}")
        for name, value in {"speed": speed, "acceleration": acceleration, "jerk": jerk}.items()
    )
    return v, a, j
