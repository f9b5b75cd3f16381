"""Stability margins of one axis of the discrete control loop, opened at its force.

The margins are those of the curve L(exp(j t)), 0 < t <= pi, of `AxisLoop`; stability is decided by
the poles.

python-control's `stability_margins` (0.10.2) is not accurate here. It computes roots of polynomials
with four to six roots at z = 1 and counts some of these as crossings (gain margins of 1e-8; with
its method "poly" a phase margin of 16 deg instead of 59 deg). Its other method gives modulus
margins of 1e5 near z = 1, and it omits t = pi, where the curve of a loop with measured speed ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from rps_pin.arrays import Array, ComplexArray
from rps_pin.control.axis_loop import AxisLoop, axis_loop
from rps_pin.other_kinds import refuses_other_kinds


class LoopMargins(NamedTuple):
    """Margins of a loop; for an unstable loop the factors are 1 and all other margins 0."""

    stable: bool
    """Whether all poles of the closed loop are inside the unit circle."""
    gain_up: float
    """Factor up to which the loop gain may rise (``inf``: any)."""
    gain_down: float
    """Factor down to which the loop gain may fall (0: any)."""
    phase: float
    """Phase margin, rad: the least rotation of L, in either direction, that moves it to -1."""
    delay: float
    """Additional delay up to which the loop stays stable, s; exact for whole ticks."""
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


@refuses_other_kinds
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
        Modelled over true inertia: a factor of the loop gain.

    Returns
    -------
    LoopMargins
        The loop is opened at the force. A loop without proportional gain is not stable: the
        position drifts.

    Raises
    ------
    InputError
        If a number is not finite or out of range, or a gain is so small that rounding hides its
        pole.

    Notes
    -----
    K. J. Astrom, R. M. Murray, *Feedback Systems*, section 10.3 (margins); K. J. Astrom,
    B. Wittenmark, *Computer-Controlled Systems*, section 3.3 (Nyquist's criterion in discrete
    time). The position is modelled as the double integral of the commanded acceleration, without
    flexible legs, force lag and coupling between the axes.
    """
    axis = axis_loop(proportional, derivative, integral, period, delay, cut_off, inertia)
    t = axis.grid()
    value = axis.response(t)
    nyquist = 0.5 / period
    crossings = _roots(_gain_excess, axis, t, value)
    if abs(value[-1]) >= 1:
        crossings = np.append(crossings, np.pi)
    # Without a crossing the whole curve is inside the unit circle: all gains are zero.
    crossover = float(nyquist * crossings[-1] / np.pi) if crossings.size else 0.0
    unstable = axis.kp == 0 or np.abs(np.linalg.eigvals(axis.matrix())).max() >= 1
    if unstable or not crossings.size:
        return LoopMargins(False, 1.0, 1.0, 0.0, 0.0, 0.0, crossover, 0.0)
    # Factors of the gain with a pole on the unit circle: 1 / abs(L) where L < 0.
    real = axis.response(np.append(_roots(np.imag, axis, t, value), np.pi)).real
    factors = 1 / real[real > 0]
    lag = np.angle(axis.response(crossings))  # of -L: the angle by which L leads -1
    # abs(L / (1 + L)) = 1 / sqrt(2); pi if it is nowhere.
    limits = _roots(
        lambda minus_l: _gain_excess(minus_l / (1 - minus_l), math.sqrt(0.5)), axis, t, value
    )
    return LoopMargins(
        stable=True,
        gain_up=float(np.min(factors[factors > 1], initial=np.inf)),
        gain_down=float(np.max(factors[factors < 1], initial=0.0)),
        phase=float(np.abs(lag).min()),
        delay=float(period * np.min(lag % (2 * np.pi) / crossings)),
        modulus=_modulus(axis, t, value),
        crossover=crossover,
        bandwidth=nyquist * float(limits[0] if limits.size else math.pi) / np.pi,
    )


def _gain_excess(value: ComplexArray, gain: float = 1.0) -> Array:
    return np.asarray(np.abs(value) - gain)


def _roots(
    function: Callable[[ComplexArray], Array], axis: AxisLoop, t: Array, value: ComplexArray
) -> Array:
    """Return the angles where a real function of -L changes sign; `value` is -L at t."""
    signs = np.sign(function(value))
    below = np.flatnonzero(signs[:-1] * signs[1:] < 0)

    def scalar(angle: float) -> float:
        return float(function(axis.response(np.array(angle))))

    return np.array([brentq(scalar, t[i], t[i + 1], xtol=1e-15, rtol=1e-13) for i in below])


def _modulus(axis: AxisLoop, t: Array, value: ComplexArray) -> float:
    distance = np.abs(1 - value)
    i = int(distance.argmin())
    found = minimize_scalar(
        lambda angle: float(np.abs(1 - axis.response(np.array(angle)))),
        bounds=(t[max(i - 1, 0)], t[min(i + 1, t.size - 1)]),
        method="bounded",
        options={"xatol": 1e-9 * t[i]},
    )
    return float(min(found.fun, distance[i]))
