"""Inverse dynamics by the motions that the closures allow: for any rows and any actuators.

The motions N (J N = 0) do not feel lambda, and leave (S N)' tau = N' f of S' tau + J' lambda = f.
With as many independent actuators as motions that has one solution; otherwise see `least_effort`.
Then lambda, of least norm since redundant rows leave it undetermined.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.dynamics.least_effort import (
    least_effort,
    refuse_nearly_singular,
    unproduced_force,
)
from rps_pin.errors import SingularityError
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, least_norm, null_space

#: What actuators may leave of N' f, relative to it, before it counts as unproduced.
_PRODUCED = 1e-9


class ByMotions(NamedTuple):
    """Actuator and constraint forces, and what neither produces."""

    tau: Array
    """Shape (na,)."""
    multipliers: Array
    """lambda, shape (nc,)."""
    unproduced: Array | None
    """f - S' tau - J' lambda, shape (nv,), or None if all is produced but for rounding."""


def solve_by_allowed_motions(
    jacobian: Array,
    actuated: Indices,
    force: Array,
    scale: Array,
    max_condition: float = 1 / RANK_TOLERANCE,
    motions: Array | None = None,
) -> ByMotions:
    """Return tau and lambda for any number of closure rows and actuators.

    Parameters
    ----------
    jacobian
        J, shape (nc, nv), its rows in one unit.
    actuated
        Indices of the actuated velocities, shape (na,).
    force
        f, shape (nv,).
    scale
        Positive scaling of the velocities, shape (nv,): coordinates v / scale share one unit.
    max_condition
        Largest condition number of the actuators' part in the motions that is accepted.
    motions
        N, shape (nv, m), N / scale orthonormal, if it is known.

    Raises
    ------
    SingularityError
        If as many actuators as motions do not move all of the mechanism, or others hardly do.
    """
    if motions is None:
        motions = scaled_motions(jacobian, scale)
    of_actuators, reduced = motions[actuated], motions.T @ force
    unproduced = None
    if of_actuators.shape[0] == of_actuators.shape[1]:
        tau = _exact(of_actuators / scale[actuated][:, None], reduced, max_condition)
        tau = tau / scale[actuated]
    else:
        effort = least_effort(of_actuators, reduced, weights=scale[actuated])
        refuse_nearly_singular(effort.values, max_condition)
        tau = effort.tau
        if np.linalg.norm(effort.missing) > _PRODUCED * np.linalg.norm(reduced):
            unproduced = unproduced_force(motions, effort.missing, scale)
    rest = force.copy() if unproduced is None else force - unproduced
    rest[actuated] -= tau
    return ByMotions(tau, least_norm((jacobian * scale).T, scale * rest), unproduced)


def scaled_motions(jacobian: Array, scale: Array) -> Array:
    """Return N, shape (nv, m), with J N = 0 and N / scale orthonormal."""
    return scale[:, None] * null_space(jacobian * scale)


def _exact(of_actuators: Array, reduced: Array, max_condition: float) -> Array:
    """Return tau with (S N)' tau = N' f, S N square and of one unit, of size 1 at best."""
    values = np.linalg.svd(of_actuators, compute_uv=False)
    condition = 1 / float(values[-1]) if values.size and values[-1] > 0 else np.inf
    if values.size and not condition <= max_condition:
        raise SingularityError(
            "the actuated joints do not move all of the mechanism here: condition "
            f"{condition:.3g}, and at most {max_condition:.3g} is accepted",
            condition,
            max_condition,
        )
    return np.asarray(np.linalg.solve(of_actuators.T, reduced), np.float64)
