"""Parts of a mechanism: what every reader returns, and a `ClosedLoopModel` is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.dynamics.passive_joint_forces import FRICTION_SPEED, JointEffects
from rps_pin.closed_loop.interference.shapes import CollisionShapes
from rps_pin.errors import ClosureError, InputError

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
        By joint name, a number or one for each velocity: N s/m or N m s/rad; N or N m; N/m or
        N m/rad; m or rad. Joints that are not named have none.
    friction_speed
        Speed at which dry friction has risen to tanh(1) of itself, m/s or rad/s; None if the
        description does not say.
    name
        Of the mechanism.
    characteristic_length
        m, or None if the description does not say.
    max_condition
        Or None if the description does not say.
    accuracy
        As for `ClosedLoopModel`; None if the description does not say.
    task
        Arguments of the mechanism's `Task`; None if the description does not say.
    continuous
        Revolute joints that the file calls continuous; a home may give their cosine and sine.
    notes
        Sentences on what the reader has decided.
    collision
        The links' collision shapes, and the pairs of links that may overlap.
    place_of
        Where the file has a closure, by its name; "" where another file has it. None: not known.
    """

    model: pin.Model
    closures: tuple[Closure, ...] = ()
    actuated: tuple[str, ...] = ()
    home: Array | None = None
    damping: Mapping[str, ArrayLike] = field(default_factory=dict)
    friction: Mapping[str, ArrayLike] = field(default_factory=dict)
    stiffness: Mapping[str, ArrayLike] = field(default_factory=dict)
    rest: Mapping[str, ArrayLike] = field(default_factory=dict)
    friction_speed: float | None = None
    name: str = ""
    characteristic_length: float | None = None
    max_condition: float | None = None
    accuracy: float | None = None
    task: Mapping[str, Any] | None = None
    continuous: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()
    collision: CollisionShapes = field(default_factory=CollisionShapes, compare=False)
    place_of: Callable[[str], str] | None = field(default=None, compare=False)

    def located(self, error: ClosureError) -> ClosureError:
        """Return an error of a closure that stays open, with the place of the closure."""
        names = [closure.name for closure in self.closures if repr(closure.name) in str(error)]
        place = self.place_of(names[0]) if self.place_of and names else ""
        return ClosureError(f"{place}: {error}", error.gap) if place else error


def with_effects(
    parts: MechanismParts, given: JointEffects | Mapping[str, Mapping[str, ArrayLike]] | None
) -> JointEffects | None:
    """Return the joints' effects of a file, with others in their place joint by joint.

    Parameters
    ----------
    parts
        The file's parts.
    given
        By effect and joint name; or `JointEffects`, whose entries that are not zero count.

    Raises
    ------
    InputError
        If there is no such effect.
    MechanismError
        As `JointEffects.named`.
    """
    values: dict[str, Any] = {name: dict(getattr(parts, name)) for name in EFFECTS}
    values["friction_speed"] = parts.friction_speed or FRICTION_SPEED
    if isinstance(given, Mapping):
        for name, of_joints in given.items():
            if name not in EFFECTS:
                raise InputError(f"effects: no {name!r}; there are: {', '.join(EFFECTS)}")
            values[name] |= of_joints
    if not any(values[name] for name in ("damping", "friction", "stiffness")):
        return given if isinstance(given, JointEffects) else None
    own = JointEffects.named(parts.model, **values)
    if not isinstance(given, JointEffects):
        return own
    if given.damping.size != own.damping.size:
        size = given.damping.size
        raise InputError(f"effects are of {size} velocities, not {own.damping.size}")
    both = {name: (getattr(own, name), getattr(given, name)) for name in EFFECTS}
    merged = {name: np.where(new != 0, new, old) for name, (old, new) in both.items()}
    return JointEffects(**merged, friction_speed=given.friction_speed)


def without_position_limits(parts: MechanismParts) -> MechanismParts:
    """Return the parts with a model of which no joint has position limits."""
    model = pin.Model(parts.model)
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv:  # those of a quaternion are not limits
            coordinates = slice(joint.idx_q, joint.idx_q + joint.nq)
            model.lowerPositionLimit[coordinates] = -np.inf
            model.upperPositionLimit[coordinates] = np.inf
    notes = (*parts.notes, "position limits are ignored, as was asked")
    return replace(parts, model=model, notes=notes)
