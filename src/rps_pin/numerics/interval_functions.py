"""Sines, angles and other functions of intervals and enclosures, with outward rounding.

NumPy's and the C library's functions are not rounded correctly. Their documented errors are at most
4 units in the last place; results are widened by 8 of them. A function is bounded by its values at
the ends of the interval, and at its extrema between these.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.numerics.intervals import Enclosure, Interval

#: Widening of sines, whose size is at most 1: 8 units of numbers from 1/2 to 1.
_SINE = 2.0**-50
#: Relative widening of other functions.
_RELATIVE = 2.0**-49
#: Extrema this near to an end count as within, in turns: k pi is rounded.
_NEAR = 1e-9
#: Numbers beyond this have no sine here.
_FAR = 1e5


def sin(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the sines."""
    if isinstance(x, Enclosure):
        return x.through(_wave(np.sin, x.values, 0.25), _wave(np.cos, x.values, 0.0))
    return _wave(np.sin, x, 0.25)


def cos(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the cosines."""
    if isinstance(x, Enclosure):
        return x.through(_wave(np.cos, x.values, 0.0), -_wave(np.sin, x.values, 0.25))
    return _wave(np.cos, x, 0.0)


def _wave(function: Callable[[Array], Array], x: Interval, top: float) -> Interval:
    """Return sines or cosines: at most 1 at `top`, in turns, and at least -1 half a turn on."""
    far = ~(np.maximum(np.abs(x.lower), np.abs(x.upper)) < _FAR)
    first, last = np.where(far, 0.0, x.lower), np.where(far, 0.0, x.upper)
    ends = function(first), function(last)
    low, high = np.minimum(*ends) - _SINE, np.maximum(*ends) + _SINE
    turns = first / (2 * np.pi), last / (2 * np.pi)
    low = np.where(far | _holds(*turns, top + 0.5), -1.0, np.maximum(low, -1.0))
    return Interval(low, np.where(far | _holds(*turns, top), 1.0, np.minimum(high, 1.0)))


def _holds(low: Array, high: Array, at: float) -> Bools:
    """Return whether at + k, k a whole number, lies from low to high."""
    return np.asarray(np.ceil(low - at - _NEAR) <= high - at + _NEAR)


def tan(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the tangents; everything where a pole is among the numbers."""
    if isinstance(x, Enclosure):
        found = tan(x.values)
        assert isinstance(found, Interval)
        return x.through(found, found.square() + 1.0)
    low, high = x.lower / np.pi, x.upper / np.pi
    pole = ~(np.abs(low) + np.abs(high) < _FAR) | _holds(low, high, 0.5)
    found = _monotone(np.tan, Interval(np.where(pole, 0.0, x.lower), np.where(pole, 0.0, x.upper)))
    endless = np.where(pole, np.inf, 0.0)
    return Interval(found.lower - endless, found.upper + endless)


def atan(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the angles of these tangents, from -pi/2 to pi/2."""
    if isinstance(x, Enclosure):
        return x.through(_monotone(np.arctan, x.values), (x.values.square() + 1.0).inverse())
    return _monotone(np.arctan, x)


def atan2(y: Interval, x: Interval) -> Interval:
    """Return the angles of points (x, y) from the x axis, -pi to pi.

    All of them where the origin, or a part of the negative x axis, is among the points: else the
    corners of the rectangle bound them.
    """
    corners = [np.arctan2(b, a) for a in (x.lower, x.upper) for b in (y.lower, y.upper)]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    cut = ~((x.lower > 0) | (y.lower > 0) | (y.upper < 0))
    low, high = np.where(cut, -np.pi, low), np.where(cut, np.pi, high)
    return Interval(low, high).widened(8 * 2.0**-51)


def exp(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the exponentials."""
    if isinstance(x, Enclosure):
        found = _monotone(np.exp, x.values)
        return x.through(found, found)
    return _monotone(np.exp, x)


def _monotone(function: Callable[[Array], Array], x: Interval) -> Interval:
    """Return the values of a function that grows; 1e-300 is added for numbers without digits."""
    low, high = function(x.lower), function(x.upper)
    wider = [_RELATIVE * np.abs(one) + 1e-300 for one in (low, high)]
    return Interval(low - wider[0], high + wider[1])


def fabs(x: Interval | Enclosure) -> Interval | Enclosure:
    """Return the sizes."""
    if isinstance(x, Enclosure):
        values = x.values
        sign = Interval(
            np.where(values.lower > 0, 1.0, -1.0), np.where(values.upper < 0, -1.0, 1.0)
        )
        found = fabs(values)
        assert isinstance(found, Interval)
        return x.through(found, sign)
    low = np.maximum(np.maximum(x.lower, -x.upper), 0.0)
    return Interval(low, np.maximum(-x.lower, x.upper))


def fmin(x: Interval, y: Interval) -> Interval:
    """Return the lesser of two numbers."""
    return Interval(np.minimum(x.lower, y.lower), np.minimum(x.upper, y.upper))


def fmax(x: Interval, y: Interval) -> Interval:
    """Return the greater of two numbers."""
    return Interval(np.maximum(x.lower, y.lower), np.maximum(x.upper, y.upper))


def power(x: Interval | Enclosure, exponent: float) -> Interval | Enclosure:
    """Return powers with whole exponents.

    Raises
    ------
    InputError
        If the exponent is not a whole number from 0 to 64.
    """
    n = int(exponent)
    if n != exponent or not 0 <= n <= 64:
        raise InputError(f"x^{exponent} of intervals; exponents are whole numbers from 0 to 64")
    found: Interval | Enclosure = 0.0 * x + 1.0
    for digit in bin(n)[2:]:
        found = found * found
        if digit == "1":
            found = found * x
    return found
