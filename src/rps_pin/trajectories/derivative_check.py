"""Consistency of a sampled rate with the sampled quantity: units and wrong entries.

Between two samples the quantity has a mean slope. Where the derivative has at most one extremum in
a step,

- a step's slope lies between the derivatives at its two ends,
- a derivative lies between the slopes of the two steps next to it,

except for its change within the step. Both may be missed by half of the column's largest value, and
by the rounding of the written numbers. This accepts a sine of four samples a period and an
acceleration that jumps, and finds wrong units and wrong entries. The first and the last derivative
have one step next to them; they are wrong if far larger than everything else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array

#: How far a slope may miss the derivatives, over the column's largest value.
_GROSS = 0.5
#: How far the first or last derivative may exceed all else.
_AT_END = 10.0
#: From so many samples on, every step's slope and both ends are judged; fewer may be far apart on
#: purpose.
_JUDGED = 6
#: Written numbers are taken to have four digits or more: this part of a column's largest value is
#: the largest last place that is allowed for.
_LAST_PLACE = 1e-4
#: No derivative as small is wrong (m/s, rad/s and the like): what should be zero may be rounding.
_NEGLIGIBLE = 1e-12

#: Likely mistakes, by the ratio of given to found derivatives.
_MISTAKES = {
    1e3: "thousandths (mm, ms) and whole units",
    1e6: "millionths (um, us) and whole units",
    180 / math.pi: "degrees and radians",
}


class Disagreement(NamedTuple):
    """A sample at which a derivative is not that of the quantity."""

    row: int
    """The sample, from 0."""
    given: float
    """The derivative there."""
    slopes: tuple[float, ...]
    """Mean slopes of the quantity in the steps next to it."""
    looks_like: str
    """The likely mistake, from the ratio of derivatives to slopes; empty if none is known."""


def disagreement(times: Array, values: Array, derivative: Array) -> Disagreement | None:
    """Return the first sample at which the derivative is grossly wrong, or none.

    Parameters
    ----------
    times
        Increasing, shape (n,), s.
    values, derivative
        Of one quantity, shape (n,).
    """
    if len(times) < 3:
        return None
    with np.errstate(all="ignore"):  # what overflows disagrees
        steps = np.diff(times)
        slope = np.diff(values) / steps
        rounding = 2 * _last_place(values) / steps + _NEGLIGIBLE
        largest = max(np.abs(slope).max(), np.abs(derivative).max())
        allowed = _GROSS * largest + rounding
        before, after = derivative[:-1], derivative[1:]
        inner = derivative[1:-1]
        wrong = np.zeros(len(times), dtype=bool)
        either = np.maximum(allowed[:-1], allowed[1:])
        wrong[1:-1] = ~(_outside(inner, slope[:-1], slope[1:]) <= either)
        if len(times) >= _JUDGED:
            wrong[1:] |= ~(_outside(slope, before, after) <= allowed)
            for end, others in ((0, after), (-1, before)):
                all_else = max(np.abs(slope).max(), np.abs(others).max())
                wrong[end] |= not abs(derivative[end]) <= _AT_END * all_else + rounding[end]
        if not wrong.any():
            return None
        row = int(np.argmax(wrong))
        middle = (slope[:-1] + slope[1:]) / 2
        ratio = float(inner @ middle / (middle @ middle))
    slopes = tuple(float(one) for one in slope[max(row - 1, 0) : row + 1])
    return Disagreement(row, float(derivative[row]), slopes, _looks_like(ratio))


def _outside(value: Array, one: Array, other: Array) -> Array:
    """Return how far values are outside what lies between two others; 0 within."""
    below, above = np.minimum(one, other) - value, value - np.maximum(one, other)
    beyond: Array = np.maximum(np.maximum(below, above), 0.0)
    return beyond


def _last_place(values: Array) -> float:
    """Return the unit of the last decimal written: the least difference of unequal values."""
    largest = np.abs(values).max()
    gaps = np.diff(np.unique(values))
    return float(min(gaps.min(initial=np.inf), _LAST_PLACE * largest) + 1e-15 * largest)


def _looks_like(ratio: float) -> str:
    if abs(ratio + 1) < 0.1:
        return "the opposite sign"
    for factor, confused in _MISTAKES.items():
        for power in (factor, 1 / factor):
            if abs(ratio / power - 1) < 0.1:
                return f"{ratio:.3g} times the slope, as if {confused} were confused"
    return ""
