"""Random laws of time, and what they reach at most: measured from their values alone."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from rps_pin.trajectories import QuinticLaw, SCurveLaw, TrapezoidalLaw

Array = NDArray[np.float64]
Law = QuinticLaw | TrapezoidalLaw | SCurveLaw
LAWS: tuple[type[Law], ...] = (QuinticLaw, TrapezoidalLaw, SCurveLaw)

POSITIVE = st.floats(-3, 3).map(lambda power: 10.0**power)
DISTANCES = st.floats(-6, 3).map(lambda power: 10.0**power)
RAMPS = st.floats(0.01, 0.5)


@st.composite
def laws(draw: st.DrawFn) -> Law:
    """Laws of any kind, for a duration."""
    kind = draw(st.sampled_from(LAWS))
    distance, duration = draw(DISTANCES), draw(POSITIVE)
    if kind is QuinticLaw:
        return QuinticLaw(distance, duration)
    return kind(distance, duration, ramp=draw(RAMPS))  # type: ignore[call-arg]


def pieces(law: Law) -> list[tuple[float, float]]:
    """Where each of its polynomials begins and ends."""
    knots = [0.0, law.duration] if isinstance(law, QuinticLaw) else law.knots.tolist()
    return list(pairwise(knots))


def inside(law: Law) -> tuple[Array, Array]:
    """Times within the pieces, and steps of which three stay within: shapes (n,)."""
    fraction = np.linspace(0.35, 0.65, 5)
    times = [begin + (end - begin) * fraction for begin, end in pieces(law)]
    steps = [np.full(5, (end - begin) / 10) for begin, end in pieces(law)]
    return np.concatenate(times), np.concatenate(steps)


class Peaks(NamedTuple):
    """Largest absolute values."""

    speed: float
    acceleration: float
    jerk: float


def measurable(law: Law) -> list[tuple[float, float]]:
    """Its pieces but those of rounding, where two cases of a law meet."""
    return [(begin, end) for begin, end in pieces(law) if end - begin > 1e-9 * law.duration]


def largest(polynomial: Polynomial) -> float:
    """Largest absolute value over [0, 1]: at an end, or where the slope vanishes."""
    level = np.real(polynomial.deriv().roots()).clip(0, 1)
    return float(np.abs(polynomial(np.array([0.0, 1.0, *level]))).max())


def peaks(law: Law) -> Peaks:
    """Found from values of u' and of u'' within each piece: of the polynomials through them."""
    found = []
    for begin, end in measurable(law):
        s = 0.5 - np.cos(np.pi * (np.arange(5) + 0.5) / 5) / 2
        values = law.at(begin + (end - begin) * s)
        speed = Polynomial.fit(s, values.rate, 4, domain=[0, 1])
        push = Polynomial.fit(s, values.acceleration, 3, domain=[0, 1])
        jerk = push.deriv() / (end - begin)
        found.append([largest(x) for x in (speed, push, jerk)])
    return Peaks(*np.max(found, axis=0).tolist())


def uncertainty(law: Law) -> float:
    """Share by which peaks may be off: times are rounded, which tells in the shortest piece."""
    shortest = min(end - begin for begin, end in measurable(law))
    return 1e-12 + 1e-14 * law.duration / shortest


def ratio(value: float, limit: float) -> float:
    """How much of a limit is used: nothing if there is none."""
    return 0.0 if math.isinf(limit) else value / limit
