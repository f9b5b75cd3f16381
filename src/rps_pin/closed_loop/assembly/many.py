"""Closing the loops from many guesses at once.

The method is that of `closing`, for all guesses in one call of the linear algebra. With J the
closures' Jacobian by the velocities that are not held, all in one unit,

    dq = - J' (J J' + mu 1)^-1 e,   mu = (c |e| / L)^2 + 1e-13 trace(J J'),

or the same by J' J, whichever is smaller. c falls by a factor of 4 where a step lessens |e|, and
grows by it where it does not. The last term of mu stands for the rank: redundant rows do no harm,
and the loops close to about 1e-10. In a rounded file (see `RankRule`), U_1' e and U_1' J take their
places. Joint limits do not count.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.rank_rule import RankRule
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.linear_algebra import rank

#: Gaps (n, nc) and Jacobians (n, nc, nv) at configurations (n, nq), as `ClosureEquations` has them.
Equations = Callable[[Array], tuple[Array, Array]]

#: A guess is closed below this gap, in characteristic lengths.
NEARLY_CLOSED = 1e-10
_ITERATIONS = 60
_FIRST_DAMPING, _FACTOR, _LEAST_DAMPING, _LARGEST_DAMPING = 0.3, 4.0, 1e-6, 1e8
_ROUNDING = 1e-13


def equations_of(system: ConstraintSystem) -> Equations:
    """Return the equations of a system, by Pinocchio, one configuration after the other."""
    equations = system.equations

    def evaluated(q: Array) -> tuple[Array, Array]:
        gaps = np.empty((len(q), equations.size))
        jacobians = np.empty((len(q), equations.size, system.model.nv))
        for k, one in enumerate(q):
            jacobians[k] = equations.jacobian(one)
            gaps[k] = equations.current_gaps(one)
        return gaps, jacobians

    return evaluated


def close_many(
    system: ConstraintSystem, equations: Equations, guesses: Array, held: Bools
) -> tuple[Array, Bools]:
    """Return configurations that steps from guesses end in, (n, nq), and which are closed, (n,).

    Parameters
    ----------
    system
        The system.
    equations
        Its equations.
    guesses
        Normalised configurations, shape (n, nq).
    held
        Velocities that stay zero, shape (nv,).
    """
    free, length = np.flatnonzero(~held), system.equations.length
    enough = NEARLY_CLOSED * length

    def scaled(q: Array) -> tuple[Array, Array]:
        gaps, jacobians = equations(q)
        error, jacobian = system.row_scale * gaps, system.scaled(jacobians)
        if system.rule.rank is None:
            return error, jacobian[:, :, free]
        rows = _independent(system.rule, jacobian)
        return (rows @ error[:, :, None])[:, :, 0], rows @ jacobian[:, :, free]

    q = guesses.copy()
    error, jacobian = scaled(q)
    size, damping = np.linalg.norm(error, axis=1), np.full(len(q), _FIRST_DAMPING)
    at = np.flatnonzero(size > enough)  # those that are not closed yet
    error, jacobian = error[at], jacobian[at]
    for _ in range(_ITERATIONS):
        if not at.size:
            break
        step = np.zeros((at.size, held.size))
        step[:, free] = _steps(jacobian, error, damping[at] * size[at] / length)
        moved = _integrated(system.model, q[at], system.column_scale * step)
        new_error, new_jacobian = scaled(moved)
        new_size = np.linalg.norm(new_error, axis=1)
        less = new_size < size[at]
        q[at[less]], size[at[less]] = moved[less], new_size[less]
        error = np.where(less[:, None], new_error, error)
        jacobian = np.where(less[:, None, None], new_jacobian, jacobian)
        more = _FACTOR * np.maximum(damping[at], _LEAST_DAMPING)
        damping[at] = np.where(less, damping[at] / _FACTOR, more)
        going = (size[at] > enough) & (damping[at] <= _LARGEST_DAMPING)
        at, error, jacobian = at[going], error[going], jacobian[going]
    return q, size <= enough


def _independent(rule: RankRule, jacobian: Array) -> Array:
    """Return U_1' of each J, (n, nc, nc), as `RankRule.independent`: rows of others are zero."""
    left, values, _ = np.linalg.svd(jacobian)
    counts = np.array([max(rule.rank or 0, rank(one, rule.tolerance)) for one in values])
    left *= np.arange(left.shape[2]) < counts[:, None, None]
    return np.asarray(left.transpose(0, 2, 1))


def _steps(jacobian: Array, error: Array, damping: Array) -> Array:
    """Return - J' (J J' + mu 1)^-1 e, shape (n, number of columns)."""
    transposed, right = jacobian.transpose(0, 2, 1), error[:, :, None]
    wide = jacobian.shape[1] <= jacobian.shape[2]
    square = jacobian @ transposed if wide else transposed @ jacobian
    rounding = _ROUNDING * np.trace(square, axis1=1, axis2=2)
    diagonal = np.arange(square.shape[1])
    square[:, diagonal, diagonal] += (damping**2 + rounding + 1e-300)[:, None]
    if wide:
        return np.asarray(-(transposed @ np.linalg.solve(square, right))[:, :, 0])
    return np.asarray(-np.linalg.solve(square, transposed @ right)[:, :, 0])


def _integrated(model: pin.Model, q: Array, steps: Array) -> Array:
    if all(joint.nq == joint.nv for joint in list(model.joints)[1:]):
        return np.asarray(q + steps)
    return np.array([pin.integrate(model, *pair) for pair in zip(q, steps, strict=True)])
