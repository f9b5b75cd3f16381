"""Passive joint forces: viscous damping, dry friction, springs.

They resist the motion with the generalised force

    e(q, v) = d v + f tanh(v / v_s) + k (q - q_0),

which adds to what `rnea` returns. Dry friction is smooth: it reaches 76 % of f at the speed v_s,
and creeps below it instead of sticking. Rotor inertia is not a passive force: set
``model.armature``, which Pinocchio's algorithms include.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.closures import joint_id
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.elementary import Number, tanh
from rps_pin.validation import positive_number, read_only, real_vector

#: rad/s or m/s.
FRICTION_SPEED = 1e-2


def friction_force(
    speed: Number, damping: Number, friction: Number, friction_speed: Number
) -> Number:
    """Return d v + f tanh(v / v_s): viscous damping and dry friction, N or N m."""
    return damping * speed + friction * tanh(speed / friction_speed)


def friction_slope(
    speed: Number, damping: Number, friction: Number, friction_speed: Number
) -> Number:
    """Return the derivative of `friction_force` by the speed."""
    share = tanh(speed / friction_speed)
    return damping + friction / friction_speed * (1.0 - share * share)


@dataclass(frozen=True, eq=False)
class JointEffects:
    """Damping, friction and springs of a model's joints; see the module's text.

    Parameters
    ----------
    damping
        d, shape (nv,), N m s/rad or N s/m; not negative.
    friction
        f, shape (nv,), N m or N; not negative.
    stiffness
        k, shape (nv,), N m/rad or N/m; not negative, and zero but for joints of one coordinate.
    rest
        q_0, shape (nv,), rad or m.
    friction_speed
        v_s, rad/s or m/s; positive.

    Raises
    ------
    InputError
        If a number breaks these rules.
    """

    damping: Array
    friction: Array
    stiffness: Array
    rest: Array
    friction_speed: float = FRICTION_SPEED

    def __post_init__(self) -> None:
        size = np.size(self.damping)
        for name in ("damping", "friction", "stiffness", "rest"):
            array = real_vector(getattr(self, name), size, name)
            if name != "rest" and (array < 0).any():
                raise InputError(f"{name} must not be negative: entry {int(array.argmin())} is")
            object.__setattr__(self, name, read_only(array))
        positive_number(self.friction_speed, "friction_speed", "rad/s or m/s")

    @classmethod
    def named(
        cls,
        model: pin.Model,
        *,
        damping: Mapping[str, ArrayLike] | None = None,
        friction: Mapping[str, ArrayLike] | None = None,
        stiffness: Mapping[str, float] | None = None,
        rest: Mapping[str, float] | None = None,
        friction_speed: float = FRICTION_SPEED,
    ) -> JointEffects:
        """Return effects given by joint names; joints not named have none.

        Parameters
        ----------
        model
            The tree with these joints.
        damping, friction
            A number for all of a joint's velocities, or one for each.
        stiffness, rest
            Of joints of one coordinate.
        friction_speed
            As for the class.

        Raises
        ------
        MechanismError
            If there is no such joint (lists those there are), or a spring is put on a joint of
            several coordinates.
        """
        given = {"damping": damping, "friction": friction, "stiffness": stiffness, "rest": rest}
        arrays = {what: by_joint(model, values or {}, what) for what, values in given.items()}
        return cls(**arrays, friction_speed=friction_speed)

    def force(self, q: Array, v: Array, q_of_v: Indices) -> Array:
        """Return e(q, v), shape (nv,); `q_of_v` from `coordinate_indices`."""
        resisting = friction_force(v, self.damping, self.friction, self.friction_speed)
        return np.asarray(resisting + self.springs(q, q_of_v))

    def springs(self, q: Array, q_of_v: Indices) -> Array:
        """Return the springs' part of e(q, v), shape (nv,)."""
        return self.stiffness * (q[q_of_v] - self.rest)

    def slopes(self, v: Array) -> tuple[Array, Array]:
        """Return the derivatives of e with respect to q and v, both diagonal, shapes (nv,)."""
        return self.stiffness, friction_slope(v, self.damping, self.friction, self.friction_speed)

    def energy(self, q: Array, q_of_v: Indices) -> float:
        """Return the energy of the springs, k (q - q_0)^2 / 2, J."""
        return float(self.stiffness @ (q[q_of_v] - self.rest) ** 2) / 2


def coordinate_indices(model: pin.Model) -> Indices:
    """Return, for each velocity, the index of its coordinate in q.

    Joints with more coordinates than velocities (balls, free-flyers, unbounded turns) have none:
    their entries are those of the joint's first coordinate, and mean nothing.
    """
    indices = np.zeros(model.nv, dtype=np.intp)
    for joint in list(model.joints)[1:]:
        offsets = np.arange(joint.nv) if joint.nq == joint.nv else np.zeros(joint.nv, np.intp)
        indices[joint.idx_v : joint.idx_v + joint.nv] = joint.idx_q + offsets
    return indices


def refuse_springs(model: pin.Model, effects: JointEffects) -> None:
    """Raise `MechanismError` if a spring acts on a joint of several coordinates."""
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        stiffness = effects.stiffness[joint.idx_v : joint.idx_v + joint.nv]
        if stiffness.any() and not joint.nq == joint.nv == 1:
            raise MechanismError(f"stiffness: joint {name!r} has {joint.nq} coordinates, not one")


def by_joint(model: pin.Model, values: Mapping[str, ArrayLike], what: str) -> Array:
    """Return values given by joint names as an array of shape (nv,), zero where none is given."""
    array = np.zeros(model.nv)
    for name, value in values.items():
        joint = model.joints[joint_id(model, name, what)]
        if what in ("stiffness", "rest") and not joint.nq == joint.nv == 1:
            raise MechanismError(f"{what}: joint {name!r} has {joint.nq} coordinates, not one")
        try:
            array[joint.idx_v : joint.idx_v + joint.nv] = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise MechanismError(
                f"{what} of joint {name!r} = {value!r}: it must be one number, or {joint.nv}"
            ) from None
    return array
