"""Forces of any number of actuators by one factorisation, the actuated velocities being completed.

Some actuated velocities (a) and some passive ones (p) are chosen once that together move
independently and determine the others (d). With J_d of full column rank and D the scaling of the
velocities to one unit, the motions that leave all actuators at rest are

    T_p:  J_d (T_p)_d = -J_p,  (T_p)_p = 1,

and the smallest force (in one unit) that the actuators lack is that of f along them,

    r = D^-2 T_p z,   (T_p' D^-2 T_p) z = T_p' f.

What is left, f - r, they produce: with further actuators (b) that move as those of a do, B T_a = C,

    tau_a + C' tau_b = T_a' (f - r),   |D tau| least,   J_d' lambda = (f - r - S' tau)_d.

These are the forces of `least_effort`, whichever velocities are chosen. Where the passive
velocities meet all rows of J, `least_squares` gives the same with less work.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.linalg.blas import dgemv, dnrm2, dsyrk
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.factorisation import Factors, PassiveFactorisation
from rps_pin.closed_loop.constraints.least_squares import PassiveLeastSquares
from rps_pin.numerics.linear_algebra import Decomposition, rank, singular_values

#: Part of the force that the actuators may leave, relative to it, before there is a residual force.
RESIDUAL = 1e-9


class Chosen(NamedTuple):
    """Velocities that determine the motion, by their indices in v."""

    driven: Indices
    """Actuated ones that move independently of each other."""
    other_driven: Indices
    """Actuated ones that those determine."""
    passive: Indices
    """Passive ones, as many as motions that no actuator drives."""


class PassiveVelocities(NamedTuple):
    """Velocities without actuator."""

    indices: Indices
    idle: int
    """How many motions of them are idle."""


def choose(factors: Decomposition, actuated: Indices, tolerance: float) -> Chosen:
    """Return velocities that determine the motion well at one configuration.

    By QR with column pivoting of the allowed motions; actuated ones before passive ones.

    Parameters
    ----------
    factors
        Of J, all entries in one unit.
    actuated
        Indices of the actuated velocities.
    tolerance
        Of ranks.
    """
    motions = factors.null_space()
    of_actuators = motions[actuated]
    passive = np.setdiff1d(np.arange(motions.shape[0]), actuated)
    count = rank(singular_values(of_actuators), tolerance)
    driven = actuated[_independent_rows(of_actuators, count)]
    left_open = motions @ np.linalg.svd(of_actuators)[2][count:].T
    chosen = _independent_rows(left_open[passive], motions.shape[1] - count)
    return Chosen(driven, np.setdiff1d(actuated, driven), np.sort(passive[chosen]))


def _independent_rows(matrix: Array, count: int) -> Indices:
    if not count:
        return np.zeros(0, dtype=np.intp)
    return np.asarray(qr(matrix.T, mode="r", pivoting=True)[1][:count], dtype=np.intp)


#: tau (na,), lambda (nc,), the norm of f - S' tau - J' lambda - r on the passive rows, and r (nv,)
#: or None if it is rounding error.
CompletedForces = tuple[Array, Array, float, Array | None]


class CompletedFactorisation:
    """Solves S' tau + J' lambda + r = f at one J after another, some velocities being chosen.

    Parameters
    ----------
    chosen
        From `choose`.
    dependent
        Factorisation of J_d: of all velocities but the chosen ones that move independently.
    actuated, passive
        The actuated velocities, in their order, and the others.
    unmoving
        Indices of velocities whose columns of J are zero at all configurations.
    columns
        Scaling of the velocities to one unit, shape (nv,).
    """

    def __init__(
        self,
        chosen: Chosen,
        dependent: PassiveFactorisation,
        actuated: Indices,
        passive: PassiveVelocities,
        unmoving: Indices,
        columns: Array,
    ) -> None:
        self._factorisation, self.passive = dependent, passive
        self._dependent = d = dependent.passive
        self._order = np.concatenate([passive.indices, actuated])
        self._actuated = actuated
        self._passive_size = passive.indices.size
        # Motions of p that move no closure are unit vectors: r has f's own entries there.
        self._alone = np.intersect1d(chosen.passive, unmoving)
        self._open = np.setdiff1d(chosen.passive, unmoving)
        self._a, self._b = chosen.driven, chosen.other_driven
        self._place_a, self._b_of_d = _places(self._a, actuated), _places(self._b, d)
        self._lacks, self._simple = chosen.passive.size > 0, not (self._open.size or self._b.size)
        self._weights = weights = columns**-2  # D^-2
        self._weights_d, self._weights_open = weights[d], np.diag(weights[self._open])
        #: The weight of all dependent velocities, if they have one.
        self._weight = float(weights[d[0]]) if d.size and np.ptp(weights[d]) == 0 else None
        self._scale = columns
        self._squares: PassiveLeastSquares | None = None
        if self._open.size and dependent.meets_all_rows and not np.isin(d, actuated).any():
            moving = np.setdiff1d(passive.indices, self._alone)
            self._squares = dependent.least_squares(moving, columns)
        #: Part of f above which r counts, whatever their directions.
        self._enough = RESIDUAL * float(columns.max() / columns.min())

    def forces(self, jacobian: Array, force: Array) -> CompletedForces | None:
        """Return the forces that produce f, shape (nv,), or None near a singularity.

        That is one of J_d, of the actuators or of the closures.
        """
        if self._squares is not None:
            found = self._by_least_squares(self._squares, jacobian, force)
            if found is not None:
                return found
        return self._by_factors(jacobian, force)

    def _by_factors(self, jacobian: Array, force: Array) -> CompletedForces | None:
        factors, lacking, rest = None, None, force
        if not self._simple:
            factors = self._factorisation.factors(jacobian)
            if factors is None:
                return None
        if self._lacks:
            lacking = np.zeros(force.size)
            if self._open.size and not self._add_lacking(lacking, factors, jacobian, force):
                return None
            lacking[self._alone] = force.take(self._alone)
            rest = force - lacking
        multipliers = self._multipliers(factors, jacobian, rest)
        if multipliers is None:
            return None
        # The passive rows first: they are the residual, the actuated ones tau.
        error = dgemv(-1.0, jacobian.T, multipliers, 1.0, rest).take(self._order)
        tau, residual = error[self._passive_size :], dnrm2(error, self._passive_size)
        if not (
            residual < math.inf
            and dnrm2(multipliers) <= self._factorisation.huge_force * dnrm2(force)
        ):
            return None
        if lacking is not None and not dnrm2(lacking) > self._enough * dnrm2(force):
            counts = self._counts(jacobian, force, tau, lacking)
            if counts is None:
                return None
            lacking = lacking if counts else None
        return tau, multipliers, residual, lacking

    def _by_least_squares(
        self, squares: PassiveLeastSquares, jacobian: Array, force: Array
    ) -> CompletedForces | None:
        multipliers = squares.multipliers(jacobian, force)
        if multipliers is None:
            return None
        lacking = dgemv(-1.0, jacobian.T, multipliers, 1.0, force)
        tau = lacking.take(self._actuated)
        lacking[self._actuated] = 0.0
        size, whole = dnrm2(lacking), dnrm2(force)
        if not (size < math.inf and dnrm2(multipliers) <= self._factorisation.huge_force * whole):
            return None
        counts = size > self._enough * whole or self._counts(jacobian, force, tau, lacking)
        if counts is None:
            return None
        return (tau, multipliers, 0.0, lacking) if counts else (tau, multipliers, size, None)

    def _multipliers(self, factors: Factors | None, jacobian: Array, rest: Array) -> Array | None:
        """Return lambda, shape (nc,), of f - r."""
        if factors is None:
            passive_jacobian = jacobian.take(self._dependent, axis=1)
            return self._factorisation.multipliers(jacobian, passive_jacobian, rest)
        of_dependent = rest.take(self._dependent)
        if self._b.size:
            of_dependent[self._b_of_d] -= self._of_others(factors, jacobian, rest, of_dependent)
        return factors.multipliers(of_dependent)

    def _add_lacking(
        self, lacking: Array, factors: Factors | None, jacobian: Array, force: Array
    ) -> bool:
        """Put r of the motions T_p that move closures into a vector (nv,), if that can be done."""
        assert factors is not None
        motion = factors.solve(jacobian.take(self._open, axis=1))  # -(T_p)_d
        if self._b.size and not self._at_rest(motion[self._b_of_d]):
            return False
        if self._weight is not None:
            gram = dsyrk(self._weight, motion, 1.0, self._weights_open, trans=1)
        else:
            gram = motion.T @ (self._weights_d[:, None] * motion) + self._weights_open
        of_dependent = force.take(self._dependent)
        along = force.take(self._open)
        if motion.size:  # BLAS takes no empty ones
            along = dgemv(-1.0, motion, of_dependent, 1.0, along, trans=1)
        if along.size == 1:  # several times as fast
            z, failed = along / gram[0, 0], 0
        else:
            _, z, failed = dposv(gram, along)
        lacking[self._open] = z
        if motion.size:
            lacking[self._dependent] = dgemv(-1.0, motion, z)
        lacking *= self._weights
        return not failed

    def _at_rest(self, rates: Array) -> bool:
        """Return whether the actuators b stand still in the motions that leave a at rest."""
        rates = rates * (self._scale[self._open] / self._scale[self._b][:, None])
        return bool(np.abs(rates).max() <= self._factorisation.scales.tolerance)

    def _of_others(
        self, factors: Factors, jacobian: Array, rest: Array, of_dependent: Array
    ) -> Array:
        """Return tau_b of the tau of least norm with tau_a + C' tau_b = T_a' (f - r)."""
        if not self._a.size:
            return np.zeros(self._b.size)
        motion = factors.solve(jacobian.take(self._a, axis=1))  # -(T_a)_d
        along = rest.take(self._a) - of_dependent @ motion
        others = -motion[self._b_of_d]  # C
        weighted = self._weights[self._b][:, None] * others
        y = dposv(np.diag(self._weights[self._a]) + others.T @ weighted, along)[1]
        return np.asarray(weighted @ y)

    def _counts(self, jacobian: Array, force: Array, tau: Array, lacking: Array) -> bool | None:
        """Return whether r is more than rounding error, next to f along the allowed motions.

        None if that takes a closer look.
        """
        size = dnrm2(self._scale * lacking)
        if size > RESIDUAL * dnrm2(self._scale * force):
            return True
        if not size:
            return False
        factors = self._factorisation.factors(jacobian)
        if factors is None:
            return None
        # The power of f along one allowed motion bounds its part along all of them from below.
        rates = self._weights[self._a] * tau[self._place_a]
        motion = np.zeros(force.size)
        motion[self._a] = rates
        motion[self._dependent] = -factors.solve(jacobian.take(self._a, axis=1) @ rates)
        power = abs(float(motion @ force))
        return False if size * dnrm2(motion / self._scale) <= RESIDUAL * power else None


def _places(some: Indices, of: Indices) -> Indices:
    """Return where some indices stand among others."""
    place = {int(index): at for at, index in enumerate(of)}
    return np.array([place[int(index)] for index in some], dtype=np.intp)
