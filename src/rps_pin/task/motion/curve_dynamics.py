"""What is bounded along a curve, by the curve's parameter u and its rates.

Along a curve x(u), forces and accelerations are

    y = m(u) u'' + c(u) u'^2 + g(u) + friction(u, u'),

the *levels*, speeds are d_u(u) u', and jerks, by the chain rule,

    d''' = d_u u''' + 3 d_uu u' u'' + d_uuu u'^3.

Reversing the motion changes the sign of friction, and leaves
the other parts as they are: this separates the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple, Self

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.trajectories.curve import Curve
from rps_pin.trajectories.path import PathSample

#: A limit counts as reached within this part of it.
ACTIVE = 1e-3
#: Relative step of the rate in the slope of friction: errors of about its square.
_STEP = 1e-5
#: Step of u in the third derivatives, over the length of the curve.
_THIRD_STEP = 2e-4
#: Places along a curve where its size is looked for.
_PLACES = 33
#: Forces at rest below this part of the limit are rounding.
_NO_WEIGHT = 1e-6
#: Forces below this part of the weight are not known well; larger accelerations are tried so often.
_HIDDEN, _TRIES = 1e-6, 6


#: No limits.
NONE: Array = np.empty((2, 0))


class CurveLimits(NamedTuple):
    """Least and largest of each quantity, shape (2, n) each; without any, (2, 0); or infinite."""

    force: Array
    """Of na actuators."""
    acceleration: Array
    """Of the actuators."""
    coordinate_acceleration: Array
    """Of m coordinates."""
    speed: Array
    """Of the actuators; the least are negative, the largest positive."""
    coordinate_speed: Array
    """Of the coordinates; the least are negative, the largest positive."""
    jerk: Array = NONE
    """Of the actuators; the least are negative, the largest positive."""
    coordinate_jerk: Array = NONE
    """Of the coordinates; the least are negative, the largest positive."""

    @property
    def levels(self) -> Array:
        """Of forces and accelerations, shape (2, k)."""
        return np.concatenate(self[:3], axis=-1)

    @property
    def speeds(self) -> Array:
        """Of speeds, shape (2, l)."""
        return np.concatenate(self[3:5], axis=-1)

    @property
    def jerks(self) -> Array:
        """Of jerks, shape (2, j)."""
        return np.concatenate(self[5:], axis=-1)


class LimitUse(NamedTuple):
    """Quantities over their limits: 1 is at the limit. Empty without limits, zero at infinite ones.

    Levels count from the middle of their limits, so that -1 is at the least of them.
    """

    force: Array
    """Of the actuators, shape (..., na); positive pushes out."""
    acceleration: Array
    """Of the actuators, shape (..., na)."""
    coordinate_acceleration: Array
    """Of the coordinates, shape (..., m)."""
    speed: Array
    """Of the actuators, shape (..., na); positive is out."""
    coordinate_speed: Array
    """Of the coordinates, shape (..., m)."""
    jerk: Array
    """Of the actuators, shape (..., na)."""
    coordinate_jerk: Array
    """Of the coordinates, shape (..., m)."""

    @property
    def sides(self) -> Array:
        """Use of each limit, (..., 2 k + l + j): largest and least levels, speeds, jerks."""
        level = np.concatenate(self[:3], axis=-1)
        either_way = np.concatenate(self[3:], axis=-1)
        return np.concatenate([level, -level, np.abs(either_way)], axis=-1)

    @property
    def most(self) -> Array:
        """The largest of them, shape (...)."""
        most: Array = self.sides.max(axis=-1)
        return most


class CurveTerms(NamedTuple):
    """Terms of levels and speeds at points of a curve; the units of these and the curve's unit."""

    inertia: Array
    """m: levels by u'', shape (..., k)."""
    velocity_product: Array
    """c: levels by u'^2, shape (..., k)."""
    holding: Array
    """g: levels at rest, against gravity and the wrench, shape (..., k)."""
    speed_slope: Array
    """d: speeds by u', shape (..., l)."""


class CurveDynamics:
    """Levels and speeds of what moves along a curve; a subclass knows what that is.

    Attributes
    ----------
    curve : Curve
        The curve.
    bounds : CurveLimits
        Limits of levels and speeds.
    sides : tuple of str
        Names of the limits, in the order of `LimitUse.sides`.
    has_friction : bool
        Whether there is any.
    times : int
        At how many times a motion is checked at last.
    """

    times = 20_001

    def __init__(
        self, curve: Curve, bounds: CurveLimits, sides: tuple[str, ...], has_friction: bool
    ) -> None:
        self.curve = curve
        self.bounds = bounds
        self.sides = sides
        self.has_friction = has_friction
        low, high = bounds.levels
        limited = np.isfinite(high)
        #: Middle and half of the range of each level, shape (k,); zero and infinite without limits.
        self.middle = (np.where(limited, high, 0.0) + np.where(limited, low, 0.0)) / 2
        self.half = (high - low) / 2
        #: u'^2 and u'' at which forces of inertia are of the size of the weight, 1/s^2.
        self._square = self._size_of_square()

    # What a subclass knows ------------------------------------------------------------------------

    def place(self, u: Array) -> Any:
        """Return what `levels` and `speed_slopes` take for parameters of shape (...)."""
        raise NotImplementedError

    def levels(self, place: Any, rate: Array, acceleration: Array) -> Array:
        """Return forces and accelerations at u' and u'' of shape (...), shape (..., k)."""
        raise NotImplementedError

    def speed_slopes(self, place: Any) -> Array:
        """Return d_u, speeds by u', shape (..., l)."""
        raise NotImplementedError

    def jerk_slopes(self, place: Any) -> tuple[Array, Array]:
        """Return d_u and d_uu of what has limits of jerk, shape (..., j) each."""
        raise NotImplementedError

    # What follows ---------------------------------------------------------------------------------

    @property
    def limited(self) -> Bools:
        """Which sides have a limit, in their order, shape (2 k + l + j,)."""
        levels = np.isfinite(self.half)
        either_way = np.concatenate([self.bounds.speeds, self.bounds.jerks], axis=-1)
        return np.concatenate([levels, levels, np.isfinite(either_way).any(axis=0)])

    def without_jerk_limits(self) -> Self:
        """Return a copy without limits of jerk."""
        other = copy(self)
        other.bounds = self.bounds._replace(jerk=NONE, coordinate_jerk=NONE)
        other.sides = self.sides[: len(self.sides) - self.bounds.jerks.shape[-1]]
        return other

    def terms(self, u: Array) -> CurveTerms:
        """Return the terms at parameters of shape (...)."""
        place, square, still = self.place(u), self._square, np.zeros_like(u)
        rate = still + np.sqrt(square)
        holding = self.levels(place, still, still)
        there, back = self.levels(place, rate, still), self.levels(place, -rate, still)
        return CurveTerms(
            (self.levels(place, still, still + square) - holding) / square,
            ((there + back) / 2 - holding) / square,
            holding,
            self.speed_slopes(place),
        )

    def friction(self, u: Array, square: Array) -> tuple[Array, Array]:
        """Return levels of friction at u'^2 of shape (...), and their slope by u'^2, (..., k)."""
        place, rate = self.place(u), np.sqrt(square)
        more = self._friction(place, rate * (1 + _STEP))
        less = self._friction(place, rate * (1 - _STEP))
        # d/d(r^2) = (d/dr) / (2 r), and (d/dr) is the difference over 2 _STEP r
        over = 4 * _STEP * square[..., None]
        slope = np.divide(more - less, over, out=np.zeros_like(more), where=over > 0)
        return self._friction(place, rate), slope

    def use_along(
        self, u: Array, square: Array, acceleration: Array, jerk: Array | None = None
    ) -> LimitUse:
        """Return what is limited over its limits at parameters, u'^2, u'' and u''' of shape (...).

        The third derivative is needed where jerks have limits.
        """
        place, rate = self.place(u), np.sqrt(square)
        levels = self.levels(place, rate, acceleration)
        jerks = np.empty((*u.shape, 0))
        if jerk is not None and self.bounds.jerks.size:
            jerks = self.jerks(u, rate, acceleration, jerk)
        return self.use_of(levels, self.speed_slopes(place) * rate[..., None], jerks)

    def use_of(self, levels: Array, speeds: Array, jerks: Array) -> LimitUse:
        """Return levels (..., k), speeds (..., l) and jerks (..., j) over their limits."""
        level = np.split((levels - self.middle) / self.half, _ends(self.bounds[:3]), axis=-1)
        speed = np.split(self.speed_over_limit(speeds), _ends(self.bounds[3:5]), axis=-1)
        over = over_limit(jerks, self.bounds.jerks)
        return LimitUse(*level, *speed, *np.split(over, _ends(self.bounds[5:]), axis=-1))

    def speed_over_limit(self, speeds: Array) -> Array:
        """Return speeds (..., l) over the limits of their directions, with their signs."""
        return over_limit(speeds, self.bounds.speeds)

    def jerks(self, u: Array, rate: Array, acceleration: Array, jerk: Array) -> Array:
        """Return the jerks that have limits at u', u'' and u''' of shape (...), (..., j)."""
        first, second = self.jerk_slopes(self.place(u))
        r, a, j = rate[..., None], acceleration[..., None], jerk[..., None]
        found: Array = first * j + 3 * second * r * a + self._third_slopes(u) * r**3
        return found

    def sample(self, u: Array, square: Array, acceleration: Array) -> PathSample:
        """Return the motion at parameters, u'^2 and u'' of shape (...)."""
        x, first, second = self.curve.at(u)
        rate = first * np.sqrt(square)[..., None]
        change = first * acceleration[..., None] + second * square[..., None]
        return PathSample(x, rate, change)

    def _third_slopes(self, u: Array) -> Array:
        """Return d_uuu, shape (..., j), by differences of d_uu within a piece of the curve."""
        breaks = breaks_of(self.curve)
        piece = np.searchsorted(breaks[1:-1], u, side="right")
        step = np.minimum(_THIRD_STEP * breaks[-1], np.diff(breaks)[piece] / 4)
        middle = u.clip(breaks[piece] + step, breaks[piece + 1] - step)
        low, mid, high = (
            self.jerk_slopes(self.place(x))[1] for x in (middle - step, middle, middle + step)
        )
        off, h = (u - middle)[..., None], step[..., None]
        third: Array = (high - low) / (2 * h) + off * (high - 2 * mid + low) / h**2
        return third

    def _friction(self, place: Any, rate: Array) -> Array:
        still = np.zeros_like(rate)
        return (self.levels(place, rate, still) - self.levels(place, -rate, still)) / 2

    def _size_of_square(self) -> float:
        u = np.linspace(0.0, self.curve.length, _PLACES)
        place, still, count = self.place(u), np.zeros(_PLACES), self.bounds.force.shape[-1]
        holding = self.levels(place, still, still)[:, :count]
        weight = float(np.abs(holding).max(initial=0.0))
        tried, largest = 1.0, 0.0
        for _ in range(_TRIES):  # until the weight does not hide the force of inertia
            inertia = self.levels(place, still, still + tried)[:, :count] - holding
            largest = float(np.abs(inertia).max(initial=0.0))
            if largest > _HIDDEN * weight:
                break
            tried /= _HIDDEN
        largest /= tried
        limit = float(self.half[:count].min(initial=math.inf))
        if math.isfinite(limit) and weight < _NO_WEIGHT * limit:
            weight = limit
        square = weight / largest if largest > 0 else 1.0
        return square if 0 < square < math.inf else 1.0


def over_limit(values: Array, limits: Array) -> Array:
    """Return values (..., n) over the limits (2, n) of their directions, with their signs."""
    least, largest = limits
    over: Array = np.where(values < 0, values / -least, values / largest)
    return over


def breaks_of(curve: Curve) -> Array:
    """Return where pieces of a curve begin and end: 0, its knots between, its length."""
    inner = np.asarray(getattr(curve, "knots", ()), dtype=np.float64)
    inside = inner[(inner > 0) & (inner < curve.length)]
    return np.concatenate([[0.0], inside, [curve.length]])


def _ends(parts: Sequence[Array]) -> Indices:
    """Return where parts of shapes (2, n) end in an array of all, without the last."""
    return np.cumsum([part.shape[-1] for part in parts])[:-1]
