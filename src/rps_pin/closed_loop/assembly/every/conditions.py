"""Condition numbers of the closures at assembly modes, by the joints that are not given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.linear_algebra import rank, singular_values


def values_at(system: ConstraintSystem, q: Array, held: Bools) -> Array:
    """Return the singular values of the closures' Jacobian by the velocities not held, at q."""
    jacobian = system.scaled(system.equations.jacobian(q))
    return singular_values(jacobian[:, ~held])


def rank_of(system: ConstraintSystem, values: Array) -> int:
    """Return the rank by singular values, by the system's rule."""
    return rank(values, system.rule.tolerance)


def condition_of(values: Array, count: int) -> float:
    """Return the condition number by the first singular values."""
    if not count:
        return 1.0
    return float(values[0] / values[count - 1]) if values[count - 1] > 0 else np.inf


def conditions(system: ConstraintSystem, values: Sequence[Array]) -> Array:
    """Return the condition numbers of modes by the largest rank among them, shape (k,)."""
    largest = max((rank_of(system, one) for one in values), default=0)
    return np.array([condition_of(one, largest) for one in values], dtype=np.float64)
