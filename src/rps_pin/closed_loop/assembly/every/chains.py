"""A free platform, and the chains of joints that closures hold it by, with given joint values."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.closures import ClosedFrame, LoopClosure
from rps_pin.closed_loop.constraints.system import ConstraintSystem


class Chains:
    """Chains of a mechanism with one free body.

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
        If not one body is free, by a free-flyer on what stands.
    """

    def __init__(self, system: ConstraintSystem, held: Bools, about: Array) -> None:
        self.model, self._data = system.model, system.data
        pin.forwardKinematics(self.model, self._data, about)
        self._held, self._still = held, [True]
        for index in range(1, self.model.njoints):
            parent = self.model.parents[index]
            self._still.append(self._still[parent] and not self.moves(index))
        free = [
            index
            for index in range(1, self.model.njoints)
            if "FreeFlyer" in self.model.joints[index].shortname() and not self._still[index]
        ]
        if len(free) != 1 or not self._still[self.model.parents[free[0]]]:
            raise NoFormulationError(f"it has {len(free)} free bodies")
        self.platform = free[0]
        self.used = {self.platform}

    def moves(self, index: int) -> bool:
        """Return whether a joint moves."""
        joint = self.model.joints[index]
        return not self._held[joint.idx_v : joint.idx_v + joint.nv].all()

    def between(
        self, closure: LoopClosure
    ) -> tuple[ClosedFrame, list[int], ClosedFrame, list[int]]:
        """Return both frames of a closure, each with the joints that move below it.

        First that at the base's side, then that at the platform's.
        """
        ends = {}
        for end in closure.closed_frames(self.model):
            joint, chain = end.joint, []
            while not self._still[joint] and joint != self.platform:
                if self.moves(joint):
                    chain.append(joint)
                joint = self.model.parents[joint]
            ends[0 if self._still[joint] else joint] = end, chain[::-1]
        if set(ends) != {0, self.platform}:
            raise NoFormulationError(f"{closure.name!r} does not join the platform to a fixed link")
        self.used.update(ends[0][1], ends[self.platform][1])
        return *ends[0], *ends[self.platform]

    def refuse_others(self) -> None:
        """Refuse joints that move and belong to no chain that was asked for."""
        moving = {i for i in range(1, self.model.njoints) if self.moves(i)}
        if rest := moving - self.used:
            raise NoFormulationError(f"joint {self.model.names[min(rest)]!r} belongs to no leg")

    def world(self, end: ClosedFrame) -> Array:
        """Return where a closed frame is, shape (3,), m."""
        return np.asarray(end.at(self._data).translation)

    def on_platform(self, point: Array) -> Array:
        """Return a point in the axes of the platform's joint, shape (3,), m."""
        return np.asarray(self._data.oMi[self.platform].actInv(point))

    def origin(self, index: int) -> Array:
        """Return a joint's origin, shape (3,), m."""
        return np.asarray(self._data.oMi[index].translation)

    def hinge(self, index: int) -> Array:
        """Return a hinge's direction in the world, shape (3,)."""
        joint, name = self.model.joints[index], self.model.names[index]
        if joint.nv != 1:
            raise NoFormulationError(f"joint {name!r} is no hinge")
        description = joint.createData()
        joint.calc(description, pin.neutral(self.model))
        motion = np.asarray(description.S).reshape(6)
        if motion[:3].any():
            raise NoFormulationError(f"joint {name!r} is not given, and slides")
        return np.asarray(self._data.oMi[index].rotation @ motion[3:])

    def placed(self, about: Array, turn: Array, position: Array) -> Array:
        """Return a configuration with the platform's joint at a rotation and a position, (nq,)."""
        below = self._data.oMi[self.model.parents[self.platform]]
        below = below * self.model.jointPlacements[self.platform]
        q, joint = about.copy(), self.model.joints[self.platform]
        place = below.actInv(pin.SE3(turn, position))
        q[joint.idx_q : joint.idx_q + joint.nq] = pin.SE3ToXYZQUAT(place)
        return q
