"""The coefficients of the exponential map and their slopes, in plain floats: Stumpff functions.

With s the squared tilt, c_n(s) = sum_k (-s)^k / (2 k + n)!. The coefficients of
`rps_pin.rps.kinematics.pose` are C = c_0, A = c_1, B = c_2 and D = c_3, and

    c_n = 1/n! - s c_{n+2},     dc_n/ds = (n c_{n+2} - c_{n+1}) / 2.
"""

from __future__ import annotations

import math

from rps_pin.numerics.compiled import compiled

#: A, B, C, D, dA/ds, dB/ds, dD/ds, d2A/ds2, d2B/ds2.
Coefficients = tuple[float, float, float, float, float, float, float, float, float]

#: Below this s the series are summed: there the closed forms cancel, and 9 terms are exact.
_SERIES_BELOW = 1.0
_C5 = tuple((-1.0) ** k / math.factorial(2 * k + 5) for k in range(9))
_C6 = tuple((-1.0) ** k / math.factorial(2 * k + 6) for k in range(9))


@compiled
def coefficients(s: float) -> Coefficients:
    """Return A, B, C, D and the slopes named above, of a squared tilt s >= 0, rad^2."""
    if s < _SERIES_BELOW:
        p0, p1, p2, p3, p4, p5, p6, p7, p8 = _C5
        c5 = p0 + s * (
            p1 + s * (p2 + s * (p3 + s * (p4 + s * (p5 + s * (p6 + s * (p7 + s * p8))))))
        )
        p0, p1, p2, p3, p4, p5, p6, p7, p8 = _C6
        c6 = p0 + s * (
            p1 + s * (p2 + s * (p3 + s * (p4 + s * (p5 + s * (p6 + s * (p7 + s * p8))))))
        )
        c3, c4 = 1.0 / 6.0 - s * c5, 1.0 / 24 - s * c6
        c1, c2 = 1.0 - s * c3, 0.5 - s * c4
        c0 = 1.0 - s * c2
    else:
        beta = math.sqrt(s)
        c0, c1 = math.cos(beta), math.sin(beta) / beta
        c2, c3 = (1.0 - c0) / s, (1.0 - c1) / s
        c4, c5 = (0.5 - c2) / s, (1.0 / 6.0 - c3) / s
        c6 = (1.0 / 24 - c4) / s
    return (
        c1,
        c2,
        c0,
        c3,
        (c3 - c2) / 2.0,
        c4 - c3 / 2.0,
        (3.0 * c5 - c4) / 2.0,
        (3.0 * c5 - 3.0 * c4 + c3) / 4.0,  # d/ds (c3 - c2)/2
        2.0 * c6 - 1.25 * c5 + c4 / 4.0,  # d/ds (c4 - c3/2)
    )
