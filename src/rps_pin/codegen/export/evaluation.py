"""A mechanism's functions and routines in Python, for condition numbers: double precision, slow.

The kernels are evaluated by CasADi's virtual machine; the loops around them are those of
`rps_pin.codegen.expressions.routines`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.expressions.functions import MechanismFunctions

#: Newton's steps from near: each squares the gap.
_NEWTON_STEPS = 5


class Evaluation:
    """Results of functions as flat arrays, matrices row by row.

    Parameters
    ----------
    functions
        Of the mechanism.
    """

    def __init__(self, functions: MechanismFunctions) -> None:
        self._functions = functions
        expressions = functions.expressions
        self._wrenches = bool(expressions.wrench_frames)

    def __call__(self, name: str, given: Sequence[Array]) -> list[Array]:
        """Return all results of a function, `check` included where it is a kernel."""
        if name == "closed":
            return self._closed(given[0], given[1:])
        if name == "step":
            q, v, tau, h, *extra = given
            return self._step(q, v, tau, float(h[0]), extra)
        found = self._functions[name].call(list(given))
        return [np.asarray(one.full()).ravel() for one in found]

    def _closed(self, q: Array, extra: Sequence[Array]) -> list[Array]:
        first = np.zeros(1)
        for k in range(_NEWTON_STEPS):
            step, gap, _ = self("closing_step", [q, *extra])
            first = first if k else gap
            (q,) = self("integrate", [q, step, *extra])
        return [q, first]

    def _step(
        self, q: Array, v: Array, tau: Array, t: float, extra: Sequence[Array]
    ) -> list[Array]:
        """Return q, v and work after the Runge-Kutta-Munthe-Kaas step of order 4."""
        alone = extra[self._wrenches :]

        def slope(q: Array, v: Array) -> tuple[Array, Array]:
            a, power, _ = self("stage", [q, v, tau, *extra])
            return a, power

        def moved(q: Array, dv: Array) -> Array:
            return self("integrate", [q, dv, *alone])[0]

        a1, p1 = slope(q, v)
        v2 = v + t / 2 * a1
        q2 = moved(q, t / 2 * v)
        a2, p2 = slope(q2, v2)
        v3 = v + t / 2 * a2
        a3, p3 = slope(moved(q, t / 2 * v2), v3)
        v4 = v + t * a3
        a4, p4 = slope(moved(q2, t * (v3 - v / 2)), v4)
        q3 = moved(q, t / 12 * (3 * v + 2 * v2 + 2 * v3 - v4))
        q4 = moved(q3, t / 12 * (2 * v2 - v + 2 * v3 + 3 * v4))
        v4 = v + t / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        step, v4, _, _ = self("projection", [q4, v4, *alone])
        closed, _ = self._closed(moved(q4, step), alone)
        (after,) = self("projected_velocity", [closed, v4, *alone])
        return [closed, after, t / 6 * (p1 + 2 * p2 + 2 * p3 + p4)]
