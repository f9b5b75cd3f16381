"""The regressor of a mechanism with closed loops: actuators' forces are linear in its parameters.

With Y the open tree's regressor (rnea(q, v, a) = Y pi), E the columns of friction, springs and
rotors, and T the motions that keep the loops closed (v = T v_a, T = 1 on the actuated rows),

    tau = T' (Y pi + E e) = W(q, v, a) p,     p = (pi, e).

=================  ===  ===========================================================================
group              np   generalised force of the joint, and parameter
=================  ===  ===========================================================================
inertia:JOINT      10   of the joint's body: mass, first moment, inertia about the joint's origin,
                        in its axes (kg, kg m, kg m^2), as in generated code
damping:JOINT      1    d v, d in N s/m or N m s/rad
friction:JOINT     1    f tanh(v / v_s), f in N or N m; v_s is the description's `friction_speed`
stiffness:JOINT    1    k (q - q_0), k in N/m or N m/rad; q_0 is the description's
armature:JOINT     1    I_r a, I_r in kg or kg m^2
offset:JOINT       1    a constant, N or N m
=================  ===  ===========================================================================

Source of the tree's part: Pinocchio's ``computeJointTorqueRegressor``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop import ClosedLoopModel, JointEffects
from rps_pin.closed_loop.dynamics.passive_joint_forces import friction_force
from rps_pin.errors import InputError, MechanismError, did_you_mean

#: Parts of a body, in the order of `pinocchio.Inertia.toDynamicParameters`.
BODY = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: Effects of joints, by group.
EFFECTS = ("damping", "friction", "stiffness", "armature", "offset")


class Columns:
    """All parameters of a mechanism's dynamics, those that are estimated among them.

    Parameters
    ----------
    mechanism
        The mechanism as it is believed to be.
    estimated
        Groups that are estimated; the others, as far as the mechanism has them, are known.

    Attributes
    ----------
    labels : tuple of str
        ``inertia:JOINT.mass``, ..., ``damping:JOINT``.
    nominal : array
        The believed parameters, shape (p,).
    free : array
        Which are estimated, shape (p,).

    Raises
    ------
    InputError
        If a group is unknown or named twice.
    MechanismError
        If a spring is asked for at a joint without one coordinate.
    """

    def __init__(self, mechanism: ClosedLoopModel, estimated: Sequence[str]) -> None:
        self._model: pin.Model = mechanism.model
        self._data = self._model.createData()
        self._actuated = mechanism.actuated_indices
        effects = mechanism.effects or JointEffects.named(self._model)
        self._effects = effects
        model = self._model
        self._joints = list(zip(list(model.names)[1:], list(model.joints)[1:], strict=True))
        wanted = self._groups(estimated)
        labels = [f"inertia:{name}.{part}" for name, _ in self._joints for part in BODY]
        bodies = [model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)]
        nominal = [float(one) for body in bodies for one in body]
        free = [f"inertia:{name}" in wanted for name, _ in self._joints for _ in BODY]
        self._of_joints: list[tuple[str, Any]] = []
        for kind in EFFECTS:
            own = self._own(kind)
            for name, joint in self._joints:
                value = own[joint.idx_v : joint.idx_v + joint.nv]
                asked = f"{kind}:{name}" in wanted
                if not asked and not value.any():
                    continue
                if kind == "stiffness" and joint.nq != joint.nv:
                    raise MechanismError(
                        f"stiffness of joint {name!r}: springs are identified at joints with a "
                        "coordinate for each velocity"
                    )
                if np.ptp(value) > 0:
                    raise MechanismError(
                        f"{kind} of joint {name!r} = {value.tolist()}: of a joint with several "
                        "velocities one number is identified, the same for all"
                    )
                labels.append(f"{kind}:{name}")
                nominal.append(float(value[0]))
                free.append(asked)
                self._of_joints.append((kind, joint))
        self.labels = tuple(labels)
        self.nominal: Array = np.array(nominal)
        self.free: Bools = np.array(free, dtype=np.bool_)

    def _own(self, kind: str) -> Array:
        """Return what the mechanism has of an effect, shape (nv,)."""
        if kind == "armature":
            return np.array(self._model.armature)
        if kind == "offset":
            return np.zeros(self._model.nv)
        return np.asarray(getattr(self._effects, kind))

    def _groups(self, given: Sequence[str]) -> set[str]:
        kinds = ("inertia", *EFFECTS)
        possible = [f"{kind}:{name}" for kind in kinds for name, _ in self._joints]
        for group in given:
            if group not in possible:
                kind = str(group).partition(":")[0]
                same = [one for one in possible if one.startswith(f"{kind}:")]
                raise InputError(
                    f"no parameters {group!r}{did_you_mean(str(group), possible)}; there are: "
                    f"{', '.join(same or [f'{one}:JOINT' for one in kinds])}"
                )
            if list(given).count(group) > 1:
                raise InputError(f"parameters {group!r} are named twice; name them once")
        return set(given)

    def rows(self, q: Array, v: Array, a: Array, basis: Array) -> Array:
        """Return W at states (n, nq), (n, nv), (n, nv), shape (n, na, p).

        Parameters
        ----------
        q, v, a
            Closed states.
        basis
            T of each, shape (n, nv, na).
        """
        bodies = 10 * len(self._joints)
        found = np.empty((len(q), self._actuated.size, self.nominal.size))
        for k in range(len(q)):
            tree = pin.computeJointTorqueRegressor(self._model, self._data, q[k], v[k], a[k])
            found[k, :, :bodies] = basis[k].T @ tree
        for j, (kind, joint) in enumerate(self._of_joints):
            own = slice(joint.idx_v, joint.idx_v + joint.nv)
            force = self._force(kind, joint, q, v, a)
            found[:, :, bodies + j] = np.einsum("nia,ni->na", basis[:, own], force)
        return found

    def _force(self, kind: str, joint: Any, q: Array, v: Array, a: Array) -> Array:
        """Return the generalised force of a joint's effect of size 1, (n, nv of the joint)."""
        own = slice(joint.idx_v, joint.idx_v + joint.nv)
        if kind == "damping":
            return v[:, own]
        if kind == "friction":
            return np.asarray(friction_force(v[:, own], 0.0, 1.0, self._effects.friction_speed))
        if kind == "stiffness":
            rest = self._effects.rest[own]
            return np.asarray(q[:, joint.idx_q : joint.idx_q + joint.nq] - rest)
        if kind == "armature":
            return a[:, own]
        return np.ones((len(q), joint.nv))
