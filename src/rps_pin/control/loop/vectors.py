"""Vectors of a control loop: three floats (or CasADi expressions), arrays, or CasADi's columns.

Each formula is written once, for one number; arrays take it as it is, element by element. Triples
of floats are several times faster than arrays.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple

_ZERO = (0.0, 0.0, 0.0)


class Vectors(NamedTuple):
    """What a loop does with vectors of one kind."""

    zero: Any
    of: Callable[[Any], Any]
    """A vector of numbers."""
    difference: Callable[[Any, Any], Any]
    """a - b."""
    total: Callable[[Any, Any], Any]
    """a + b."""
    low_pass: Callable[[Any, Any, Any], Any]
    """s + share (u - s)."""
    backward_difference: Callable[[Any, Any, Any], Any]
    """(x - last) / elapsed."""
    mean: Callable[[Any, Any], Any]
    """(a + b) / 2."""
    pid: Callable[..., tuple[Any, Any]]
    """See `pid`."""
    unwound: Callable[..., Any]
    """See `unwound`."""


def difference(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def total(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def low_pass(u: Triple, s: Triple, share: Number) -> Triple:
    """Return s + share (u - s), the filter's next output; share is 1 - exp(-2 pi f T)."""
    (u1, u2, u3), (s1, s2, s3) = u, s
    return _low_pass(u1, s1, share), _low_pass(u2, s2, share), _low_pass(u3, s3, share)


def backward_difference(x: Triple, last: Triple, elapsed: Number) -> Triple:
    """Return the mean speed between two readings, a time (s) apart."""
    (x1, x2, x3), (y1, y2, y3) = x, last
    return _slope(x1, y1, elapsed), _slope(x2, y2, elapsed), _slope(x3, y3, elapsed)


def mean(one: Triple, other: Triple) -> Triple:
    """Return the mean of two rates."""
    (x1, x2, x3), (y1, y2, y3) = one, other
    return _mean(x1, y1), _mean(x2, y2), _mean(x3, y3)


def pid(
    error: Triple,
    error_rate: Triple,
    integral: Triple,
    gains: tuple[Triple, Triple, Triple],
    elapsed: Number,
) -> tuple[Triple, Triple]:
    """Return Kd e' + Kp e + I after the step I += Ki e elapsed, and I."""
    (p1, p2, p3), (d1, d2, d3), (k1, k2, k3) = gains
    (e1, e2, e3), (v1, v2, v3), (i1, i2, i3) = error, error_rate, integral
    u1, i1 = _pid(e1, v1, i1, (p1, d1, k1), elapsed)
    u2, i2 = _pid(e2, v2, i2, (p2, d2, k2), elapsed)
    u3, i3 = _pid(e3, v3, i3, (p3, d3, k3), elapsed)
    return (u1, u2, u3), (i1, i2, i3)


def unwound(integral: Triple, error: Triple, rate: Triple, elapsed: Number) -> Triple:
    """Return the integral after back-calculation: I' = (command error) / T_t, rate = 1 / T_t."""
    (i1, i2, i3), (m1, m2, m3), (w1, w2, w3) = integral, error, rate
    return (
        _unwound(i1, m1, w1, elapsed),
        _unwound(i2, m2, w2, elapsed),
        _unwound(i3, m3, w3, elapsed),
    )


def _low_pass(u: Any, s: Any, share: Any) -> Any:
    return s + share * (u - s)


def _slope(x: Any, last: Any, elapsed: Any) -> Any:
    return (x - last) / elapsed


def _mean(one: Any, other: Any) -> Any:
    return (one + other) / 2.0


def _pid(error: Any, rate: Any, integral: Any, gains: Any, elapsed: Any) -> tuple[Any, Any]:
    kp, kd, ki = gains
    integral = integral + elapsed * ki * error
    return kp * error + kd * rate + integral, integral


def _unwound(integral: Any, error: Any, rate: Any, elapsed: Any) -> Any:
    return integral + elapsed * rate * error


TRIPLES = Vectors(
    _ZERO, tuple, difference, total, low_pass, backward_difference, mean, pid, unwound
)


def arrays(count: int) -> Vectors:
    """Return formulas of arrays, shape (count,)."""
    zero = np.zeros(count)
    zero.setflags(write=False)
    of = partial(np.array, ndmin=1)
    return Vectors(zero, of, np.subtract, np.add, _low_pass, _slope, _mean, _pid, _unwound)


def columns(count: int) -> Vectors:
    """Return formulas of CasADi's columns, shape (count, 1)."""
    import casadi as ca  # noqa: PLC0415

    add, subtract = operator.add, operator.sub
    zero = ca.SX.zeros(count)
    return Vectors(zero, ca.SX, subtract, add, _low_pass, _slope, _mean, _pid, _unwound)
