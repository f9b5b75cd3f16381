"""Velocities and accelerations of a mechanism whose loops stay closed.

With J the closures' Jacobian, every velocity with J v = 0 is v = T u, u the velocities of some
joints that move independently of each other (S_i their rows): T = N (S_i N)^-1 for any basis N of
the null space of J.
"""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.system import MAX_CONDITION, ConstraintSystem
from rps_pin.closed_loop.freedoms import Rest, in_words, of_actuators, open_motions, rest_of
from rps_pin.errors import ClosureError, SingularityError
from rps_pin.numerics import linear_algebra

#: Speed at which a given velocity opens loops at least, over its own, where it counts as opening.
_LITTLE = 1e-3


def allowed_motions(system: ConstraintSystem, jacobian: Array) -> Array:
    """Return N, shape (nv, m), a basis of the null space of J, orthonormal in one unit."""
    motions = linear_algebra.null_space(system.scaled(jacobian), system.rule.tolerance)
    return system.column_scale[:, None] * motions


def motion_basis(system: ConstraintSystem, q: Array, chosen: Indices) -> Array:
    """Return T, shape (nv, m), of independent velocities; see `ClosedLoopModel.motion_basis`."""
    jacobian = system.equations.jacobian(q)
    if chosen is system.actuated:
        solved = system.factorisation.passive_motion(jacobian, jacobian.take(chosen, axis=1))
        if solved is not None:
            return actuated_basis(system, solved)
    factors = system.decomposed(jacobian)
    motions = system.column_scale[:, None] * factors.null_space()
    of_chosen = motions[chosen]
    if of_chosen.shape[0] < of_chosen.shape[1]:
        return _basis_without_idle(system, q, jacobian, chosen, _named(*of_chosen.shape))
    if of_chosen.shape[0] != of_chosen.shape[1]:
        reason = _named(*of_chosen.shape)
        raise SingularityError(reason, np.inf, system.max_condition)
    if factors.rank:
        condition = float(factors.values[0] / factors.values[factors.rank - 1])
        limit = max(system.max_condition, MAX_CONDITION)
        reason = "the closures are nearly singular here"
        linear_algebra.refuse_condition(condition, limit, reason)
    # N is orthonormal in one unit: joints that take part in all motions have a block of size 1.
    scale = system.column_scale[chosen]
    reason = "these joints do not determine the motion here"
    scaled = of_chosen / scale[:, None]
    solved = linear_algebra.solve_transposed(scaled, motions.T, system.max_condition, reason)
    return solved.T / scale


def _basis_without_idle(
    system: ConstraintSystem, q: Array, jacobian: Array, chosen: Indices, named: str
) -> Array:
    """Return T where only idle freedoms are left open, of least norm: J_r T_r = -J_c."""
    _, rest, factors = _determined(system, q, jacobian, chosen, named)
    right = -system.row_scale[:, None] * jacobian[:, chosen]
    scaled = factors.least_norm(right)
    opening = np.abs(system.scaled(jacobian)[:, rest] @ scaled - right).max(initial=0.0)
    if opening > system.rule.consistent * np.abs(right).max(initial=0.0):
        raise SingularityError(
            "these joints do not move independently here: the loops would open",
            np.inf,
            system.max_condition,
        )
    basis = np.zeros((system.model.nv, chosen.size))
    basis[chosen] = np.eye(chosen.size)
    basis[rest] = system.column_scale[rest][:, None] * scaled
    return basis


def condition(system: ConstraintSystem, q: Array, jacobian: Array) -> float:
    """Return the condition number of J_p, idle freedoms left out; see `ClosedLoopModel`."""
    idle = of_actuators(system, q, jacobian).idle.shape[1]
    return system.factorisation.condition(jacobian[:, system.passive], idle)


def _named(count: int, mobility: int) -> str:
    return f"{count} independent velocities are named, for a mobility of {mobility} here"


def _determined(
    system: ConstraintSystem,
    q: Array,
    jacobian: Array,
    given: Indices,
    reason: str = "the actuated joints do not determine the motion here",
) -> Rest:
    """Return the velocities that are not given, which those that are determine.

    Raises
    ------
    SingularityError
        If motions are left open that are not idle, or nearly so.
    """
    rest = rest_of(system, jacobian, given)
    factors = rest.factors
    if factors.rank < rest.indices.size:
        lacking = open_motions(system, q, rest.left_open()).lacking
        if lacking.size:
            raise SingularityError(
                f"{reason}: {in_words(system, lacking)} can move while these stand still",
                np.inf,
                system.max_condition,
            )
    if factors.rank:
        condition = float(factors.values[0] / factors.values[factors.rank - 1])
        system.refuse_singular(condition)
    return rest


def actuated_basis(system: ConstraintSystem, solved: Array) -> Array:
    """Return T of the actuated joints from J_p^-1 J_a: its passive rows are minus that."""
    basis = np.zeros((system.model.nv, system.actuated.size))
    basis[system.passive], basis[system.actuated] = -solved, system.identity
    return basis


def velocity(system: ConstraintSystem, q: Array, given: Indices, rates: Array) -> Array:
    """Return v with J v = 0 and given entries; see `ClosedLoopModel.velocity`."""
    still = np.zeros(system.equations.size)
    return _completed(system, q, system.equations.jacobian(q), given, rates, still)


def acceleration(
    system: ConstraintSystem, q: Array, v: Array, given: Indices, accelerations: Array
) -> Array:
    """Return a with J a + J' v = 0 and given entries; see `ClosedLoopModel.acceleration`."""
    bias = system.equations.bias(q, v)
    jacobian = system.equations.jacobian(q)
    opening = float(np.abs(system.row_scale * (jacobian @ v)).max(initial=0.0))
    speed = float(np.abs(v / system.column_scale).max(initial=0.0))
    if opening > system.rule.consistent * max(speed, system.equations.speed):
        raise ClosureError(
            f"v opens the loops at {opening:.3g} m/s; complete it with velocity() first", opening
        )
    turning = speed**2 / system.equations.length  # what the terms of J' v are of the size of
    return _completed(system, q, jacobian, given, accelerations, bias, turning)


def _completed(
    system: ConstraintSystem,
    q: Array,
    jacobian: Array,
    given: Indices,
    values: Array,
    bias: Array,
    turning: float = 0.0,
) -> Array:
    """Return x with x_g given and J x + bias = 0 for the rest: J_r x_r = -J_g x_g - bias.

    Of least norm in one unit where idle freedoms are left open. The bias has rounding errors of
    terms of the size of `turning`.
    """
    full = np.empty(system.model.nv)
    full[given] = values
    right = jacobian.take(given, axis=1) @ values + bias
    if given is system.actuated:
        solved = system.factorisation.passive_motion(jacobian, right[:, None])
        if solved is not None:
            full[system.passive] = -solved[:, 0]
            return full
    _, rest, factors = _determined(system, q, jacobian, given)
    right = -system.row_scale * right
    scaled = factors.least_norm(right)
    opening = float(np.abs(system.scaled(jacobian)[:, rest] @ scaled - right).max(initial=0.0))
    size = float(np.abs(right).max(initial=0.0))
    # What is asked for may move the loops little: a part of it counts; or all, in a rounded file,
    # where nearly redundant rows give little.
    share = _LITTLE if system.rule.rank is None else 1.0
    asked = share * float(np.abs(values / system.column_scale[given]).max(initial=0.0))
    if opening > system.rule.consistent * max(size, asked, _LITTLE * turning):
        raise ClosureError(
            f"no motion of the mechanism has these {given.size} actuated values: "
            f"the loops would open at a rate of {opening:.3g} (asked for: {size:.3g})",
            opening,
        )
    full[rest] = system.column_scale[rest] * scaled
    return full
