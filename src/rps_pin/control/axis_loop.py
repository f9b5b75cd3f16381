"""Loop transfer function L(z) and poles of one axis of the discrete control loop.

With exact inverse dynamics an axis is a double integrator whose acceleration is held between ticks.
With T the period, z = exp(j t) where t = 2 pi f T, and d ticks from reading to force,

    L(z) = (modelled / true inertia) z^-d [P_x (Kp + Ki T z / (z - 1)) + Kd D],
    P_x = T^2 (z + 1) / (2 (z - 1)^2),    P_v = T / (z - 1),
    D = P_v with measured speed,
    D = P_x (s / T) (z - 1) / (z - (1 - s)),  s = 1 - exp(-2 pi cut_off T),  with `SpeedFilter`,

opened at the force and closed as 1 + L(z) = 0. L is evaluated with z - 1 = 2j sin(t / 2)
exp(j t / 2), which avoids cancellation near z = 1, where the poles are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, ComplexArray
from rps_pin.errors import InputError
from rps_pin.validation import non_negative_number, positive_number, whole_number

_LONGEST_DELAY = 200
_SLOWEST = 1e-11  # 1 / tick: rounding hides poles closer to z = 1


class AxisLoop(NamedTuple):
    """The loop with the tick as unit of time."""

    kp: float
    """Kp T^2, times the inertia factor as kd and ki are."""
    kd: float
    """Kd T."""
    ki: float
    """Ki T^3."""
    delay: int
    share: float | None
    """s of the filter; None with measured speed."""

    def response(self, t: Array) -> ComplexArray:
        """Return -L(exp(j t)) at angles t (rad a tick, 0 < t <= pi, any shape)."""
        sine, cosine = np.sin(t / 2), np.cos(t / 2)
        # P_x = -exp(-j t/2) cos(t/2) / (4 sin^2(t/2));  z / (z - 1) = exp(j t/2) / (2j sin(t/2))
        position = cosine * (self.kp + self.ki * np.exp(0.5j * t) / (2j * sine))
        if self.share is None:
            speed = 2j * sine
        else:
            # s (1 - 1/z) / (1 - (1 - s)/z), z - (1 - s) = (z - 1) + s
            top = self.share * 2j * sine * np.exp(0.5j * t)
            speed = cosine * top / (2j * sine * np.exp(0.5j * t) + self.share)
        lag = np.exp(-1j * (0.5 + self.delay) * t)
        value: ComplexArray = lag * (position + self.kd * speed) / (4 * sine**2)
        # cos(pi / 2) is not 0 in floating point: at t = pi, L is real, and 0 without P_v.
        end = 0.0 if self.share is not None else 0.5 * self.kd * (-1.0) ** self.delay
        return np.where(t == np.pi, end, value)

    def matrix(self) -> Array:
        """Return the closed loop's state matrix, (5 + delay) square.

        States: x, v, last x, filtered speed, integral, commands on their way.
        x+ = x + v + a/2, v+ = v + a;  command = -(kp x + kd s + i) of the same tick.
        """
        now = np.eye(5 + self.delay)
        x, v, last, filtered, integral = now[:5]
        if self.share is not None:
            # s_k = s_{k-1} + share (x_k - x_{k-1} - s_{k-1})
            filtered = filtered + self.share * (x - last - filtered)
        integral = integral + self.ki * x
        command = -(self.kp * x + self.kd * (v if self.share is None else filtered) + integral)
        a, *waiting = [*now[5:], command]
        if not self.ki:  # a constant integral would be a pole at 1
            integral = 0 * integral
        if self.share is None:
            filtered = 0 * filtered
        return np.array([x + v + a / 2, v + a, x, filtered, integral, *waiting])

    def slowest(self) -> float:
        """Return an estimate of the slowest pole's rate, 1 / tick."""
        rates = [math.sqrt(self.kp), self.kp / self.kd if self.kd else 1.0]
        return min([*rates, self.ki / self.kp] if self.ki else rates)

    def grid(self) -> Array:
        """Return angles up to pi: geometric for L's corners, even for the turns of the delay."""
        corners = [1.0, self.kd, math.sqrt(self.kp), math.cbrt(self.ki), self.share or 0.0]
        corners += [self.kp / self.kd, math.sqrt(self.ki / self.kd)] if self.kd else []
        corners += [self.ki / self.kp] if self.kp else []
        # No relevant corner is below the slowest pole: see `axis_loop`.
        lowest = 1e-3 * max(min(corner for corner in corners if corner > 0), _SLOWEST)
        even = np.linspace(0, np.pi, 64 * (self.delay + 8) + 1)[1:]
        ratio = np.geomspace(lowest, np.pi, 200 * math.ceil(math.log10(np.pi / lowest)))
        return np.union1d(np.minimum(ratio, np.pi), even)


def axis_loop(
    proportional: float,
    derivative: float,
    integral: float,
    period: float,
    delay: int,
    cut_off: float | None,
    inertia: float,
) -> AxisLoop:
    """Return the loop of one axis; parameters and errors as `loop_margins`."""
    kp = non_negative_number(proportional, "proportional", "1/s^2")
    kd = non_negative_number(derivative, "derivative", "1/s")
    ki = non_negative_number(integral, "integral", "1/s^3")
    T, k = positive_number(period, "period", "s"), positive_number(inertia, "inertia")
    if whole_number(delay, "delay", 0) > _LONGEST_DELAY:
        raise InputError(f"delay = {delay} ticks: it must be at most {_LONGEST_DELAY}")
    share = None
    if cut_off is not None:
        rate = 2 * math.pi * positive_number(cut_off, "cut_off", "Hz", infinite=True)
        share = -math.expm1(-rate * T)
    axis = AxisLoop(k * kp * T * T, k * kd * T, k * ki * T * T * T, int(delay), share)
    if not max(axis[:3]) < 1e12:
        raise InputError(
            f"Kp T^2, Kd T, Ki T^3, times the inertia factor, = {axis.kp:.3g}, {axis.kd:.3g}, "
            f"{axis.ki:.3g}: stable loops have at most about 1, more than 1e12 is refused"
        )
    slowest = min(axis.slowest() if axis.kp else 1.0, 1.0 if share is None else share)
    if slowest < _SLOWEST:
        raise InputError(
            f"the slowest pole moves by {slowest:.3g} a tick of {T:.3g} s, rounding hides less "
            f"than {_SLOWEST:.3g}: raise that gain (or cut-off), make it zero, or lengthen the tick"
        )
    return axis
