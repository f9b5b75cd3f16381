"""When two configurations are the same: the links are in the same places.

Configurations are compared by the origins of all joints and closed frames, in the mechanism's size,
and by the rotations of all links. So it does not matter by how many turns an angle is written, nor
by which sign a quaternion. Frames can be chosen whose places alone count. Where an idle freedom
turns a link on the spot (`freedoms`), what it moves does not count.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.random_starts import mechanism_size
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: What moves less than this in an idle motion stands, in one unit.
_STANDS = 1e-6
_TURNED = 1e-9


class Sameness:
    """Places of a mechanism's links, and angles within a turn.

    Parameters
    ----------
    system
        The system.
    about
        A configuration, shape (nq,).
    frames
        Frames by whose places alone configurations are compared; all links if None.
    """

    def __init__(
        self, system: ConstraintSystem, about: Array, frames: Sequence[str] | None = None
    ) -> None:
        self._system, self._size = system, mechanism_size(system, about)
        model = system.model
        #: What is compared: points by their joint and where they are behind it; rotations by joint.
        self._points: list[tuple[int, Array]]
        self._turned: list[int] = list(range(1, model.njoints))
        self._points = [(joint, np.zeros(3)) for joint in self._turned]
        for closed in system.equations.closed_frames:
            self._points += [(one.joint, one.placement.translation) for one in (closed.a, closed.b)]
        self._turns = self._turning(about)
        if frames is not None:
            chosen = [model.frames[system.frame(name)] for name in frames]
            self._points = [(one.parentJoint, one.placement.translation) for one in chosen]
            self._turned = [one.parentJoint for one in chosen]

    def places(self, q: Array) -> Array:
        """Return the places of what is compared, shape (m,): points in sizes, and rotations."""
        data = self._system.data
        pin.forwardKinematics(self._system.model, data, q)
        points = [data.oMi[joint].act(point) / self._size for joint, point in self._points]
        turns = [data.oMi[joint].rotation.ravel() for joint in self._turned]
        return np.concatenate([np.zeros(0), *points, *turns])

    def leave_out(self, q: Array, motions: Array) -> None:
        """Leave out points and rotations that motions, (nv, k) in one unit, change at q."""
        system, world = self._system, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        model, data = system.model, system.data
        pin.computeJointJacobians(model, data, q)
        velocities = system.column_scale[:, None] * motions
        twists = [np.zeros((6, motions.shape[1]))] + [
            pin.getJointJacobian(model, data, i, world).reshape(6, model.nv) @ velocities
            for i in range(1, model.njoints)
        ]

        def point_stands(joint: int, point: Array) -> bool:
            lever = data.oMi[joint].rotation @ point
            return _stands(twists[joint][:3] - pin.skew(lever) @ twists[joint][3:])

        self._points = [one for one in self._points if point_stands(*one)]
        length = system.equations.length
        self._turned = [joint for joint in self._turned if _stands(length * twists[joint][3:])]

    # Turns ----------------------------------------------------------------------------------------

    def within_a_turn(self, q: Array, held: Bools) -> Array:
        """Return the same configuration with angles within a turn, and quaternions of one sign.

        Within the joint's limits where one of its turns is; else from -pi to pi. Coordinates that
        are held, (nv,), and angles whose turns count (of screws, and of coupled joints) stay.
        """
        limits, model, same = self._system.limits, self._system.model, q.copy()
        free = self._turns & ~held[limits.v]
        at, lower, upper = limits.q[free], limits.lower[free], limits.upper[free]
        narrow = upper / 2 - lower / 2 < np.pi
        with np.errstate(invalid="ignore"):  # infinite limits
            first = np.clip(-np.pi, lower, upper - 2 * np.pi)
            first = np.where(narrow, lower / 2 + upper / 2 - np.pi, first)
        same[at] = first + np.mod(q[at] - first, 2 * np.pi)
        for joint in list(model.joints)[1:]:
            if joint.nq - joint.nv == 1 and joint.nv in (3, 6) and joint.nq in (4, 7):
                last = joint.idx_q + joint.nq - 1
                is_planar = "Planar" in joint.shortname()
                if same[last] < 0 and not is_planar:
                    same[last - 3 : last + 1] *= -1
        return same

    def _turning(self, about: Array) -> Bools:
        """Return which limited coordinates are angles that a turn leaves as they are."""
        system, limits = self._system, self._system.limits
        places, gaps = self.places(about), system.equations.gaps(about)
        turning = np.zeros(limits.q.size, dtype=bool)
        for k, (i, j) in enumerate(zip(limits.q, limits.v, strict=True)):
            if not system.equations.angular_velocities[j]:
                continue
            turned = about.copy()
            turned[i] += 2 * np.pi
            change = np.abs(self.places(turned) - places).max(initial=0.0)
            opened = np.abs(system.row_scale * (system.equations.gaps(turned) - gaps))
            closed = opened.max(initial=0.0) <= _TURNED * system.equations.length
            turning[k] = change <= _TURNED and closed
        return turning


def _stands(speeds: Array) -> bool:
    return float(np.abs(speeds).max(initial=0.0)) <= _STANDS
