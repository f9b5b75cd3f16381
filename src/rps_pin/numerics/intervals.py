"""Intervals with outward rounding, and with gradients: proofs over boxes of numbers.

An `Interval` encloses every number that the exact operation gives for numbers of its operands: the
bounds that floats give are moved outwards by one unit in the last place, half of which IEEE 754's
operations err at most. An `Enclosure` is a function over a box: an interval of its values and one
of each slope, so that f(x) lies in f(c) + slopes (x - c) too, the mean value form, which is sharp
to the square of the box's size.

Both are numbers of kernels (``rps_pin.numerics.elementary``): they have + - * / and sqrt. Arrays
hold many boxes. A bound that is not known is infinite or NaN, of which no comparison holds, so that
nothing is proven by it. Libraries of intervals for Python compute one number a call; a workspace
takes millions.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, Self

import numpy as np

from rps_pin.arrays import Array

_ENDLESS = np.inf


def _down(x: Array) -> Array:
    return np.nextafter(x, -_ENDLESS)


def _up(x: Array) -> Array:
    return np.nextafter(x, _ENDLESS)


class Interval:
    """Numbers from `lower` to `upper`, arrays of one shape."""

    __slots__ = ("lower", "upper")
    __array_ufunc__ = None  # an array times an interval is an interval
    lower: Array
    upper: Array

    def __init__(self, lower: Any, upper: Any = None) -> None:
        self.lower = np.asarray(lower, dtype=np.float64)
        self.upper = self.lower if upper is None else np.asarray(upper, dtype=np.float64)

    def __repr__(self) -> str:
        return f"Interval({self.lower!r}, {self.upper!r})"

    def __getitem__(self, part: Any) -> Interval:
        return Interval(self.lower[part], self.upper[part])

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Enclosure):
            return NotImplemented
        low, high = _bounds(other)
        return Interval(_down(self.lower + low), _up(self.upper + high))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Enclosure):
            return NotImplemented
        low, high = _bounds(other)
        return Interval(_down(self.lower - high), _up(self.upper - low))

    def __rsub__(self, other: Any) -> Any:
        return -(self - other)

    def __mul__(self, other: Any) -> Any:
        if other is self:
            return self.square()
        if isinstance(other, Enclosure):
            return NotImplemented
        if isinstance(other, Interval):
            ends = [a * b for a in (self.lower, self.upper) for b in (other.lower, other.upper)]
            low = np.minimum(np.minimum(ends[0], ends[1]), np.minimum(ends[2], ends[3]))
            high = np.maximum(np.maximum(ends[0], ends[1]), np.maximum(ends[2], ends[3]))
            return Interval(_down(low), _up(high))
        one, two = self.lower * other, self.upper * other
        return Interval(_down(np.minimum(one, two)), _up(np.maximum(one, two)))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self * _as_interval(other).inverse()

    def __rtruediv__(self, other: Any) -> Any:
        return self.inverse() * other

    def square(self) -> Interval:
        """Return the squares."""
        one, two = np.abs(self.lower), np.abs(self.upper)
        low = np.where(self.lower * self.upper <= 0, 0.0, np.minimum(one, two))
        high = np.maximum(one, two)
        return Interval(np.maximum(_down(low * low), 0.0), _up(high * high))

    def inverse(self) -> Interval:
        """Return the reciprocals; everything if zero is among the numbers."""
        with np.errstate(divide="ignore"):
            low, high = _down(1.0 / self.upper), _up(1.0 / self.lower)
        whole = ~(self.lower * np.sign(self.upper) > 0)
        return Interval(np.where(whole, -_ENDLESS, low), np.where(whole, _ENDLESS, high))

    def sqrt(self) -> Interval:
        """Return the square roots; those of negative numbers are left out."""
        low, high = (np.sqrt(np.maximum(end, 0.0)) for end in (self.lower, self.upper))
        return Interval(np.maximum(_down(low), 0.0), _up(high))

    def meet(self, other: Interval) -> Interval:
        """Return the numbers that are in both."""
        return Interval(np.fmax(self.lower, other.lower), np.fmin(self.upper, other.upper))

    def hull(self, other: Interval) -> Interval:
        """Return the least interval that holds both."""
        return Interval(np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper))

    def widened(self, by: float) -> Interval:
        """Return the interval widened at both ends."""
        return Interval(_down(self.lower - by), _up(self.upper + by))


class Enclosure:
    """A function over boxes: its values, and its slopes by each coordinate of the box."""

    __slots__ = ("slopes", "values")
    __array_ufunc__ = None
    values: Interval
    """Of shape (n,)."""
    slopes: Interval
    """Of shape (coordinates, n)."""

    def __init__(self, values: Interval, slopes: Interval) -> None:
        self.values, self.slopes = values, slopes

    @classmethod
    def coordinates(cls, box: Interval) -> tuple[Self, ...]:
        """Return the coordinates of boxes (coordinates, n), functions of themselves."""
        count, n = box.lower.shape
        unit = np.zeros((count, count, n))
        unit[range(count), range(count)] = 1.0
        return tuple(cls(box[i], Interval(unit[i])) for i in range(count))

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.values, -self.slopes)

    def __add__(self, other: Any) -> Enclosure:
        if isinstance(other, Enclosure):
            return Enclosure(self.values + other.values, self.slopes + other.slopes)
        return Enclosure(self.values + other, self.slopes)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -other

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        if other is self:
            return self.through(self.values.square(), self.values * 2.0)
        if isinstance(other, Enclosure):
            slopes = self.slopes * other.values + other.slopes * self.values
            return Enclosure(self.values * other.values, slopes)
        return Enclosure(self.values * other, self.slopes * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return (
            self * other.inverse()
            if isinstance(other, Enclosure)
            else self * (_as_interval(other).inverse())
        )

    def __rtruediv__(self, other: Any) -> Any:
        return self.inverse() * other

    def inverse(self) -> Enclosure:
        """Return the reciprocal."""
        found = self.values.inverse()
        return self.through(found, -found.square())

    def sqrt(self) -> Enclosure:
        """Return the square root."""
        found = self.values.sqrt()
        return self.through(found, 0.5 * found.inverse())

    def through(self, values: Interval, slope: Interval) -> Enclosure:
        """Return a function of this one, of such values and such a slope by this one's values."""
        return Enclosure(values, self.slopes * slope)

    def about(self, centre: Interval, offsets: Interval) -> Interval:
        """Return the values, sharpened by the mean value form.

        Parameters
        ----------
        centre
            Of the function at points of the boxes, shape (n,).
        offsets
            The boxes, or parts of them, less these points, shape (coordinates, n).
        """
        found = centre
        for i in range(offsets.lower.shape[0]):
            found = found + self.slopes[i] * offsets[i]
        return self.values.meet(found)

    def share_above(self, centre: Interval, offsets: Interval) -> Array:
        """Return a share of each box where the function is above zero, at least, shape (n,).

        With slopes g +- d, f(x) >= f(c) + g (x - c) - d |x - c|: a plane bounds that part.
        """
        half = np.maximum(-offsets.lower, offsets.upper)
        wide = half.max(axis=1, initial=0.0) > 0.0  # coordinates that are not held
        half, low, high = (one[wide] for one in (half, self.slopes.lower, self.slopes.upper))
        g, d = (low + high) / 2, np.maximum(high - low, 0.0) * (0.5 + 2.0**-40)
        return share_beyond(np.abs(g) * half, (d * half).sum(axis=0) - centre.lower)


def share_beyond(a: Array, t: Array) -> Array:
    """Return the share of the cube |u_i| <= 1 in which a . u > t, or a little less.

    In k dimensions its volume is the sum of +- (a . u - t)^k / (k! a_1 ... a_k) over the corners u
    with a . u > t, with the sign of the product of the u_i. Of (k, n) numbers a, not negative, and
    t (n,).
    """
    least = 1e-2 * a.max(axis=0) + 1e-300
    raised = np.maximum(a, least)  # a . u >= raised . u - sum (raised - a)
    t = t + (raised - a).sum(axis=0) + 1e-9 * raised.sum(axis=0)
    total = np.zeros_like(t)
    for corner in product((1.0, -1.0), repeat=len(a)):
        total += math.prod(corner) * np.maximum(np.array(corner) @ raised - t, 0.0) ** len(a)
    share = total / (math.prod(range(1, len(a) + 1)) * np.prod(2.0 * raised, axis=0))
    return np.asarray(np.where(np.isfinite(share), np.clip(share, 0.0, 1.0), 0.0))


def is_enclosing(x: Any) -> bool:
    """Return whether this is an `Interval` or an `Enclosure`."""
    return isinstance(x, Interval | Enclosure)


def _as_interval(x: Any) -> Interval:
    return x if isinstance(x, Interval) else Interval(x)


def _bounds(x: Any) -> tuple[Any, Any]:
    return (x.lower, x.upper) if isinstance(x, Interval) else (x, x)
