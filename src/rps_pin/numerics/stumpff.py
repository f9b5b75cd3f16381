"""Stumpff functions, of which the coefficients of rotations are made.

c_n(s) = sum_k (-s)^k / (2 k + n)!, so that with s = beta^2, c_0 = cos(beta), c_1 = sin(beta)/beta,
and

    c_n = 1/n! - s c_(n+2),     dc_n/ds = (n c_(n+2) - c_(n+1)) / 2.
"""

from __future__ import annotations

import math

import numpy as np

from rps_pin.numerics.elementary import Number, cos, is_real_array, less, select, sin, sqrt
from rps_pin.numerics.intervals import Enclosure, Interval

Stumpff = tuple[Number, Number, Number, Number, Number, Number, Number]

#: Below this s the series are summed, exact to rounding; above, the recursion from c_0 and c_1 is.
_SERIES_BELOW = 4.0
#: Least upper bound, rounded up, of the error of the summed series: 40 roundings, each of at most
#: 2^-53 of sum_k s^k / (2 k)! = cosh(2), and what is left out, below 1e-19 (Horner's rule; Higham,
#: Accuracy and Stability of Numerical Algorithms, section 5.1).
_ROUNDING = 2e-14
#: Terms of c_5 and c_6, from the last to the second.
_TERMS = tuple(
    ((-1.0) ** k / math.factorial(2 * k + 5), (-1.0) ** k / math.factorial(2 * k + 6))
    for k in range(9, 0, -1)
)


def bounds_at_ends(s: Interval) -> tuple[Stumpff, Stumpff]:
    """Return bounds of c_0 to c_6 at both ends of intervals; endless beyond `_SERIES_BELOW`.

    Each c_n and each of its derivatives is monotone for s < pi^2, so that the ends bound them
    between: c_n^(k)(s) is an integral of c_0^(k)(t^2 s) with positive weights, and the derivatives
    of c_0 keep their signs there.
    """
    endless = np.where(s.upper < _SERIES_BELOW, 0.0, np.inf)

    def at(end: Number) -> Stumpff:
        of_floats = _from_series(np.clip(end, 0.0, _SERIES_BELOW))
        parts = (Interval(c).widened(_ROUNDING) for c in of_floats)
        return tuple(Interval(one.lower - endless, one.upper + endless) for one in parts)  # type: ignore[return-value]

    return at(s.lower), at(s.upper)


def enclosures(s: Interval | Enclosure) -> tuple[Number, ...]:
    """Return c_0 to c_4 over boxes; with slopes, of what has them."""
    low, high = bounds_at_ends(s.values if isinstance(s, Enclosure) else s)
    c = [one.hull(other) for one, other in zip(low, high, strict=True)]
    if not isinstance(s, Enclosure):
        return tuple(c[:5])
    return tuple(s.through(c[n], 0.5 * (n * c[n + 2] - c[n + 1])) for n in range(5))


def _from_series(s: Number) -> Stumpff:
    """Return c_0 to c_6 from the series of c_5 and c_6: of small s."""
    c5, c6 = 0.0 * s, 0.0 * s
    for term_5, term_6 in _TERMS:
        c5 += term_5  # in place, of arrays
        c5 *= s
        c6 += term_6
        c6 *= s
    c5 += 1.0 / 120.0
    c6 += 1.0 / 720.0
    c3, c4 = 1.0 / 6.0 - s * c5, 1.0 / 24.0 - s * c6
    c1, c2 = 1.0 - s * c3, 0.5 - s * c4
    return 1.0 - s * c2, c1, c2, c3, c4, c5, c6


def _by_recursion(s: Number) -> Stumpff:
    """Return c_0 to c_6, upwards: of s that are not small."""
    beta = sqrt(s)
    c0, c1 = cos(beta), sin(beta) / beta
    c2, c3 = (1.0 - c0) / s, (1.0 - c1) / s
    c4, c5 = (0.5 - c2) / s, (1.0 / 6.0 - c3) / s
    return c0, c1, c2, c3, c4, c5, (1.0 / 24.0 - c4) / s


def stumpff(s: Number) -> Stumpff:
    """Return the Stumpff functions c_0 to c_6 of s >= 0."""
    if type(s) is float:
        return _from_series(s) if s < _SERIES_BELOW else _by_recursion(s)
    if is_real_array(s):
        if s.max(initial=0.0) < _SERIES_BELOW:
            return _from_series(s)
        values, far = _from_series(np.minimum(s, _SERIES_BELOW)), s >= _SERIES_BELOW
        for value, beyond in zip(values, _by_recursion(s[far]), strict=True):
            value[far] = beyond
        return values
    small = less(s, _SERIES_BELOW)
    near = _from_series(select(small, s, 1.0))
    far = _by_recursion(select(small, _SERIES_BELOW, s))
    first, *rest = (select(small, a, b) for a, b in zip(near, far, strict=True))
    c1, c2, c3, c4, c5, c6 = rest
    return first, c1, c2, c3, c4, c5, c6
