"""Reasons why a point is outside the workspace: one bit each, so that a point can have several."""

from __future__ import annotations

import math
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array
from rps_pin.rps.kernels.limits import length_within, within
from rps_pin.rps.parameters import RPSParameters

Flags = NDArray[np.uint16]


class Reason(IntFlag):
    """Reasons why a point is out; a point with none of them is inside."""

    INSIDE = 0
    LEG_1_SHORT = 1 << 0
    """Leg 1 would be shorter than its lower limit."""
    LEG_2_SHORT = 1 << 1
    LEG_3_SHORT = 1 << 2
    LEG_1_LONG = 1 << 3
    """Leg 1 would be longer than its upper limit."""
    LEG_2_LONG = 1 << 4
    LEG_3_LONG = 1 << 5
    LEG_1_ANGLE = 1 << 6
    """Leg 1's angle would be beyond its limits."""
    LEG_2_ANGLE = 1 << 7
    LEG_3_ANGLE = 1 << 8
    LEG_1_SPHERICAL = 1 << 9
    """Leg 1's spherical joint would leave its cone."""
    LEG_2_SPHERICAL = 1 << 10
    LEG_3_SPHERICAL = 1 << 11
    SINGULAR = 1 << 12
    """At a parallel singularity, or beyond it, seen from the start pose."""
    UNREACHABLE = 1 << 13
    """These leg lengths do not close in the start's assembly mode: there is no pose to judge."""

    @property
    def text(self) -> str:
        """The reason in words, for legends and reports."""
        if self is Reason.INSIDE:
            return "inside"
        words = {
            "SHORT": "too short",
            "LONG": "too long",
            "ANGLE": "angle beyond its limits",
            "SPHERICAL": "spherical joint beyond its cone",
        }
        names = [str(reason.name).split("_") for reason in self]
        return ", ".join(
            f"leg {name[1]} {words[name[2]]}" if name[0] == "LEG" else name[0].lower()
            for name in names
        )


def broken_limits(
    parameters: RPSParameters, length: Array, angle: Array, cone: Array | None
) -> Flags:
    """Return the limits of the legs and joints that each pose breaks, shape (n,).

    Parameters
    ----------
    parameters
        The robot; `RPSParameters.leg_length_limits` and its like are the limits.
    length, angle
        Of the legs, shape (3 legs, n) each, m and rad.
    cone
        Angles of the spherical joints, shape (3 legs, n), rad; None where they have no limit.
    """
    shortest, longest = parameters.leg_length_limits
    checks = [
        (Reason.LEG_1_SHORT, length_within(length, shortest, math.inf)),
        (Reason.LEG_1_LONG, length_within(length, 0.0, longest)),
        (Reason.LEG_1_ANGLE, within(angle, *parameters.leg_angle_limits)),
    ]
    if cone is not None:
        checks.append((Reason.LEG_1_SPHERICAL, within(cone, 0.0, parameters.spherical_cone_limit)))
    flags = np.zeros(length.shape[1:], dtype=np.uint16)
    for leg_1, kept in checks:
        for leg in range(3):  # the bits of legs 2 and 3 follow that of leg 1
            flags |= np.uint16(leg_1 << leg) * ~kept[leg]
    return flags
