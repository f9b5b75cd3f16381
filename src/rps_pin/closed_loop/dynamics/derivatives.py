"""Derivatives of inverse and forward dynamics, in all coordinates and in independent ones.

With F(q, v, a) = rnea + passive joint forces - external forces - J' lambda, which is S' tau, its
derivatives F_q, F_v, F_a = M (lambda held) and c(q, v, a) = J a + J' v of the closures' rows with
c_q, c_v, c_a = J, the KKT equations differentiate to

    S' dtau + J' dlambda = dF,      J da + dc = 0.

Multiplied by T' (J T = 0, S T = 1), the first gives inverse dynamics, dtau = T' dF; for forward
dynamics da = T dw + x, x any solution of J x = -dc, and (T' M T) dw = T' (S' dtau - dF - M x).

In independent coordinates y the rest of the mechanism follows them:

    dq = T dy,    dv = T dy' + V_y dy,    da = T dy'' + A_y dy + A_y' dy',
    J V_y = -(J v)_q T,    J A_y = -(c_q T + c_v V_y),    J A_y' = -c_v T,

the independent joints' rows of V_y, A_y and A_y' being zero.

Where idle freedoms are left open, T is of least norm, and `idle_slopes` tells how that changes: it
is added to V_y, to A_y, and to dtau = T' dF + dT' r, r the residual force.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints import derivatives
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.forward_dynamics import forward_dynamics
from rps_pin.closed_loop.dynamics.idle_slopes import IdleSlopes
from rps_pin.closed_loop.dynamics.inverse_dynamics import constraint_forces, inverse_dynamics
from rps_pin.closed_loop.dynamics.wrenches import Wrenches, closure_wrenches, forces_on_joints
from rps_pin.closed_loop.editing.split import split
from rps_pin.closed_loop.kinematics import motion_basis

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


class DynamicsDerivatives:
    """Derivatives of the dynamics of one system.

    They are taken on a tree whose joints have derivatives in Pinocchio (see `split`): the system's,
    or the same tree with some joints split.

    Parameters
    ----------
    system
        The system; its scratch memory is used.
    """

    def __init__(self, system: ConstraintSystem) -> None:
        self._system, self._equations = system, system.equations
        tree = split(system.model)
        if tree is not system.model:
            equations = system.equations
            self._equations = ClosureEquations(tree, equations.closures, equations.length)

    def inverse(
        self, q: Array, v: Array, a: Array, wrenches: Wrenches | None
    ) -> InverseDynamicsDerivatives:
        """Return the derivatives of tau; the independent joints are the actuated ones."""
        system = self._system
        T = motion_basis(system, q, system.actuated)
        solved, idle = self._solution(q, system.actuated)
        forces = inverse_dynamics(system, q, v, a, wrenches)
        force, rows = self._force_derivatives((q, v, a), forces.constraint_forces, wrenches)
        bent = idle.slope(v) @ T, idle.slope(a) @ T
        V_y, A_y, A_dy = following(T, system.actuated, solved, rows, bent)
        by_q, by_v, by_a = (T.T @ derivative for derivative in force)
        if forces.unproduced is not None:
            by_q += np.array([forces.unproduced @ idle.slope(motion) for motion in T.T])
        return InverseDynamicsDerivatives(
            by_q,
            by_v,
            by_a,
            by_q @ T + by_v @ V_y + by_a @ A_y,
            by_v @ T + by_a @ A_dy,
            by_a @ T,
        )

    def forward(
        self, q: Array, v: Array, tau: Array, chosen: Indices, wrenches: Wrenches | None
    ) -> ForwardDynamicsDerivatives:
        """Return the derivatives of a; `chosen` are the independent velocities."""
        system = self._system
        a = forward_dynamics(system, q, v, tau, wrenches)
        multipliers = constraint_forces(system, q, v, a, tau, wrenches)
        T = motion_basis(system, q, chosen)
        (F_q, F_v, M), rows = self._force_derivatives((q, v, a), multipliers, wrenches)
        solved, idle = self._solution(q, chosen)
        V_y, _, _ = following(T, chosen, solved, rows, (idle.slope(v) @ T, 0.0))
        every = np.concatenate([T, idle.motions], axis=1)
        mass = every.T @ M @ every

        def response(of_force: Array, opening: Array) -> Array:
            """Return da of dF and dc, shapes (nv, k) and (nc, k)."""
            x = -solved(opening)
            along = np.linalg.solve(mass, -every.T @ (of_force + M @ x))
            return every @ along + x

        by_q = response(F_q, rows.acceleration_q)
        by_v = response(F_v, rows.acceleration_v)
        by_tau = every @ np.linalg.solve(mass, every[system.actuated].T)
        return ForwardDynamicsDerivatives(
            by_q,
            by_v,
            by_tau,
            (by_q @ T + by_v @ V_y)[chosen],
            (by_v @ T)[chosen],
            by_tau[chosen],
        )

    def _force_derivatives(
        self, motion: tuple[Array, Array, Array], multipliers: Array, wrenches: Wrenches | None
    ) -> tuple[tuple[Array, Array, Array], derivatives.ClosureDerivatives]:
        """Return F_q, F_v and M (nv, nv), lambda held, and the closures' derivatives."""
        motions = derivatives.FrameMotions(self._equations, motion)
        rows = derivatives.closure_derivatives(motions)
        return force_derivatives(self._system, motions, multipliers, wrenches), rows

    def _solution(self, q: Array, chosen: Indices) -> tuple[Solved, IdleSlopes]:
        """Return a solver of J x = b at q, and the slopes of what the chosen velocities leave open.

        x has passive rows only, if they determine it.
        """
        system = self._system
        jacobian = system.equations.jacobian(q).copy()
        solve = system.factorisation.passive_motion
        if solve(jacobian, np.zeros((system.equations.size, 1))) is None:
            factors = system.decomposed(jacobian)
            rows, columns = system.row_scale[:, None], system.column_scale[:, None]
            idle = IdleSlopes(system, self._equations, q, chosen)
            return lambda right: columns * factors.least_norm(rows * right), idle

        def solved(right: Array) -> Array:
            x = np.zeros((system.model.nv, right.shape[1]))
            found = solve(jacobian, np.asfortranarray(right))
            assert found is not None  # as it was above
            x[system.passive] = found
            return x

        return solved, IdleSlopes.none(system)


def force_derivatives(
    system: ConstraintSystem,
    motions: derivatives.FrameMotions,
    multipliers: Array,
    wrenches: Wrenches | None,
) -> tuple[Array, Array, Array]:
    """Return F_q, F_v and M, shape (nv, nv) each, lambda held, at a motion.

    The equations of `motions` are the system's, or those of its tree with some joints split.
    """
    equations, motion = motions.equations, motions.motion
    model, on_frames = equations.model, system.by_frame(wrenches)
    on_closures = closure_wrenches(equations, motion[0], multipliers)
    beyond = derivatives.closure_force_slope(motions, multipliers)
    beyond += derivatives.external_force_slope(motions, on_frames)
    forces = forces_on_joints(equations, on_closures, on_frames)
    by_q, by_v, mass = (
        np.array(part).reshape(model.nv, model.nv)
        for part in pin.computeRNEADerivatives(model, equations.data, *motion, forces)
    )
    by_q -= beyond
    if system.effects is not None:
        by_v += np.diag(system.effects.slopes(motion[1]))
    if system.springs is not None:
        by_q += system.springs.slope(motion[0])
    return by_q, by_v, mass


def following(
    basis: Array,
    chosen: Indices,
    solved: Solved,
    rows: derivatives.ClosureDerivatives,
    idle: tuple[Array, Array | float],
) -> tuple[Array, Array, Array]:
    """Return V_y, A_y and A_y': how the whole mechanism follows independent coordinates.

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
    idle
        Parts of V_y and A_y in idle freedoms.
    """

    def held(right: Array) -> Array:
        """Return x with J x = right and zero rows for the independent joints."""
        x = solved(right)
        return np.asarray(x - basis @ x[chosen])

    velocity_y = held(-rows.rate_q @ basis) + idle[0]
    acceleration_y = held(-rows.acceleration_q @ basis - rows.acceleration_v @ velocity_y)
    return velocity_y, acceleration_y + idle[1], held(-rows.acceleration_v @ basis)


def linearisation(derivatives: ForwardDynamicsDerivatives) -> Linearisation:
    """Return A and B of the derivatives in independent coordinates, (..., rows, columns)."""
    position, velocity, actuation = derivatives[3:]
    *batch, m, na = actuation.shape
    still = np.zeros((*batch, m, m))
    kept = np.broadcast_to(np.eye(m), still.shape)
    A = np.concatenate(
        [np.concatenate([still, kept], axis=-1), np.concatenate([position, velocity], axis=-1)],
        axis=-2,
    )
    return Linearisation(A, np.concatenate([np.zeros((*batch, m, na)), actuation], axis=-2))
