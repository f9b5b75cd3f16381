"""Manifold of a mechanism's closed configurations: dynamics on it, and projection to it.

In scaled velocities x (v = S x, all of one unit), A x = 0 keeps the loops closed, A being the rows
of the closures' Jacobian that are independent of each other *where the loops are closed*. They are
selected there once: a step in time evaluates the dynamics at slightly open configurations too,
where redundant rows contradict each other slightly and would lock the mechanism. Of a rounded file
they are U_1' J with the U_1 of the configuration where they are selected (see `rank_rule`). With
the velocities partitioned into dependent and independent ones,

    A_d x_d + A_i x_i = 0,   x = T x_i,   T_d = -A_d^-1 A_i,

the dynamics are those of `forward_dynamics`: smooth in q and v, also off the manifold.
"""

from __future__ import annotations

from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin
from scipy.linalg import qr
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import CLOSED, closed_gap
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.forward_dynamics import reduced_acceleration
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.regular import refuse_lost_rows
from rps_pin.errors import ClosureError, SingularityError
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, rank, refuse_condition, singular_values

#: One Newton step leads from here to rounding error; below `CLOSED` with room to spare.
_NEWTON_ENDS = 1e-14
_NEWTON_STEPS = 8
#: The partition is chosen again once the condition of A_d is worse by this factor.
_WORSE = 10.0
#: Tolerance of the rank in gaps, in characteristic lengths, where the loops are slightly open.
_OF_GAPS = 100.0


class ClosedManifold:
    """A mechanism's closed configurations near one of them.

    Parameters
    ----------
    system
        The system; its scratch memory is used.
    q
        A closed configuration, or nearly, shape (nq,).
    """

    def __init__(self, system: ConstraintSystem, q: Array) -> None:
        self._system, self._equations = system, system.equations
        self.model: pin.Model = system.model
        self._columns, self._row_scale = system.column_scale, system.row_scale
        self._rank = -1
        #: U_1', shape (rank, nc), of a rounded file.
        self._combined: Array | None = None
        self._choose(q)
        refuse_lost_rows(system, q, self._system.decomposed(self._equations.jacobian(q)))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the factorisation's memory."""
        return {name: value for name, value in vars(self).items() if name != "_factors"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._factors = eigenpy.PartialPivLU(max(self._rank, 1))

    # Gaps -----------------------------------------------------------------------------------------

    def gap(self, q: Array) -> float:
        """Return the largest gap, as `ClosedLoopModel.loop_gap` does."""
        return self._equations.largest_gap(self._equations.gaps(q))

    def _evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return all rows of the Jacobian, in one unit, and the gaps."""
        return self._system.scaled(self._equations.jacobian(q)), self._equations.current_gaps(q)

    # Independent rows, dependent velocities -------------------------------------------------------

    def _choose(self, q: Array) -> None:
        """Select rows and partition velocities, at a closed configuration, or nearly."""
        jacobian, gaps = self._evaluate(q)
        rule = self._system.rule
        # Rows that are redundant where the loops are closed differ here by about the gap.
        nearly = _OF_GAPS * self._equations.largest_gap(gaps) / self._equations.length
        tolerance = max(RANK_TOLERANCE, nearly) if rule.rank is None else rule.tolerance
        found = rank(singular_values(jacobian), tolerance)
        if self._rank >= 0 and found != self._rank:
            raise SingularityError(
                f"the closures had {self._rank} independent rows and have {found} here: the motion "
                "is not determined any more",
                np.inf,
                self._system.max_condition,
            )
        self._rank, nv = found, self.model.nv
        *_, order = qr(jacobian.T, mode="economic", pivoting=True)
        self._rows = np.sort(order[:found]).astype(np.intp)
        if rule.rank is not None:
            self._combined = rule.independent(jacobian)[:, :found].T
        self._all_rows = found == self._equations.size
        selected = self._selected(jacobian)
        *_, order = qr(selected, mode="economic", pivoting=True)
        self._dependent = np.sort(order[:found]).astype(np.intp)
        self._independent = np.setdiff1d(np.arange(nv), self._dependent)
        self._factors = eigenpy.PartialPivLU(max(found, 1))
        self._basis = np.zeros((nv, nv - found))
        self._basis[self._independent] = np.diag(self._columns[self._independent])
        self._rcond = self._chosen_rcond = 1.0
        if found:
            self._factors.compute(selected.take(self._dependent, axis=1))
            self._rcond = self._chosen_rcond = self._factors.rcond()

    def _selected(self, rows: Array) -> Array:
        """Return A of J, or what A takes of another array with the closures' rows."""
        if self._all_rows:
            return rows
        return rows[self._rows] if self._combined is None else self._combined @ rows

    def _open_by(self, gaps: Array) -> float:
        """Return the largest gap of a closure that the selected rows can close."""
        if self._combined is None:
            return self._equations.largest_gap(gaps)
        along = self._combined.T @ (self._combined @ (self._row_scale * gaps))
        return self._equations.largest_gap(along / self._row_scale)

    def renew(self, q: Array) -> None:
        """Select rows and partition velocities again, if the present choice is ill-conditioned.

        Raises
        ------
        SingularityError
            If the closures have lost or gained independent rows.
        """
        if self._rcond * _WORSE < self._chosen_rcond:
            self._choose(q)

    @property
    def basis(self) -> Array:
        """T, shape (nv, m), at the last `acceleration`; written over by the next."""
        return self._basis

    # Dynamics -------------------------------------------------------------------------------------

    def acceleration(
        self, q: Array, v: Array, tau: Array, wrenches: Wrenches | None, gain: float = 0.0
    ) -> tuple[Array, float]:
        """Return the acceleration, shape (nv,), and the power of the applied forces, W.

        J a + J' v + 2 alpha J v + alpha^2 e = 0 with the gain alpha: Baumgarte's stabilisation,
        under which a gap decays like exp(-alpha t); none if it is 0. The power is that of actuator
        forces (na,), wrenches, damping and friction; that of springs is a change of potential.

        Raises
        ------
        SingularityError
            If the motion is not determined.
        """
        system, equations = self._system, self._equations
        bias = self._row_scale * equations.bias(q, v)
        jacobian = system.scaled(equations.jacobian(q))
        if gain:
            gaps = self._row_scale * equations.current_gaps(q)
            bias += 2 * gain * (jacobian @ (v / self._columns)) + gain**2 * gaps
        basis, a_0 = self._basis_and_bias(jacobian, bias)
        a, resisting = reduced_acceleration(system, (q, v), tau, wrenches, basis, a_0)
        power = float(tau.dot(v.take(system.actuated)))
        if resisting is not None:
            power -= float(resisting.dot(v))
        if system.springs is not None:
            power += float(system.springs.force(q).dot(v))
        return a, power

    def _basis_and_bias(self, jacobian: Array, bias: Array) -> tuple[Array, Array]:
        """Return T, shape (nv, m), and a_0 (nv,) with A a_0 + bias = 0 and a_0,i = 0."""
        a_0 = np.zeros(self.model.nv)
        if self._rank == 0:
            return self._basis, a_0
        jacobian, bias = self._selected(jacobian), self._selected(bias)
        factors, rank, m = self._factors, self._rank, self._independent.size
        factors.compute(jacobian.take(self._dependent, axis=1))
        self._rcond = factors.rcond()
        if not self._rcond * self._system.max_condition > 1:
            self._refuse_singular(self._rcond)
        right = np.empty((rank, m + 1), order="F")
        right[:, :m], right[:, m] = jacobian.take(self._independent, axis=1), bias
        solved = factors.solve(right).reshape(rank, m + 1)  # a single row comes flat
        scale = self._columns[self._dependent]
        self._basis[self._dependent] = -scale[:, None] * solved[:, :m]
        a_0[self._dependent] = -scale * solved[:, m]
        return self._basis, a_0

    def _refuse_singular(self, rcond: float) -> None:
        condition = 1 / rcond if rcond > 0 else np.inf
        reason = "the closures do not determine the motion here"
        refuse_condition(condition, self._system.max_condition, reason)

    # Projection -----------------------------------------------------------------------------------

    def project(self, q: Array, v: Array) -> tuple[Array, Array, float]:
        """Return closed q, v that keeps it so, and the largest gap that is left.

        The corrections are the smallest, in scaled velocities: S A' (A A')^-1 times the gaps.
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
        size = closed_gap(self._system, q)
        before = np.inf
        for _ in range(_NEWTON_STEPS):
            jacobian, gaps = self._evaluate(q)
            rows, worst = self._selected(jacobian), self._open_by(gaps)
            # The gaps are rounding error once they do not shrink any more.
            if worst <= _NEWTON_ENDS / CLOSED * size or (worst <= size and worst >= before / 4):
                break
            before = worst
            open_by = self._selected(self._row_scale * gaps)
            step = self._columns * self._least(rows, open_by)
            q = pin.integrate(self.model, q, -step)
        if not worst <= size:
            raise ClosureError(
                f"the loops stay open by {worst:.3g} m after {_NEWTON_STEPS} Newton steps "
                "(too long a step in time, as for stiff springs? Take a shorter one, or "
                "method='adaptive')",
                worst,
            )
        v = v - self._columns * self._least(rows, rows @ (v / self._columns))
        if self._combined is not None:
            worst = self._equations.largest_gap(gaps)
        return q, v, worst

    def _least(self, rows: Array, right: Array) -> Array:
        """Return the x of least norm with A x = right."""
        _, multipliers, info = dposv(rows @ rows.T, right)
        if info:
            self._refuse_singular(0.0)
        return np.asarray(rows.T @ multipliers)
