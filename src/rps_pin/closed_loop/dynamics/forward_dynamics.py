"""Forward dynamics of a mechanism with closed loops, in reduced coordinates.

With v = T u for any basis T of the motions that the closures allow (J T = 0) and a_0 any solution
of J a + J' v = 0, all accelerations are a = T w + a_0, and multiplying

    rnea(q, v, a) + e(q, v) = S' tau + J' lambda + external forces

by T' leaves a small system without lambda, regular also where links are massless:

    (T' M T) w = T' (S' tau + external forces - rnea(q, v, a_0) - e(q, v)).
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.generalised_forces import resisting_force, tree_mass
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.kinematics import actuated_basis
from rps_pin.closed_loop.regular import refuse_lost_rows
from rps_pin.errors import SingularityError, few
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, Decomposition

#: A squared pivot below this, relative to the largest, counts as no inertia.
_NO_INERTIA = 1e-14
#: Motions that are told where that is so: of inertias below this, relative to the largest, and
#: their joints that move by more than this, relative to the one that moves most.
_MASSLESS, _TOLD = 1e-12, 1e-3


def forward_dynamics(
    system: ConstraintSystem,
    q: Array,
    v: Array,
    tau: Array,
    wrenches: Wrenches | None,
    *,
    closed: bool = True,
) -> Array:
    """Return the acceleration, shape (nv,); see `ClosedLoopModel.forward_dynamics`.

    An open q is refused if it has to be `closed`; otherwise the equations are solved all the same.
    """
    bias = system.equations.bias(q, v)
    jacobian = system.equations.jacobian(q)
    if closed:
        system.refuse_open(q)
    right = np.empty((bias.size, system.actuated.size + 1), order="F")
    right[:, :-1], right[:, -1] = jacobian.take(system.actuated, axis=1), bias
    solved = system.factorisation.passive_motion(jacobian, right)
    if solved is None:  # the motion is determined at a singularity of the actuators, too
        factors = system.decomposed(jacobian)
        refuse_lost_rows(system, q, factors)
        basis, a_0 = basis_and_bias(factors, system.row_scale * bias, system.column_scale)
    else:  # T_p = -J_p^-1 J_a
        a_0 = np.zeros(system.model.nv)
        a_0[system.passive] = -solved[:, -1]
        basis = actuated_basis(system, solved[:, :-1])
        if system.actuated_scale is not None:  # the pivots of the mass matrix are compared
            basis *= system.actuated_scale
    return reduced_acceleration(system, (q, v), tau, wrenches, basis, a_0)[0]


def reduced_acceleration(
    system: ConstraintSystem,
    state: tuple[Array, Array],
    tau: Array,
    wrenches: Wrenches | None,
    basis: Array,
    a_0: Array,
) -> tuple[Array, Array | None]:
    """Return a = T w + a_0, and passive joint forces less external forces (None: none).

    After `computeJointJacobians` at the state.

    Parameters
    ----------
    system
        Tree and actuators.
    state
        q (nq,) and v (nv,).
    tau, wrenches
        Actuator forces (na,), and external wrenches.
    basis, a_0
        T (nv, m), its columns of one unit, and a_0 (nv,).
    """
    q, v = state
    force, resisting = -pin.rnea(system.model, system.data, q, v, a_0), None
    if system.effects is not None or wrenches is not None:
        resisting = resisting_force(system, q, v, wrenches)
        force -= resisting
    force[system.actuated] += tau
    mass = basis.T @ tree_mass(system, q) @ basis
    solution = solve_reduced(mass, basis.T @ force)
    if solution is None:
        _refuse_massless(system, basis, mass)
    return basis @ solution + a_0, resisting


def basis_and_bias(factors: Decomposition, bias: Array, scale: Array) -> tuple[Array, Array]:
    """Return T, shape (nv, m), and a_0, shape (nv,), of a Jacobian of any rank.

    Parameters
    ----------
    factors
        Of J, shape (nc, nv), all entries in one unit.
    bias
        J' v, shape (nc,), its rows in that unit.
    scale
        Scaling of the velocities to one unit, shape (nv,).
    """
    return scale[:, None] * factors.null_space(), -scale * factors.least_norm(bias)


def solve_reduced(mass: Array, force: Array) -> Array | None:
    """Return w of (T' M T) w = force, or None if a motion has no inertia."""
    if mass.size == 0:
        return np.zeros(0)
    factor, solution, failed = dposv(mass, force)  # Cholesky
    diagonal = factor.diagonal()
    if not failed and diagonal.min() ** 2 > _NO_INERTIA * diagonal.max() ** 2:
        return np.asarray(solution, dtype=np.float64)
    return None


def _refuse_massless(system: ConstraintSystem, basis: Array, mass: Array) -> NoReturn:
    """Raise `SingularityError` with the joints of the motions T w that have no inertia."""
    inertias, motions = np.linalg.eigh(mass)
    count = max(1, int((inertias <= _MASSLESS * inertias[-1]).sum()))
    moved = np.abs(basis @ motions[:, :count]).max(axis=1) / system.column_scale
    model = system.model
    names = [
        model.names[index]
        for index in range(1, model.njoints)
        if moved[model.idx_vs[index] :][: model.nvs[index]].max(initial=0.0) > _TOLD * moved.max()
    ]
    raise SingularityError(
        "a motion that the closures allow moves no mass: its acceleration is not determined; it "
        f"moves the joints {few(names)} (give the links that they carry a mass, or the joints an "
        "armature)",
        np.inf,
        1 / RANK_TOLERANCE,
    )
