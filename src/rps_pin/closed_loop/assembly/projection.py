"""Projection: the closed configuration nearest to a given one.

With d(q) = q_given - q, the tangent from q to the given configuration, in one unit, |d|^2 / 2 is
minimised by steps in the null space N of the closures' Jacobian: towards -grad |d|^2 / 2, as far as
the joint limits allow, with the loops closed again after each. The search ends where no such step
is left.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import close, close_gaps, is_closed
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import null_space
from rps_pin.numerics.quadratic_program import by_least_squares

#: The search ends when a step would be below this, in characteristic lengths.
NEAREST_STEP = 1e-9
NEAREST_STEPS = 500


def project(system: ConstraintSystem, given: Array, *, within_limits: bool = True) -> Array:
    """Return the closed configuration nearest to a normalised one; see `ClosedLoopModel.project`.

    Raises
    ------
    ClosureError
        If the loops do not close from the given configuration, or the steps do not settle.
    """
    model, equations, limits = system.model, system.equations, system.limits
    q, length = close(system, given, within_limits=within_limits), 1.0
    none = np.zeros(model.nv, dtype=bool)
    distance, towards = _distance(system, q, given)
    step = towards
    for _ in range(NEAREST_STEPS):
        step = _step(system, q, towards, within_limits)
        if np.linalg.norm(step) <= NEAREST_STEP * equations.length:
            return q
        moved = pin.integrate(model, q, length * step * system.column_scale)
        moved = limits.clip(moved) if within_limits else moved
        moved = close_gaps(system, moved, none, within_limits)
        nearer, moved_towards = _distance(system, moved, given)
        if nearer < distance and is_closed(system, moved):
            q, distance, towards, length = moved, nearer, moved_towards, min(1.0, 2 * length)
        elif length < 1e-6:
            return q  # nearer by no more than rounding
        else:
            length /= 2
    raise ClosureError(
        f"the nearest closed configuration was not found in {NEAREST_STEPS} steps: the last would "
        f"still move by {float(np.linalg.norm(step)):.3g} m",
        equations.largest_gap(equations.gaps(q)),
    )


def _distance(system: ConstraintSystem, q: Array, given: Array) -> tuple[float, Array]:
    """Return |d|, and -grad |d|^2 / 2, (nv,), both in one unit."""
    nv, scale = system.model.nv, system.column_scale
    d = pin.difference(system.model, q, given) / scale
    slope = pin.dDifference(system.model, q, given)[0].reshape(nv, nv)  # of d by q
    return float(np.linalg.norm(d)), -(slope.T @ (d / scale)) * scale


def _step(system: ConstraintSystem, q: Array, towards: Array, within_limits: bool) -> Array:
    """Return the allowed motion nearest to `towards` that stays within the limits, (nv,)."""
    scaled, limits = system.scaled(system.equations.jacobian(q)), system.limits
    motions = null_space(scaled, system.rule.tolerance)
    y = motions.T @ towards
    if within_limits:
        limited = (motions * system.column_scale[:, None])[limits.v]
        lower = np.minimum(limits.lower - q[limits.q], 0.0)
        upper = np.maximum(limits.upper - q[limits.q], 0.0)
        if (limited @ y < lower).any() or (limited @ y > upper).any():
            y = y + by_least_squares(limited, lower - limited @ y, upper - limited @ y)
    return np.asarray(motions @ y)
