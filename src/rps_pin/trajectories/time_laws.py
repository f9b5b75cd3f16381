"""Laws of time from rest to rest: u grows from 0 to a distance.

All are symmetric in time. A law is made for a duration, or, by `within`, as the shortest of its
kind that keeps limits of speed u', acceleration u'' and jerk u'''.

- quintic: u = D (10 s^3 - 15 s^4 + 6 s^5), s = t / T. Smooth; jerk jumps at the ends.
- trapezoidal speed: a steady push, a steady speed, a steady brake. The shortest with limits of
  speed and acceleration; acceleration jumps.
- S-curve: the same with jerk limited, seven pieces of steady jerk. The shortest with limits of
  speed, acceleration and jerk.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

from numpy.typing import ArrayLike

from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import LawSample, TimeLaw
from rps_pin.trajectories.path import checked_times
from rps_pin.trajectories.piecewise_law import PiecewiseLaw
from rps_pin.trajectories.poses import real

Profile = Literal["quintic", "trapezoidal", "s-curve"]

#: Of the quintic: largest speed, acceleration and jerk of D = T = 1.
_QUINTIC_PEAKS = (15 / 8, 10 / math.sqrt(3), 60.0)

#: Numbers that a law is made of lie between these: its speed and jerk are then finite, too.
_SMALLEST, _LARGEST = 1e-50, 1e50

#: Without limits, the share of the duration in which the speed rises, and in which it falls.
RAMP = 0.25


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
        self.distance = positive(distance, "distance")
        self.duration = positive(duration, "duration")

    @classmethod
    def within(
        cls,
        distance: float,
        *,
        speed: float = math.inf,
        acceleration: float = math.inf,
        jerk: float = math.inf,
    ) -> QuinticLaw:
        """Return the shortest that keeps limits; at least one must be finite."""
        limits = _limits(speed, acceleration, jerk)
        D = positive(distance, "distance")
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


class TrapezoidalLaw(PiecewiseLaw):
    """Trapezoidal speed: a push, a steady speed, a brake as long as the push.

    Parameters
    ----------
    distance
        In the unit of u; positive.
    duration
        In s; positive.
    ramp
        Share of the duration that the push takes, above 0 and at most 1/2: then the speed is a
        triangle.

    Raises
    ------
    InputError
        If a number is out of its range.
    """

    def __init__(self, distance: float, duration: float, *, ramp: float = RAMP) -> None:
        D, T = positive(distance, "distance"), positive(duration, "duration")
        up = T * checked_ramp(ramp)
        push = D / (up * (T - up))
        super().__init__([up, T - 2 * up, up], [0.0] * 3, [push, 0.0, -push])

    @classmethod
    def within(
        cls,
        distance: float,
        *,
        speed: float = math.inf,
        acceleration: float = math.inf,
        jerk: float = math.inf,
    ) -> TrapezoidalLaw:
        """Return the shortest that keeps limits; that of the acceleration must be finite.

        Raises
        ------
        InputError
            Also if a finite jerk is asked for, which trapezoidal speed cannot keep.
        """
        v, a, j = _limits(speed, acceleration, jerk)
        if math.isfinite(j):
            raise InputError("trapezoidal speed has no limit of jerk; the profile 's-curve' has")
        if not math.isfinite(a):
            raise InputError("trapezoidal speed needs a limit of acceleration")
        D = positive(distance, "distance")
        if v * v >= D * a:  # a triangle: its top is sqrt(D a)
            return cls(D, 2 * math.sqrt(D / a), ramp=0.5)
        duration = D / v + v / a
        return cls(D, duration, ramp=min(v / a / duration, 0.5))


class SCurveLaw(PiecewiseLaw):
    """An S-curve: seven pieces of steady jerk, some of which may be missing.

    In the push, the acceleration rises for `rise`, stays, and falls for `rise`.

    Parameters
    ----------
    distance
        In the unit of u; positive.
    duration
        In s; positive.
    ramp
        Share of the duration that the push takes, above 0 and at most 1/2. The acceleration rises
        for half of the push and then falls.

    Raises
    ------
    InputError
        If a number is out of its range.
    """

    def __init__(self, distance: float, duration: float, *, ramp: float = RAMP) -> None:
        D, T = positive(distance, "distance"), positive(duration, "duration")
        push = T * checked_ramp(ramp)
        # A push of 2 r with jerk j ends at the speed j r^2; the distance is that times T - 2 r.
        rise = push / 2
        self._build(D / (rise**2 * (T - push)), rise, 0.0, T - 2 * push)

    @classmethod
    def within(
        cls,
        distance: float,
        *,
        speed: float = math.inf,
        acceleration: float = math.inf,
        jerk: float = math.inf,
    ) -> SCurveLaw:
        """Return the shortest that keeps limits; that of the jerk must be finite.

        With rises of r and a steady acceleration for s, the push ends at the speed
        j r (r + s), and push and brake alone cover j r (r + s) (2 r + s).
        """
        v, a, j = _limits(speed, acceleration, jerk)
        if not math.isfinite(j):
            raise InputError("an S-curve needs a limit of jerk")
        D = positive(distance, "distance")
        whole = (D / (2 * j)) ** (1 / 3)  # four rises cover the distance
        rise = min(a / j, math.sqrt(v / j), whole)
        steady, no_cruise = 0.0, rise == whole
        if rise == a / j:
            # The longest steady push that the speed, and the distance without a cruise, allow.
            by_speed = v / a - rise
            # a (r + s) (2 r + s) = D, a quadratic in s
            by_distance = (-3 * rise + math.sqrt(rise**2 + 4 * D / a)) / 2
            steady = max(0.0, min(by_speed, by_distance))
            no_cruise = by_distance <= by_speed
        top = j * rise * (rise + steady)
        cruise = 0.0 if no_cruise else max(0.0, D / top - (2 * rise + steady))
        law = cls.__new__(cls)
        # The jerk is reckoned back from the pieces: the distance is met to rounding.
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
    speed: float = math.inf,
    acceleration: float = math.inf,
    jerk: float = math.inf,
) -> TimeLaw:
    """Return a law by the name of its profile: for a duration, or the shortest within limits.

    Raises
    ------
    InputError
        If the profile is unknown, or both a duration and limits are given, or neither is, or the
        profile needs a limit that is not given.
    """
    made: dict[str, tuple[Callable[..., TimeLaw], Callable[..., TimeLaw]]] = {
        "quintic": (QuinticLaw, QuinticLaw.within),
        "trapezoidal": (TrapezoidalLaw, TrapezoidalLaw.within),
        "s-curve": (SCurveLaw, SCurveLaw.within),
    }
    if not isinstance(profile, str) or profile not in made:
        raise InputError(f"profile = {shown(profile)}; it must be one of {', '.join(made)}")
    for_duration, within = made[profile]
    limited = any(limit != math.inf for limit in (speed, acceleration, jerk))
    if (duration is not None) == limited:
        given = "both are given" if limited else "neither is given"
        raise InputError(f"give a duration, or limits for the shortest one: {given}")
    if duration is not None:
        return for_duration(distance, duration)
    return within(distance, speed=speed, acceleration=acceleration, jerk=jerk)


def positive(value: float, name: str) -> float:
    """Return a number that is finite and above zero, and within what can be reckoned with."""
    number = real(value)
    if not 0 < number < math.inf:
        raise InputError(f"{name} = {shown(value)}: it must be a positive number")
    if not _SMALLEST <= number <= _LARGEST:
        raise InputError(f"{name} = {shown(value)}: it must be from {_SMALLEST} to {_LARGEST}")
    return number


def checked_ramp(ramp: float) -> float:
    """Return a share of the duration above 0 and at most 1/2."""
    if not 0 < real(ramp) <= 0.5:
        raise InputError(f"ramp = {shown(ramp)}: it must be above 0 and at most 0.5")
    return positive(ramp, "ramp")


def _limits(speed: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    """Return limits that are positive; infinity is none."""
    v, a, j = (
        math.inf if real(value) == math.inf else positive(value, f"limit of {name}")
        for name, value in (("speed", speed), ("acceleration", acceleration), ("jerk", jerk))
    )
    return v, a, j
