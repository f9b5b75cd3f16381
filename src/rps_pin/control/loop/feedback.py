"""Feedback that all laws share: proportional, derivative and integral."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple

#: Kp, Kd, Ki, each for three errors.
GainRows = tuple[Triple, Triple, Triple]
#: What a law calls with the error, the wanted rate and the rate: `pid` with its memory.
Feedback: TypeAlias = Callable[[Triple, Triple, Triple], Triple]
#: What a law calls with leg geometry, rate and acceleration of the pose: the actuator forces.
Dynamics: TypeAlias = Callable[[LegGeometry, Triple, Triple], Triple | None]


def pid(
    error: Triple, error_rate: Triple, integral: Triple, gains: GainRows, elapsed: Number
) -> tuple[Triple, Triple]:
    """Return Kd e' + Kp e + I after the step I += Ki e elapsed, and I."""
    (p1, p2, p3), (d1, d2, d3), (k1, k2, k3) = gains
    (e1, e2, e3), (v1, v2, v3), (i1, i2, i3) = error, error_rate, integral
    i1, i2, i3 = i1 + elapsed * k1 * e1, i2 + elapsed * k2 * e2, i3 + elapsed * k3 * e3
    return (
        p1 * e1 + d1 * v1 + i1,
        p2 * e2 + d2 * v2 + i2,
        p3 * e3 + d3 * v3 + i3,
    ), (i1, i2, i3)
