"""Derivatives of inverse and forward dynamics, in all coordinates and in independent ones.

With F(q, v, a) = rnea + effects - external forces - J' lambda, which is S' tau, its slopes F_q,
F_v, F_a = M (lambda held) and the rows' c(q, v, a) = J a + J' v with c_q, c_v, c_a = J, the KKT
equations differentiate to

    S' dtau + J' dlambda = dF,      J da + dc = 0.

Multiplied by T' (J T = 0, S T = 1), the first gives inverse dynamics, dtau = T' dF; for forward
dynamics da = T dw + x, x any solution of J x = -dc, and (T' M T) dw = T' (S' dtau - dF - M x).

In independent coordinates y the rest of the mechanism follows them:

    dq = T dy,    dv = T dy' + V_y dy,    da = T dy'' + A_y dy + A_y' dy',
    J V_y = -(J v)_q T,    J A_y = -(c_q T + c_v V_y),    J A_y' = -c_v T,

the independent joints' own rows of V_y, A_y and A_y' being zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.derivatives import (
    ClosureDerivatives,
    FrameMotions,
    closure_derivatives,
    closure_force_slope,
    external_force_slope,
)
from rps_pin.closed_loop.constraints.loops import Loops
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.dynamics.wrenches import closure_wrenches, forces_on_joints

Solved = Callable[[Array], Array]


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of tau (na,), each in the units of tau over those of the coordinate."""

    q: Array
    """With respect to the configuration's tangent, v and a held, shape (na, nv)."""
    v: Array
    """With respect to the velocity, shape (na, nv)."""
    a: Array
    """With respect to the acceleration, shape (na, nv)."""
    position: Array
    """With respect to the actuated joints' positions, the rest following, shape (na, na)."""
    velocity: Array
    """With respect to their velocities, shape (na, na)."""
    acceleration: Array
    """With respect to their accelerations, shape (na, na): the reduced mass matrix."""


class ForwardDynamicsDerivatives(NamedTuple):
    """Derivatives of a (nv,), or of its independent entries a_i (m,)."""

    q: Array
    """Of a, with respect to the configuration's tangent, v and tau held, shape (nv, nv)."""
    v: Array
    """Of a, with respect to the velocity, shape (nv, nv)."""
    tau: Array
    """Of a, with respect to the actuator forces, shape (nv, na)."""
    position: Array
    """Of a_i, with respect to the independent joints' positions, the rest following, (m, m)."""
    velocity: Array
    """Of a_i, with respect to their velocities, shape (m, m)."""
    actuation: Array
    """Of a_i, with respect to the actuator forces, shape (m, na)."""


class Linearisation(NamedTuple):
    """dx/dt = A dx + B dtau about an operating point, x = (positions, velocities), (2 m,)."""

    A: Array
    """Shape (2 m, 2 m)."""
    B: Array
    """Shape (2 m, na)."""


class _Slopes(NamedTuple):
    """F_q, F_v and M, shapes (nv, nv)."""

    q: Array
    v: Array
    a: Array


def dynamics_slopes(
    loops: Loops,
    motion: tuple[Array, Array, Array],
    multipliers: Array,
    wrenches: Mapping[int, Array],
    effects: JointEffects | None,
) -> tuple[_Slopes, ClosureDerivatives]:
    """Return the derivatives of F with lambda held, and those of the closures' rows.

    Parameters
    ----------
    loops
        The tree and its closures.
    motion
        q (nq,), v (nv,), a (nv,).
    multipliers
        lambda, shape (nc,).
    wrenches
        External wrenches by frame index, in world axes.
    effects
        Damping, friction, springs.
    """
    model, data = loops.model, loops.data
    on_closures = closure_wrenches(loops, motion[0], multipliers)
    motions = FrameMotions(loops, motion)
    rows = closure_derivatives(motions)
    beyond = closure_force_slope(motions, multipliers) + external_force_slope(motions, wrenches)
    forces = forces_on_joints(loops, on_closures, wrenches)
    by_q, by_v, mass = (
        np.array(part).reshape(model.nv, model.nv)
        for part in pin.computeRNEADerivatives(model, data, *motion, forces)
    )
    by_q -= beyond
    if effects is not None:
        stiffness, damping = effects.slopes(motion[1])
        by_q += np.diag(stiffness)
        by_v += np.diag(damping)
    return _Slopes(by_q, by_v, mass), rows


class Following:
    """How the whole mechanism follows independent coordinates: T, V_y, A_y and A_y'.

    Parameters
    ----------
    basis
        T, shape (nv, m).
    chosen
        Indices of the independent velocities, shape (m,).
    solved
        Right-hand sides b (nc, k) to some solutions x (nv, k) of J x = b.
    rows
        Derivatives of the closures' rows.
    """

    def __init__(
        self, basis: Array, chosen: Indices, solved: Solved, rows: ClosureDerivatives
    ) -> None:
        self.T, self._chosen, self.solved = basis, chosen, solved
        self.velocity_y = self._held(-rows.rate_q @ basis)
        self.acceleration_y = self._held(
            -rows.acceleration_q @ basis - rows.acceleration_v @ self.velocity_y
        )
        self.acceleration_dy = self._held(-rows.acceleration_v @ basis)

    def _held(self, right: Array) -> Array:
        """Return x with J x = right and zero rows for the independent joints."""
        x = self.solved(right)
        held: Array = x - self.T @ x[self._chosen]
        return held


def inverse_derivatives(slopes: _Slopes, following: Following) -> InverseDynamicsDerivatives:
    """Return the derivatives of tau; the independent joints are the actuated ones."""
    T = following.T
    by_q, by_v, by_a = (T.T @ slope for slope in slopes)
    return InverseDynamicsDerivatives(
        by_q,
        by_v,
        by_a,
        by_q @ T + by_v @ following.velocity_y + by_a @ following.acceleration_y,
        by_v @ T + by_a @ following.acceleration_dy,
        by_a @ T,
    )


def forward_derivatives(
    slopes: _Slopes,
    rows: ClosureDerivatives,
    following: Following,
    indices: tuple[Indices, Indices],
) -> ForwardDynamicsDerivatives:
    """Return the derivatives of a; `indices` of the independent and of the actuated velocities."""
    T, (chosen, actuated) = following.T, indices
    mass = T.T @ slopes.a @ T

    def response(force: Array, opening: Array) -> Array:
        """Return da of dF and dc, shapes (nv, k) and (nc, k)."""
        x = -following.solved(opening)
        along = np.linalg.solve(mass, -T.T @ (force + slopes.a @ x))
        da: Array = T @ along + x
        return da

    by_q = response(slopes.q, rows.acceleration_q)
    by_v = response(slopes.v, rows.acceleration_v)
    by_tau = T @ np.linalg.solve(mass, T[actuated].T)
    return ForwardDynamicsDerivatives(
        by_q,
        by_v,
        by_tau,
        (by_q @ T + by_v @ following.velocity_y)[chosen],
        (by_v @ T)[chosen],
        by_tau[chosen],
    )


def linearisation(derivatives: ForwardDynamicsDerivatives) -> Linearisation:
    """Return A and B of the derivatives in independent coordinates."""
    m, na = derivatives.actuation.shape
    A = np.block([[np.zeros((m, m)), np.eye(m)], [derivatives.position, derivatives.velocity]])
    return Linearisation(A, np.vstack([np.zeros((m, na)), derivatives.actuation]))
