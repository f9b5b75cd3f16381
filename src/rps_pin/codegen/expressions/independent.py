"""Choice of the independent velocities of a mechanism, from its Jacobian at closed configurations.

With J of rank r, m = nv - r velocities u move independently and the others follow:
J_d v_d = -J_u u, J_d of full column rank. Generated code has u fixed, so the choice is made once,
for J_d well conditioned at all samples. `elimination.blocks` then orders J_d's rows and columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import qr
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.assembly.closing import close_gaps, closed_gap, is_closed
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.linear_algebra import (
    RANK_TOLERANCE,
    condition_number,
    rank,
    singular_values,
)

#: Lengths of the random steps from home, in radians or characteristic lengths of all motions.
_STEPS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
#: A matrix larger than this counts as large: fewer steps, and pivots for singular values.
_LARGE = 100
#: A step that does not close is halved so often.
_HALVINGS = 4
#: mu in [1 J'; J -mu], which gives steps of least norm also where rows are redundant.
_REGULARISATION = 1e-9
#: Samples nearer to a singularity than this, compared with the best of them, do not count.
_NEAR_SINGULAR = 0.1
#: Condition of J_d up to which the actuated velocities are taken as they are.
_ACCEPTED = 1e5
#: Condition of J_d up to which a set with more actuated velocities goes before a better one.
_GOOD = 1e4
#: Part of the longest row of the motions' bases from which on a velocity is taken as shared.
_GOOD_PART = 0.05
#: An actuated velocity goes before others whose part of the motions is at most 1 / this larger.
_PREFERENCES = (1e-3, 1e-1, 1.0)


class Samples(NamedTuple):
    """Regular closed configurations near home."""

    configurations: Array
    """Shape (K, nq)."""
    jacobians: Array
    """J at each, all entries in one unit, shape (K, nc, nv)."""


@dataclass(frozen=True, eq=False)
class Partition:
    """Independent and dependent velocities of a mechanism.

    Attributes
    ----------
    independent : (m,) array
        Indices in v; the actuated ones first, in their order, then the others as in v.
    dependent : (nv - m,) array
        The others, as in v.
    idle : index array
        Velocities whose columns of J vanish at all samples; they are independent.
    rank : int
        Of J, and number of dependent velocities.
    redundant_rows : int
        Rows of J that depend on others, nc - rank.
    is_actuated : bool
        Whether the independent velocities are the actuated ones.
    actuated_rank : int
        How many motions the actuators drive.
    condition : float
        The largest condition number of J_d (all entries in one unit) at the samples; of more than
        100 velocities an estimate by the pivots of QR, which is too small (20 times for a chain of
        256 loops).
    """

    independent: Indices
    dependent: Indices
    idle: Indices
    rank: int
    redundant_rows: int
    is_actuated: bool
    actuated_rank: int
    condition: float

    @property
    def mobility(self) -> int:
        """Number of independent velocities."""
        return self.independent.size


# Samples ------------------------------------------------------------------------------------------


def regular_samples(system: ConstraintSystem, home: Array, seed: int = 0) -> Samples:
    """Return regular closed configurations near a closed one: it, and random ones of each length.

    Those where J has not the largest rank met, or is nearly of lower rank, are left out. If that
    holds at home, more are found from the best of the others. Joint limits are not looked at. The
    same for the same arguments.
    """
    rng = np.random.default_rng(seed)
    places = [home, *_around(system, home, rng)]
    regular = _regular(system, places)
    if not regular[0]:
        places += _around(system, places[int(np.argmax(regular))], rng)
        regular = _regular(system, places)
    found = [place for place, quality in zip(places, regular, strict=True) if quality]
    jacobians = [system.scaled(system.equations.jacobian(q)) for q in found]
    return Samples(np.array(found), np.array(jacobians))


def _around(system: ConstraintSystem, q: Array, rng: np.random.Generator) -> list[Array]:
    """Return closed configurations after steps of all lengths, as far as they close."""
    steps = _STEPS[::2] if system.model.nv > _LARGE else _STEPS
    found = [_moved(system, q, size, rng.normal(size=system.model.nv)) for size in steps]
    return [place for place in found if place is not None]


def _regular(system: ConstraintSystem, places: list[Array]) -> Array:
    """Return the least singular value over the largest of J, or 0 where it is not regular."""
    values = [_values(system.scaled(system.equations.jacobian(q))) for q in places]
    ranks = np.array([rank(one, system.rule.tolerance) for one in values])
    best = int(ranks.max(initial=0))
    least = np.array([one[best - 1] / one[0] if best else 1.0 for one in values])
    least[ranks < best] = 0.0
    least[least < _NEAR_SINGULAR * least.max()] = 0.0
    return least


def _moved(system: ConstraintSystem, q: Array, length: float, direction: Array) -> Array | None:
    """Return the closed configuration after an allowed step of a root mean square length."""
    along = _solution(system.scaled(system.equations.jacobian(q)), direction, None)
    size = float(np.linalg.norm(along))
    if size < 1e-9 * np.linalg.norm(direction):  # no mobility
        return None
    # A random direction's part in m dimensions of nv has length sqrt(m).
    step = length * system.equations.length * max(size, 1.0) / size * along
    for halving in range(_HALVINGS):
        moved = pin.integrate(system.model, q, system.column_scale * step / 2**halving)
        closed = _closed(system, moved)
        if closed is not None:
            return closed
    return None


def _closed(system: ConstraintSystem, q: Array) -> Array | None:
    """Return a closed configuration near q by Newton's steps of least norm, or damped ones.

    Of a rounded file by damped ones, which leave out the nearly redundant rows.
    """
    if system.rule.rank is None:
        found = _newton(system, q)
        if found is not None:
            return found
    q = close_gaps(system, q, np.zeros(system.model.nv, dtype=bool), False, iterations=30)
    return q if is_closed(system, q) else None


def _newton(system: ConstraintSystem, q: Array) -> Array | None:
    """Return what Newton's steps of least norm lead to, if they close the loops."""
    equations, tolerance, first = system.equations, closed_gap(system, q), np.inf
    for _ in range(10):
        gaps = equations.gaps(q)
        largest = equations.largest_gap(gaps)
        if largest <= tolerance:
            return q
        if not largest < 2 * first:
            break
        first = min(first, largest)
        jacobian = system.scaled(equations.jacobian(q))
        step = _solution(jacobian, None, -system.row_scale * gaps)
        q = pin.integrate(system.model, q, system.column_scale * step)
    return None


def _solution(jacobian: Array, near: Array | None, right: Array | None) -> Array:
    """Return the x nearest to a vector with J x = b; either is zero if left out.

    [1 J'; J -mu] [x; l] = [near; b], sparse: linear in the number of loops.
    """
    rows, columns = jacobian.shape
    if not rows:
        return np.zeros(columns) if near is None else near
    i, j = np.nonzero(jacobian)
    entries, x, multipliers = jacobian[i, j], np.arange(columns), columns + np.arange(rows)
    regularisation = np.full(rows, -_REGULARISATION)
    matrix = csc_matrix(
        (
            np.concatenate([np.ones(columns), entries, entries, regularisation]),
            (
                np.concatenate([x, columns + i, j, multipliers]),
                np.concatenate([x, j, columns + i, multipliers]),
            ),
        )
    )
    both = np.concatenate(
        [
            np.zeros(columns) if near is None else near,
            np.zeros(rows) if right is None else right,
        ]
    )
    return np.asarray(splu(matrix).solve(both)[:columns], np.float64)


def _values(matrix: Array) -> Array:
    """Return the singular values; of large matrices the pivots of QR, which tell the rank."""
    if min(matrix.shape) <= _LARGE:
        return singular_values(matrix)
    (upper,) = qr(matrix, mode="r", pivoting=True)[:1]
    return np.abs(np.diagonal(upper))


def _condition(matrix: Array) -> float:
    """Return the condition number of a matrix that must not lose a column, by `_values`."""
    if min(matrix.shape) <= _LARGE:
        return condition_number(matrix)
    values = _values(matrix)
    lost = rank(values) < matrix.shape[1]
    return np.inf if lost else float(values[0] / values[-1])


# Choice -------------------------------------------------------------------------------------------


def choose(system: ConstraintSystem, jacobians: Array, pattern: Bools | None = None) -> Partition:
    """Return the independent velocities of a mechanism, the same for the same arguments.

    The actuated ones where they determine the motion, at half of the samples or more. Otherwise the
    velocities with the largest part in the motions that those chosen before leave (QR with column
    pivoting of bases of the motions at all samples at once), actuated ones preferred.

    Parameters
    ----------
    system
        The mechanism.
    jacobians
        J at regular closed configurations, all entries in one unit, shape (K, nc, nv).
    pattern
        Which entries of J the generated code has, shape (nc, nv); all if left out.

    Raises
    ------
    InputError
        If shapes do not fit.
    MechanismError
        If the rank differs between the samples, or entries that are not zero are outside the
        pattern.
    """
    rows, columns = system.equations.size, system.model.nv
    if jacobians.ndim != 3 or not len(jacobians) or jacobians.shape[1:] != (rows, columns):
        raise InputError(f"jacobians have the shape (K, {rows}, {columns}), not {jacobians.shape}")
    if pattern is not None and pattern.shape != (rows, columns):
        raise InputError(f"the pattern has the shape ({rows}, {columns}), not {pattern.shape}")
    jacobians, idle = _without_noise(jacobians, pattern)
    ranks = {rank(_values(jacobian), system.rule.tolerance) for jacobian in jacobians}
    if len(ranks) > 1:
        raise MechanismError(
            f"the closures' Jacobian has rank {min(ranks)} at some samples and {max(ranks)} at "
            "others: all must be regular"
        )
    found = ranks.pop()

    def partition(independent: Indices, at: Array = jacobians) -> Partition:
        dependent = np.setdiff1d(np.arange(columns), independent)
        worst = max(_condition(jacobian[:, dependent]) for jacobian in at)
        is_actuated = np.array_equal(independent, system.actuated)
        redundant, driven = rows - found, _actuated_rank(system, at, found)
        return Partition(
            independent, dependent, idle, found, redundant, is_actuated, driven, float(worst)
        )

    if system.actuated.size == columns - found:
        # Home may be a singularity of the actuators, which is no reason against them elsewhere.
        conditions = [_condition(jacobian[:, system.passive]) for jacobian in jacobians]
        regular = np.array(conditions) <= _ACCEPTED
        if 2 * np.count_nonzero(regular) >= len(jacobians):
            return partition(system.actuated, jacobians[regular])
    motions = np.array([_motions(jacobian, found) for jacobian in jacobians])
    best: Partition | None = None
    for preference in _PREFERENCES:
        candidate = partition(_pivoted(motions, idle, system.actuated, preference))
        if best is None or candidate.condition < best.condition:
            best = candidate
        if best.condition <= _GOOD:
            break
    assert best is not None
    return best


def choose_shared(system: ConstraintSystem, jacobians: Array) -> Partition:
    """Return independent velocities without which the closures have least in common.

    Those of joints in many closures, as a platform's, go before others: the rest of each closure
    then follows on its own, with few operations. For what does not depend on the choice: the
    acceleration, and projections.

    Parameters
    ----------
    system, jacobians
        As for `choose`.
    """
    jacobians, idle = _without_noise(jacobians, None)
    found = rank(singular_values(jacobians[0]), system.rule.tolerance)
    moved = np.abs(jacobians).max(axis=0) > RANK_TOLERANCE
    closures = [system.equations.rows(closure.name) for closure in system.equations.closures]
    shared = np.sum([moved[rows].any(axis=0) for rows in closures], axis=0)
    left = np.array([_motions(jacobian, found) for jacobian in jacobians])
    chosen: list[int] = []
    for step in range(left.shape[2]):
        length = np.linalg.norm(left, axis=2)
        least = length.min(axis=0)
        least[chosen] = -1.0
        at = int(idle[step]) if step < idle.size else _first(shared, least)
        along = left[:, at] / length[:, at, None]
        left -= np.einsum("kjm,km->kj", left, along)[:, :, None] * along[:, None]
        chosen.append(at)
    independent = np.sort(np.array(chosen, dtype=np.intp))
    dependent = np.setdiff1d(np.arange(system.model.nv), independent)
    worst = max(_condition(jacobian[:, dependent]) for jacobian in jacobians)
    is_actuated = np.array_equal(independent, system.actuated)
    redundant, driven = system.equations.size - found, _actuated_rank(system, jacobians, found)
    return Partition(
        independent, dependent, idle, found, redundant, is_actuated, driven, float(worst)
    )


def _actuated_rank(system: ConstraintSystem, jacobians: Array, found: int) -> int:
    """Return the largest rank of the actuators' part in the motions, J's rank being known."""
    motions = (_motions(jacobian, found)[system.actuated] for jacobian in jacobians)
    return max(rank(singular_values(one), system.rule.tolerance) for one in motions)


def _first(shared: Array, least: Array) -> int:
    """Return the velocity in most closures, of those with a good part in the motions left."""
    good = np.flatnonzero(least >= _GOOD_PART * least.max())
    return int(max(good, key=lambda j: (shared[j], least[j])))


def _without_noise(jacobians: Array, pattern: Bools | None) -> tuple[Array, Indices]:
    """Return J without columns that are rounding error at all samples, and their indices."""
    size = max(float(np.abs(jacobians).max(initial=0.0)), 1.0)
    vanishing = np.abs(jacobians).max(axis=(0, 1), initial=0.0) <= RANK_TOLERANCE * size
    if pattern is not None:
        # Rows of other axes than J's mix those of one closure, columns never.
        outside = ~vanishing & ~np.asarray(pattern, dtype=bool).any(axis=0)
        if outside.any():
            raise MechanismError(
                f"velocities {np.flatnonzero(outside).tolist()} move the closures, but have no "
                "entries in the pattern"
            )
    return np.where(vanishing, 0.0, jacobians), np.flatnonzero(vanishing)


def _motions(jacobian: Array, found: int) -> Array:
    """Return an orthonormal basis of the null space of a J of known rank, shape (nv, m)."""
    if not jacobian.shape[0]:
        return np.eye(jacobian.shape[1])
    turned, _, _ = qr(jacobian.T, pivoting=True)
    return np.asarray(turned[:, found:], np.float64)


def _pivoted(motions: Array, idle: Indices, actuated: Indices, preference: float) -> Indices:
    """Return m velocities whose rows of the motions' bases (K, nv, m) are independent.

    Idle ones first. An actuated one whose row, less what those before have of it, is at least
    `preference` times the longest goes before the others; lengths are the least of the samples.
    """
    left, count = motions.copy(), motions.shape[2]
    is_actuated = np.zeros(motions.shape[1], dtype=bool)
    is_actuated[actuated] = True
    chosen: list[int] = []
    for step in range(count):
        length = np.linalg.norm(left, axis=2)
        least = length.min(axis=0)
        least[chosen] = -1.0
        at = int(idle[step]) if step < idle.size else int(least.argmax())
        if step >= idle.size and not is_actuated[at]:
            driven = np.where(is_actuated, least, -1.0)
            if driven.max() >= preference * least[at]:
                at = int(driven.argmax())
        along = left[:, at] / length[:, at, None]
        left -= np.einsum("kjm,km->kj", left, along)[:, :, None] * along[:, None]
        chosen.append(at)
    others = sorted(set(chosen) - set(actuated.tolist()))
    return np.array([*[j for j in actuated.tolist() if j in chosen], *others], dtype=np.intp)
