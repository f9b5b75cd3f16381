"""Loads on a task's mechanism: a payload fixed to the output frame, and external wrenches on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, InverseDynamics
from rps_pin.errors import InputError, MechanismError, ParameterError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.validation import finite_number, fixed_array, inertia_fault, real_array


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body fixed to the platform, or to the output frame of a task.

    Parameters
    ----------
    mass
        kg; positive.
    centre
        Its centre of mass in the axes of the platform or the frame, from its origin, shape (3,), m.
    inertia
        About its own centre of mass, in these axes, shape (3, 3), kg m^2; zero (a point) if left
        out.

    Raises
    ------
    ParameterError
        If the mass is not positive, or no rigid body has the inertia.
    InputError
        If a number is not finite, or a shape is wrong.
    """

    mass: float
    centre: Array | Sequence[float] = (0.0, 0.0, 0.0)
    inertia: Array | Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        mass = finite_number(self.mass, "payload mass", "kg")
        if not mass > 0:
            raise ParameterError("payload mass", mass, "must be positive, in kg")
        inertia = np.zeros((3, 3)) if self.inertia is None else self.inertia
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "centre", fixed_array(self.centre, "payload centre", (3,)))
        object.__setattr__(self, "inertia", fixed_array(inertia, "payload inertia", (3, 3)))
        if fault := inertia_fault(np.asarray(self.inertia)):
            raise ParameterError("payload inertia", self.inertia, fault)

    @property
    def first_moment(self) -> Array:
        """Mass times centre, shape (3,), kg m, platform axes."""
        moment: Array = self.mass * np.asarray(self.centre, dtype=np.float64)
        return moment

    @property
    def inertia_about_platform(self) -> Array:
        """Inertia about the platform's centre, shape (3, 3), kg m^2, platform axes: Steiner."""
        c = np.asarray(self.centre, dtype=np.float64)
        own = np.asarray(self.inertia, dtype=np.float64)
        inertia: Array = own + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return inertia

    def as_inertia(self) -> pin.Inertia:
        """Return it as Pinocchio has it, in the platform's frame."""
        return pin.Inertia(self.mass, np.asarray(self.centre), np.asarray(self.inertia))


class Loads:
    """A task's mechanism with a payload, and the wrench on its output frame.

    Parameters
    ----------
    task
        The task.
    payload
        Fixed to its output frame.
    wrench
        (force, moment) that the surroundings exert at the output frame's origin, in world axes, N
        and N m: constant, shape (6,), or one for each of n samples, (n, 6).

    Attributes
    ----------
    mechanism : ClosedLoopModel
        With the payload.

    Raises
    ------
    MechanismError
        If the task is one of joints, which has no output frame to carry them.
    InputError
        If the wrench is not finite, or of another shape.
    """

    def __init__(
        self, task: Task, payload: Payload | None = None, wrench: ArrayLike | None = None
    ) -> None:
        self.frame, self._offset = task.output_frame
        if self.frame is None and (payload is not None or wrench is not None):
            raise MechanismError(
                "a task of joints has no output frame for a payload or a wrench; name one: "
                "Task(mechanism, frame=...), or give the body its mass in the description"
            )
        self.wrench = None if wrench is None else real_array(wrench, "wrench", (6,))
        if self.wrench is not None and self.wrench.ndim > 2:
            raise InputError(f"wrench has shape {self.wrench.shape}; it must be (6,) or (n, 6)")
        self.mechanism = task.mechanism
        if payload is not None:
            self.mechanism = _carrying(task.mechanism, self.frame or "", self._offset, payload)

    def refuse_other_count(self, count: int) -> None:
        """Raise `InputError` unless the wrench is constant, or one for each of the samples."""
        if self.wrench is not None and self.wrench.ndim == 2 and len(self.wrench) != count:
            raise InputError(
                f"wrench has shape {self.wrench.shape}; it must be (6,) or ({count}, 6)"
            )

    def wrenches(self, q: Array, sample: int = 0) -> dict[str, Array] | None:
        """Return the wrench by frame, as `ClosedLoopModel.inverse_dynamics` takes it."""
        if self.wrench is None or self.frame is None:
            return None
        given = self.wrench if self.wrench.ndim == 1 else self.wrench[sample]
        placed = self.mechanism.frame_placement(q, self.frame)
        lever = placed[:3, :3] @ self._offset.translation
        moment = given[3:] + np.cross(lever, given[:3])
        return {self.frame: np.concatenate([given[:3], moment])}

    def dynamics(self, q: Array, v: Array, a: Array, sample: int = 0) -> InverseDynamics:
        """Return the forces of a motion; see `ClosedLoopModel.inverse_dynamics`."""
        return self.mechanism.inverse_dynamics(q, v, a, wrenches=self.wrenches(q, sample))


def _carrying(
    mechanism: ClosedLoopModel, frame: str, offset: pin.SE3, payload: Payload
) -> ClosedLoopModel:
    """Return a mechanism with a payload fixed to a frame."""
    model = pin.Model(mechanism.model)
    place = model.frames[mechanism.system.frame(frame)]
    model.appendBodyToJoint(place.parentJoint, payload.as_inertia(), place.placement * offset)
    return mechanism.with_model(model)
