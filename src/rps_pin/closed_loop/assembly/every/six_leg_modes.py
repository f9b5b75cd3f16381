"""All poses of a platform on six legs, as guesses of its mechanism's modes."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.every.legs import SixLegs, six_legs
from rps_pin.closed_loop.assembly.every.solutions import Solutions
from rps_pin.closed_loop.assembly.every.study import (
    GENERAL,
    Legs,
    poses_of,
    proven,
    real_ones,
)
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.homotopy.krawczyk import all_distinct
from rps_pin.numerics.intervals import Interval


def six_leg_solutions(system: ConstraintSystem, held: Bools, about: Array) -> Solutions:
    """Return all poses of a platform on six legs.

    Raises
    ------
    NoFormulationError
        If the mechanism is no such platform; says why.
    """
    found = six_legs(system, held, about)
    centre, unit = found.base.mean(axis=0), _unit(found)
    base, platform, length = (
        (found.base - centre) / unit,
        found.platform / unit,
        found.length / unit,
    )
    legs = Legs(*(one.astype(np.complex128) for one in (base, platform, length**2)))
    poses = poses_of(legs)
    x = real_ones(poses)
    exact = Legs(Interval(base), Interval(platform), Interval(length).square())
    boxes = proven(exact, x, np.random.default_rng(0))
    regular = len(poses)
    guesses = np.array([_with_pose(found, about, one, centre, unit) for one in x])
    joint = system.model.joints[found.chains.platform]
    solved = np.zeros(system.model.nv, dtype=bool)
    solved[joint.idx_v : joint.idx_v + joint.nv] = True
    return Solutions(
        guesses.reshape(len(x), system.model.nq),
        solved,
        all_distinct(boxes),
        regular,
        GENERAL,
        GENERAL - regular,
        _known(regular),
    )


def _known(regular: int) -> str:
    if regular == GENERAL:
        return f"{GENERAL} is the most that six legs can have (Ronga and Vust, 1992): all are found"
    return (
        f"six legs have {GENERAL} at most; the paths from the {GENERAL} of a general platform lead "
        "to all regular ones, with probability one"
    )


def _unit(found: SixLegs) -> float:
    """Return a power of two near the platform's size, by which numbers divide exactly."""
    size = max(float(np.abs(found.length).max()), float(np.abs(found.platform).max()))
    return 2.0 ** round(math.log2(size))


def _with_pose(found: SixLegs, about: Array, x: Array, centre: Array, unit: float) -> Array:
    """Return the configuration with the platform at Study coordinates, shape (nq,)."""
    e, f = x[:4], x[4:]
    # p = 2 vec(f e*) / e.e
    p = 2 * (e[3] * f[:3] - f[3] * e[:3] + np.cross(e[:3], f[:3])) / (e @ e)
    turn = pin.Quaternion(e / np.linalg.norm(e)).toRotationMatrix()
    return found.chains.placed(about, turn, centre + unit * p)
