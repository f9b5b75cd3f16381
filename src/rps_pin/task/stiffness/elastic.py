"""Equilibrium and tangent of a mechanism with springs.

With q all coordinates, springs' among them, e(q) the closures' gaps, J their Jacobian, F(q) gravity
and the mechanism's own springs less external forces, K the springs' stiffness and s their stretch,

    F(q) + K s(q) - J' lambda = 0 in all directions that are not held,   e(q) = e(q_0):

the loops close as they do at the nominal configuration q_0, where the springs are without load.
Rigid actuators are held. Newton's method: with H the derivative of the left side, lambda held, and
B a basis of the motions that closures and held actuators allow (J B = 0),

    dq = d + B y,   J d = e(q_0) - e(q),   B' H B y = -B' (F + K s + H d).

B' H B is the tangent stiffness: H holds the geometric part of gravity, of external wrenches and of
the reactions lambda. With A the Jacobian of the output, the output's compliance and the vibrations
of the mechanism are

    C = A B (B' H B)^-1 B' A',     (B' H B) phi = omega^2 (B' M B) phi.

Motions that strain no spring (idle ones: the spin of a rod between balls) are left out of B.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.derivatives import FrameMotions
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.derivatives import force_derivatives
from rps_pin.closed_loop.dynamics.generalised_forces import required_force
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.editing.split import split
from rps_pin.errors import SingularityError
from rps_pin.numerics.linear_algebra import Decomposition, full_svd, rank

#: Least share of the output's motion in a motion without springs that makes it free.
_FREE = 1e-7


class Motions(NamedTuple):
    """Motions that closures and held actuators allow, and that strain springs."""

    basis: Array
    """B, shape (nv, k)."""
    idle: Array
    """Motions that strain nothing, shape (nv, i)."""


class Loads(NamedTuple):
    """What acts on a mechanism beside gravity."""

    wrenches: Wrenches
    """By frame, in world axes."""
    force: Array
    """Generalised, shape (nv,)."""


class Rows:
    """The closures' rows at one Jacobian J (nc, nv), in what is free.

    Parameters
    ----------
    system
        Gives the scaling of J to one unit.
    jacobian
        J.
    free
        Velocities that are not held.
    tolerance
        Of the rank.
    """

    def __init__(
        self, system: ConstraintSystem, jacobian: Array, free: Indices, tolerance: float
    ) -> None:
        self._free, self._size = free, system.model.nv
        self._column, self._row = system.column_scale[free], system.row_scale
        self._parts = Decomposition(system.scaled(jacobian)[:, free], tolerance)

    @property
    def motions(self) -> Array:
        """Orthonormal basis of the motions with J v = 0, of free velocities in one unit."""
        return self._parts.null_space()

    @property
    def undetermined(self) -> Array:
        """Basis of the lambda with J' lambda = 0, shape (nc, nc - rank)."""
        return np.asarray(self._row[:, None] * self._parts.left[:, self._parts.rank :])

    def whole(self, motions: Array) -> Array:
        """Return motions of free velocities in one unit, (nf, ...), as those of all, (nv, ...)."""
        found = np.zeros((self._size, *motions.shape[1:]))
        found[self._free] = (self._column * motions.T).T
        return found

    def multipliers(self, force: Array) -> Array:
        """Return the lambda of least norm with J' lambda = force in what is free, shape (nc,)."""
        scaled = self._column * force[self._free]
        return np.asarray(self._row * self._parts.transposed_least_norm(scaled))

    def correction(self, opening: Array) -> Array:
        """Return the d of least norm with J d = opening, shape (nv,)."""
        return self.whole(self._parts.least_norm(self._row * opening))


class ElasticSystem:
    """Equations of a mechanism with springs.

    Parameters
    ----------
    system
        The tree with springs as joints, and its closures; its effects are the mechanism's own.
    stiffness
        K, shape (nv,): of springs and actuators; zero elsewhere.
    held
        Velocities of rigid actuators.
    tolerance
        Of ranks.
    """

    def __init__(
        self, system: ConstraintSystem, stiffness: Array, held: Indices, tolerance: float
    ) -> None:
        self.system, self.stiffness, self.held = system, stiffness, held
        self.free = np.setdiff1d(np.arange(system.model.nv), held)
        self._tolerance = tolerance
        tree, equations = split(system.model), system.equations
        self._split = equations
        if tree is not system.model:
            self._split = ClosureEquations(tree, equations.closures, equations.length)
        own = system.springs
        strained = stiffness > 0 if own is None else (stiffness > 0) | (own.stiffness > 0)
        #: Of the free velocities, those with springs.
        self._strained = np.flatnonzero(strained[self.free])
        self._sprung = np.flatnonzero(stiffness)
        self._coordinates = _coordinates(system.model)[self._sprung]

    def stretch(self, q: Array, rest: Array) -> Array:
        """Return s at q, shape (nv,), where springs are at rest at a configuration (nq,)."""
        found = np.zeros(self.system.model.nv)
        found[self._sprung] = (q - rest)[self._coordinates]
        return found

    def rows(self, q: Array) -> Rows:
        """Return the closures' rows at q."""
        J = self.system.equations.jacobian(q)
        return Rows(self.system, J, self.free, self._tolerance)

    def motions(self, rows: Rows, output: Array) -> Motions:
        """Return the motions that strain springs, the output's Jacobian being (p, nv).

        Raises
        ------
        SingularityError
            If the output moves without straining a spring: it is not held.
        """
        N = rows.motions
        _, strains, turned = full_svd(N[self._strained])
        kept = rank(strains, self._tolerance)
        basis = rows.whole(N @ turned.T)
        found = Motions(basis[:, :kept], basis[:, kept:])
        moved = output @ found.idle
        if np.abs(moved).max(initial=0.0) > _FREE * max(self.system.equations.length, 1.0):
            free = np.linalg.matrix_rank(moved, _FREE)
            raise SingularityError(
                "the output moves although all actuators and springs are still: nothing holds it "
                f"here in {free} of its directions",
                np.inf,
                self.system.max_condition,
            )
        return found

    def forces(self, q: Array, rest: Array, loads: Loads) -> Array:
        """Return F + K s at q, shape (nv,)."""
        still = np.zeros(self.system.model.nv)
        found = required_force(self.system, q, still, still, loads.wrenches)
        return np.asarray(found + self.stiffness * self.stretch(q, rest) - loads.force)

    def slopes(self, q: Array, multipliers: Array, loads: Loads) -> tuple[Array, Array]:
        """Return H and M at q, shape (nv, nv) each."""
        still = np.zeros(self.system.model.nv)
        motions = FrameMotions(self._split, (q, still, still))
        by_q, _, mass = force_derivatives(self.system, motions, multipliers, loads.wrenches)
        return by_q + np.diag(self.stiffness), mass


def _coordinates(model: pin.Model) -> Indices:
    """Return the coordinate of each velocity whose joint has one for each, shape (nv,)."""
    found = np.zeros(model.nv, dtype=np.intp)
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv:
            found[joint.idx_v : joint.idx_v + joint.nv] = joint.idx_q + np.arange(joint.nv)
    return found
