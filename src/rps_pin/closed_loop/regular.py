"""Regular configurations: closed ones where the closures' Jacobian has its full rank."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import close
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.kinematics import allowed_motions
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import (
    Decomposition,
    rank,
    refuse_condition,
    singular_values,
)

#: Where a regular configuration is looked for: so many random steps of this length (rad).
_TRIES, _STEP = 10, 0.15


def regular_near(system: ConstraintSystem, home: Array) -> tuple[Array, bool]:
    """Return a closed configuration near a closed one of the largest ranks met.

    That is the rank of the closures' Jacobian J and, where two have the same, that of the actuated
    joints' part S N in the allowed motions N. Also says if the ranks are lower at the given one.
    """
    q, rng = home, np.random.default_rng(0)
    places, ranks = [home], [ranks_at(system, home)]
    for _ in range(_TRIES):
        motions = allowed_motions(system, system.equations.jacobian(q))
        step = _STEP * rng.normal(size=motions.shape[1]) * system.equations.length
        moved = pin.integrate(system.model, q, motions @ step)
        try:
            q = close(system, system.normalised(moved, "q"), restarts=0)
        except ClosureError:  # a step too far: go on from where it stood
            continue
        places.append(q)
        ranks.append(ranks_at(system, q))
    best = max(range(len(ranks)), key=lambda i: ranks[i])
    return places[best], ranks[0] < ranks[best]


def refuse_irregular(system: ConstraintSystem, q: Array, ranks: tuple[int, int]) -> None:
    """Raise `SingularityError` if the ranks at q are lower than at regular configurations near it.

    The ranks of the mechanism are found once; only a q where they differ is looked at more closely.
    """
    if system.ranks is None:
        system.ranks = ranks_at(system, regular_near(system, q)[0])
    if ranks == system.ranks:
        return
    condition = system.condition(system.equations.jacobian(q))
    regular, singular = regular_near(system, q)
    if singular:
        rows, driven = ranks_at(system, regular)
        reason = (
            f"the configuration is singular: the closures have rank {ranks[0]} and the actuators "
            f"rank {ranks[1]}, and {rows} and {driven} next to it"
        )
        limit = system.max_condition
        refuse_condition(condition if condition > limit else math.inf, limit, reason)


def ranks_at(system: ConstraintSystem, q: Array) -> tuple[int, int]:
    """Return the ranks of J and of S N at a configuration."""
    factors = Decomposition(system.scaled(system.equations.jacobian(q)))
    return factors.rank, actuated_rank(system, factors)


def actuated_rank(system: ConstraintSystem, factors: Decomposition) -> int:
    """Return the rank of S N in one unit, N the null space of a scaled J."""
    return rank(singular_values(factors.null_space()[system.actuated]))
