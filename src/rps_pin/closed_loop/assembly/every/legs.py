"""Six legs between a platform and what stands still, recognised in a mechanism.

A leg holds a point of the platform at a distance from a fixed point: a closure of kind
``distance``, or one of kind ``spherical`` with a chain of joints at one side that turns about a
point only. That is a ball, or two hinges whose axes meet at right angles, and a tip across the
second one (a universal joint). The joints with given values stand: a prismatic joint in the chain,
a crank below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.every.chains import Chains
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.closures import Closure, LoopClosure
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: Distances below this part of the characteristic length are none: files are rounded.
_NONE = 1e-9
_LEGS = 6


class SixLegs(NamedTuple):
    """A platform on six legs."""

    chains: Chains
    """Of the mechanism."""
    base: Array
    """Fixed points in the world, shape (6, 3), m."""
    platform: Array
    """Points of the platform in its joint's axes, shape (6, 3), m."""
    length: Array
    """Shape (6,), m."""


def six_legs(system: ConstraintSystem, held: Bools, about: Array) -> SixLegs:
    """Return the legs of a mechanism with given joint values.

    Parameters
    ----------
    system
        The system.
    held
        Which velocities stand, shape (nv,).
    about
        A configuration with the given values, shape (nq,).

    Raises
    ------
    NoFormulationError
        If it is another mechanism; says why.
    """
    chains = Chains(system, held, about)
    none = _NONE * system.equations.length
    legs = [_leg(chains, closure, none) for closure in system.equations.closures]
    if len(legs) != _LEGS:
        raise NoFormulationError(f"it has {len(legs)} legs, not six")
    chains.refuse_others()
    base, platform, length = (np.array(one) for one in zip(*legs, strict=True))
    return SixLegs(chains, base, platform, length)


def _leg(chains: Chains, closure: Closure, none: float) -> tuple[Array, Array, float]:
    """Return the fixed point, the platform's point and the length of a closure's leg."""
    if not isinstance(closure, LoopClosure) or closure.kind not in ("spherical", "distance"):
        raise NoFormulationError("a closure is neither of kind 'spherical' nor 'distance'")
    fixed, chain, moved, other = chains.between(closure)
    at_base, at_platform = chains.world(fixed), chains.world(moved)
    if closure.distance is not None:
        if chain or other:
            raise NoFormulationError(f"{closure.name!r} has joints between platform and base")
        return at_base, chains.on_platform(at_platform), closure.distance
    if bool(chain) == bool(other):
        raise NoFormulationError(f"{closure.name!r} has no leg, or joints at both of its sides")
    tip = at_base if chain else at_platform
    centre = _centre(chains, chain or other, tip, closure.name, none)
    length = float(np.linalg.norm(tip - centre))
    if chain:
        return centre, chains.on_platform(at_platform), length
    return at_base, chains.on_platform(centre), length


def _centre(chains: Chains, chain: list[int], tip: Array, name: str, none: float) -> Array:
    """Return the point about which a chain turns its tip."""
    if len(chain) == 1 and "Spherical" in chains.model.joints[chain[0]].shortname():
        return chains.origin(chain[0])
    if len(chain) != 2:
        raise NoFormulationError(f"the leg of {name!r} is no universal joint or ball")
    (x, a), (y, b) = ((chains.hinge(joint), chains.origin(joint)) for joint in chain)
    # Of axes at right angles, the points that are nearest to each other.
    centre, other = a + ((b - a) @ x) * x, b + ((a - b) @ y) * y
    if abs(float(x @ y)) > _NONE or np.linalg.norm(centre - other) > none:
        raise NoFormulationError(f"the axes of the leg of {name!r} do not meet at right angles")
    if abs(float((tip - centre) @ y)) > none:
        raise NoFormulationError(f"the leg of {name!r} is not across its second axis")
    return np.asarray(centre)
