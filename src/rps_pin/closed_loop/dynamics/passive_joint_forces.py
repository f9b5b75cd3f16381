"""Passive joint forces: viscous damping, dry friction, springs.

They resist the motion with the generalised force

    e(q, v) = d v + f tanh(v / v_s) + k s(q),

which adds to what `rnea` returns. The stretch s of a spring is q - q_0, or the turn from rest of a
ball; see `springs`. Dry friction is smooth: it reaches 76 % of f at the speed v_s,
and creeps below it instead of sticking. Rotor inertia is not a passive force: set
``model.armature``, which Pinocchio's algorithms include.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import joint_id
from rps_pin.errors import InputError, MechanismError, shown
from rps_pin.numerics.elementary import Number, tanh
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import numbers, positive_number, read_only, real_vector

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


@refuses_other_kinds
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
        k, shape (nv,), N m/rad or N/m; not negative. The turns of a ball, and the turns and the
        shifts of a free-flyer, have one.
    rest
        Where springs are at rest, shape (nv,), rad or m: coordinates; of a ball its rotation
        vector; of a free-flyer its position, then its rotation vector.
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
        stiffness: Mapping[str, ArrayLike] | None = None,
        rest: Mapping[str, ArrayLike] | None = None,
        friction_speed: float = FRICTION_SPEED,
    ) -> JointEffects:
        """Return effects given by joint names; joints not named have none.

        Parameters
        ----------
        model
            The tree with these joints.
        damping, friction, stiffness, rest
            A number for all of a joint's velocities, or one for each.
        friction_speed
            As for the class.

        Raises
        ------
        MechanismError
            If there is no such joint (lists those there are), or not as many numbers.
        """
        given = {"damping": damping, "friction": friction, "stiffness": stiffness, "rest": rest}
        arrays = {what: by_joint(model, values or {}, what) for what, values in given.items()}
        return cls(**arrays, friction_speed=friction_speed)

    def resistance(self, v: Array) -> Array:
        """Return damping and friction at v, shape (nv,)."""
        return np.asarray(friction_force(v, self.damping, self.friction, self.friction_speed))

    def slopes(self, v: Array) -> Array:
        """Return the derivatives of damping and friction by v, which are diagonal, shape (nv,)."""
        return np.asarray(friction_slope(v, self.damping, self.friction, self.friction_speed))


def by_joint(model: pin.Model, values: Mapping[str, ArrayLike], what: str) -> Array:
    """Return values given by joint names as an array of shape (nv,), zero where none is given."""
    array = np.zeros(model.nv)
    for name, value in values.items():
        joint = model.joints[joint_id(model, name, what)]
        try:
            given = numbers(value, what, "numbers")
            array[joint.idx_v : joint.idx_v + joint.nv] = given
        except ValueError:
            raise MechanismError(
                f"{what} of joint {name!r} = {shown(value)}: it must be one number, or {joint.nv}"
            ) from None
    return array
