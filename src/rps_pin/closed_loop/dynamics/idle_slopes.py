"""How motions of least norm change with the configuration where idle freedoms are left open.

Independent velocities (S their rows) leave idle motions E open: J E = 0, S E = 0, E' E = 1 in one
unit. A motion x of least norm has no part in them, E' x = 0, and so x = J' mu + S' sigma. Whatever
the direction dq, 0 = d(J E) = dJ E + J dE and S dE = 0 give

    E' dx = -dE' x = -(J dE)' mu = (dJ E)' mu,

and E E' dx is the part of dx in the idle motions. The rest of dx follows from the closures.
"""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.derivatives import FrameMotions, closure_derivatives
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.freedoms import rest_of


class IdleSlopes:
    """Slopes of the idle parts of motions at a configuration.

    Parameters
    ----------
    system
        The mechanism.
    equations
        Its closures, on a tree whose joints have derivatives.
    q
        Configuration, shape (nq,).
    chosen
        Indices of the independent velocities, shape (m,).

    Attributes
    ----------
    motions : (nv, k) array
        E, orthonormal in one unit.
    """

    def __init__(
        self, system: ConstraintSystem, equations: ClosureEquations, q: Array, chosen: Indices
    ) -> None:
        nv = system.model.nv
        jacobian = system.equations.jacobian(q).copy()
        rest = rest_of(system, jacobian, chosen)
        scaled = rest.left_open()
        self.motions = system.column_scale[:, None] * scaled
        if not scaled.size:
            return
        self._rest, self._factors = rest.indices, rest.factors
        self._rows, self._columns = system.row_scale, system.column_scale[self._rest]
        states = [(q, motion, np.zeros(nv)) for motion in self.motions.T]
        #: dJ E by each direction, (k, nc, nv).
        self._turns = np.array(
            [closure_derivatives(FrameMotions(equations, state)).rate_q for state in states]
        )

    @classmethod
    def none(cls, system: ConstraintSystem) -> IdleSlopes:
        """Return those of independent velocities that leave nothing open."""
        slopes = object.__new__(cls)
        slopes.motions = np.zeros((system.model.nv, 0))
        return slopes

    def slope(self, motion: Array) -> Array:
        """Return the slope of the idle part of a motion x of least norm, E E' dx/dq, (nv, nv)."""
        if not self.motions.size:
            return np.zeros((motion.size, motion.size))
        x = motion[self._rest] / self._columns
        mu = self._rows * self._factors.transposed_least_norm(x)
        return np.asarray(self.motions @ (mu @ self._turns))
