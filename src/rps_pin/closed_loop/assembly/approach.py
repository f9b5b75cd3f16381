"""Following closed configurations towards more given coordinates than there are motions.

The closures let such coordinates move along some directions only. With N the motions that the
closures allow, N_g its rows of the given coordinates and d what is left of their way, each step is

    N y,   y = N_g+ d,

as far as N stays nearly the same space, with the loops closed again after it. It ends where the
given coordinates are reached, or where no motion leads nearer.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.assembly.closing import close_gaps, is_closed
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.linear_algebra import Decomposition, null_space

#: Largest motion in a step, rad or characteristic lengths; and when nothing is left of the way.
_REACH, _REACHED = 0.3, 1e-7
_MOST_STEPS = 2000
#: Least cosine between the motions allowed before and after a step; most correction of a step.
_SAME, _CORRECTION = 0.7, 0.25


def approached(
    system: ConstraintSystem, given: Indices, coordinates: Indices, start: Array, target: Array
) -> tuple[Array, float]:
    """Return the closed configuration nearest to given coordinates on the way, and what is left.

    Parameters
    ----------
    system
        The system.
    given, coordinates
        Velocities and coordinates of the given joints, shapes (k,) and (l,).
    start
        A closed configuration, shape (nq,).
    target
        One with the given coordinates as they are wanted, shape (nq,).

    Returns
    -------
    tuple
        The configuration, shape (nq,), and the norm of what is left of the way, in one unit (m).
    """
    model, scale, length = system.model, system.column_scale, system.equations.length
    none = np.zeros(model.nv, dtype=bool)

    def left(q: Array) -> Array:
        wanted = q.copy()
        wanted[coordinates] = target[coordinates]
        return np.asarray((pin.difference(model, q, wanted) / scale)[given])

    def motions(q: Array) -> Array:
        return null_space(system.scaled(system.equations.jacobian(q)), system.rule.tolerance)

    q, share = start, 1.0
    allowed, way = motions(q), left(q)
    for _ in range(_MOST_STEPS):
        distance = float(np.linalg.norm(way))
        step = allowed @ Decomposition(allowed[given]).least_norm(way)
        reach = float(np.abs(step).max(initial=0.0))
        if distance <= _REACHED * length or reach <= _REACHED * length or share < _REACHED:
            break
        share = min(share, _REACH * length / reach)
        predicted = pin.integrate(model, q, share * scale * step)
        moved = close_gaps(system, predicted, none, False)
        corrected = pin.difference(model, predicted, moved) / scale
        after, way_after = motions(moved), left(moved)
        nearer = (
            is_closed(system, moved)
            and float(np.linalg.norm(corrected)) <= _CORRECTION * share * np.linalg.norm(step)
            and after.shape == allowed.shape
            and np.linalg.svd(allowed.T @ after, compute_uv=False).min(initial=1.0) >= _SAME
            and np.linalg.norm(way_after) < distance
        )
        if nearer:
            q, allowed, way, share = moved, after, way_after, min(1.0, 2 * share)
        else:
            share /= 2
    return q, float(np.linalg.norm(way))
