"""Dynamics of a mechanism with closed loops: the forces of a motion, the motion under forces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pinocchio import computeJointJacobians, getConstraintsJacobian, rnea
from scipy.linalg.blas import dgemv, dnrm2

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.dynamics.forward_dynamics import (
    ProximalDynamics,
    basis_and_drift,
    solve_reduced,
)
from rps_pin.closed_loop.dynamics.inverse_dynamics import InverseDynamics
from rps_pin.closed_loop.dynamics.kinematics import MAX_CONDITION, ClosedLoopKinematics
from rps_pin.closed_loop.dynamics.null_space_solution import (
    scaled_motions,
    solve_by_allowed_motions,
)
from rps_pin.closed_loop.dynamics.passive_joint_forces import (
    JointEffects,
    coordinate_indices,
    refuse_springs,
)
from rps_pin.closed_loop.dynamics.wrenches import Wrenches, checked_wrench, generalised_force
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.linear_algebra import least_norm
from rps_pin.validation import real_vector

_INFINITY = math.inf
#: How many times the forces of the tree no well conditioned closure carries.
_HUGE = 1e12


class ClosedLoopDynamics(ClosedLoopKinematics):
    """The dynamic half of `ClosedLoopModel`, which see for the parameters."""

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        home: ArrayLike | None = None,
        effects: JointEffects | None = None,
        name: str = "",
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
    ) -> None:
        super().__init__(
            model,
            closures,
            actuated,
            home=home,
            characteristic_length=characteristic_length,
            max_condition=max_condition,
        )
        if effects is not None and effects.damping.size != model.nv:
            raise InputError(f"effects are of {effects.damping.size} velocities, not {model.nv}")
        if effects is not None:
            refuse_springs(model, effects)
        self.effects = effects
        self.name = name or model.name
        self._q_of_v = coordinate_indices(model)
        self._proximal: ProximalDynamics | None = None
        loops, solver = self._loops, self._solver
        # What a call of `inverse_dynamics` needs, in two look-ups.
        self._pinocchio = (
            model,
            loops.data,
            loops.calls,
            loops.constraints,
            loops.constraint_data,
        )
        self._algebra = (
            solver.lu,
            self._passive,
            self._passive.size,
            np.concatenate([self._passive, self._actuated]),
            solver.harmless_rcond,
            self._scales,
        )

    # Inverse dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, *, wrenches: Wrenches | None = None
    ) -> InverseDynamics:
        """Return the forces that make the mechanism move as asked: constrained RNEA (see module).

        For speed the motion is taken at its word: q must be closed, and v and a keep it so (as
        `close`, `velocity` and `acceleration` make them, or `loop_errors` shows).

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them.
        wrenches
            External wrenches by frame name: (force, moment), (6,), N and N m, that the surroundings
            exert at the frame's origin, in world axes.

        Returns
        -------
        InverseDynamics
            `tau` (na,), `constraint_forces` (nc,), `residual`, `condition`. With more actuators
            than mobility, the tau of least norm, torques made forces by `characteristic_length`
            (with limits and weights: `ForceDistribution`). With fewer, the tau that misses least,
            and what is missing in `unproduced`.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        SingularityError
            If the configuration is singular (condition number above `max_condition`).
        """
        model, data, calls, constraints, constraint_data = self._pinocchio
        try:
            force = rnea(model, data, q, v, a)
            computeJointJacobians(model, data, q)
        except (TypeError, ValueError):  # a list, an array of integers, or a wrong shape
            given, checked = (q, v, a), self._checked_state(q, v, a)
            if all(array is one for array, one in zip(checked, given, strict=True)):
                raise  # a complaint of Pinocchio's own
            return self.inverse_dynamics(*checked, wrenches=wrenches)
        for calc, scratch in calls:  # getConstraintsJacobian reads what they refresh
            calc(model, data, scratch)
        jacobian = getConstraintsJacobian(model, data, constraints, constraint_data)
        if not self._loops.plain:
            jacobian = self._loops.kept_rows(jacobian)
        if self.effects is not None or wrenches:
            force = force + self._other_forces(q, v, wrenches)
        if not self._solver.square:
            return self._inverse_dynamics_otherwise(
                jacobian.reshape(self.constraint_size, model.nv), force
            )

        factors, passive, size, order, harmless_rcond, scales = self._algebra
        passive_jacobian = jacobian.take(passive, axis=1)
        factors.compute(passive_jacobian.T)
        multipliers = factors.solve(force.take(passive))  # J_p' lambda = rnea_p
        if not factors.rcond() > harmless_rcond:
            self._checked_state(q, v, a)
            if not self._condition(jacobian) <= self.max_condition:
                return self._inverse_dynamics_by_motions(jacobian, force)  # refuses, or reports
        # rnea - J' lambda, the passive rows first: they are the residual, the actuated ones tau.
        rest = dgemv(-1.0, jacobian.T, multipliers, 1.0, force).take(order)
        residual = dnrm2(rest, size)
        # A pivot that is exactly zero, and a J_p that is all rounding, escape the estimate.
        if not (residual < _INFINITY and dnrm2(multipliers) <= _HUGE * dnrm2(force)):
            self._checked_state(q, v, a)
            return self._inverse_dynamics_by_motions(jacobian, force)
        return InverseDynamics(rest[size:], multipliers, residual, (scales, passive_jacobian))

    def generalised_force(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, wrenches: Wrenches | None = None
    ) -> Array:
        """Return what actuators and closures together must produce, S' tau + J' lambda, (nv,).

        That is ``rnea(q, v, a)`` plus the joints' effects less the external wrenches (as in
        `inverse_dynamics`).
        """
        q_, v_, a_ = self._checked_state(q, v, a)
        force: Array = rnea(self.model, self._loops.data, q_, v_, a_).copy()
        if self.effects is not None or wrenches:
            computeJointJacobians(self.model, self._loops.data, q_)
            force += self._other_forces(q_, v_, wrenches)
        return force

    def constraint_forces(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
    ) -> Array:
        """Return lambda (nc,) of a motion under known actuator forces, of least norm.

        Solves J' lambda = rnea(q, v, a) + effects - external forces - S' tau in the least-squares
        sense: exact where a is what `forward_dynamics` returns.
        """
        rest = self.generalised_force(q, v, a, wrenches=wrenches)
        rest[self._actuated] -= real_vector(tau, self._actuated.size, "tau")
        rows, columns = self._loops.row_scale, self._loops.column_scale
        jacobian = self._scaled(self._loops.jacobian(np.asarray(q, dtype=np.float64)))
        scaled: Array = rows * least_norm(jacobian.T, columns * rest)
        return scaled

    # Forward dynamics -----------------------------------------------------------------------------

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        method: Literal["reduced", "proximal"] = "reduced",
    ) -> Array:
        """Return the acceleration under given actuator forces, shape (nv,).

        Parameters
        ----------
        q, v
            Closed configuration (nq,), and a velocity that keeps it closed (nv,).
        tau
            Forces of the actuated joints, shape (na,).
        wrenches
            External wrenches, as for `inverse_dynamics`.
        method
            ``"reduced"`` solves in the motions that the closures allow (see `forward_dynamics`):
            exact, also with massless links and redundant rows. ``"proximal"`` calls Pinocchio's
            `constraintDynamics`, for spherical and rigid closures of links that all have mass.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        SingularityError
            If a motion that the closures allow moves no mass.
        MechanismError
            If ``"proximal"`` does not apply.
        """
        q_, v_ = real_vector(q, self.model.nq, "q"), real_vector(v, self.model.nv, "v")
        tau_ = real_vector(tau, self._actuated.size, "tau")
        if method == "proximal":
            return self._proximal_dynamics(q_, v_, tau_, wrenches)
        if method != "reduced":
            raise InputError(f"method = {method!r}; it must be 'reduced' or 'proximal'")
        return self._reduced_dynamics(q_, v_, tau_, wrenches, self._loops.drift(q_, v_))

    def mass_matrix(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the reduced mass matrix T' M T, shape (m, m); T of `motion_basis`.

        The kinetic energy is u' (T' M T) u / 2, u the velocities of the independent joints (the
        actuated ones if left out).
        """
        basis = self.motion_basis(q, independent)
        mass: Array = basis.T @ self._tree_mass(np.asarray(q, dtype=np.float64)) @ basis
        return mass

    def bias(self, q: ArrayLike, v: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the reduced bias T' (rnea(q, v, a_0) + effects), shape (m,).

        The forces at the independent joints that keep them from accelerating: a_0 is the
        acceleration with w = 0. Includes gravity, Coriolis forces, damping, friction and springs.
        """
        basis = self.motion_basis(q, independent)
        chosen = self._independent(independent)
        a = self.acceleration(q, v, np.zeros(chosen.size), independent)
        bias: Array = basis.T @ self.generalised_force(q, v, a)
        return bias

    def gravity_forces(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the forces T' g at the independent joints that carry the weight, shape (m,)."""
        q_ = real_vector(q, self.model.nq, "q")
        basis = self.motion_basis(q_, independent)
        weight = pin.computeGeneralizedGravity(self.model, self._loops.data, q_)
        forces: Array = basis.T @ weight
        return forces

    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[float, float]:
        """Return kinetic energy, rotors included, and potential energy, springs included, J."""
        q_, v_ = real_vector(q, self.model.nq, "q"), real_vector(v, self.model.nv, "v")
        kinetic = float(v_ @ self._tree_mass(q_) @ v_) / 2  # with armature, unlike Pinocchio's own
        potential = pin.computePotentialEnergy(self.model, self._loops.data, q_)
        if self.effects is not None:
            potential += self.effects.energy(q_, self._q_of_v)
        return kinetic, float(potential)

    # Inner workings -------------------------------------------------------------------------------

    def _inverse_dynamics_otherwise(self, jacobian: Array, force: Array) -> InverseDynamics:
        """Return the answer where J_p is not square: redundant rows, more or fewer actuators."""
        if not np.isfinite(force).all():
            raise InputError("q, v and a must be finite")
        factors = self._solver.factors(jacobian)
        if factors is None:
            return self._inverse_dynamics_by_motions(jacobian, force)
        multipliers = factors.multipliers(force[self._passive])  # J_p' lambda = rnea_p
        rest = force - jacobian.T @ multipliers
        return self._inverse_answer(rest[self._actuated], multipliers, rest, jacobian)

    def _inverse_dynamics_by_motions(self, jacobian: Array, force: Array) -> InverseDynamics:
        scaled_jacobian, scale = self._scaled_rows(jacobian), self._loops.column_scale
        motions = scaled_motions(scaled_jacobian, scale)
        if motions.shape[1] == self._actuated.size:
            self._refuse_singular(jacobian)
        tau, scaled, unproduced = solve_by_allowed_motions(
            scaled_jacobian, self._actuated, force, scale, self.max_condition, motions
        )
        multipliers = self._loops.row_scale * scaled
        rest = force - jacobian.T @ multipliers
        return self._inverse_answer(tau, multipliers, rest, jacobian, unproduced)

    def _inverse_answer(
        self,
        tau: Array,
        multipliers: Array,
        rest: Array,
        jacobian: Array,
        unproduced: Array | None = None,
    ) -> InverseDynamics:
        wrong = rest if unproduced is None else rest - unproduced
        residual = float(dnrm2(wrong[self._passive])) if self._passive.size else 0.0
        of_passive = jacobian[:, self._passive]
        return InverseDynamics(tau, multipliers, residual, (self._scales, of_passive), unproduced)

    def _reduced_dynamics(
        self, q: Array, v: Array, tau: Array, wrenches: Wrenches | None, drift: Array
    ) -> Array:
        """Return the acceleration; `drift` is what J a must cancel."""
        basis, a_0 = self._basis_and_drift(q, drift)
        force = -rnea(self.model, self._loops.data, q, v, a_0)
        if self.effects is not None or wrenches:
            force -= self._other_forces(q, v, wrenches)
        force[self._actuated] += tau
        mass = basis.T @ self._tree_mass(q) @ basis
        a: Array = basis @ solve_reduced(mass, basis.T @ force) + a_0
        return a

    def _basis_and_drift(self, q: Array, drift: Array) -> tuple[Array, Array]:
        """Return T and a_0; T_p = -J_p^-1 J_a where that is well conditioned."""
        jacobian = self._loops.jacobian(q)
        right = np.empty((self.constraint_size, self._actuated.size + 1), order="F")
        right[:, :-1], right[:, -1] = jacobian.take(self._actuated, axis=1), drift
        solved = self._solver.solve(jacobian, right)
        if solved is None:  # at a singularity of the actuators, too, the motion is determined
            rows = self._loops.row_scale
            return basis_and_drift(rows[:, None] * jacobian, rows * drift, self._loops.column_scale)
        a_0 = np.zeros(self.model.nv)
        a_0[self._passive] = -solved[:, -1]
        return self._basis(solved[:, :-1]), a_0

    def _proximal_dynamics(
        self, q: Array, v: Array, tau: Array, wrenches: Wrenches | None
    ) -> Array:
        if not self._loops.plain:
            raise MechanismError(
                "method='proximal' takes spherical and rigid closures only; use method='reduced'"
            )
        force = np.zeros(self.model.nv)
        if self.effects is not None or wrenches:
            computeJointJacobians(self.model, self._loops.data, q)
            force -= self._other_forces(q, v, wrenches)
        force[self._actuated] += tau
        if self._proximal is None:
            self._proximal = ProximalDynamics(self.model, self._loops.constraints)
        return self._proximal(q, v, force)

    def _tree_mass(self, q: Array) -> Array:
        """Return the open tree's mass matrix, armature included, shape (nv, nv)."""
        mass: Array = pin.crba(self.model, self._loops.data, q)
        return mass.reshape(self.model.nv, self.model.nv)

    def _other_forces(self, q: Array, v: Array, wrenches: Wrenches | None) -> Array:
        """Return effects less external forces, (nv,); the joints' Jacobians must be computed."""
        model, data = self.model, self._loops.data
        force = -generalised_force(model, data, self._by_frame(wrenches), model.nv)
        if self.effects is not None:
            force += self.effects.force(q, v, self._q_of_v)
        return force

    def _by_frame(self, wrenches: Wrenches | None) -> Mapping[int, Array]:
        given = wrenches or {}
        return {self._frame(name): checked_wrench(value, name) for name, value in given.items()}
