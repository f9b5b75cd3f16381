"""Whether the numbers of a mechanism's file are rounded, and the rule of rank that follows.

Rows that would be redundant in exact numbers are nearly so in rounded ones. What tells them from
the rows of a mechanism near a singular configuration is that they stay so wherever it moves: with
the suspected rows left out, closed configurations are found by a random walk, and at all of them

- the singular values have a gap after the same number r of values: s_r is many times s_r+1,
- s_r+1 (over the largest), and the gap that the loops keep (over the characteristic length), are
  at most the accuracy.

Rows and columns are divided by their own size first (not below `_LEVER`): a short lever or a large
ratio of a coupling is not a rounding error.

Without an accuracy of the user's, `ACCURACY` holds; and `COARSE` where the rows, if they counted,
would leave fewer motions than there are actuators. Values between the two are reported, and count.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.closing import close, close_gaps, closed_gap, is_closed
from rps_pin.closed_loop.constraints.rank_rule import EXACT, RankRule, Rounding, largest
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.regular import around, values_at
from rps_pin.errors import AccuracyWarning, ClosureError, warn_caller
from rps_pin.numerics.linear_algebra import (
    RANK_TOLERANCE,
    full_svd,
    null_space,
    rank,
    singular_values,
)

#: Largest relative error of a file's numbers that is looked for, in characteristic lengths (rad).
ACCURACY = 1e-3
#: The same where the actuators show that the rows are meant to be redundant.
COARSE = 5e-3
#: Singular values up to this are those of exact numbers.
_ROUNDING = 1e-11
#: Least ratio of the singular values on both sides of the gap.
_GAP = 30.0
#: The tolerance is at most so many times the largest value that it leaves out.
_MARGIN = 100.0
#: Columns of J smaller than this are rounding errors, not levers.
_LEVER = 3e-5
#: Steps after which a file whose redundant rows are so to rounding error counts as exact.
_FIRST = 2
#: Configurations nearer to a singularity than this, compared with the best, do not count.
_NEAR_SINGULAR = 0.1
#: Attempts to close the loops from one guess.
_ATTEMPTS = 3
#: And to close them exactly where they seem not to.
_RESTARTS = 8
#: Part of the nearly redundant rows from which on a closure is named.
_PART = 0.2
#: A motion is tried by a step of this length (rad), and followed if so much of it remains.
_STEP, _FOLLOWED = 0.1, 0.5
#: Velocities above which a mechanism counts as large.
_LARGE = 200


class _Spectrum(NamedTuple):
    """Singular values over the largest, at closed configurations; the gap after the r-th."""

    rank: int
    kept: float
    dropped: float


def find_rule(
    system: ConstraintSystem, guesses: Sequence[Array], accuracy: float | None
) -> RankRule | None:
    """Return the rule of rank of a mechanism; None if the loops do not close from the guesses.

    Parameters
    ----------
    system
        The system; its scratch memory is not used.
    guesses
        Configurations, shape (nq,) each.
    accuracy
        Of the file's numbers, in characteristic lengths and rad; 0: exact. None: see above.

    Warns
    -----
    AccuracyWarning
        If the file is rounded.
    """
    bound = COARSE if accuracy is None else accuracy
    length = system.equations.length
    if bound <= RANK_TOLERANCE or not system.equations.size or system.model.nv > _LARGE:
        return EXACT
    trial = system.trial(RankRule(bound, rank=0, gap=bound * length))
    for guess in guesses:
        trial.rescale(system.row_scale, system.column_scale)
        _equalise(trial, guess)
        q = _closed(trial, guess)
        rule = None if q is None else _rule(system, trial, q, accuracy)
        if rule is not None:
            return rule
    return None


def _rule(
    system: ConstraintSystem, trial: ConstraintSystem, q: Array, accuracy: float | None
) -> RankRule | None:
    """Return the rule that follows from closed configurations about q; None if they do not tell."""
    bound = trial.rule.tolerance
    closed = closed_gap(system, q)
    trial.rescale(system.row_scale, system.column_scale)
    _equalise(trial, q)
    if _is_exact(trial, q, closed):
        return EXACT
    places = around(trial, q, within_limits=False)
    judged, places = _spectrum(trial, places, bound)
    gaps = [_gap(trial, place) for place in places]
    trial.rescale(system.row_scale, system.column_scale)
    counted, _ = _spectrum(trial, places, bound, judged.rank)
    # Numbers that are rounded leave their gap everywhere, singular configurations do not.
    is_open = float(np.median(gaps)) > closed
    rest = max(gaps) if is_open else 0.0
    if not (is_open or judged.dropped) or min(_ratio(judged), _ratio(counted)) < _GAP:
        return EXACT
    if accuracy is None and not _moves(trial, max(places, key=partial(_kept, trial, judged.rank))):
        return None  # nothing tells it from a gap that does not close from here
    if accuracy is None and _closes_elsewhere(system, trial, q):
        return EXACT
    rows = rank(values_at(trial, places[0]))
    moves_less = system.model.nv - rows < system.actuated.size
    limit = (COARSE if moves_less else ACCURACY) if accuracy is None else accuracy
    size = max(counted.dropped, judged.dropped, rest / system.equations.length)
    rounding = _rounding(trial, places[0], counted, rest)
    name = system.model.name or "the mechanism"
    if size > limit:
        warn_caller(
            f"{name}: nearly redundant rows, {rounding}. They count as they stand; if they are the "
            f"rounding of the file, set accuracy={2 * size:.1g}, and if not, accuracy=0",
            AccuracyWarning,
        )
        return EXACT
    tolerance = min(np.sqrt(counted.kept * counted.dropped), _MARGIN * counted.dropped)
    follows = (
        "The nearly redundant rows count as redundant"
        if counted.dropped
        else "That much may stay open"
    )
    warn_caller(
        f"{name}: the file's numbers are rounded, {rounding}. {follows}; set accuracy to change "
        f"that (now {limit:g}; 0: exact)",
        AccuracyWarning,
    )
    gap = limit * system.equations.length
    return RankRule(max(float(tolerance), RANK_TOLERANCE), judged.rank, gap, rounding)


def _is_exact(trial: ConstraintSystem, q: Array, closed: float) -> bool:
    """Return whether a few configurations show that no row is nearly redundant, and no gap open."""
    if _gap(trial, q) > closed:
        return False
    values = values_at(trial, q)
    if values.size == trial.equations.size and values[-1] > trial.rule.tolerance * largest(values):
        return True
    places = around(trial, q, within_limits=False, steps=_FIRST)
    return max(_gap(trial, at) for at in places) <= closed and not _nearly(trial, places).any()


def _closed(trial: ConstraintSystem, guess: Array) -> Array | None:
    """Return a configuration near a guess that is closed as far as the trial's rule asks."""
    rng, start, model = np.random.default_rng(0), guess, trial.model
    free = np.zeros(model.nv, dtype=bool)
    for attempt in range(_ATTEMPTS):
        q = close_gaps(trial, start, free, within_limits=False, iterations=60)
        if is_closed(trial, q):
            return q
        spread = (attempt + 1) * trial.equations.length
        away = spread * rng.normal(size=model.nv) * trial.column_scale
        start = pin.integrate(model, guess, away)
    return None


def _moves(trial: ConstraintSystem, q: Array) -> bool:
    """Return whether the mechanism can follow each motion that is left by the rows that count.

    Where a gap does not close because links are too short, or at a singular configuration, one of
    the directions of the null space is none of a motion: the next closed configuration is back.
    """
    scale = trial.column_scale
    motions = null_space(trial.scaled(trial.equations.jacobian(q)), trial.rule.tolerance)
    reached = np.zeros((motions.shape[1],) * 2)
    size = _STEP * trial.equations.length
    free = np.zeros(trial.model.nv, dtype=bool)
    for k, direction in enumerate(motions.T):
        moved = pin.integrate(trial.model, q, scale * size * direction)
        moved = close_gaps(trial, moved, free, within_limits=False, iterations=60)
        if is_closed(trial, moved):
            reached[k] = (pin.difference(trial.model, q, moved) / scale) @ motions / size
    return bool(reached.size and singular_values(reached).min() > _FOLLOWED)


def _closes_elsewhere(system: ConstraintSystem, trial: ConstraintSystem, q: Array) -> bool:
    """Return whether the loops close to rounding error, without nearly redundant rows, from q on.

    Then q is of an assembly mode in which they do not, for other reasons than rounded numbers.
    """
    exact = system.trial(EXACT)
    try:
        q = close(exact, q, within_limits=False, restarts=_RESTARTS)
    except ClosureError:
        return False
    exact.rescale(trial.row_scale, trial.column_scale)
    return not _nearly(exact, [q], trial.rule.tolerance).any()


def _nearly(system: ConstraintSystem, places: list[Array], bound: float | None = None) -> Bools:
    """Return which singular values are nearly zero: above rounding error, at most a bound."""
    values = np.array([one / largest(one) for one in (values_at(system, q) for q in places)])
    return (values > _ROUNDING) & (values <= (bound or system.rule.tolerance))


def _kept(system: ConstraintSystem, count: int, q: Array) -> float:
    """Return the last singular value that counts."""
    return float(values_at(system, q)[count - 1]) if count else 0.0


def _gap(system: ConstraintSystem, q: Array) -> float:
    return system.equations.largest_gap(system.equations.gaps(q))


def _equalise(trial: ConstraintSystem, q: Array) -> None:
    """Divide rows larger than 1, and all columns but the smallest, by their size at q."""
    scaled = trial.scaled(trial.equations.jacobian(q))
    of_rows = np.maximum(np.linalg.norm(scaled, axis=1), 1.0)
    of_columns = np.linalg.norm(scaled / of_rows[:, None], axis=0)
    of_columns[of_columns < _LEVER] = 1.0
    trial.rescale(trial.row_scale / of_rows, trial.column_scale / of_columns)


def _spectrum(
    trial: ConstraintSystem, places: list[Array], bound: float, count: int | None = None
) -> tuple[_Spectrum, list[Array]]:
    """Return the gap after the largest number of values above a bound, or after a given number.

    And the configurations where so many are above it, and that are not near a singularity.
    """
    values = [values_at(trial, place) for place in places]
    relative = np.array([one / largest(one) for one in values])
    counts = np.count_nonzero(relative > bound, axis=1)
    found = int(counts.max(initial=0)) if count is None else count
    regular = counts >= found if count is None else np.ones(len(places), dtype=bool)
    if not found:
        return _Spectrum(0, 1.0, _largest_of_most(relative)), places
    last = relative[:, found - 1]
    usable = regular & (last >= _NEAR_SINGULAR * last.max())
    beyond = _largest_of_most(relative[usable, found:])
    spectrum = _Spectrum(found, float(last[usable].min()), beyond)
    return spectrum, [place for place, use in zip(places, usable, strict=True) if use]


def _largest_of_most(values: Array) -> float:
    """Return the largest entry of an array (K, n), or 0 if it is rounding error in most rows."""
    of_rows = values.max(axis=1, initial=0.0)
    return float(of_rows.max()) if np.median(of_rows) > _ROUNDING else 0.0


def _ratio(spectrum: _Spectrum) -> float:
    return spectrum.kept / spectrum.dropped if spectrum.dropped > 0 else np.inf


# What to tell -------------------------------------------------------------------------------------


def _rounding(system: ConstraintSystem, q: Array, spectrum: _Spectrum, gap: float) -> Rounding:
    equations = system.equations
    left, _, _ = full_svd(system.scaled(equations.jacobian(q)))
    open_by = np.abs(system.row_scale * equations.gaps(q))
    of_rows = np.linalg.norm(left[:, spectrum.rank :], axis=1)
    if gap > closed_gap(system, q):
        of_rows = of_rows * (open_by > _PART * open_by.max()) if not spectrum.dropped else of_rows
    parts = [
        float(np.linalg.norm(of_rows[equations.rows(closure.name)]))
        for closure in equations.closures
    ]
    names = tuple(
        closure.name
        for closure, part in zip(equations.closures, parts, strict=True)
        if part >= _PART * max(parts)
    )
    axes = _not_parallel(system, q, names)
    return Rounding(spectrum.kept, spectrum.dropped, gap, names, axes)


def _not_parallel(
    system: ConstraintSystem, q: Array, names: Sequence[str]
) -> tuple[tuple[str, float], ...]:
    """Return hinges in closures whose axes are nearly, not quite, parallel to most others."""
    model, equations = system.model, system.equations
    jacobian = system.scaled(equations.jacobian(q))
    rows = [equations.rows(name) for name in names]
    moving = np.zeros(model.nv, dtype=bool)
    for one in rows:
        moving |= np.abs(jacobian[one]).max(axis=0) > RANK_TOLERANCE
    joints = [
        index
        for index in range(1, model.njoints)
        if model.joints[index].nv == 1 and moving[model.joints[index].idx_v]
    ]
    axes = np.array([_axis(system, index) for index in joints]).reshape(-1, 3)
    angles = np.linalg.norm(np.cross(axes[:, None], axes[None]), axis=2)
    near, same = angles <= 2 * COARSE, angles <= RANK_TOLERANCE
    found = []
    for k, index in enumerate(joints):
        group = np.flatnonzero(near[k])
        reference = group[int(np.argmax(same[group][:, group].sum(axis=1)))]
        if same[reference][group].sum() > 1 and not same[reference, k]:
            found.append((str(model.names[index]), float(angles[reference, k])))
    return tuple(found)


def _axis(system: ConstraintSystem, index: int) -> Array:
    """Return a joint's axis in the world, after a Jacobian."""
    local = pin.getJointJacobian(
        system.model, system.equations.data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).reshape(6, -1)[:, system.model.joints[index].idx_v]
    angular = np.asarray(local[3:])
    size = float(np.linalg.norm(angular))
    return angular / size if size > 0 else np.zeros(3)
