"""A mechanism's closed configurations as a manifold to move on: the dynamics, and the way back.

In scaled velocities x (v = S x, all of one unit), A x = 0 keeps the loops closed, A being the rows
of the closures' Jacobian that are independent of each other *where the loops are closed*. They are
chosen there once: a step in time evaluates the dynamics at slightly open configurations too, where
redundant rows contradict each other by a little and would lock the mechanism. With the velocities
parted into dependent and independent ones,

    A_d x_d + A_i x_i = 0,   x = T x_i,   T_d = -A_d^-1 A_i,

the dynamics are those of `forward_dynamics`: smooth in q and v, also off the manifold.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import eigenpy
import numpy as np
import pinocchio as pin
from scipy.linalg import qr
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.dynamics.forward_dynamics import solve_reduced
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.errors import ClosureError, SingularityError
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, rank, singular_values

if TYPE_CHECKING:
    from rps_pin.closed_loop.model import ClosedLoopModel


#: Gaps are brought below this, in m where coordinates are of the order of 1.
CLOSED = 1e-12
#: One Newton step leads from here to rounding error; below `CLOSED` with room to spare.
_NEWTON_ENDS = 1e-14
_NEWTON_STEPS = 8
#: The parting is chosen anew once the condition of A_d is worse than when chosen by this factor.
_WORSE = 10.0
#: Singular values count as zero, too, that so many gaps (in lengths of the mechanism) may make.
_OF_GAPS = 100.0


class ClosedManifold:
    """A mechanism's closed configurations near one of them.

    Parameters
    ----------
    mechanism
        The mechanism; its scratch memory is used.
    q
        A closed configuration, or nearly, shape (nq,).
    """

    def __init__(self, mechanism: ClosedLoopModel, q: Array) -> None:
        self._mechanism, self._loops = mechanism, mechanism._loops
        self.model: pin.Model = mechanism.model
        self._actuated = mechanism.actuated_indices
        self._columns: Array = self._loops.column_scale
        self._row_scale: Array = self._loops.row_scale
        self._scale: Array = self._row_scale[:, None] * self._columns
        self._rank = -1
        self._groups = self._rows_of_a_kind()
        self._choose(q)

    # Gaps -----------------------------------------------------------------------------------------

    def gap(self, q: Array) -> float:
        """Return the largest gap, as `ClosedLoopModel.loop_gap` does."""
        return self._worst(self._evaluate(q)[1])

    def _evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return all rows of the Jacobian and the gaps, both in one unit (m)."""
        loops = self._loops
        jacobian = self._scale * loops.jacobian(q)
        return jacobian, self._gaps(q)

    def _gaps(self, q: Array) -> Array:
        """Return the scaled gaps; from the placements that computing the Jacobian has refreshed."""
        loops = self._loops
        gaps = np.empty(loops.size)
        for frames in loops.closed_frames:
            placement = frames.constraint_data.c1Mc2
            gap = frames.kept.gap(placement)
            if frames.in_world:
                gap = (gap.reshape(-1, 3) @ frames.constraint_data.oMc1.rotation.T).ravel()
            gaps[frames.rows] = gap
        for row, (at, _, ratio, offset) in loops.couplings:
            gaps[row] = q[at[0]] - ratio * q[at[1]] - offset
        gaps *= self._row_scale
        return gaps

    def _rows_of_a_kind(self) -> Indices:
        """Return where the rows of each closure begin, linear and angular ones apart."""
        loops = self._loops
        starts = {loops.rows(closure.name).start for closure in loops.closures}
        starts |= set((np.flatnonzero(np.diff(loops.angular_rows.astype(int))) + 1).tolist())
        return np.array(sorted(starts), dtype=np.intp)

    def _worst(self, gaps: Array) -> float:
        if gaps.size == 0:
            return 0.0
        return math.sqrt(max(np.add.reduceat(gaps * gaps, self._groups).tolist()))

    # Independent rows, dependent velocities -------------------------------------------------------

    def _choose(self, q: Array) -> None:
        """Part rows and velocities anew, at a closed configuration, or nearly."""
        jacobian, gaps = self._evaluate(q)
        # Rows that are redundant where the loops are closed differ here by about the gap.
        nearly = _OF_GAPS * self._worst(gaps) / self._mechanism.characteristic_length
        found = rank(singular_values(jacobian), max(RANK_TOLERANCE, nearly))
        if self._rank >= 0 and found != self._rank:
            raise SingularityError(
                f"the closures had {self._rank} independent rows and have {found} here: the motion "
                "is not determined any more",
                np.inf,
                self._mechanism.max_condition,
            )
        self._rank, nv = found, self.model.nv
        if found == 0:
            self._rows, self._dependent = np.zeros(0, np.intp), np.zeros(0, np.intp)
        else:
            *_, order = qr(jacobian.T, mode="economic", pivoting=True)
            self._rows = np.sort(order[:found]).astype(np.intp)
            *_, order = qr(jacobian[self._rows], mode="economic", pivoting=True)
            self._dependent = np.sort(order[:found]).astype(np.intp)
        self._independent = np.setdiff1d(np.arange(nv), self._dependent)
        self._all_rows = found == self._loops.size
        self._factors = eigenpy.PartialPivLU(max(found, 1))
        self._basis = np.zeros((nv, nv - found))
        self._basis[self._independent] = np.diag(self._columns[self._independent])
        self._rcond = self._chosen_rcond = 1.0
        if found:
            self._factors.compute(jacobian[np.ix_(self._rows, self._dependent)])
            self._rcond = self._chosen_rcond = self._factors.rcond()

    def renew(self, q: Array) -> None:
        """Part rows and velocities anew at a closed configuration, if the present parting is poor.

        Raises
        ------
        SingularityError
            If the closures have lost or gained independent rows.
        """
        if self._rcond * _WORSE < self._chosen_rcond:
            self._choose(q)

    # Dynamics -------------------------------------------------------------------------------------

    def acceleration(
        self, q: Array, v: Array, tau: Array, wrenches: Wrenches | None, gain: float = 0.0
    ) -> Array:
        """Return the acceleration, shape (nv,), under actuator forces (na,) and wrenches.

        J a + J' v + 2 alpha J v + alpha^2 e = 0 with the gain alpha: Baumgarte's stabilisation,
        which lets a gap die out like exp(-alpha t); none if it is 0.

        Raises
        ------
        SingularityError
            If the motion is not determined.
        """
        mechanism, model, data = self._mechanism, self.model, self._loops.data
        drift = self._row_scale * self._loops.drift(q, v)
        jacobian = self._scale * self._loops.jacobian(q)
        if gain:
            drift += 2 * gain * (jacobian @ (v / self._columns)) + gain**2 * self._gaps(q)
        basis, a_0 = self._basis_and_drift(jacobian, drift)
        force = -pin.rnea(model, data, q, v, a_0)
        if mechanism.effects is not None or wrenches:
            force -= mechanism._other_forces(q, v, wrenches)
        force[self._actuated] += tau
        mass = basis.T @ mechanism._tree_mass(q) @ basis
        a: Array = basis @ solve_reduced(mass, basis.T @ force) + a_0
        return a

    def _basis_and_drift(self, jacobian: Array, drift: Array) -> tuple[Array, Array]:
        """Return T, shape (nv, m), and a_0 (nv,) with A a_0 + drift = 0 and a_0,i = 0."""
        a_0 = np.zeros(self.model.nv)
        if self._rank == 0:
            return self._basis, a_0
        if not self._all_rows:
            jacobian, drift = jacobian[self._rows], drift[self._rows]
        factors, rank, m = self._factors, self._rank, self._independent.size
        factors.compute(jacobian.take(self._dependent, axis=1))
        self._rcond = factors.rcond()
        if not self._rcond * self._mechanism.max_condition > 1:
            raise self._singular(self._rcond)
        right = np.empty((rank, m + 1), order="F")
        right[:, :m], right[:, m] = jacobian.take(self._independent, axis=1), drift
        solved = factors.solve(right).reshape(rank, m + 1)  # a single row comes flat
        scale = self._columns[self._dependent]
        self._basis[self._dependent] = -scale[:, None] * solved[:, :m]
        a_0[self._dependent] = -scale * solved[:, m]
        return self._basis, a_0

    def _singular(self, rcond: float) -> SingularityError:
        condition = 1 / rcond if rcond > 0 else np.inf
        limit = self._mechanism.max_condition
        return SingularityError(
            f"the closures do not determine the motion here: the condition number is "
            f"{condition:.3g}, and at most {limit:.3g} is accepted",
            condition,
            limit,
        )

    # The way back ---------------------------------------------------------------------------------

    def project(self, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return closed q, v that keeps it so, and the largest gap that is left.

        The corrections are the smallest, in scaled velocities: S A' (A A')^-1 times what is open.
        (The kinetic energy is no norm where links are massless; and corrections as small as a
        step's error disturb the energy by no more than that error does.)

        Raises
        ------
        ClosureError
            If Newton's steps do not close the loops.
        SingularityError
            If the rows are not independent any more.
        """
        if self._rank == 0:
            return q, v, self.gap(q)
        size = CLOSED * max(1.0, self._mechanism.characteristic_length)
        before = np.inf
        for _ in range(_NEWTON_STEPS):
            jacobian, gaps = self._evaluate(q)
            rows, open_by = jacobian[self._rows], gaps[self._rows]
            worst = self._worst(gaps)
            # Newton's steps have done what they can once the gaps shrink no more.
            if worst <= _NEWTON_ENDS / CLOSED * size or (worst <= size and worst >= before / 4):
                break
            before = worst
            step = self._columns * self._least(rows, open_by)
            q = pin.integrate(self.model, q, -step)
        if not worst <= size:
            raise ClosureError(
                f"the loops stay open by {worst:.3g} m after {_NEWTON_STEPS} Newton steps "
                "(too long a step in time?)",
                worst,
            )
        v = v - self._columns * self._least(rows, rows @ (v / self._columns))
        return q, v, worst

    def _least(self, rows: Array, right: Array) -> Array:
        """Return the x of least norm with A x = right."""
        _, multipliers, info = dposv(rows @ rows.T, right)
        if info:
            raise self._singular(0.0)
        least: Array = rows.T @ multipliers
        return least
