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
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.closures import ClosedFrame, LoopClosure
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: Distances below this part of the characteristic length are none: files are rounded.
_NONE = 1e-9
_LEGS = 6


class SixLegs(NamedTuple):
    """A platform on six legs."""

    joint: int
    """Index of the platform's joint."""
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
    model, data = system.model, system.data
    pin.forwardKinematics(model, data, about)
    still = [True]
    for index in range(1, model.njoints):
        joint = model.joints[index]
        own = held[joint.idx_v : joint.idx_v + joint.nv]
        still.append(still[model.parents[index]] and bool(own.all()))
    free = [
        index
        for index in range(1, model.njoints)
        if "FreeFlyer" in model.joints[index].shortname() and not still[index]
    ]
    if len(free) != 1 or not still[model.parents[free[0]]]:
        raise NoFormulationError(f"it has {len(free)} free bodies")
    reader = _Reader(system, held, still, free[0])
    legs = [reader.leg(closure) for closure in system.equations.closures]
    if len(legs) != _LEGS:
        raise NoFormulationError(f"it has {len(legs)} legs, not six")
    moving = {i for i in range(1, model.njoints) if not held[_own(model, i)].all()}
    if rest := moving - reader.used - {free[0]}:
        raise NoFormulationError(f"joint {model.names[min(rest)]!r} belongs to no leg")
    base, platform, length = (np.array(one) for one in zip(*legs, strict=True))
    return SixLegs(free[0], base, platform, length)


def _own(model: pin.Model, index: int) -> slice:
    joint = model.joints[index]
    return slice(joint.idx_v, joint.idx_v + joint.nv)


class _Reader:
    """Reads legs in the configuration that the data is of."""

    def __init__(
        self, system: ConstraintSystem, held: Bools, still: list[bool], platform: int
    ) -> None:
        self._model, self._data, self._held = system.model, system.data, held
        self._still, self._platform = still, platform
        self._none = _NONE * system.equations.length
        self.used: set[int] = set()

    def leg(self, closure: object) -> tuple[Array, Array, float]:
        """Return the fixed point, the platform's point and the length of a closure's leg."""
        if not isinstance(closure, LoopClosure) or closure.kind not in ("spherical", "distance"):
            raise NoFormulationError("a closure is neither of kind 'spherical' nor 'distance'")
        ends = {}
        for end in closure.closed_frames(self._model):
            root, chain = self._chain(end.joint)
            ends[root] = end, chain
        if set(ends) != {0, self._platform}:
            raise NoFormulationError(f"{closure.name!r} does not join the platform to a fixed link")
        (fixed, chain), (moved, other) = ends[0], ends[self._platform]
        if closure.kind == "distance":
            if chain or other:
                raise NoFormulationError(f"{closure.name!r} has joints between platform and base")
            length = float(closure.distance or 0.0)
            return self._world(fixed), self._on_platform(self._world(moved)), length
        if bool(chain) == bool(other):
            raise NoFormulationError(f"{closure.name!r} has no leg, or joints at both of its sides")
        tip = self._world(fixed if chain else moved)
        centre = self._centre(chain or other, tip, closure.name)
        length = float(np.linalg.norm(tip - centre))
        self.used.update(chain or other)
        if chain:
            return centre, self._on_platform(self._world(moved)), length
        return self._world(fixed), self._on_platform(centre), length

    def _chain(self, joint: int) -> tuple[int, list[int]]:
        """Return what a joint hangs on, 0 or the platform, and the joints that move in between."""
        chain = []
        while not self._still[joint] and joint != self._platform:
            if not self._held[_own(self._model, joint)].all():
                chain.append(joint)
            joint = self._model.parents[joint]
        return (0 if self._still[joint] else joint), chain[::-1]

    def _world(self, end: ClosedFrame) -> Array:
        return np.asarray(end.at(self._data).translation)

    def _on_platform(self, point: Array) -> Array:
        return np.asarray(self._data.oMi[self._platform].actInv(point))

    def _centre(self, chain: list[int], tip: Array, name: str) -> Array:
        """Return the point about which a chain turns its tip."""
        if len(chain) == 1 and "Spherical" in self._model.joints[chain[0]].shortname():
            return np.asarray(self._data.oMi[chain[0]].translation)
        if len(chain) != 2:
            raise NoFormulationError(f"the leg of {name!r} is no universal joint or ball")
        (x, a), (y, b) = (self._axis(joint, name) for joint in chain)
        t = float((b - a) @ x)  # for axes at right angles, the points nearest to the other
        u = float((a - b) @ y)
        centre = a + t * x
        if abs(float(x @ y)) > _NONE or np.linalg.norm(centre - (b + u * y)) > self._none:
            raise NoFormulationError(f"the axes of the leg of {name!r} do not meet at right angles")
        if abs(float((tip - centre) @ y)) > self._none:
            raise NoFormulationError(f"the leg of {name!r} is not across its second axis")
        return np.asarray(centre)

    def _axis(self, index: int, name: str) -> tuple[Array, Array]:
        """Return the direction of a hinge in the world, and a point of it."""
        joint = self._model.joints[index]
        if joint.nv != 1:
            raise NoFormulationError(f"the leg of {name!r} is no universal joint or ball")
        description = joint.createData()
        joint.calc(description, pin.neutral(self._model))
        motion = np.asarray(description.S).reshape(6)
        if motion[:3].any():
            raise NoFormulationError(f"joint {self._model.names[index]!r} is not given, and slides")
        place = self._data.oMi[index]
        return np.asarray(place.rotation @ motion[3:]), np.asarray(place.translation)
