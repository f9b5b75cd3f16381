"""Proof that a system has one zero near a point: Krawczyk's test with outward rounding.

With y near a zero of f, of as many equations as unknowns, X a box about y and C about f'(y)^-1,

    K = y - C f(y) + (1 - C f'(X)) (X - y)

lies inside X only if X holds one and only one zero of f, and that lies in K (Krawczyk 1969;
Neumaier, Interval Methods for Systems of Equations, 1990). f(y) and f'(X) are intervals
(`Interval`), so that rounding errors are part of the proof. f is the system with its numbers as the
computer holds them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.intervals import Interval

#: Values (n,) and derivatives (n, n) of a system over a box (n,).
System = Callable[[Interval], tuple[Interval, Interval]]

_NEWTON = 3
#: Half widths of boxes, in those of the first one: each is tried.
_WIDENED = (1.0, 8.0, 64.0, 512.0)
_LEAST = 2.0**-48


def proven_zero(system: System, near: Array) -> Interval | None:
    """Return a box that holds one zero of a system, and only one; none if that is not proven.

    Parameters
    ----------
    system
        The system, over boxes.
    near
        Where the zero should be, shape (n,), with numbers of about one.
    """
    y: Array = near
    inverse: Array = np.eye(len(near))
    for _ in range(_NEWTON):
        values, slopes = system(Interval(y))
        middle = (slopes.lower + slopes.upper) / 2
        if not np.isfinite(middle).all():
            return None
        try:
            inverse = np.asarray(np.linalg.inv(middle), np.float64)
        except np.linalg.LinAlgError:
            return None
        step = inverse @ ((values.lower + values.upper) / 2)
        if float(np.abs(step).max()) <= _LEAST * max(1.0, float(np.abs(y).max())):
            break
        y = y - step
    values, _ = system(Interval(y))
    error = np.abs(inverse) @ np.maximum(np.abs(values.lower), np.abs(values.upper))
    least = _LEAST * max(1.0, float(np.abs(y).max()))
    for wider in _WIDENED:
        half = 2.0 * wider * (error + least)
        box = Interval(y - half, y + half)
        inside = _krawczyk(system, y, inverse, values, box)
        if inside is not None:
            return inside
    return None


def _krawczyk(
    system: System, y: Array, inverse: Array, values: Interval, box: Interval
) -> Interval | None:
    """Return K if it lies inside the box."""
    n = len(y)
    _, slopes = system(box)
    left = Interval(np.eye(n)) - _product(inverse, slopes)
    away = box - Interval(y)
    k = Interval(y) - _product(inverse, values[:, None])[:, 0]
    for j in range(n):
        k = k + left[:, j] * away[j]
    inside = (k.lower > box.lower) & (k.upper < box.upper)
    return k if bool(inside.all()) else None


def _product(matrix: Array, other: Interval) -> Interval:
    """Return the product of a matrix (n, m) and intervals (m, l)."""
    total = Interval(np.zeros((len(matrix), other.lower.shape[1])))
    for k in range(matrix.shape[1]):
        total = total + Interval(matrix[:, k, None]) * other[k][None]
    return total


def disjoint(one: Interval, other: Interval) -> bool:
    """Return whether two boxes have no point in common."""
    return bool(((one.upper < other.lower) | (other.upper < one.lower)).any())


def all_distinct(boxes: list[Interval | None]) -> Bools:
    """Return which boxes there are that have no point in common with any other one."""
    found = np.array([box is not None for box in boxes], dtype=bool)
    for i, one in enumerate(boxes):
        for j, other in enumerate(boxes[:i]):
            if one is not None and other is not None and not disjoint(one, other):
                found[i] = found[j] = False
    return found
