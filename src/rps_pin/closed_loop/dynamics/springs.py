"""Springs of joints: their forces, energy and slopes.

With stiffness k and stretch s they resist with the generalised force k s and hold k |s|^2 / 2:

==============================  ====================================================  ============
joint                           stretch                                               rest q_0
==============================  ====================================================  ============
a rate for each coordinate      q - q_0                                               coordinates
ball                            log(R_0' R), the rotation vector from rest            log R_0
free-flyer                      R' (p - p_0) of its origin, log(R_0' R) of its turn   p_0, log R_0
==============================  ====================================================  ============

The force of a turn's spring is along its rotation vector, about which the turn from rest is: the
stiffness is one number. It is of at most half a turn, where its direction, and the force, jump to
the opposite. This is what MuJoCo's springs do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.errors import MechanismError, shown


class TurnSpring(NamedTuple):
    """The spring of a ball, or of the turn of a free-flyer."""

    idx_v: int
    """Where its three velocities start."""
    idx_q: int
    """Where its quaternion starts, (x, y, z, w)."""
    stiffness: float
    rest: pin.Quaternion

    def stretch(self, q: Array) -> Array:
        """Return log(R_0' R), shape (3,), rad."""
        turn = self.rest.conjugate() * _quaternion(q, self.idx_q)
        if turn.w < 0:  # the same rotation, by less than half a turn
            turn = pin.Quaternion(-turn.coeffs())
        return np.asarray(pin.log3(turn))


class ShiftSpring(NamedTuple):
    """The spring of a free-flyer's origin."""

    idx_v: int
    idx_q: int
    stiffness: float
    rest: Array
    """p_0, shape (3,), m."""

    def stretch(self, q: Array) -> Array:
        """Return R' (p - p_0), shape (3,), m."""
        turn = _quaternion(q, self.idx_q + 3).toRotationMatrix()
        return np.asarray(turn.T @ (q[self.idx_q : self.idx_q + 3] - self.rest))


class Springs:
    """The springs of a model's joints.

    Parameters
    ----------
    model
        The tree.
    effects
        Their `stiffness` and `rest`.

    Attributes
    ----------
    stiffness : array
        k, shape (nv,).
    turns, shifts : lists of TurnSpring and ShiftSpring
        Those that are not of single coordinates.
    single : list of (int, int)
        Velocity and coordinate of the others.

    Raises
    ------
    MechanismError
        If a spring is on a joint that can have none, or a turn has several stiffnesses.
    """

    def __init__(self, model: pin.Model, effects: JointEffects) -> None:
        self.stiffness = effects.stiffness
        self.turns: list[TurnSpring] = []
        self.shifts: list[ShiftSpring] = []
        self.single: list[tuple[int, int]] = []
        self._coordinates: Indices = np.zeros(model.nv, dtype=np.intp)
        self.rest = np.array(effects.rest)
        for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
            own = slice(joint.idx_v, joint.idx_v + joint.nv)
            if not self.stiffness[own].any():
                continue
            refuse_spring(name, joint)
            if joint.nq == joint.nv:
                coordinates = range(joint.idx_q, joint.idx_q + joint.nq)
                self._coordinates[own] = coordinates
                self.single += zip(range(own.start, own.stop), coordinates, strict=True)
            else:
                self._add(name, joint)

    def _add(self, name: str, joint: pin.JointModel) -> None:
        """Add the springs of a ball or a free-flyer."""
        start, at = joint.idx_v, joint.idx_q
        if joint.nv == 6:
            stiffness = self._only(name, start, "shifts")
            if stiffness:
                rest = self.rest[start : start + 3].copy()
                self.shifts.append(ShiftSpring(start, at, stiffness, rest))
            start, at = start + 3, at + 3
        stiffness = self._only(name, start, "turns")
        if stiffness:
            turn = pin.Quaternion(pin.exp3(self.rest[start : start + 3]))
            self.turns.append(TurnSpring(start, at, stiffness, turn))

    def _only(self, name: str, start: int, what: str) -> float:
        values = self.stiffness[start : start + 3]
        if np.ptp(values) > 0:
            raise MechanismError(
                f"stiffness of joint {name!r} = {shown(values.tolist())}: the {what} of a joint "
                "have one stiffness"
            )
        return float(values[0])

    def stretch(self, q: Array) -> Array:
        """Return s at q (nq,), shape (nv,), m or rad; what has no spring counts for nothing."""
        found: Array = q[self._coordinates] - self.rest
        for turn in self.turns:
            found[turn.idx_v : turn.idx_v + 3] = turn.stretch(q)
        for shift in self.shifts:
            found[shift.idx_v : shift.idx_v + 3] = shift.stretch(q)
        return found

    def force(self, q: Array) -> Array:
        """Return the generalised force with which they resist at q (nq,), shape (nv,)."""
        return self.stiffness * self.stretch(q)

    def energy(self, q: Array) -> float:
        """Return the energy that they hold at q (nq,), J."""
        return float(self.stiffness @ self.stretch(q) ** 2) / 2

    def slope(self, q: Array) -> Array:
        """Return the derivative of the force along the tangent at q (nq,), shape (nv, nv)."""
        found = np.diag(self.stiffness)
        for turn in self.turns:
            own = slice(turn.idx_v, turn.idx_v + 3)
            found[own, own] = turn.stiffness * pin.Jlog3(pin.exp3(turn.stretch(q)))
        for shift in self.shifts:
            own, turns = (slice(shift.idx_v + k, shift.idx_v + k + 3) for k in (0, 3))
            found[own, turns] = shift.stiffness * pin.skew(shift.stretch(q))
        return found


def refuse_spring(name: str, joint: pin.JointModel) -> None:
    """Raise `MechanismError` if a joint can have no spring."""
    if joint.nq != joint.nv and joint.shortname().removeprefix("JointModel") not in (
        "Spherical",
        "FreeFlyer",
    ):
        raise MechanismError(
            f"stiffness: joint {name!r} ({joint.shortname()}) has {joint.nq} coordinates for "
            f"{joint.nv} velocities; springs are of joints with a coordinate for each velocity, of "
            "balls and of free-flyers"
        )


def _quaternion(q: Array, start: int) -> pin.Quaternion:
    return pin.Quaternion(q[start : start + 4])
