"""Parts of a mechanism: what every reader returns, and a `ClosedLoopModel` is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure

#: Effects at joints, by their names in a description.
EFFECTS = ("damping", "friction", "stiffness", "rest")


@dataclass(frozen=True)
class MechanismParts:
    """An open tree, its closures, its actuated joints, effects at joints, and a home.

    Attributes
    ----------
    model
        The open tree, with its gravity and armature.
    closures
        Its `LoopClosure` and `JointCoupling` objects.
    actuated
        Names of the actuated joints, in the order of `tau`.
    home
        A configuration to close the loops from, shape (nq,), or None.
    damping, friction, stiffness, rest
        By joint name: N s/m or N m s/rad; N or N m; N/m or N m/rad; m or rad. Joints that are
        not named have none.
    friction_speed
        Speed at which dry friction has risen to tanh(1) of itself, m/s or rad/s; None if the
        description does not say.
    name
        Of the mechanism.
    characteristic_length
        m, or None if the description does not say.
    max_condition
        Or None if the description does not say.
    """

    model: pin.Model
    closures: tuple[Closure, ...] = ()
    actuated: tuple[str, ...] = ()
    home: Array | None = None
    damping: Mapping[str, float] = field(default_factory=dict)
    friction: Mapping[str, float] = field(default_factory=dict)
    stiffness: Mapping[str, float] = field(default_factory=dict)
    rest: Mapping[str, float] = field(default_factory=dict)
    friction_speed: float | None = None
    name: str = ""
    characteristic_length: float | None = None
    max_condition: float | None = None
