"""Forces of too few actuators by least squares, where the passive velocities meet all rows.

Where J_p, the closures' Jacobian by the passive velocities, has full row rank, the forces are those
that leave the least of f on the passive rows, in one unit (D the scaling of the velocities):

    |D_p (f_p - J_p' lambda)| least,   tau = (f - J' lambda)_a,   r = (f - J' lambda)_p.

One QR factorisation with column pivoting of (J_p D_p)' gives lambda.
"""

from __future__ import annotations

import eigenpy
import numpy as np

from rps_pin.arrays import Array, Indices

#: The estimate of the condition number by pivots is rarely 10 times too small.
_DOUBT = 100.0


class PassiveLeastSquares:
    """Solves for lambda at one J after another, memory allocated once.

    Parameters
    ----------
    passive
        Indices of the passive velocities that move closures, shape (k,).
    rows, columns
        Scaling of J to one unit, shapes (nc,) and (nv,).
    max_condition
        Of `ClosedLoopModel`.
    """

    def __init__(self, passive: Indices, rows: Array, columns: Array, max_condition: float) -> None:
        self._passive, self._size = passive, rows.size
        self._factors = eigenpy.ColPivHouseholderQR(passive.size, rows.size)
        self._factors.setThreshold(min(_DOUBT / max_condition, 1.0))
        scale = rows[:, None] * columns[passive]
        #: Scaling of J_p, of f_p and of lambda, if their entries have several units.
        self._scaling: tuple[Array, Array, Array] | None = None
        if np.ptp(scale):
            self._scaling = scale, columns[passive], rows

    def multipliers(self, jacobian: Array, force: Array) -> Array | None:
        """Return lambda, shape (nc,), of f, shape (nv,); None where J_p has not full row rank."""
        matrix, right = jacobian.take(self._passive, axis=1), force.take(self._passive)
        if self._scaling is not None:
            matrix *= self._scaling[0]
            right *= self._scaling[1]
        self._factors.compute(matrix.T)
        if self._factors.rank() < self._size:
            return None
        found: Array = self._factors.solve(right)
        return found if self._scaling is None else self._scaling[2] * found
