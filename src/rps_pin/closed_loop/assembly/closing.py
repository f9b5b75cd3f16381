"""Closing the loops of a mechanism from a guess.

The gaps e(q) are brought to zero by the Levenberg-Marquardt method on the configuration manifold,

    dq = - J' (J J' + mu I)^-1 e,   mu = (c |e| / L)^2,

in coordinates scaled to one unit, L the characteristic length. mu falls to zero as the loops close:
the last steps are Newton's, of least norm, and the result is closed to rounding. Joints that a step
would drive through a limit are held there, and the step is computed again without them.

In a rounded file (see `RankRule`) that is done with U_1' e and U_1' J, and what remains of the
gaps outside U_1 is accepted up to the file's accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import rank

#: A loop counts as closed below this gap, in characteristic lengths, in lengths of the way to it
#: along the links, or in displacements of slides and free-flyers, whichever is more.
CLOSED = 1e-12

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e8
#: In characteristic lengths.
_SMALLEST_STEP = 1e-15
#: Tolerance of the rank: lower than elsewhere, as mu keeps steps along small values short.
_ROUNDING = 1e-12


def close(
    system: ConstraintSystem,
    guess: Array,
    *,
    fixed: Sequence[str] = (),
    within_limits: bool = True,
    restarts: int = 20,
) -> Array:
    """Return a closed configuration near a normalised guess; see `ClosedLoopModel.close`."""
    model, equations, limits = system.model, system.equations, system.limits
    held = np.zeros(model.nv, dtype=bool)
    held[system.velocity_indices(fixed, "to fix")] = True
    outside = limits.outside(guess) if within_limits else {}
    if outside.keys() & set(fixed):
        phrases = ", ".join(outside[name] for name in fixed if name in outside)
        raise ClosureError(f"fixed joints are outside their limits: {phrases}", np.inf)
    start = limits.clip(guess) if within_limits else guess
    system.settle_rule(start)
    best, best_gap, rng = start, np.inf, np.random.default_rng(0)
    for attempt in range(1 + restarts):
        q = close_gaps(system, start, held, within_limits)
        if is_closed(system, q):
            return q
        gap = equations.largest_gap(equations.gaps(q))
        if gap < best_gap:
            best, best_gap = q, gap
        spread = np.pi * equations.length * (attempt + 1) / max(restarts, 1)
        away = spread * rng.normal(size=model.nv) * system.column_scale
        start = pin.integrate(model, guess, np.where(held, 0.0, away))
        start = limits.clip(start) if within_limits else start
    gaps = equations.gaps(best)
    reached = limits.reached(best) if within_limits else []
    raise ClosureError(
        f"the loops do not close from this guess: {equations.open_closure(gaps)}"
        + (f", with {', '.join(reached)}" if reached else "")
        + f"; largest gap of the guess: {equations.largest_gap(equations.gaps(guess)):.6g} m",
        equations.largest_gap(gaps),
    )


def closed_gap(system: ConstraintSystem, q: Array) -> float:
    """Return the gap below which a configuration counts as closed, m."""
    return CLOSED * max(system.equations.reach, system.displacement(q))


def is_closed(system: ConstraintSystem, q: Array) -> bool:
    """Return whether the loops are closed at q, as far as the file's accuracy lets them."""
    equations, rule = system.equations, system.rule
    gaps = equations.gaps(q)
    largest, closed = equations.largest_gap(gaps), closed_gap(system, q)
    if rule.rank is None or largest <= closed:
        return largest <= closed
    return largest <= rule.gap and independent_gap(system, q, gaps) <= closed


def independent_gap(system: ConstraintSystem, q: Array, gaps: Array) -> float:
    """Return the largest gap of a closure along the independent rows of a rounded file, m."""
    rows = system.rule.independent(system.scaled(system.equations.jacobian(q)))
    along = rows @ (rows.T @ (system.row_scale * gaps)) / system.row_scale
    return system.equations.largest_gap(along)


def close_gaps(
    system: ConstraintSystem,
    guess: Array,
    held: Bools,
    within_limits: bool,
    iterations: int = 200,
) -> Array:
    """Return the configuration that Levenberg-Marquardt steps from a guess end in.

    Parameters
    ----------
    system
        The system; its gaps end below `CLOSED` if the steps close them.
    guess
        Configuration to start from, shape (nq,); within the joint limits if these count.
    held
        Velocities that stay zero, shape (nv,).
    within_limits
        Whether to stay within the joint limits.
    iterations
        At most so many steps.

    Returns
    -------
    array
        The best configuration met, shape (nq,), whether its loops are closed or not.
    """
    equations, limits, rule = system.equations, system.limits, system.rule
    length, rows = equations.length, None
    tolerance = CLOSED * length
    q, error, damping = guess, system.row_scale * equations.gaps(guess), _FIRST_DAMPING
    for _ in range(iterations):
        jacobian, still = system.scaled(equations.jacobian(q)), held.copy()
        if rule.rank is not None:
            rows = rule.independent(jacobian).T
            jacobian, error = rows @ jacobian, rows @ (system.row_scale * equations.current_gaps(q))
        size = float(np.linalg.norm(error))
        factors = _factors(jacobian, still)
        while True:
            step = _damped_step(factors, error, damping * size / length)
            step[still] = 0.0
            if within_limits and (blocked := limits.blocked(q, step) & ~still).any():
                still |= blocked
                factors = _factors(jacobian, still)
                continue
            candidate = pin.integrate(system.model, q, system.column_scale * step)
            candidate = limits.clip(candidate) if within_limits else candidate
            candidate_error = system.row_scale * equations.gaps(candidate)
            if rows is not None:
                candidate_error = rows @ candidate_error
            if np.linalg.norm(candidate_error) < size:
                break
            if size <= tolerance or np.linalg.norm(step) < _SMALLEST_STEP * length:
                return q
            damping = 10 * max(damping, 1e-6)
            if damping > _LARGEST_DAMPING:
                return q
        q, error, damping = candidate, candidate_error, damping / 10
        if not error.any():
            return q
    return q


def _factors(jacobian: Array, still: Bools) -> tuple[Array, Array, Array]:
    """Return the singular value decomposition of J without the columns that stand still."""
    return np.linalg.svd(np.where(still, 0.0, jacobian), full_matrices=False)


def _damped_step(factors: tuple[Array, Array, Array], error: Array, damping: float) -> Array:
    """Return -V s / (s^2 + mu^2) U' e, without singular values s that are rounding error."""
    left, values, right = factors
    count = rank(values, _ROUNDING)
    kept = values[:count] / (values[:count] ** 2 + damping**2)
    return np.asarray(-right[:count].T @ (kept * (left.T @ error)[:count]))
