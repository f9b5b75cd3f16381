"""Completing a partly given configuration, in the assembly mode of a guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.assembly.approach import approached
from rps_pin.closed_loop.assembly.closing import close, is_closed
from rps_pin.closed_loop.assembly.continuation import Followed, Path
from rps_pin.closed_loop.assembly.reach import far_frame
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import ClosureError, InputError, SingularityError
from rps_pin.validation import numbers, real_vector

#: How far outside a limit rounding error may leave a joint, rad or characteristic lengths.
AT_LIMIT = 1e-9
#: Values this near to those of the guess are its own, rad or characteristic lengths.
_SAME = 1e-13
#: Ways of this length, in characteristic lengths, are worth asking whether they leave all reach.
_LONG = 10.0
#: The last correction of an overdetermined configuration, characteristic lengths.
_NEAR = 1e-3


def complete(
    system: ConstraintSystem,
    values: Mapping[str, ArrayLike] | ArrayLike,
    guess: Array,
    *,
    within_limits: bool = True,
    jump: bool = False,
    restarts: int = 20,
) -> Array:
    """Return the closed configuration with given joint values; see `ClosedLoopModel.complete`."""
    named = by_name(system, values)
    given = system.velocity_indices(list(named), "to give a value")
    target = with_values(system, guess, named)
    if jump:
        return close(
            system, target, fixed=list(named), within_limits=within_limits, restarts=restarts
        )
    if within_limits:
        refuse_values_outside(system, target, named)
    start = _closed_start(system, guess, within_limits)
    if start is not guess:
        target = with_values(system, start, named)
    moved = np.abs(pin.difference(system.model, start, target) / system.column_scale)
    if moved.max(initial=0.0) <= _SAME * system.equations.length:
        return target
    long = within_limits and moved.max() > _LONG * system.equations.length
    far = far_frame(system, target) if long else None
    found = Path(system, given, start, target, far).follow()
    q = found.q
    if found.share < 1 and not found.consistent:
        q = _overdetermined(system, named, given, start, target)
    elif found.share < 1:
        _refuse(system, named, target, found, within_limits, start is guess, restarts)
    if not is_closed(system, q):
        q = close(system, q, fixed=list(named), within_limits=False, restarts=0)
    return _within_limits(system, q, named) if within_limits else q


def by_name(
    system: ConstraintSystem, values: Mapping[str, ArrayLike] | ArrayLike
) -> dict[str, ArrayLike]:
    """Return values by joint name; an array is that of the actuated joints."""
    if isinstance(values, Mapping):
        return dict(values)
    given = real_vector(values, len(system.actuated_names), "values")
    return dict(zip(system.actuated_names, given, strict=True))


def with_values(system: ConstraintSystem, q: Array, values: Mapping[str, ArrayLike]) -> Array:
    """Return a configuration in which joints have given values, shape (nq,)."""
    model, changed = system.model, q.copy()
    at = system.velocity_indices(list(values), "to give a value")
    coordinates = system.coordinates_of(at)
    each: list[Any] = list(values.values())
    plain = [x for x in each if isinstance(x, float) and isfinite(x)]
    if len(plain) == len(values) == coordinates.size and values.keys() <= system.joint_names:
        # Joints of one coordinate each: in one step.
        changed[coordinates[np.argsort(np.argsort(at))]] = plain
        return system.normalised(changed, "q_guess")
    for name, value in values.items():
        if not model.existJointName(name):
            raise InputError(f"{name!r} is a part of a joint: give all of its coordinates in q")
        joint = model.joints[model.getJointId(name)]
        what = f"the value of joint {name!r}"
        given = np.atleast_1d(numbers(value, what, f"{joint.nq} numbers"))
        changed[joint.idx_q : joint.idx_q + joint.nq] = real_vector(given, joint.nq, what)
    return system.normalised(changed, "q_guess")


def beyond_limits(system: ConstraintSystem, q: Array) -> Bools:
    """Return which limited coordinates are outside by more than rounding error, shape (n,)."""
    slack = AT_LIMIT * system.equations.length * system.column_scale[system.limits.v]
    return system.limits.beyond(q, slack)


# The ends of the path -----------------------------------------------------------------------------


def _closed_start(system: ConstraintSystem, guess: Array, within_limits: bool) -> Array:
    if is_closed(system, guess):
        return guess
    return close(system, guess, within_limits=within_limits)


def refuse_values_outside(
    system: ConstraintSystem, target: Array, names: Sequence[str] | Mapping[str, ArrayLike]
) -> None:
    """Raise `ClosureError` if a configuration has one of these joints outside its limits."""
    outside = system.limits.outside(target)
    if outside.keys() & set(names):
        phrases = ", ".join(outside[name] for name in names if name in outside)
        raise ClosureError(f"given joints are outside their limits: {phrases}", np.inf)


def _within_limits(system: ConstraintSystem, q: Array, given: Mapping[str, ArrayLike]) -> Array:
    """Return the configuration within the joint limits: angles may be turned by whole turns."""
    limits = system.limits
    x = q[limits.q]
    out = beyond_limits(system, q)
    out &= np.array([name not in given for name in limits.names], dtype=bool)
    if not out.any():
        return q
    turned = q.copy()
    for i in np.flatnonzero(out):
        turns = np.ceil((limits.lower[i] - x[i]) / (2 * np.pi))
        nearer = x[i] + 2 * np.pi * (
            turns if turns > 0 else np.floor((limits.upper[i] - x[i]) / (2 * np.pi))
        )
        angular = system.equations.angular_velocities[limits.v[i]]
        sprung = system.effects is not None and system.effects.stiffness[limits.v[i]] > 0
        if angular and not sprung and limits.lower[i] <= nearer <= limits.upper[i]:
            turned[limits.q[i]] = nearer
    outside = limits.outside(turned)
    beyond = [phrase for name, phrase in outside.items() if name not in given]
    still = [name for i, name in enumerate(limits.names) if out[i] and name in outside]
    if still or not is_closed(system, turned):
        raise ClosureError(
            "the configuration with these values in the assembly mode of the guess is outside "
            f"joint limits: {', '.join(beyond or list(limits.outside(q).values()))}; "
            "within_limits=False returns it",
            np.inf,
        )
    return turned


def _refuse(
    system: ConstraintSystem,
    named: Mapping[str, ArrayLike],
    target: Array,
    found: Followed,
    within_limits: bool,
    closed: bool,
    restarts: int,
) -> None:
    """Raise the error of a path that ends in a singularity."""
    if found.is_long:
        raise InputError(
            f"the way from the guess's values to those asked for is too long to be followed: "
            f"{found.share:.4%} of it was; take values nearer, such as angles less whole turns, "
            "lead there in parts, or take jump=True"
        )
    where = f"after {found.share:.4%} of the way from the guess's values to those asked for"
    if not closed:
        where = f"after the guess, which is open, was closed, and {where[6:]}"
    try:
        close(system, target, fixed=list(named), within_limits=within_limits, restarts=restarts)
    except ClosureError as error:
        raise ClosureError(
            f"no closed configuration with these values was found: {error}; {where} the assembly "
            "mode ends in a singularity",
            error.gap,
        ) from None
    met = (
        f"{where}, a singularity is met (condition number {found.condition:.3g} where the steps "
        "became too short to go on): configurations with these values exist, but the assembly mode "
        "of the guess does not lead to them on a straight line of the given coordinates"
    )
    if found.share == 0 and not found.condition <= system.max_condition:
        met = (
            f"the guess itself is singular (condition number {found.condition:.3g}): there is no "
            "way to tell to which of the configurations with these values it leads"
        )
    raise SingularityError(
        f"{met}. Take a guess nearer to them, lead there in parts, or take jump=True, which may "
        "change the assembly mode",
        found.condition,
        system.max_condition,
    )


# More values than motions -------------------------------------------------------------------------


def _overdetermined(
    system: ConstraintSystem,
    named: Mapping[str, ArrayLike],
    given: Indices,
    start: Array,
    target: Array,
) -> Array:
    """Return the configuration with more given values than there are motions."""
    q, left = approached(system, given, system.coordinates_of(given), start, target)
    wanted = with_values(system, q, named)
    try:
        ended = close(system, wanted, fixed=list(named), within_limits=False)
    except ClosureError as error:
        raise ClosureError(
            f"{given.size} values are given, more than there are motions, and no configuration "
            f"with all of them was found: {error}",
            error.gap,
        ) from None
    moved = np.abs(pin.difference(system.model, q, ended) / system.column_scale).max(initial=0.0)
    if moved > _NEAR * system.equations.length:
        raise ClosureError(
            f"{given.size} values are given, more than there are motions, and no motion from the "
            f"guess leads to all of them: {left:.3g} m are left where it comes nearest; "
            "configurations with these values exist elsewhere (jump=True)",
            left,
        )
    return ended
