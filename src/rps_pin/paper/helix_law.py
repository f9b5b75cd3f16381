"""What phi(t) of Eq. 29 does, corrected and as printed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rps_pin.paper import paper_data as paper
from rps_pin.paper.read_helix import corrected_turn, printed_turn


class HelixLaw(NamedTuple):
    """What Eq. 29, corrected, does."""

    end: float
    """First time after the brakes go on at which phi' is zero, s."""
    turn_at_end: float
    """phi there, rad."""
    greatest_speed: float
    """Of the centre with r_h = 0.75 and p_h = 0.5, units/s."""
    ramp: float
    """Its acceleration along the path while phi' rises, units/s^2."""
    turn_at_printed_end: float
    """phi at Table 1's t_t = 5.2 s, rad."""
    printed_end_turn: float
    """phi at the end with the last branch as printed, rad."""
    printed_end_rate: float
    """phi' there, rad/s."""


def helix_law() -> HelixLaw:
    """Return what Eq. 29 does, corrected and as printed, by root finding and sampling."""

    def rate(t: float) -> float:
        return float(corrected_turn(t)[1])

    end = float(brentq(rate, paper.BRAKE_START, 6.0, xtol=1e-14))
    times = np.linspace(0.0, end, 20_001)
    phi, _, _ = corrected_turn(times)
    radius, climb = paper.HELIX_RADIUS, paper.HELIX_PITCH / (2 * math.pi)
    path = np.stack([radius * np.cos(phi), radius * np.sin(phi), climb * phi], axis=-1)
    speed = np.linalg.norm(np.gradient(path, times, axis=0, edge_order=2), axis=-1)
    rising = times < paper.RAMP_END - 0.01
    ramp = np.polynomial.polynomial.polyfit(times[rising], speed[rising], 1)[1]
    last = printed_turn(end)
    return HelixLaw(
        end,
        float(corrected_turn(end)[0]),
        float(speed.max()),
        float(ramp),
        float(corrected_turn(paper.PRINTED_TIMES[2])[0]),
        float(last[0]),
        float(last[1]),
    )
