"""Steps in time of a mechanism's state (q, v), q on its configuration manifold.

Both take the velocity field (v, a(t, q, v)), v in joint axes as in Pinocchio, and move along the
manifold by `pin.integrate`, written q (+) v here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853

from rps_pin.arrays import Array
from rps_pin.bounds import ROWS, STEPS, check_size
from rps_pin.errors import SingularityError
from rps_pin.validation import positive_number, whole_number

#: Function of (t, q, v) that returns the acceleration a, shape (nv,).
Acceleration = Callable[[float, Array, Array], Array]
#: Weights of the stages of `rk4_step`, for integrals along a step.
RK4_WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
#: Of the work among the entries of an adaptive step.
_SCALE = 1e-100
#: Motions and speeds of an adaptive step, in their sizes, that are none: it is too long.
_FAR = 1e12


def rk4_step(
    model: pin.Model,
    acceleration: Acceleration,
    t: float,
    state: tuple[Array, Array],
    step: float,
    first: Array | None = None,
) -> tuple[Array, Array]:
    """Return (q, v) one step later, to order 4.

    The commutator-free method of Celledoni, Marthinsen and Owren (Commutator-free Lie group
    methods, Future Generation Computer Systems 19, 2003, the method of order 4 with the classical
    coefficients). For v, which lives in a vector space, it is the classical method of Runge and
    Kutta. Two short moves at the end, instead of a long one, stand for the commutators.

    Parameters
    ----------
    model
        Its configuration manifold.
    acceleration
        The field; called four times (three if `first` is given).
    t
        Time at the start, s.
    state
        q (nq,) and v (nv,) at the start.
    step
        h, s.
    first
        The acceleration at the start; computed if left out.
    """
    q, v = state
    h, plus = step, pin.integrate
    a = acceleration(t, q, v) if first is None else first
    q2, v2 = plus(model, q, h / 2 * v), v + h / 2 * a
    a2 = acceleration(t + h / 2, q2, v2)
    q3, v3 = plus(model, q, h / 2 * v2), v + h / 2 * a2
    a3 = acceleration(t + h / 2, q3, v3)
    q4, v4 = plus(model, q2, h * (v3 - v / 2)), v + h * a3
    a4 = acceleration(t + h, q4, v4)
    middle = plus(model, q, h / 12 * (3 * v + 2 * v2 + 2 * v3 - v4))
    end = plus(model, middle, h / 12 * (-v + 2 * v2 + 2 * v3 + 3 * v4))
    return end, v + h / 6 * (a + 2 * a2 + 2 * a3 + a4)


class AdaptiveStepper:
    """Steps of DOP853 (order 8, error estimated by orders 5 and 3), each in its own coordinates.

    Around the configuration q_0 that a step starts from, q = q_0 (+) u, and

        v = D(u) u',  D = d(q_0 (+) u) / du,

    where D is the identity for joints whose coordinates are plain numbers. The length of the last
    step is where the next one starts from.

    Parameters
    ----------
    model
        Its configuration manifold.
    tolerance
        Relative error of a step, and absolute error in units of `sizes`.
    first_step
        Length of the first step that is tried, s.
    sizes
        Of the entries of u and of v, (2 nv,): m or rad, and per s. One if left out.
    """

    def __init__(
        self,
        model: pin.Model,
        tolerance: float,
        first_step: float,
        sizes: Array | None = None,
    ) -> None:
        self._model, self._tolerance, self._next = model, tolerance, first_step
        self._sizes = np.ones(2 * model.nv) if sizes is None else sizes
        joints = list(model.joints)[1:]
        self._flat = all(joint.nv in (joint.nq, 1) for joint in joints)
        self.work: Callable[[float], float] = lambda time: 0.0

    def step(
        self,
        acceleration: Acceleration,
        t: float,
        state: tuple[Array, Array],
        until: float,
        power: Callable[[], float] = lambda: 0.0,
    ) -> tuple[float, Callable[[float], tuple[Array, Array]]]:
        """Take one step, not beyond `until`; return its end and the state at times within.

        `power` returns the power at the last call of `acceleration`. Its integral from the start of
        the step to a time within is ``work(time)`` afterwards; the step length ignores its error.

        Raises
        ------
        SingularityError
            If no step is short enough for the tolerance, or to stay off a singularity.
        """
        model, nv = self._model, self._model.nv
        start, v_start = state
        far = _FAR * self._sizes
        met: list[SingularityError] = []

        def slope(time: float, y: Array) -> Array:
            u, v = y[:nv], y[nv:-1]
            rate = np.full(y.size, np.nan)
            if not (np.abs(y[:-1]) < far).all():
                return rate
            rate[:nv], rate[nv:-1] = v, acceleration(time, pin.integrate(model, start, u), v)
            rate[-1] = _SCALE * power()
            if not self._flat:
                chart = pin.dIntegrate(model, start, u, pin.ArgumentPosition.ARG1)
                rate[:nv] = np.linalg.solve(chart, v)
            return rate

        def tried(time: float, y: Array) -> Array:
            """Return the slope, or NaN where a step is too long to have one: it is shortened."""
            try:
                return slope(time, y)
            except np.linalg.LinAlgError:
                pass
            except SingularityError as error:
                if not y[:nv].any():  # where it stands
                    raise
                met.append(error)
            return np.full(y.size, np.nan)

        # The work is scaled so that its error counts for nothing; DOP853 takes the root mean square
        # of all errors, which one more entry does not change then.
        tolerance = self._tolerance * math.sqrt(2 * nv / (2 * nv + 1))
        absolute: Any = tolerance * np.append(self._sizes, 1.0)
        solver = DOP853(
            tried,
            t,
            np.concatenate([np.zeros(nv), v_start, [0.0]]),
            until,
            rtol=tolerance,
            atol=absolute,
            first_step=min(self._next, until - t),
        )
        message = solver.step()
        if solver.status == "failed":
            if met:
                raise met[-1]
            raise SingularityError(f"no step is short enough: {message}", np.inf, np.inf)
        if solver.h_abs >= self._next or solver.t < until:
            self._next = solver.h_abs  # one cut short by `until` does not tell about the next
        interpolant = solver.dense_output() if solver.t > t else None

        @lru_cache(
            maxsize=2
        )  # at(time), work(time), and work(time) again where the next row begins
        def values(time: float) -> Array:
            if time == solver.t or interpolant is None:
                return np.asarray(solver.y, np.float64)
            return np.asarray(interpolant(time), np.float64)

        def at(time: float) -> tuple[Array, Array]:
            y = values(time)
            return pin.integrate(model, start, y[:nv]), np.array(y[nv:-1])

        self.work = lambda time: float(values(time)[-1] / _SCALE)
        return float(solver.t), at


def check_times(duration: float, step: float, record_every: int) -> None:
    """Refuse times that are not positive, and more steps or rows than memory and patience hold."""
    positive_number(duration, "duration", "s")
    positive_number(step, "step", "s")
    whole_number(record_every, "record_every")
    steps = duration / step
    check_size(steps, STEPS, f"duration / step = {steps:.3g} steps")
    rows = steps / record_every
    check_size(rows, ROWS, f"{rows:.3g} rows to record (record_every keeps fewer)")


def times(duration: float, step: float) -> Iterator[tuple[int, float]]:
    """Yield (k, k h) up to the duration, which ends the last, perhaps shorter, step."""
    ratio = duration / step
    whole = round(ratio)
    count = whole if abs(ratio - whole) <= 1e-9 * max(ratio, 1.0) else int(np.ceil(ratio))
    for k in range(count):
        yield k, k * step
    yield count, duration
