"""The point nearest to the origin that linear limits allow: a quadratic program, solved exactly.

    minimise |x|^2 / 2   subject to   lower <= C x <= upper

At the solution x = -C' z. z has a multiplier for each limit: positive where an upper limit is
active, negative where a lower one is, and zero elsewhere. These are the optimality conditions; they
are checked for every point that is returned.

In a sequence of similar problems mostly the same limits are active. So those of the last solution
are tried first; where that fails, ProxQP, warm-started, finds the active ones. From them alone x
follows by a small factorisation, to rounding error rather than to ProxQP's tolerance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import proxsuite
from scipy.linalg.lapack import dpotrf, dpotrs
from scipy.optimize import linprog, nnls

from rps_pin.arrays import Array, Bools, Indices

#: How far beyond a limit x may be, relative to the size of the problem.
EXACT = 1e-10
#: ProxQP's tolerances, in the same units: enough to tell which limits are active.
_PROXQP_TOLERANCE = 1e-9
#: ProxQP converges in tens of iterations or not at all.
_PROXQP_ITERATIONS = 200
#: How near to a limit ProxQP's answer must be for the limit to be a candidate.
_TIGHT = 1e-8
#: Rows whose share in x is below this, relative to the largest, do not depend on x.
_CONSTANT = 1e-10
#: Square of the distance from the other rows, relative to the largest, below which a row is taken
#: to depend on them.
_DEPENDENT = 1e-14


class ActiveSet(NamedTuple):
    """Active limits, their rows independent."""

    limits: Indices
    upper: Bools
    """Whether it is the upper limit, of each of these."""


NONE_ACTIVE = ActiveSet(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.bool_))


class NearestPoint(NamedTuple):
    """The solution."""

    x: Array
    """Shape (n,)."""
    limits: Indices
    """The active limits."""
    multipliers: Array
    """z of these limits, positive for upper ones."""
    iterations: int
    """Of ProxQP; 0 where it was not needed."""


class LeastDistance:
    """Solves such problems of k limits, one after another; for one thread.

    The ProxQP problem of each number of unknowns is built when it is first met, then updated.

    Parameters
    ----------
    limits
        Number of limits, k.
    """

    def __init__(self, limits: int) -> None:
        self._solvers: dict[int, Any] = {}
        self._multipliers = np.zeros(limits)  # of the scaled problem that ProxQP sees
        self._active = NONE_ACTIVE

    def reset(self) -> None:
        """Forget the last solution: the next problem is solved as if it were the first."""
        self._solvers.clear()
        self._multipliers[:] = 0
        self._active = NONE_ACTIVE

    def solve(self, rows: Array, lower: Array, upper: Array, size: float) -> NearestPoint | None:
        """Return the nearest point, or None if none was found that all limits allow.

        Parameters
        ----------
        rows
            C, shape (k, n).
        lower, upper
            Shape (k,); infinite where there is no limit.
        size
            Of what the limits are compared with, in the unit of x: sets the scale of tolerances.
        """
        if self._active.limits.size:
            point = nearest_with(self._active, rows, lower, upper, EXACT * size)
            if point is not None:
                return point
        if max(lower.max(initial=0.0), -upper.min(initial=0.0)) <= EXACT * size:
            self._active = NONE_ACTIVE
            return NearestPoint(np.zeros(rows.shape[1]), NONE_ACTIVE.limits, np.zeros(0), 0)
        if not rows.shape[1]:
            return None
        # Made of rows of length one, and an x of the order of one.
        norms = np.sqrt(np.einsum("ij,ij->i", rows, rows))
        constant = norms <= _CONSTANT * norms.max()
        beyond = np.maximum(lower, -upper)
        if beyond.max(where=constant, initial=0.0) > EXACT * size:
            return None  # a limit on which x has no influence
        norms[constant] = 1.0
        size = size + float((beyond / norms).max(where=~constant, initial=0.0))
        problem = (
            np.where(constant[:, None], 0.0, rows / norms[:, None]),
            np.where(constant, -np.inf, lower / (norms * size)),
            np.where(constant, np.inf, upper / (norms * size)),
        )
        x, iterations = self._by_proxqp(*problem)
        active = active_limits(x, *problem)
        point = nearest_with(active, *problem, EXACT)
        if point is None:  # ProxQP did not converge, rarely; or there is no point
            active = active_limits(by_least_squares(*problem), *problem)
            point = nearest_with(active, *problem, EXACT)
        if point is None:
            return None
        self._active = active
        self._multipliers[:] = 0
        self._multipliers[active.limits] = point.multipliers
        multipliers = point.multipliers * (size / norms[active.limits])
        return NearestPoint(size * point.x, active.limits, multipliers, iterations)

    def _by_proxqp(self, rows: Array, lower: Array, upper: Array) -> tuple[Array, int]:
        n = rows.shape[1]
        solver = self._solvers.get(n)
        if solver is None:
            proxqp = proxsuite.proxqp
            solver = self._solvers[n] = proxqp.dense.QP(n, 0, len(rows))
            settings = solver.settings
            settings.eps_abs, settings.eps_rel = _PROXQP_TOLERANCE, 0.0
            settings.max_iter = settings.max_iter_in = _PROXQP_ITERATIONS
            settings.initial_guess = proxqp.InitialGuess.WARM_START
            # Without it ProxQP takes a warm start that is feasible, but not optimal, for the
            # solution.
            settings.check_duality_gap = True
            settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = _PROXQP_TOLERANCE, 0.0
            solver.init(np.eye(n), np.zeros(n), None, None, rows, lower, upper)
        else:
            solver.update(None, None, None, None, rows, lower, upper, update_preconditioner=False)
        solver.solve(-rows.T @ self._multipliers, None, self._multipliers)
        return np.array(solver.results.x), int(solver.results.info.iter)


def nearest_with(
    active: ActiveSet, rows: Array, lower: Array, upper: Array, tolerance: float
) -> NearestPoint | None:
    """Return the solution if exactly these limits are active, or else None."""
    limits = active.limits
    if not 0 < limits.size <= rows.shape[1]:
        return None
    chosen = rows.take(limits, axis=0)
    target = np.where(active.upper, upper.take(limits), lower.take(limits))
    factor, info = dpotrf(chosen @ chosen.T)
    pivots = factor.diagonal().tolist()  # few: quicker in Python, here and below
    if info or not min(pivots) ** 2 > _DEPENDENT * max(pivots) ** 2:
        return None
    pull = dpotrs(factor, target)[0]  # x = C' pull, C x = target
    pull += dpotrs(factor, target - chosen @ (pull @ chosen))[0]  # refined
    x = pull @ chosen
    values = rows @ x
    beyond = np.maximum(lower - values, values - upper).max()
    if not beyond <= tolerance:
        return None
    for limit, pulls, is_upper in zip(limits, pull.tolist(), active.upper.tolist(), strict=True):
        # z = -pull has the sign of its limit, unless the limits are one
        if (pulls > 0) == is_upper and lower[limit] < upper[limit]:
            return None
    return NearestPoint(x, limits, -pull, 0)


def active_limits(x: Array, rows: Array, lower: Array, upper: Array) -> ActiveSet:
    """Return the active limits at a point near the solution.

    Of those that are tight, a smallest set with x = -C' z.
    """
    values = rows @ x
    tight = _TIGHT * (1 + np.abs(x).max())
    at_upper, at_lower = upper - values < tight, values - lower < tight
    columns = np.concatenate([rows[at_upper], -rows[at_lower]]).T
    if not (columns.size and np.isfinite(x).all()):
        return NONE_ACTIVE
    pushing = nnls(columns, -x)[0] > 0  # its choice is independent
    limits = np.concatenate([np.flatnonzero(at_upper), np.flatnonzero(at_lower)])
    is_upper = np.arange(limits.size) < np.count_nonzero(at_upper)
    return ActiveSet(limits[pushing], is_upper[pushing])


def by_least_squares(rows: Array, lower: Array, upper: Array) -> Array:
    """Return the point by Lawson and Hanson's least-distance algorithm: slower, but finite.

    With G x >= h the limits, it is -r / r_h, r and r_h the remainder of the problem
    min |(G' u, h' u) - (0, 1)|, u >= 0. The limits are widened by half of what counts as exact, so
    that a single point is found. Without a remainder there is none: the origin is returned.
    """
    has_upper, has_lower = np.isfinite(upper), np.isfinite(lower)
    sides = np.concatenate([-rows[has_upper], rows[has_lower]])
    bounds = np.concatenate([-upper[has_upper], lower[has_lower]]) - EXACT / 2
    system = np.vstack([sides.T, bounds])
    target = np.zeros(len(system))
    target[-1] = 1.0
    remainder = system @ nnls(system, target)[0] - target
    if not abs(remainder[-1]) > np.finfo(np.float64).eps:
        return np.zeros(rows.shape[1])
    return np.asarray(-remainder[:-1] / remainder[-1])


def least_violation(rows: Array, lower: Array, upper: Array, size: float) -> tuple[Array, Array]:
    """Return x and how far it is beyond each limit, the sum of which is least.

    A linear program (HiGHS), for saying which limits leave no room: its solutions break few.

    Parameters
    ----------
    rows, lower, upper, size
        As for `LeastDistance.solve`; what is beyond different limits is taken as comparable.

    Returns
    -------
    x : (n,) array
    beyond : (k,) array
        Positive above the upper limit, negative below the lower.
    """
    k, n = rows.shape
    size = size + float(np.maximum(lower, -upper).max(initial=0.0))
    has_lower, has_upper = np.isfinite(lower), np.isfinite(upper)
    slack = np.eye(k)
    answer = linprog(
        np.concatenate([np.zeros(n), np.ones(k)]),
        A_ub=np.vstack(
            [
                np.hstack([rows, -slack])[has_upper],  # C x - s <= upper
                np.hstack([-rows, -slack])[has_lower],  # C x + s >= lower
            ]
        ),
        b_ub=np.concatenate([upper[has_upper], -lower[has_lower]]) / size,
        bounds=[(None, None)] * n + [(0, None)] * k,
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.x is None:
        raise np.linalg.LinAlgError(f"the least violation was not found: {answer.message}")
    x = size * np.asarray(answer.x[:n], dtype=np.float64)
    values = rows @ x
    return x, np.maximum(values - upper, 0.0) - np.maximum(lower - values, 0.0)
