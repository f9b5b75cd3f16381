"""Generalised forces and energies of the open tree, which the closures do not enter."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.wrenches import Wrenches

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def required_force(
    system: ConstraintSystem, q: Array, v: Array, a: Array, wrenches: Wrenches | None
) -> Array:
    """Return rnea(q, v, a) + passive joint forces - external forces, shape (nv,)."""
    force: Array = pin.rnea(system.model, system.data, q, v, a).copy()
    if system.effects is not None or wrenches is not None:
        pin.computeJointJacobians(system.model, system.data, q)
        force += resisting_force(system, q, v, wrenches)
    return force


def resisting_force(
    system: ConstraintSystem, q: Array, v: Array, wrenches: Wrenches | None
) -> Array:
    """Return passive joint forces less external forces, (nv,); after `computeJointJacobians`."""
    force = -external_force(system, wrenches)
    if system.effects is not None:
        force += system.effects.resistance(v)
    if system.springs is not None:
        force += system.springs.force(q)
    return force


def external_force(system: ConstraintSystem, wrenches: Wrenches | None) -> Array:
    """Return the sum of J_f' w over frames, shape (nv,), after `computeJointJacobians`."""
    nv = system.model.nv
    force = np.zeros(nv)
    for frame, wrench in system.by_frame(wrenches).items():
        jacobian = pin.getFrameJacobian(system.model, system.data, frame, _WORLD).reshape(6, nv)
        force += jacobian.T @ wrench
    return force


def tree_mass(system: ConstraintSystem, q: Array) -> Array:
    """Return the open tree's mass matrix, armature included, shape (nv, nv)."""
    mass: Array = pin.crba(system.model, system.data, q)
    return mass.reshape(system.model.nv, system.model.nv)


def energy(system: ConstraintSystem, q: Array, v: Array) -> tuple[float, float]:
    """Return kinetic energy, rotors included, and potential energy, springs included, J."""
    kinetic = float(v @ tree_mass(system, q) @ v) / 2  # with armature, unlike Pinocchio's own
    potential = pin.computePotentialEnergy(system.model, system.data, q)
    if system.springs is not None:
        potential += system.springs.energy(q)
    return kinetic, float(potential)
