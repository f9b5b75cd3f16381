"""A step towards the shortest time under limits of jerk: a linear program about a time law.

The unknowns are u, u' and u'' at the knots, u''' on the pieces, and kappa of each phase between the
passages: by how much longer it takes. Within a phase the law is linear in them, exactly; from one
to the next, u' changes its unit by the ratio of the two kappas, and u'' by its square, which is
made linear. So are the limits. The program minimises the duration, with an excess over all limits
that has a cost. The step is bounded: u by `reach` of the length, u' by `reach` of its
largest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from rps_pin.arrays import Array, Indices
from rps_pin.task.motion.jerk.jerk_profile import JerkProfile
from rps_pin.task.motion.jerk.limit_rows import IMPOSED, LimitRows

Sparse = Any  # a matrix of scipy.sparse; its stubs cannot follow how one is put together

#: Least and largest change of the duration in a step, relative.
_SHORTER, _LONGER = -0.3, 3.0
#: Of the solver: gap and residuals.
_TOLERANCE = 1e-9
_SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)


class Step(NamedTuple):
    """What a linear program found."""

    profile: JerkProfile
    excess: float
    """Of the linear limits."""
    duration: float
    """Of the linear law, over that of the law before."""


def linear_step(profile: JerkProfile, rows: LimitRows, reach: float, cost: float) -> Step | None:
    """Return the best law of the linear program about a law; None if the solver finds none.

    Parameters
    ----------
    profile, rows
        The law, and its limits.
    reach
        How far the step may go.
    cost
        Of one unit of excess over all limits, in durations.
    """
    return _Program(profile, rows, reach, cost).step()


class _Program:
    """The program in the solver's form: least ``cost @ z`` with ``right - matrix @ z`` in cones."""

    def __init__(self, profile: JerkProfile, rows: LimitRows, reach: float, cost: float) -> None:
        self.profile = profile
        n, phase = profile.pieces, profile.phase
        i = np.arange(n)
        self.phases = int(phase[-1]) + 1
        self.jerks, self.kappas = 3 * (n + 1), 4 * n + 3
        self.size = self.kappas + self.phases + 1
        #: Columns of the state at the beginning of each piece, and its jerk, shape (n, 4).
        self.columns = np.stack([i, n + 1 + i, 2 * n + 2 + i, self.jerks + i], axis=-1)
        x, v, a = profile.states()
        self.now = np.concatenate([x, v, a, profile.jerks, np.ones(self.phases), [0.0]])
        unit = np.ones(self.size)
        for part in (slice(n + 1), slice(n + 1, 2 * n + 2), slice(2 * n + 2, self.jerks),
                     slice(self.jerks, self.kappas)):  # fmt: skip
            unit[part] = np.abs(self.now[part]).max()
        self.unit = unit
        # How the unit of u' and u'' changes where a phase begins: by its kappa, and the last one's.
        turn = np.zeros((n, 4))
        turn[:, 1], turn[:, 2] = v[:-1], 2 * a[:-1]
        begins = np.append(False, phase[1:] > phase[:-1])
        self.turn = turn * begins[:, None]
        self.phase = phase
        equal, zero = self._law()
        limits, right = self._limits(rows)
        boxes, edges = self._boxes(reach)
        scaled = sparse.vstack([equal, limits, boxes]).tocsc() @ sparse.diags_array(unit)
        self.matrix = sparse.csc_matrix(scaled)
        self.right = np.concatenate([zero, right, edges])
        self.kinds = [
            clarabel.ZeroConeT(len(zero)),
            clarabel.NonnegativeConeT(len(right) + len(edges)),
        ]
        self.cost = np.zeros(self.size)
        self.cost[self.kappas : -1] = np.bincount(phase, profile.shares)
        self.cost[-1] = cost

    def step(self) -> Step | None:
        """Solve it."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
        no_square = sparse.csc_matrix((self.size, self.size))
        found = clarabel.DefaultSolver(
            no_square, self.cost, self.matrix, self.right, self.kinds, settings
        ).solve()
        if found.status not in _SOLVED:
            return None
        z, old = np.array(found.x) * self.unit, self.profile
        kappa = z[self.kappas : -1][self.phase]
        steps = old.shares * kappa
        longer = float(steps.sum())
        jerks = z[self.jerks : self.kappas] * (longer / kappa) ** 3
        profile = JerkProfile(
            steps / longer, jerks, old.length, old.duration * longer, old.passages
        )
        return Step(profile, max(float(z[-1]), 0.0), longer)

    # Rows -----------------------------------------------------------------------------------------

    def _rows(self, piece: Indices, local: Array) -> Sparse:
        """Return rows of the state at the beginning of pieces (r,) and jerk, times (r, 4)."""
        row = np.arange(piece.size)
        turned = (local * self.turn[piece]).sum(axis=-1)
        columns = self.columns[piece]
        phase = self.kappas + self.phase[piece]
        before = self.kappas + self.phase[np.maximum(piece - 1, 0)]
        values = np.concatenate([local.ravel(), turned, -turned])
        places = (
            np.concatenate([np.repeat(row, 4), row, row]),
            np.concatenate([columns.ravel(), phase, before]),
        )
        return sparse.csc_array((values, places), (piece.size, self.size))

    def _units(self, columns: Indices) -> Sparse:
        rows = np.arange(len(columns))
        return sparse.csc_array((np.ones(len(columns)), (rows, columns)), (rows.size, self.size))

    def _law(self) -> tuple[Sparse, Array]:
        """Return the equations of the law: each piece leads to the next; ends and passages."""
        n, passages = self.profile.pieces, self.profile.passages
        ends = _along(self.profile.shares)[:, :3].reshape(-1, 4)  # three rows of each piece
        piece = np.repeat(np.arange(n), 3)
        after = (self.columns[:, :3] + 1).ravel()
        moves = self._rows(piece, ends) - self._units(after)
        fixed = np.concatenate([self.columns[0, :3], self.columns[-1, :3] + 1, passages.knot])
        places = np.concatenate([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], passages.place])
        rows = sparse.vstack([moves, self._units(fixed)])
        return rows, np.concatenate([np.zeros(3 * n), places])

    def _limits(self, rows: LimitRows) -> tuple[Sparse, Array]:
        """Return the linear limits."""
        n, m, r = rows.value.shape
        slopes = np.stack([rows.by_place, rows.by_rate, rows.by_acceleration, rows.by_jerk], -1)
        along = _along(self.profile.shares[:, None] * IMPOSED)
        local = np.einsum("nmrk,nmkc->nmrc", slopes, along).reshape(-1, 4)
        piece = np.repeat(np.arange(n), m * r)
        number = np.arange(piece.size)
        values = np.concatenate([rows.by_duration.ravel(), np.full(piece.size, -1.0)])
        columns = np.concatenate(
            [self.kappas + self.phase[piece], np.full(piece.size, self.size - 1)]
        )
        others = sparse.csc_array((values, (np.tile(number, 2), columns)), (piece.size, self.size))
        matrix = self._rows(piece, local) + others
        return matrix, matrix @ self.now - rows.value.ravel()

    def _boxes(self, reach: float) -> tuple[Sparse, Array]:
        """Return how far the step may go; and u' is not negative."""
        n = self.profile.pieces
        inner = np.arange(1, n)
        x, v = self._units(inner), self._units(n + 1 + inner)
        kappa = self._units(self.kappas + np.arange(self.phases))
        excess = self._units(np.array([self.size - 1]))
        at, rate = self.now[inner], self.now[n + 1 + inner]
        step = reach * rate.max()
        far = 1.0 if self.phases == 1 else 3 * reach
        one = np.ones(self.phases)
        rows = sparse.vstack([x, -x, v, -v, kappa, -kappa, -excess])
        edges = [
            at + reach, reach - at, rate + step, np.minimum(step - rate, 0.0),
            one * (1 + far * _LONGER), -one * (1 + far * _SHORTER), [0.0],
        ]  # fmt: skip
        return rows, np.concatenate(edges)


def _along(d: Array) -> Array:
    """Return x, x', x'', x''' a time d after a state, as rows of it, shape (..., 4, 4)."""
    o, e = np.zeros_like(d), np.ones_like(d)
    rows = [[e, d, d**2 / 2, d**3 / 6], [o, e, d, d**2 / 2], [o, o, e, d], [o, o, o, e]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
