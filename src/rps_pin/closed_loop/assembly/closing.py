"""Closing the loops of a mechanism from a guess, and completing a partly given configuration.

The gaps e(q) are brought to zero by the Levenberg-Marquardt method on the configuration manifold,

    dq = - J' (J J' + mu I)^-1 e,

in coordinates scaled to one unit. mu falls to zero as the loops close: the last steps are Newton's,
of least norm, and the result is closed to rounding. Joints that a step would drive through a limit
are held there, and the step is computed again without them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import rank
from rps_pin.validation import real_vector

#: A loop counts as closed below this gap, in characteristic lengths or in m, whichever is more.
CLOSED = 1e-12

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e8
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
    best, best_gap, rng = start, np.inf, np.random.default_rng(0)
    for attempt in range(1 + restarts):
        q = least_norm_steps(system, start, held, within_limits)
        gap = equations.largest_gap(equations.gaps(q))
        if gap <= closed_gap(system):
            return q
        if gap < best_gap:
            best, best_gap = q, gap
        spread = np.pi * (attempt + 1) / max(restarts, 1)
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


def complete(
    system: ConstraintSystem,
    values: Mapping[str, ArrayLike] | ArrayLike,
    guess: Array,
    *,
    within_limits: bool = True,
) -> Array:
    """Return the closed configuration with given joint values; see `ClosedLoopModel.complete`."""
    q, model, actuated = guess.copy(), system.model, system.actuated_names
    if not isinstance(values, Mapping):
        given = real_vector(values, len(actuated), "values")
        values = dict(zip(actuated, given, strict=True))
    system.velocity_indices(list(values), "to give a value")
    for name, value in values.items():
        joint = model.joints[model.getJointId(name)]
        numbers = real_vector(np.atleast_1d(value), joint.nq, f"the value of joint {name!r}")
        q[joint.idx_q : joint.idx_q + joint.nq] = numbers
    q = system.normalised(q, "q_guess")
    return close(system, q, fixed=list(values), within_limits=within_limits)


def closed_gap(system: ConstraintSystem) -> float:
    """Return the gap below which a configuration counts as closed, m."""
    return CLOSED * max(system.equations.length, 1.0)


def least_norm_steps(
    system: ConstraintSystem, start: Array, held: Bools, within_limits: bool
) -> Array:
    """Return the configuration that the steps from a start end in, closed or not."""
    equations, scale = system.equations, system.column_scale
    return close_gaps(
        start,
        gaps=lambda q: system.row_scale * equations.gaps(q),
        jacobian=lambda q: system.scaled(equations.jacobian(q)),
        integrate=lambda q, step: pin.integrate(system.model, q, scale * step),
        tolerance=CLOSED * equations.length,
        held=held,
        box=system.limits if within_limits else None,
    )


# Steps --------------------------------------------------------------------------------------------


class Box(Protocol):
    """Limits that the configuration stays within; see `joint_limits.JointLimits`."""

    def clip(self, q: Array) -> Array:
        """Return q brought within the limits."""

    def blocked(self, q: Array, step: Array) -> Bools:
        """Return which entries of a step would leave the limits at once."""


def close_gaps(
    guess: Array,
    gaps: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    integrate: Callable[[Array, Array], Array],
    tolerance: float,
    iterations: int = 200,
    *,
    held: Bools | None = None,
    box: Box | None = None,
) -> Array:
    """Return the configuration that Levenberg-Marquardt steps from a guess end in.

    Parameters
    ----------
    guess
        Configuration to start from, shape (nq,); within the box.
    gaps
        e(q), shape (nc,), in one unit.
    jacobian
        de/dv at q, shape (nc, nv), scaled like `integrate`'s steps.
    integrate
        (q, step) to configuration; the step in scaled coordinates, shape (nv,).
    tolerance
        The steps end once they no longer reduce a gap norm below this.
    iterations
        At most so many steps.
    held
        Velocities that stay zero, shape (nv,); none if left out.
    box
        Limits to stay within; none if left out.

    Returns
    -------
    array
        The best configuration met, shape (nq,), whether its loops are closed or not.
    """
    q, error, damping = guess, gaps(guess), _FIRST_DAMPING
    for _ in range(iterations):
        size = float(np.linalg.norm(error))
        step_for = _Steps(jacobian(q), error, q, held, box)
        while True:
            step = step_for(damping * size)
            candidate = integrate(q, step)
            candidate = candidate if box is None else box.clip(candidate)
            candidate_error = gaps(candidate)
            if np.linalg.norm(candidate_error) < size:
                break
            if size <= tolerance or np.linalg.norm(step) < _SMALLEST_STEP:
                return q
            damping = 10 * max(damping, 1e-6)
            if damping > _LARGEST_DAMPING:
                return q
        q, error, damping = candidate, candidate_error, damping / 10
        if not error.any():
            return q
    return q


class _Steps:
    """Steps from one configuration, for any damping."""

    def __init__(
        self,
        jacobian: Array,
        error: Array,
        q: Array,
        held: Bools | None,
        box: Box | None,
    ) -> None:
        self._jacobian, self._error, self._q, self._box = jacobian, error, q, box
        self._held = np.zeros(jacobian.shape[1], dtype=bool) if held is None else held.copy()
        self._factorise()

    def __call__(self, damping: float) -> Array:
        step = self._free_step(damping)
        while self._box is not None:
            blocked = self._box.blocked(self._q, step) & ~self._held
            if not blocked.any():
                break
            self._held |= blocked
            self._factorise()
            step = self._free_step(damping)
        return step

    def _factorise(self) -> None:
        left, self._values, self._right = np.linalg.svd(
            np.where(self._held, 0.0, self._jacobian), full_matrices=False
        )
        self._along = left.T @ self._error

    def _free_step(self, damping: float) -> Array:
        step: Array = -self._right.T @ (_filter(self._values, damping) * self._along)
        step[self._held] = 0.0
        return step


def _filter(values: Array, damping: float) -> Array:
    """Return s / (s^2 + mu^2) of singular values s, and 0 where s is rounding error."""
    count = rank(values, _ROUNDING)
    filtered = np.zeros(values.size)
    filtered[:count] = values[:count] / (values[:count] ** 2 + damping**2)
    return filtered
