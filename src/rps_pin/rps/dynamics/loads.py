"""Loads of the platform: a payload fixed to it, and external wrenches.

A payload is a rigid body that moves with the platform: `RPSRobot.with_payload` returns the robot
that carries it, and everything which that robot computes includes it. A wrench is what something
else (a tool, the wind, a person) exerts on the platform: (force, moment), N and N m, in base axes,
the moment about the platform's centre. It is an argument of the dynamics, ``wrench=``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, ParameterError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import finite_number, fixed_array, inertia_fault, real_array


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body fixed to the platform.

    Parameters
    ----------
    mass
        kg; positive.
    centre
        Its centre of mass in platform axes, from the platform's centre, shape (3,), m.
    inertia
        About its own centre of mass, in platform axes, shape (3, 3), kg m^2; zero (a point) if left
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


def checked_wrench(value: ArrayLike, batch: tuple[int, ...]) -> Array:
    """Return a wrench on the platform for each sample of a batch, shape (*batch, 6).

    Parameters
    ----------
    value
        (force, moment), constant (6,) or of a shape (..., 6) that broadcasts to the batch; N, N m.
    batch
        The batch's shape.

    Raises
    ------
    InputError
        If it is not finite, or its shape does not fit.
    """
    wrench = real_array(value, "wrench", (6,), "force and moment")
    try:
        return np.broadcast_to(wrench, (*batch, 6))
    except ValueError:
        raise InputError(
            f"wrench has shape {wrench.shape}; it must be (6,) or go with {(*batch, 6)}: force and "
            "moment of each sample"
        ) from None
