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
from numbers import Real
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import LawSample, TimeLaw
from rps_pin.trajectories.path import checked_times

Profile = Literal["quintic", "trapezoidal", "s-curve"]

#: Of the quintic: largest speed, acceleration and jerk of D = T = 1.
_QUINTIC_PEAKS = (15 / 8, 10 / math.sqrt(3), 60.0)

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


class PiecewiseLaw:
    """A law of pieces of steady jerk (or, without any jerk, of steady acceleration).

    Parameters
    ----------
    durations
        Of the pieces, s; none negative.
    jerks
        u''' in each piece.
    accelerations
        u'' at the start of each piece; it may jump.

    Attributes
    ----------
    knots : array
        Times at which the pieces begin, and the end, s.
    distance, duration : float
        Where u ends, and when (s).
    """

    def __init__(self, durations: ArrayLike, jerks: ArrayLike, accelerations: ArrayLike) -> None:
        steps = np.asarray(durations, dtype=np.float64)
        kept = steps > 0
        self._steps = steps[kept]
        self._jerk = np.asarray(jerks, dtype=np.float64)[kept]
        self._acceleration = np.asarray(accelerations, dtype=np.float64)[kept]
        self.knots = np.concatenate([[0.0], np.cumsum(self._steps)])
        self.duration = float(self.knots[-1])
        h, a, j = self._steps, self._acceleration, self._jerk
        self._speed = np.concatenate([[0.0], np.cumsum(a * h + j * h**2 / 2)])
        moved = self._speed[:-1] * h + a * h**2 / 2 + j * h**3 / 6
        self._u = np.concatenate([[0.0], np.cumsum(moved)])
        self.distance = float(self._u[-1])

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}(distance={self.distance:.6g}, duration={self.duration:.6g})"

    def at(self, t: ArrayLike) -> LawSample:
        """Return u, u' and u'' at times of shape (...), s; where u'' jumps, the later piece's."""
        times = checked_times(t, self.duration)
        i = np.searchsorted(self.knots[1:-1], times, side="right")
        h, a, j = times - self.knots[i], self._acceleration[i], self._jerk[i]
        v = self._speed[i]
        return LawSample(
            self._u[i] + h * (v + h * (a / 2 + h * j / 6)), v + h * (a + h * j / 2), a + h * j
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
        up = min(v / a, math.sqrt(D / a))
        duration = D / (a * up) + up
        return cls(D, duration, ramp=min(up / duration, 0.5))


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
        rise = min(a / j, math.sqrt(v / j), (D / (2 * j)) ** (1 / 3))
        steady = 0.0
        if rise == a / j:
            # The longest steady push that the speed, and the distance without a cruise, allow.
            by_speed = v / a - rise
            # a (r + s) (2 r + s) = D, a quadratic in s
            by_distance = (-3 * rise + math.sqrt(rise**2 + 4 * D / a)) / 2
            steady = max(0.0, min(by_speed, by_distance))
        top = j * rise * (rise + steady)
        cruise = max(0.0, D / top - (2 * rise + steady))
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
    if profile not in made:
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
    """Return a number that is finite and above zero."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or value <= 0:
        raise InputError(f"{name} = {shown(value)}: it must be a positive number")
    return float(value)


def checked_ramp(ramp: float) -> float:
    """Return a share of the duration above 0 and at most 1/2."""
    if not 0 < ramp <= 0.5:
        raise InputError(f"ramp = {ramp}: it must be above 0 and at most 0.5")
    return float(ramp)


def _limits(speed: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    limits = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    for name, value in limits.items():
        if not isinstance(value, Real) or isinstance(value, bool) or not value > 0:
            raise InputError(f"limit of {name} = {shown(value)}: it must be a positive number")
    return float(speed), float(acceleration), float(jerk)
