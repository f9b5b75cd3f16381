"""Gains of a control law: proportional, derivative and integral, for each error.

Their units depend on the law: see `ComputedTorque` and `PDControl`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import positive_number, read_only, real_array, whole_number


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Gains:
    """Gains, one number for all errors or a number for each: three of the 3-RPS, m of a task.

    Parameters
    ----------
    proportional
        Kp, not negative; shape () or (m,), stored as (m,); (3,) where all are of shape ().
    derivative
        Kd, likewise.
    integral
        Ki, likewise; zero for none. A positive Ki needs a positive Kd (see `tracking_time`).

    Raises
    ------
    InputError
        If a gain is negative, not finite, or of another shape.
    """

    proportional: Array | float
    derivative: Array | float
    integral: Array | float = 0.0
    _alike: bool = field(default=True, init=False, repr=False)

    def __post_init__(self) -> None:
        names = ("proportional", "derivative", "integral")
        rows = {name: real_array(getattr(self, name), f"gain {name}") for name in names}
        sizes = [given.size for given in rows.values() if given.ndim == 1 and given.size]
        count = sizes[0] if sizes else 3
        for name, given in rows.items():
            if given.shape not in ((), (count,)):
                raise InputError(
                    f"gain {name} has shape {given.shape}; it must be () or ({count},)"
                )
            if (given < 0).any():
                raise InputError(f"gain {name} = {given.tolist()}: it must not be negative")
            object.__setattr__(self, name, read_only(np.broadcast_to(given, count)))
        object.__setattr__(self, "_alike", not sizes)
        integral, derivative = np.asarray(self.integral), np.asarray(self.derivative)
        if ((integral > 0) & (derivative == 0)).any():
            raise InputError("an integral gain needs a derivative gain, which provides the damping")

    @classmethod
    def placed(cls, bandwidth: float, *, damping: float = 1.0, integral: float = 0.0) -> Self:
        """Return gains for laws that command accelerations (1/s^2, 1/s, 1/s^3), by pole placement.

        With w = 2 pi bandwidth they are Kp = w^2, Kd = 2 damping w and Ki = integral w^3: without
        integral the error obeys s^2 + 2 damping w s + w^2 = 0. A continuous loop is stable for
        integral < 2 damping; for a sampled one, with filter and delay, see `loop_margins`.

        Parameters
        ----------
        bandwidth
            Hz; positive.
        damping
            1 for critical damping; positive.
        integral
            Integral action as a multiple of w^3, 0 for none.
        """
        w = 2 * math.pi * positive_number(bandwidth, "bandwidth", "Hz")
        return cls(w**2, 2 * positive_number(damping, "damping") * w, integral * w**3)

    def times(self, inertia: ArrayLike) -> Gains:
        """Return gains for laws that command forces: these multiplied by the inertia of each error.

        Parameters
        ----------
        inertia
            Shape () or (m,), kg (or kg m^2 for tilts); see `effective_inertia`.
        """
        factor = real_array(inertia, "inertia")
        if factor.ndim > 1 or not factor.size:
            raise InputError(f"inertia has shape {factor.shape}; it must be () or (m,)")
        one = self.of(factor.size) if factor.ndim else self
        return Gains(one.proportional * factor, one.derivative * factor, one.integral * factor)

    def of(self, count: int) -> Gains:
        """Return the gains of so many errors: one number for all is one for each.

        Raises
        ------
        InputError
            If they are the gains of another number of errors, or the number is none.
        """
        count = whole_number(count, "count")
        rows = [np.asarray(row) for row in (self.proportional, self.derivative, self.integral)]
        if len(rows[0]) == count:
            return self
        if not self._alike:
            raise InputError(f"the gains are those of {len(rows[0])} errors; there are {count}")
        return Gains(*(np.full(count, row[0]) for row in rows))

    @property
    def rows(self) -> tuple[Any, Any, Any]:
        """Kp, Kd and Ki as floats, a tuple each."""
        kp, kd, ki = (
            tuple(np.asarray(one).tolist())
            for one in (self.proportional, self.derivative, self.integral)
        )
        return kp, kd, ki

    @property
    def tracking_time(self) -> tuple[float, ...]:
        """Time constant of the back-calculation at a force limit, s: sqrt(Kd / Ki).

        The geometric mean of the integral time Kp / Ki and the derivative time Kd / Kp (Astrom and
        Hagglund, Advanced PID Control, 2006, 3.5). Infinite without integral.
        """
        _, derivative, integral = self.rows
        return tuple(
            math.sqrt(kd / ki) if ki > 0 else math.inf
            for kd, ki in zip(derivative, integral, strict=True)
        )
