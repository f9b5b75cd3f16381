"""Regular configurations: closed ones where the closures' Jacobian has its full rank.

At a singular configuration of the closures (a parallelogram laid flat, for example) the rank is
lower, the mechanism has more motions than beside it, and forces beside it grow without bound.
**One rule** holds there for all dynamics: with r the rank at regular configurations nearby and s_i
the singular values of J (all entries in one unit), max(s_1, 1) / s_r above 1e8 (``max_condition``
if that is more) is refused, at the singular configuration itself (where s_r = 0) as beside it.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import close
from rps_pin.closed_loop.constraints.rank_rule import largest
from rps_pin.closed_loop.constraints.system import MAX_CONDITION, ConstraintSystem
from rps_pin.closed_loop.kinematics import allowed_motions
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import (
    Decomposition,
    rank,
    refuse_condition,
    singular_values,
)

#: Regular configurations are looked for by so many random steps of this length (rad).
_TRIES, _STEP = 10, 0.15


def around(
    system: ConstraintSystem, q: Array, *, within_limits: bool = True, steps: int = _TRIES
) -> list[Array]:
    """Return a closed configuration and those of a random walk from it; always the same walk."""
    places, rng = [q], np.random.default_rng(0)
    for _ in range(steps):
        motions = allowed_motions(system, system.equations.jacobian(q))
        step = _STEP * rng.normal(size=motions.shape[1]) * system.equations.length
        moved = pin.integrate(system.model, q, motions @ step)
        try:
            moved = system.normalised(moved, "q")
            q = close(system, moved, within_limits=within_limits, restarts=0)
        except ClosureError:  # a step too far: go on from where it stood
            continue
        places.append(q)
    return places


def values_at(system: ConstraintSystem, q: Array) -> Array:
    """Return the singular values of J, all entries in one unit."""
    return singular_values(system.scaled(system.equations.jacobian(q)))


def regular_near(
    system: ConstraintSystem, home: Array, *, within_limits: bool = True
) -> tuple[Array, bool]:
    """Return a closed configuration near a closed one of the largest ranks met.

    That is the rank of the closures' Jacobian J and, where two have the same, that of the actuated
    joints' part S N in the allowed motions N. Also says if the ranks are lower at the given one.
    """
    places = around(system, home, within_limits=within_limits)
    ranks = [ranks_at(system, q) for q in places]
    best = max(range(len(ranks)), key=lambda i: ranks[i])
    return places[best], ranks[0] < ranks[best]


def ranks_at(system: ConstraintSystem, q: Array) -> tuple[int, int]:
    """Return the ranks of J and of S N at a configuration."""
    factors = system.decomposed(system.equations.jacobian(q))
    return factors.rank, actuated_rank(system, factors)


def actuated_rank(system: ConstraintSystem, factors: Decomposition) -> int:
    """Return the rank of S N in one unit, N the null space of a scaled J."""
    return rank(singular_values(factors.null_space()[system.actuated]), system.rule.tolerance)


# Singular ones are refused ------------------------------------------------------------------------


def refuse_irregular(system: ConstraintSystem, q: Array, factors: Decomposition) -> int:
    """Raise `SingularityError` where the closures or the actuators are singular, or nearly.

    That is where a rank is lower than at regular configurations near it. Those of the mechanism are
    found once; only a q where they differ is looked at more closely.

    Parameters
    ----------
    system
        The system; its scratch memory is not used.
    q
        Closed configuration, shape (nq,).
    factors
        Of J there.

    Returns
    -------
    int
        Rank of the actuated joints' part in the allowed motions.
    """
    ranks = factors.rank, actuated_rank(system, factors)
    regular = system.ranks if ranks == system.ranks else _regular_ranks(system, q)
    _refuse(system, q, ranks, regular)
    _refuse_vanishing(system, factors, regular[0])
    return ranks[1]


def refuse_lost_rows(system: ConstraintSystem, q: Array, factors: Decomposition) -> None:
    """Raise `SingularityError` where the closures are singular or nearly: `refuse_irregular`."""
    regular = system.ranks
    if regular is None or regular[0] != factors.rank:
        regular = _regular_ranks(system, q)
    _refuse(system, q, (factors.rank, regular[1]), regular)
    _refuse_vanishing(system, factors, regular[0])


def _regular_ranks(system: ConstraintSystem, q: Array) -> tuple[int, int]:
    """Return the ranks at regular configurations near q, and keep the first found as `ranks`."""
    trial = system.trial(system.rule)
    try:
        q = close(trial, q, within_limits=False, restarts=0)
    except ClosureError:
        return ranks_at(trial, q)
    found = ranks_at(trial, regular_near(trial, q, within_limits=False)[0])
    system.ranks = system.ranks or found
    return found


def _refuse(
    system: ConstraintSystem, q: Array, ranks: tuple[int, int], regular: tuple[int, int]
) -> None:
    """Raise the error of a configuration with lower ranks than near it."""
    if ranks >= regular:
        return
    trial, limit = system.trial(system.rule), system.max_condition
    condition = trial.condition(trial.equations.jacobian(q))
    refuse_condition(
        condition if condition > limit else math.inf,
        limit,
        f"the configuration is singular: the closures have rank {ranks[0]} and the actuators "
        f"rank {ranks[1]}, and {regular[0]} and {regular[1]} next to it",
    )


def _refuse_vanishing(system: ConstraintSystem, factors: Decomposition, count: int) -> None:
    """Raise the error of a configuration where one of the independent rows nearly depends."""
    if not 0 < count <= factors.rank:
        return
    condition = largest(factors.values) / float(factors.values[count - 1])
    limit = max(system.max_condition, MAX_CONDITION)
    refuse_condition(condition, limit, "the closures are nearly singular here")
