"""Forces at joints that the actuators cannot produce, told by joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: A force below this, relative to those that are needed, is rounding error.
_ROUNDING = 1e-9


class NotHeld(NamedTuple):
    """What is missing at one joint."""

    joint: str
    """Its name."""
    force: float
    """Magnitude of the force along its axes that nothing produces, N."""
    moment: float
    """Magnitude of the moment about its axes that nothing produces, N m."""

    def __str__(self) -> str:
        parts = [(self.force, "N"), (self.moment, "N m")]
        told = " and ".join(f"{value:.6g} {unit}" for value, unit in parts if value > 0)
        return f"{told} at joint {self.joint!r}"


def not_held(system: ConstraintSystem, missing: Array | None, needed: Array) -> tuple[NotHeld, ...]:
    """Return what is missing at each joint; empty if nothing is.

    Parameters
    ----------
    system
        The system.
    missing
        The smallest generalised force that would have to be added, shape (nv,): the attribute
        `unproduced` of an inverse dynamics' result.
    needed
        The generalised force that the motion, or the rest, needs, shape (nv,).
    """
    if missing is None:
        return ()
    least = _ROUNDING * float(np.abs(needed * system.column_scale).max(initial=0.0))
    angular = system.equations.angular_velocities
    found = []
    for name, joint in list(zip(system.model.names, system.model.joints, strict=True))[1:]:
        own = slice(joint.idx_v, joint.idx_v + joint.nv)
        part = np.where(np.abs(missing * system.column_scale)[own] > least, missing[own], 0.0)
        force = float(np.linalg.norm(part[~angular[own]]))
        moment = float(np.linalg.norm(part[angular[own]]))
        if force or moment:
            found.append(NotHeld(name, force, moment))
    return tuple(found)
