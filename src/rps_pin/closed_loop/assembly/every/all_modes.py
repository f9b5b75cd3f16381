"""All assembly modes of a mechanism: solutions of its closures as polynomials, closed to rounding.

A formulation gives all solutions over the complex numbers and says which are real. The joints that
it solves for are set; the others close with these held, then all joints that are not given are
closed to rounding together.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.closing import close, close_gaps, is_closed
from rps_pin.closed_loop.assembly.completion import beyond_limits
from rps_pin.closed_loop.assembly.every.conditions import conditions, values_at
from rps_pin.closed_loop.assembly.every.found_modes import FoundModes
from rps_pin.closed_loop.assembly.every.general.modes import general_solutions
from rps_pin.closed_loop.assembly.every.planar_modes import planar_solutions
from rps_pin.closed_loop.assembly.every.six_leg_modes import six_leg_solutions
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError, Solutions
from rps_pin.closed_loop.assembly.every.three_tips import three_tip_solutions
from rps_pin.closed_loop.assembly.sameness import Sameness
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import ClosureError

_FORMULATIONS = {
    "platform on six legs": six_leg_solutions,
    "platform on three tips": three_tip_solutions,
    "planar mechanism": planar_solutions,
}
#: Modes whose places differ by less are one.
_SAME = 1e-7
#: Of closing legs within their limits.
_RESTARTS = 1


def every_mode(
    system: ConstraintSystem,
    about: Array,
    held: Bools,
    same: Sameness,
    within_limits: bool,
    longest: float = np.inf,
    progress: Callable[[float], None] | None = None,
) -> FoundModes:
    """Return all assembly modes; see `ClosedLoopModel.assembly_modes` with ``method="all"``.

    Parameters
    ----------
    system
        The system.
    about
        A configuration with the given values, shape (nq,).
    held
        Velocities of joints that are given or that no closure moves, shape (nv,).
    same
        By what modes are told apart.
    within_limits
        Whether the modes must lie within the joint limits.
    longest
        Time for loops in the parameters, s; see `general_solutions`.
    progress
        Called with the share of these loops that is done.
    """
    solutions = _solutions(system, held, about, longest, progress)
    modes: list[Array] = []
    places: list[Array] = []
    certified: list[bool] = []
    outside = 0
    for guess, proven in zip(solutions.guesses, solutions.certified, strict=True):
        q = _closed(system, guess, held, solutions, within_limits)
        q = same.within_a_turn(q, held)
        place = same.places(q)
        if any(np.abs(place - other).max(initial=0.0) <= _SAME for other in places):
            continue
        if within_limits and beyond_limits(system, q).any():
            outside += 1
            continue
        modes.append(q)
        places.append(place)
        certified.append(bool(proven))
    apart = [np.linalg.norm(place - same.places(about)) for place in places]
    order = np.argsort(apart, kind="stable")
    q = np.array(modes).reshape(-1, system.model.nq)[order]
    return FoundModes(
        q,
        np.zeros(len(q), dtype=np.intp),
        conditions(system, [values_at(system, one, held) for one in q]),
        starts=0,
        closed=0,
        outside=outside,
        expected=float(len(q) + outside),
        stopped="paths",
        complex_count=solutions.complex_count,
        paths=solutions.paths,
        singular=solutions.singular,
        known=solutions.known,
        certified=np.array(certified, dtype=bool)[order],
    )


def _solutions(
    system: ConstraintSystem,
    held: Bools,
    about: Array,
    longest: float,
    progress: Callable[[float], None] | None,
) -> Solutions:
    """Return those of the first formulation that the mechanism is of."""
    refusals = []
    for kind, formulation in _FORMULATIONS.items():
        try:
            return formulation(system, held, about)
        except NoFormulationError as refusal:
            refusals.append(f"it is no {kind} ({refusal})")
    try:
        return general_solutions(system, held, about, longest, progress)
    except NoFormulationError as refusal:
        refusals.append(f"its closures are not followed in general ({refusal})")
    raise NoFormulationError(" and ".join(refusals))


def _closed(
    system: ConstraintSystem, guess: Array, held: Bools, solutions: Solutions, within_limits: bool
) -> Array:
    """Return the closed configuration of a solution; within the limits if there is one."""
    fixed = held | solutions.solved
    q = close_gaps(system, close_gaps(system, guess, fixed, False), held, False)
    if not is_closed(system, q):
        gap = system.equations.largest_gap(system.equations.gaps(q))
        raise ClosureError("the links of a pose that was found do not close", gap)
    if not within_limits or fixed.all() or not beyond_limits(system, q).any():
        return q
    joints = list(system.model.names)[1:]
    names = [name for name in joints if fixed[_own(system, name)].all()]
    try:  # legs may close within the limits too
        return close_gaps(system, close(system, q, fixed=names, restarts=_RESTARTS), held, False)
    except ClosureError:
        return q


def _own(system: ConstraintSystem, name: str) -> slice:
    joint = system.model.joints[system.model.getJointId(name)]
    return slice(joint.idx_v, joint.idx_v + joint.nv)
