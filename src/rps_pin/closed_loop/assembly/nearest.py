"""The closed configuration nearest to a given one.

With d(q) = q_given - q, the tangent from q to the given configuration, in one unit, |d|^2 / 2 is
made least by steps along the motions N that the closures allow: towards -grad |d|^2 / 2, as far as
the joints' limits let it, and the loops closed anew. It ends where no such step is left.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.closed_loop.constraints.loops import Loops
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import null_space
from rps_pin.numerics.quadratic_program import by_least_squares

#: The search ends when a step would be below this, in characteristic lengths.
_SHORTEST = 1e-9
_STEPS = 500


class NearestSearch:
    """A search in one mechanism.

    Parameters
    ----------
    model, loops
        The tree and its closures.
    limits
        To stay within, or None.
    close
        Closes the loops near a configuration that is almost closed.
    is_closed
        Whether it could.
    """

    def __init__(
        self,
        model: pin.Model,
        loops: Loops,
        limits: JointLimits | None,
        close: Callable[[Array], Array],
        is_closed: Callable[[Array], bool],
    ) -> None:
        self._model, self._loops, self._limits = model, loops, limits
        self._close, self._is_closed = close, is_closed
        self._units = 1 / loops.column_scale

    def run(self, given: Array, start: Array) -> Array:
        """Return the nearest closed configuration, starting from a closed one.

        Raises
        ------
        ClosureError
            If the steps do not settle.
        """
        q, length = start, 1.0
        distance, towards = self._distance(q, given)
        step = towards
        for _ in range(_STEPS):
            step = self._step(q, towards)
            if np.linalg.norm(step) <= _SHORTEST * self._loops.length:
                return q
            moved = pin.integrate(self._model, q, length * step / self._units)
            moved = self._close(moved if self._limits is None else self._limits.clip(moved))
            nearer, moved_towards = self._distance(moved, given)
            if nearer < distance and self._is_closed(moved):
                q, distance, towards, length = moved, nearer, moved_towards, min(1.0, 2 * length)
            elif length < 1e-6:
                return q  # nearer by no more than rounding
            else:
                length /= 2
        raise ClosureError(
            f"the nearest closed configuration was not found in {_STEPS} steps: the last would "
            f"still move by {float(np.linalg.norm(step)):.3g} m",
            self._loops.worst(self._loops.gaps(q))[0],
        )

    def _distance(self, q: Array, given: Array) -> tuple[float, Array]:
        """Return |d|, and -grad |d|^2 / 2, (nv,), both in one unit."""
        nv = self._model.nv
        d = self._units * pin.difference(self._model, q, given)
        slope = pin.dDifference(self._model, q, given)[0].reshape(nv, nv)  # of d by q
        return float(np.linalg.norm(d)), -(slope.T @ (self._units * d)) / self._units

    def _step(self, q: Array, towards: Array) -> Array:
        """Return the allowed motion nearest to `towards` that stays within the limits, (nv,)."""
        motions = null_space(
            self._loops.row_scale[:, None] * self._loops.jacobian(q) * self._loops.column_scale
        )
        y = motions.T @ towards
        if self._limits is not None:
            own = (motions / self._units[:, None])[self._limits.v]
            lower = np.minimum(self._limits.lower - q[self._limits.q], 0.0)
            upper = np.maximum(self._limits.upper - q[self._limits.q], 0.0)
            if (own @ y < lower).any() or (own @ y > upper).any():
                y = y + by_least_squares(own, lower - own @ y, upper - own @ y)
        step: Array = motions @ y
        return step
