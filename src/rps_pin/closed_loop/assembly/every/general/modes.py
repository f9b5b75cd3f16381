"""All assembly modes of any tree of turns, slides and balls, by loops in complex parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools, ComplexArray
from rps_pin.closed_loop.assembly.every.general.equations import Loop, parts
from rps_pin.closed_loop.assembly.every.general.factors import (
    Ball,
    Factor,
    Slide,
    Turn,
    joint_factors,
)
from rps_pin.closed_loop.assembly.every.general.family import (
    GeneralFamily,
    Linear,
    on_its_own,
)
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError, Solutions
from rps_pin.closed_loop.assembly.random_starts import mechanism_size
from rps_pin.closed_loop.constraints.couplings import CouplingRow
from rps_pin.closed_loop.constraints.equations import ClosedFrames
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.homotopy.krawczyk import all_distinct, proven_zero
from rps_pin.numerics.homotopy.monodromy import QUIET, Between, Fibre, all_by_loops, distinct
from rps_pin.numerics.homotopy.tracking import tracked
from rps_pin.numerics.intervals import Interval
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE

#: Complex solutions at most.
_MOST = 400
_TRIES = 3
#: How far along a path must come before it counts as one to a singular end.
_NEAR_END = 0.999
#: Imaginary parts of angles beyond this are at infinity.
_INFINITE = 15.0


def general_solutions(
    system: ConstraintSystem,
    held: Bools,
    about: Array,
    longest: float = np.inf,
    progress: Callable[[float], None] | None = None,
) -> Solutions:
    """Return all solutions of a mechanism's closures that loops in their parameters lead to.

    Parameters
    ----------
    system, held, about
        As for `every_mode`.
    longest
        Time for the loops, s.
    progress
        Called with the share of the loops without a new solution that end the search.

    Raises
    ------
    NoFormulationError
        If the closures are not polynomial, not as many as the unknowns, have too many solutions, or
        take too long; says why.
    """
    until = time.monotonic() + longest

    def told(share: float) -> None:
        if share < 1.0 and time.monotonic() > until:
            raise NoFormulationError(f"that takes longer than {longest:g} s")
        if progress is not None:
            progress(share)

    family = general_family(system, held, about)
    fibre = all_by_loops(family, np.random.default_rng(0), _MOST, told)
    if fibre is None:
        raise NoFormulationError(f"it has more than {_MOST} complex solutions in general")
    count = len(fibre.x)
    x = ends_of(family, fibre)
    places = family.places(x)
    # The conjugate of a solution is one too: it is real if that is itself.
    apart = np.abs(places.conj()[:, None] - places[None]).max(axis=2, initial=0.0)
    own = np.argmin(apart, axis=1) == np.arange(len(x)) if len(x) else np.zeros(0, dtype=bool)
    real = real_parts(family, x[own])
    boxes = [proven_zero(lambda box: one_of(family, box), one) for one in real]
    guesses = [configuration(family, about, one) for one in real]
    solved = np.ones(system.model.nv, dtype=bool)
    return Solutions(
        np.array(guesses).reshape(len(real), system.model.nq),
        solved,
        all_distinct(boxes),
        len(x),
        count,
        count - len(x),
        f"with its closed frames anywhere the mechanism has {count} that {fibre.loops} loops in "
        f"their places lead to, the last {QUIET} to no new one: that none is missing is not proven",
    )


def ends_of(family: GeneralFamily, fibre: Fibre) -> ComplexArray:
    """Return the mechanism's own regular solutions, shape (k, n).

    If a path stops before its end is near, all are followed again on another arc.
    """
    rng, start = np.random.default_rng(0), np.tile(fibre.parameters, (len(fibre.x), 1))
    turns = [one.at for one in family.factors if isinstance(one, Turn)]
    found = fibre.x[:0]
    for attempt in range(_TRIES):
        bend = attempt * np.full(len(start), rng.uniform(-1.0, 1.0))
        with np.errstate(all="ignore"):  # of paths to infinity
            ends = tracked(Between(family, start, np.zeros_like(start), bend), fibre.x)
        finite = np.abs(ends.x[:, turns].imag).max(axis=1, initial=0.0) < _INFINITE
        found = distinct(family, np.concatenate([found, ends.x[ends.regular & finite]]))
        if ends.s.min() >= _NEAR_END or len(found) == len(start):
            break
    return found


def real_parts(family: GeneralFamily, x: ComplexArray) -> Array:
    """Return real solutions as real numbers; quaternions may be given times i."""
    real = x.copy()
    for at in family.balls:
        e = x[:, at : at + 4]
        largest = e[np.arange(len(e)), np.argmax(np.abs(e), axis=1)]
        e = e / (largest / np.abs(largest))[:, None]
        real[:, at : at + 4] = e / np.linalg.norm(e, axis=1)[:, None]
    return np.asarray(real.real)


def one_of(family: GeneralFamily, box: Interval) -> tuple[Interval, Interval]:
    """Return the mechanism's own values (n,) and derivatives (n, n) over a box."""
    values, slopes = family.at_zero(box[None])
    return values[0], slopes[0]


def configuration(family: GeneralFamily, about: Array, x: Array) -> Array:
    """Return the configuration with unknowns x, shape (nq,)."""
    q = about.copy()
    for one in family.factors:
        if isinstance(one, Slide):
            q[one.q] = x[one.at] * family.unit
        elif isinstance(one, Ball):
            q[one.q : one.q + 4] = x[one.at : one.at + 4]
        elif isinstance(one, Turn) and one.by_cosine:
            q[one.q : one.q + 2] = math.cos(x[one.at]), math.sin(x[one.at])
        else:
            q[one.q] = x[one.at]
    return q


# The equations ------------------------------------------------------------------------------------


def general_family(system: ConstraintSystem, held: Bools, about: Array) -> GeneralFamily:
    """Return the equations of a mechanism, as many as unknowns.

    Raises
    ------
    NoFormulationError
        If there is no such; says why.
    """
    family = closures_of(system, held, about)
    _make_square(family, about, np.random.default_rng(1))
    return family


def closures_of(system: ConstraintSystem, held: Bools, about: Array) -> GeneralFamily:
    """Return the equations of a mechanism, of any number; raises as `general_family`."""
    equations = system.equations
    if equations.held:
        raise NoFormulationError("a closure holds coordinates of a frame")
    unit = 2.0 ** round(math.log2(mechanism_size(system, about)))
    joints, size = joint_factors(system, held, about, unit)
    if not size:
        raise NoFormulationError("all its joints are given")
    at = {one.q: one for joint in joints for one in joint.factors}
    owners = [(i, one) for i, joint in enumerate(joints) for one in joint.factors]
    loops = [_loop(system.model, owners, size, one) for one in equations.closed_frames]
    loops = [loop for loop in loops if loop.sides.any()]
    rows = equations.couplings
    linear = [_coupled(one, at, rows, about, size, unit) for one in rows]
    return GeneralFamily(joints, size, loops, linear, unit)


def _loop(
    model: pin.Model, owners: list[tuple[int, Factor]], size: int, frames: ClosedFrames
) -> Loop:
    sides = np.zeros(size)
    above = [set(model.supports[end.joint]) for end in (frames.a, frames.b)]
    for index, one in owners:
        sides[list(on_its_own(one))] = float(index in above[1]) - float(index in above[0])
    return Loop(frames, parts(frames.selected), sides)


def _coupled(
    row: CouplingRow,
    at: dict[int, Factor],
    rows: list[CouplingRow],
    about: Array,
    size: int,
    unit: float,
) -> Linear:
    """Return q_j - sum c_k q_k = offset, of turns by whole numbers that follow others, or slides.

    A turn that follows others by whole numbers leaves it open by how many turns they are written.
    """
    weights, constant = np.zeros(size), row.constant
    terms = [(row.idx_q, 1.0), *((one.idx_q, -one.coefficients[0]) for one in row.terms)]
    if not row.is_linear:
        raise NoFormulationError("a coupling is not linear")
    kinds = {type(at[q]) for q, _ in terms if q in at}
    for q, weight in terms:
        if q in at:
            weights[at[q].at] = weight
        else:
            constant -= weight * about[q]
    if kinds == {Slide}:
        return Linear(weights, constant / unit)
    used = sum(row.idx_q in (one.idx_q, *(term.idx_q for term in one.terms)) for one in rows)
    whole = bool((weights == np.round(weights)).all())
    if kinds != {Turn} or row.idx_q not in at or used > 1 or not whole:
        raise NoFormulationError("a coupling is not of turns by whole numbers")
    return Linear(weights, constant)


def _make_square(family: GeneralFamily, about: Array, rng: np.random.Generator) -> None:
    """Add equations for what is idle; refuse if there are not as many as unknowns then."""
    x, parameters = family.seeds(rng, 1)
    slopes = family.evaluated(x, parameters, np.zeros_like(parameters))[1][0]
    for one in family.factors:
        own = on_its_own(one)
        columns = slopes[:, list(own)]
        if _rank(columns) == one.size:
            continue
        weights, constant = np.zeros(family.size), 0.0
        if isinstance(one, Ball):
            if _rank(columns) < 3:
                raise NoFormulationError("a ball is left open")
            weights[list(own)] = rng.normal(size=4)
        else:
            weights[one.at] = 1.0
            constant = float(about[one.q]) / (family.unit if isinstance(one, Slide) else 1.0)
            if isinstance(one, Turn) and one.by_cosine:
                constant = math.atan2(about[one.q + 1], about[one.q])
        family.spins.append(Linear(weights, constant))
    x, parameters = family.seeds(rng, 1)
    slopes = family.evaluated(x, parameters, np.zeros_like(parameters))[1][0]
    if len(slopes) != family.size:
        raise NoFormulationError(f"its equations are {len(slopes)} for {family.size} unknowns")
    if _rank(slopes) < family.size:
        raise NoFormulationError("its equations depend on each other")


def _rank(matrix: ComplexArray) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.count_nonzero(values > RANK_TOLERANCE * max(1.0, values.max(initial=0.0))))
