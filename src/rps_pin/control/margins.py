"""Stability margins of one axis of the discrete control loop, opened at its force.

The margins are those of the curve L(exp(j t)), 0 < t <= pi, of `AxisLoop`; whether the loop is
stable is read from the poles.

python-control's `stability_margins` (0.10.2) is not used: it takes roots of polynomials that have
four to six of their roots at z = 1 and calls some of these crossings (gain margins of 1e-8; by
its method "poly" a phase margin of 16 deg where 59 deg is right), its other method finds modulus
margins of 1e5 near z = 1, and it leaves out t = pi, where a loop with measured speed ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from rps_pin.arrays import Array, ComplexArray
from rps_pin.control.axis_loop import axis_loop

Response = Callable[[Array], ComplexArray]


class LoopMargins(NamedTuple):
    """What a loop tolerates; of an unstable loop the factors are 1 and every other margin is 0."""

    stable: bool
    """Whether every pole of the closed loop is inside the unit circle."""
    gain_up: float
    """Factor below which the loop gain may rise (``inf``: any)."""
    gain_down: float
    """Factor above which the loop gain may fall (0: any)."""
    phase: float
    """Phase margin, rad: the least turn of L, either way, that brings it to -1."""
    delay: float
    """Further delay below which the loop stays stable, s; exact for whole ticks."""
    modulus: float
    """Modulus (vector) margin: least distance of L from -1, 1 / max |sensitivity|."""
    crossover: float
    """Highest frequency at which abs(L) = 1, Hz."""
    bandwidth: float
    """Frequency at which abs(L / (1 + L)) first falls below 1 / sqrt(2), Hz; 0 if unstable."""

    def __str__(self) -> str:
        if not self.stable:
            return f"unstable; crossover {self.crossover:.3g} Hz"
        return (
            f"stable; loop gain may change by factors of {self.gain_down:.3g} to "
            f"{self.gain_up:.3g}; phase margin {math.degrees(self.phase):.3g} deg; further delay "
            f"up to {1e3 * self.delay:.3g} ms; modulus margin {self.modulus:.3g}; crossover "
            f"{self.crossover:.3g} Hz; bandwidth {self.bandwidth:.3g} Hz"
        )


def loop_margins(
    proportional: float,
    derivative: float,
    integral: float = 0.0,
    *,
    period: float = 1e-3,
    delay: int = 1,
    cut_off: float | None = 50.0,
    inertia: float = 1.0,
) -> LoopMargins:
    """Return the margins of one axis of the loop.

    Parameters
    ----------
    proportional, derivative, integral
        Kp (1/s^2), Kd (1/s), Ki (1/s^3) of one axis, not negative: acceleration per error.
    period
        T, s.
    delay
        Whole ticks from the reading to the force computed from it, 0 to 200.
    cut_off
        Of the `SpeedFilter`, Hz (``inf``: bare differences); None for measured speed.
    inertia
        Believed over true inertia: a factor of the loop gain.

    Returns
    -------
    LoopMargins
        The loop is opened at the force. Without a proportional gain no loop is called stable: the
        position drifts.

    Raises
    ------
    InputError
        A number is not finite or out of range, or a gain is so small that rounding hides its pole.

    Notes
    -----
    K. J. Astrom, R. M. Murray, *Feedback Systems*, section 10.3 (margins); K. J. Astrom,
    B. Wittenmark, *Computer-Controlled Systems*, section 3.3 (Nyquist's criterion in discrete
    time). The position is taken as the double integral of the commanded acceleration: flexible
    legs, force lag and coupling between the axes are not in it.
    """
    axis = axis_loop(proportional, derivative, integral, period, delay, cut_off, inertia)
    t = axis.grid()
    value = axis.response(t)
    nyquist = 0.5 / period
    crossings = _unit_gain(axis.response, t, value)
    if crossings.size == 0:  # only without gains is the whole curve inside the unit circle
        return LoopMargins(False, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    crossover = float(nyquist * crossings[-1] / np.pi)
    if axis.kp == 0 or np.abs(np.linalg.eigvals(axis.matrix())).max() >= 1:
        return LoopMargins(False, 1.0, 1.0, 0.0, 0.0, 0.0, crossover, 0.0)
    factors = _critical_factors(axis.response, t, value)
    lag = np.angle(axis.response(crossings))  # of -L: how far L is ahead of -1
    return LoopMargins(
        stable=True,
        gain_up=float(np.min(factors[factors > 1], initial=np.inf)),
        gain_down=float(np.max(factors[factors < 1], initial=0.0)),
        phase=float(np.abs(lag).min()),
        delay=float(period * np.min(lag % (2 * np.pi) / crossings)),
        modulus=_modulus(axis.response, t, value),
        crossover=crossover,
        bandwidth=nyquist * _bandwidth(axis.response, t, value) / np.pi,
    )


def _roots(function: Callable[[Array], Array], t: Array, values: Array) -> Array:
    """Angles where a real function of the angle changes sign, refined."""
    below = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)

    def scalar(angle: float) -> float:
        return float(function(np.array(angle)))

    return np.array([brentq(scalar, t[i], t[i + 1], xtol=1e-15, rtol=1e-13) for i in below])


def _unit_gain(response: Response, t: Array, value: ComplexArray) -> Array:
    """Angles where abs(L) = 1, rising; t = pi too where the curve ends outside the unit circle."""
    roots = _roots(lambda angle: np.abs(response(angle)) - 1, t, np.abs(value) - 1)
    return np.append(roots, np.pi) if abs(value[-1]) >= 1 else roots


def _critical_factors(response: Response, t: Array, value: ComplexArray) -> Array:
    """Factors of the loop gain that put a pole on the unit circle: 1 / abs(L) where L < 0."""
    roots = _roots(lambda angle: response(angle).imag, t, value.imag)
    real = response(np.append(roots, np.pi)).real
    factors: Array = 1 / real[real > 0]
    return factors


def _modulus(response: Response, t: Array, value: ComplexArray) -> float:
    distance = np.abs(1 - value)
    i = int(distance.argmin())
    found = minimize_scalar(
        lambda angle: float(np.abs(1 - response(np.array(angle)))),
        bounds=(t[max(i - 1, 0)], t[min(i + 1, t.size - 1)]),
        method="bounded",
        options={"xatol": 1e-9 * t[i]},
    )
    return float(min(found.fun, distance[i]))


def _bandwidth(response: Response, t: Array, value: ComplexArray) -> float:
    """First angle where abs(L / (1 + L)) = 1 / sqrt(2); pi if it never falls so far."""

    def excess(minus_l: ComplexArray) -> Array:
        gain: Array = np.abs(minus_l / (1 - minus_l)) - math.sqrt(0.5)
        return gain

    roots = _roots(lambda angle: excess(response(angle)), t, excess(value))
    return float(roots[0]) if roots.size else math.pi
