"""Inverse dynamics of a mechanism with closed loops: constrained RNEA, a KKT problem.

With S selecting the actuated rows and J the closures' Jacobian,

    S' tau + J' lambda = f,   f = rnea(q, v, a) + passive joint forces - external forces.

The passive rows have no actuator: J_p' lambda = f_p. With as many actuators as mobility, lambda
follows from one factorisation of J_p (see `factorisation`; of least norm where rows are redundant),
and the actuated rows give tau.

With more or fewer actuators, or dependent ones, some velocities are chosen that determine the
motion (see `completion`). Where that fails, the null space N of J is used: J N = 0 leaves
(S N)' tau = N' f (see `least_effort`), and lambda of least norm follows from the rest. Both give
the same forces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pinocchio import computeJointJacobians, getConstraintsJacobian, rnea
from scipy.linalg.blas import dgemv, dnrm2

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.completion import PassiveVelocities
from rps_pin.closed_loop.constraints.factorisation import Scales
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics import least_effort
from rps_pin.closed_loop.dynamics.generalised_forces import required_force, resisting_force
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.freedoms import of_actuators
from rps_pin.closed_loop.regular import refuse_irregular
from rps_pin.errors import InputError
from rps_pin.numerics import linear_algebra
from rps_pin.validation import FLOAT64

_INFINITY, _ARRAY = math.inf, np.ndarray


class InverseDynamics:
    """Actuator and constraint forces that make a mechanism move as asked.

    Attributes
    ----------
    tau : (na,) array
        Generalised forces of the actuated joints, in the order of `ClosedLoopModel.actuated`; N for
        prismatic joints, N m for revolute ones. Positive does work when the coordinate grows.
    constraint_forces : (nc,) array
        The multipliers lambda, in the rows of the closures: the force of each closure's frame b
        side on its frame a side, in world axes (spherical, rigid) or frame a's axes (the others)
        at frame a's origin; N, and N m for the angular rows. ``mechanism.rows(name)`` are those of
        a closure.
    residual : float
        Norm of the KKT equations' error on the passive rows, in the units of generalised forces.
    unproduced : (nv,) array or None
        Residual force of an underactuated mechanism: the smallest generalised force that would have
        to be added for this motion, S' tau + J' lambda + unproduced = f. None if the actuators
        produce the motion.
    """

    __slots__ = (
        "_passive",
        "_passive_jacobian",
        "_scales",
        "constraint_forces",
        "residual",
        "tau",
        "unproduced",
    )

    def __init__(
        self,
        tau: Array,
        constraint_forces: Array,
        residual: float,
        scales: Scales,
        passive_jacobian: Array,
        unproduced: Array | None = None,
        passive: PassiveVelocities | None = None,
    ) -> None:
        self.tau = tau
        self.constraint_forces = constraint_forces
        self.residual = residual
        self._scales = scales
        self._passive_jacobian = passive_jacobian
        self.unproduced = unproduced
        self._passive = passive  # if the Jacobian has other columns too

    @property
    def condition(self) -> float:
        """Condition number of the passive joints' Jacobian (see `ClosedLoopModel.condition`).

        Computed when asked for.
        """
        idle, tolerance = self._passive.idle if self._passive else 0, self._scales.tolerance
        return linear_algebra.condition_number(self._scaled_jacobian(), idle, tolerance)

    @property
    def orientation(self) -> int:
        """Sign of det J_p: it changes where a motion crosses a singularity.

        0 where J_p is not square, or its determinant vanishes. Computed when asked for.
        """
        return orientation(self._scaled_jacobian())

    def _scaled_jacobian(self) -> Array:
        """Return J_p with all entries in one unit, shape (nc, np)."""
        rows, columns, _ = self._scales
        jacobian = self._passive_jacobian
        return rows * (jacobian[:, self._passive.indices] if self._passive else jacobian) * columns

    def __repr__(self) -> str:
        return (
            f"InverseDynamics(tau={self.tau}, constraint_forces={self.constraint_forces}, "
            f"residual={self.residual:.3g}"
            + (")" if self.unproduced is None else f", unproduced={self.unproduced})")
        )


def orientation(passive_jacobian: Array) -> int:
    """Return the sign of det J_p; 0 where J_p is not square, or its determinant vanishes."""
    if passive_jacobian.shape[0] != passive_jacobian.shape[1]:
        return 0
    return int(np.linalg.slogdet(passive_jacobian)[0])


def inverse_dynamics(
    system: ConstraintSystem,
    q: Array,
    v: Array,
    a: Array,
    wrenches: Wrenches | None,
    *,
    closed: bool = True,
) -> InverseDynamics:
    """Return the forces of a motion; see `ClosedLoopModel.inverse_dynamics`.

    An open q is refused if it has to be `closed`; otherwise the equations are solved all the same.
    """
    model, data, equations = system.model, system.data, system.equations
    # What Pinocchio would read wrongly (other byte orders) or otherwise than meant (masks).
    if not (
        q.__class__ is v.__class__ is a.__class__ is _ARRAY
        and q.dtype is v.dtype is a.dtype is FLOAT64
        and q.ndim == v.ndim == a.ndim == 1
    ):
        q, v, a = system.state(q, v, a)
    try:
        force = rnea(model, data, q, v, a)
        computeJointJacobians(model, data, q)
    except (TypeError, ValueError):  # a wrong size
        given, checked = (q, v, a), system.state(q, v, a)
        if all(array is one for array, one in zip(checked, given, strict=True)):
            raise  # a complaint of Pinocchio's own
        return inverse_dynamics(system, *checked, wrenches, closed=closed)
    for calc, constraint_data in equations.calls:  # getConstraintsJacobian reads what they refresh
        calc(model, data, constraint_data)
    jacobian = getConstraintsJacobian(model, data, equations.constraints, equations.constraint_data)
    if not equations.plain:
        jacobian = equations.select_rows(jacobian, q)
    if closed and equations.is_open(q):
        system.state(q, v, a)  # not finite?
        system.refuse_open(q)
    if system.effects is not None or wrenches is not None:
        force = force + resisting_force(system, q, v, wrenches)

    if system.completion is not None:
        found = system.completion.forces(jacobian, force)
        if found is not None:
            scales, passive = system.factorisation.scales, system.completion.passive
            return InverseDynamics(*found[:3], scales, jacobian, found[3], passive)
        system.state(q, v, a)
        return _of_any_actuators(system, q, jacobian, force)
    passive_jacobian = jacobian.take(system.passive, axis=1)
    factorisation = system.factorisation
    multipliers = factorisation.multipliers(jacobian, passive_jacobian, force)
    if multipliers is None:
        system.state(q, v, a)
        return _of_any_actuators(system, q, jacobian, force)
    # f - J' lambda, the passive rows first: they are the residual, the actuated ones tau.
    rest = dgemv(-1.0, jacobian.T, multipliers, 1.0, force).take(system.order)
    size = system.passive_size
    residual = dnrm2(rest, size)
    # The estimate of the condition does not see a pivot that is exactly zero, nor a matrix of
    # rounding errors.
    if not (residual < _INFINITY and dnrm2(multipliers) <= factorisation.huge_force * dnrm2(force)):
        system.state(q, v, a)
        return _of_any_actuators(system, q, jacobian, force)
    scales = factorisation.scales
    return InverseDynamics(rest[size:], multipliers, residual, scales, passive_jacobian)


def constraint_forces(
    system: ConstraintSystem,
    q: Array,
    v: Array,
    a: Array,
    tau: Array,
    wrenches: Wrenches | None,
) -> Array:
    """Return lambda (nc,) of a motion under given actuator forces, of least norm."""
    rest = required_force(system, q, v, a, wrenches)
    rest[system.actuated] -= tau
    factors = system.decomposed(system.equations.jacobian(q))
    return system.row_scale * factors.transposed_least_norm(system.column_scale * rest)


def _of_any_actuators(
    system: ConstraintSystem, q: Array, jacobian: Array, force: Array
) -> InverseDynamics:
    """Return the forces near a singularity, or of actuators that are not those of `factorisation`.

    Raises
    ------
    SingularityError
        If the configuration is singular, or nearly.
    """
    if not np.isfinite(force).all():
        raise InputError("q, v and a must be finite")
    jacobian = jacobian.reshape(system.equations.size, system.model.nv).copy()
    factors = system.decomposed(jacobian)
    driven, mobility = refuse_irregular(system, q, factors), system.model.nv - factors.rank
    scales = system.factorisation.scales
    idle = of_actuators(system, q, jacobian).idle.shape[1]
    passive = PassiveVelocities(system.passive, idle)
    if mobility == system.actuated.size == driven:
        system.refuse_singular(system.condition(jacobian))
    else:
        found = system.completed(factors, idle).forces(jacobian, force)
        if found is not None:
            return InverseDynamics(*found[:3], scales, jacobian, found[3], passive)
    tau, scaled, unproduced = null_space_solution(
        factors, system.actuated, force, system.column_scale, system.max_condition
    )
    multipliers = system.row_scale * scaled
    error = force - jacobian.T @ multipliers
    if unproduced is not None:
        error -= unproduced
    residual = float(np.linalg.norm(error[system.passive]))
    return InverseDynamics(tau, multipliers, residual, scales, jacobian, unproduced, passive)


class NullSpaceSolution(NamedTuple):
    """Actuator and constraint forces, and the residual force."""

    tau: Array
    """Shape (na,)."""
    multipliers: Array
    """lambda, shape (nc,)."""
    residual_force: Array | None
    """f - S' tau - J' lambda, shape (nv,), or None if it is rounding error."""


def null_space_solution(
    factors: linear_algebra.Decomposition,
    actuated: Indices,
    force: Array,
    scale: Array,
    max_condition: float = 1 / linear_algebra.RANK_TOLERANCE,
) -> NullSpaceSolution:
    """Return tau and lambda for any number of closure rows and actuators.

    Parameters
    ----------
    factors
        Of J times the scale, shape (nc, nv), all entries in one unit.
    actuated
        Indices of the actuated velocities, shape (na,).
    force
        f, shape (nv,).
    scale
        Positive scaling of the velocities, shape (nv,): coordinates v / scale share one unit.
    max_condition
        Largest condition number of the actuators' part in the motions that is accepted.

    Raises
    ------
    SingularityError
        If the actuators move a motion, but hardly.
    """
    motions = scale[:, None] * factors.null_space()
    of_actuators, reduced = motions[actuated], motions.T @ force
    effort = least_effort.least_effort(of_actuators, reduced, weights=scale[actuated])
    least_effort.refuse_nearly_singular(effort.values, max_condition)
    remaining = None
    if np.linalg.norm(effort.missing) > least_effort.RESIDUAL * np.linalg.norm(reduced):
        remaining = least_effort.residual_force(motions, effort.missing, scale)
    rest = force.copy() if remaining is None else force - remaining
    rest[actuated] -= effort.tau
    return NullSpaceSolution(effort.tau, factors.transposed_least_norm(scale * rest), remaining)
