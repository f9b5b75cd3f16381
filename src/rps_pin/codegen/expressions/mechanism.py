"""Dynamics of a mechanism with closed loops as sparse CasADi expressions.

With J the closures' Jacobian, and velocities partitioned into independent ones u and dependent ones
(columns J_d, of full column rank),

    J_d T_d = -J_u,      v = T u,      a = T w + a_0,      J_d a_0 = -J' v,

the forces f = rnea(q, v, a) + passive joint forces - external forces of a motion are carried by

    J_d' lambda = (f - S' tau)_d,      T' S' tau = T' f,

and (T' M T) w = T' (S' tau - f(a_0)) gives the acceleration. J_d, its rows
scaled to one unit, is factorised once by orthogonal reflections (see `elimination`).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.column_names import column_names
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.passive_joint_forces import friction_force
from rps_pin.codegen.expressions.closures import ClosureRows, closure_rows
from rps_pin.codegen.expressions.elimination import LDL, Householder
from rps_pin.codegen.expressions.independent import Partition
from rps_pin.codegen.expressions.joints import clean, rotation_of, turn_between
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.tree import Tree
from rps_pin.errors import MechanismError, few

#: A CasADi SX expression.
Expression = Any

#: Sum of squared inverse pivots of J_d, in one unit, above which a state is handed to the Pinocchio
#: engine: its rounding errors are still far below 1e-10 there.
GROWTH = 1e5
#: The same for the spread of the pivots of T' M T, above which a motion may move no mass.
SPREAD = 1e12
#: Condition of J_d at samples up to which other independent velocities are as good.
_WELL_CONDITIONED = 1e3
#: Keeps a quotient of two numbers that vanish at zero; not zero in single precision either.
_NOTHING = {"double": 1e-300, "float": 1e-30}
#: Largest check in double and single precision, squared and over that of `GROWTH`: what rounding
#: errors may grow to, relative, is about 1e-11 and 1e-4 then.
LIMITS: Mapping[str, float] = {"double": 1.0, "float": 1e-4}


class Forces(NamedTuple):
    """Actuator and constraint forces of a motion."""

    tau: Expression
    """Shape (na,)."""
    multipliers: Expression
    """lambda, shape (nc,), in the rows of `ClosureRows`."""
    residual: Expression
    """Norm of the error of the equations on the passive rows."""
    unproduced: Expression
    """Residual force of an underactuated mechanism, shape (nv,); else structurally zero."""
    missing: Expression
    """Its squared size, relative to that of the reduced force."""
    growth: Expression
    """As `MechanismExpressions.growth`, of the actuators' part in the motions."""


class MechanismExpressions:
    """Expressions of one mechanism in q, v, a, and in what is left open.

    Parameters
    ----------
    system
        The mechanism.
    partition
        Its independent and dependent velocities.
    parameters
        Names of the parameters that stay symbols (see `Parameters`).
    wrench_frames
        Frames at which external wrenches act.
    single
        Whether the code computes in single precision: what it accepts is wider then.
    shared
        Another choice of velocities, for what does not depend on it; see `choose_shared`.

    Attributes
    ----------
    tree : Tree
    rows : ClosureRows
    q, v, a, tau, wrenches, parameters : expressions
        Symbols of shapes (nq,), (nv,), (nv,), (na,), (6 k,) and (np,).
    """

    def __init__(
        self,
        system: ConstraintSystem,
        partition: Partition,
        parameters: Sequence[str] = (),
        wrench_frames: Sequence[str] = (),
        single: bool = False,
        shared: Partition | None = None,
    ) -> None:
        self.system = system
        self._shared = shared
        self._single = single
        #: Opening rate that `acceleration` accepts, relative to the speed; in double precision as
        #: `kinematics` does.
        self.consistent = max(1e-4, system.rule.consistent) if single else system.rule.consistent
        self.nothing = _NOTHING["float" if single else "double"]
        self.parameters = Parameters(system, parameters)
        self.tree = tree = Tree(self.parameters.model, self.parameters)
        self.rows: ClosureRows = closure_rows(tree, system.equations)
        self.partition = partition
        self.q, self.v, self.a = tree.q, tree.v, tree.a
        self.tau = ca.SX.sym("tau", system.actuated.size)
        self.wrench_frames = tuple(wrench_frames)
        self.wrenches = ca.SX.sym("wrenches", 6 * len(self.wrench_frames))

    @cached_property
    def cheapest(self) -> MechanismExpressions:
        """These expressions with the independent velocities that take fewer operations.

        For what does not depend on the choice: the acceleration, and projections.
        """
        if self._shared is None or not self._shared.condition <= _WELL_CONDITIONED:
            return self
        other = copy.copy(self)
        for name in [
            name for name, of in vars(type(self)).items() if isinstance(of, cached_property)
        ]:
            vars(other).pop(name, None)
        other.partition = self._shared
        return min(self, other, key=lambda one: _operations(one.basis, one.drift))

    # Closures -------------------------------------------------------------------------------------

    @property
    def independent(self) -> Indices:
        """Indices of the independent velocities, shape (m,)."""
        return self.partition.independent

    @property
    def jacobian(self) -> Expression:
        """J, shape (nc, nv)."""
        return self.rows.jacobian

    @cached_property
    def factors(self) -> Householder:
        """Of J_d, its rows scaled to one unit."""
        dependent = self.partition.dependent.tolist()
        return Householder(self.jacobian[:, dependent], row_scale=self.system.row_scale)

    @cached_property
    def basis(self) -> Expression:
        """T, shape (nv, m)."""
        independent, dependent = self.independent.tolist(), self.partition.dependent.tolist()
        basis = ca.SX(self.tree.model.nv, len(independent))
        basis[independent, :] = ca.SX.eye(len(independent))
        if dependent:
            basis[dependent, :] = -self.factors.solve(self.jacobian[:, independent])
        return ca.sparsify(basis)

    def dependent(self, right: Expression) -> Expression:
        """Return x (nv, k), zero for the independent velocities, with J x = right (nc, k)."""
        x = ca.SX(self.tree.model.nv, right.shape[1])
        if self.partition.dependent.size:
            x[self.partition.dependent.tolist(), :] = self.factors.solve(ca.sparsify(right))
        return x

    @cached_property
    def drift(self) -> Expression:
        """The acceleration a_0, shape (nv,)."""
        return ca.densify(-self.dependent(self.rows.bias))

    @cached_property
    def growth(self) -> Expression:
        """Sum of the squared inverse pivots of J_d in one unit, over that of `GROWTH`."""
        if not self.partition.dependent.size:
            return ca.SX(0)
        return _growth(self.factors, 1 / self.system.column_scale[self.partition.dependent])

    @cached_property
    def orientation(self) -> Expression | None:
        """1 or -1, which changes with the sign of det J_d; none if J_d is not square."""
        return self.factors.orientation if self.partition.dependent.size else ca.SX(1)

    @cached_property
    def opening(self) -> Expression:
        """Sum of the squared gaps, over that of an open configuration."""
        if self._single:  # whose rounding errors are larger than the squares that `rows` sums
            return self._squared(self.rows.gap) / self.system.equations.open_limit**2
        return self.rows.opening / self.system.equations.open_limit**2

    @cached_property
    def squared_gap(self) -> Expression:
        """Sum of the squared gaps, over the squared characteristic length; exact for small gaps.

        Of a rounded file (see `RankRule`) of those that can be closed, J_d J_d^+ e.
        """
        gap = self.rows.gap
        if self.system.rule.rank is not None and self.partition.dependent.size:
            gap = self.jacobian[:, self.partition.dependent.tolist()] @ self.factors.solve(gap)
        return self._squared(gap) / self.system.equations.length**2

    def _squared(self, gap: Expression) -> Expression:
        """Return the sum of the squares of gaps (nc,), m^2."""
        return ca.sumsqr(ca.DM(self.system.row_scale) * ca.densify(gap))

    @property
    def check(self) -> Expression:
        """Opening and growth: at most 1 each where the answers hold."""
        return ca.vertcat(self.opening, self.growth)

    # Forces ---------------------------------------------------------------------------------------

    @cached_property
    def passive_forces(self) -> Expression:
        """e(q, v) of damping, friction and springs, shape (nv,)."""
        effects, force = self.system.effects, self.springs
        if effects is not None:
            for i, (d, f) in enumerate(zip(effects.damping, effects.friction, strict=True)):
                if d or f:
                    speed = effects.friction_speed
                    force[i] += friction_force(self.v[i], float(d), float(f), speed)
        return force

    @property
    def springs(self) -> Expression:
        """The springs' part of e(q, v), shape (nv,)."""
        force = ca.SX(self.tree.model.nv, 1)
        for start, stiffness, stretch in self._stretched():
            force[start : start + stretch.numel()] = stiffness * stretch
        return force

    @property
    def spring_energy(self) -> Expression:
        """Potential energy of the springs, J."""
        return sum((k * ca.sumsqr(s) / 2 for _, k, s in self._stretched()), ca.SX(0))

    def _stretched(self) -> Iterator[tuple[int, float, Expression]]:
        """Yield the first velocity, the stiffness and the stretch of each spring; see `springs`."""
        springs, q = self.system.springs, self.q
        if springs is None:
            return
        for i, coordinate in springs.single:
            if springs.stiffness[i]:
                yield i, float(springs.stiffness[i]), q[coordinate] - float(springs.rest[i])
        for turn in springs.turns:
            rest = ca.SX(clean(turn.rest.coeffs()))
            here = q[turn.idx_q : turn.idx_q + 4]
            yield turn.idx_v, turn.stiffness, turn_between(rest, here)
        for shift in springs.shifts:
            moved = q[shift.idx_q : shift.idx_q + 3] - ca.SX(shift.rest)
            back = rotation_of(q[shift.idx_q + 3 : shift.idx_q + 7]).T
            yield shift.idx_v, shift.stiffness, back @ moved

    @cached_property
    def external_forces(self) -> Expression:
        """Sum of J_f' w over the wrench frames, shape (nv,)."""
        force = ca.SX(self.tree.model.nv, 1)
        for k, name in enumerate(self.wrench_frames):
            jacobian = self.tree.frame_jacobian(self.system.frame(name))
            force += ca.sparsify(jacobian).T @ self.wrenches[6 * k : 6 * k + 6]
        return force

    def required(self, a: Expression) -> Expression:
        """Return rnea(q, v, a) + passive joint forces - external forces, shape (nv,)."""
        return self.tree.rnea(self.v, a) + self.passive_forces - self.external_forces

    def reduced(self, force: Expression) -> tuple[Expression, Expression]:
        """Return T' f, shape (m,), and lambda with J_d' lambda = f_d, shape (nc,)."""
        independent, dependent = self.independent.tolist(), self.partition.dependent.tolist()
        if not dependent:
            return force[independent, 0], ca.SX(self.jacobian.shape[0], 1)
        y = self.factors.transposed(ca.sparsify(force[dependent, 0]))
        return force[independent, 0] - self.jacobian[:, independent].T @ y, y

    @cached_property
    def forces(self) -> Forces:
        """Actuator and constraint forces of the motion q, v, a."""
        return self.carried(self.required(self.a))

    def carried(self, force: Expression) -> Forces:
        """Return the forces of actuators and closures that carry f, shape (nv,).

        As many actuators as motions: the only ones. More: tau of least norm; fewer: least squares,
        both in one unit; and both where they are not independent.
        """
        actuated, none = self.system.actuated.tolist(), ca.SX(self.tree.model.nv, 1)
        reduced, y = self.reduced(force)
        if self.partition.is_actuated:
            return self._forces(force, reduced, y, none, ca.SX(1, 1), ca.SX(0))
        if self.partition.actuated_rank < min(len(actuated), self.independent.size):
            return self._carried_by_dependent(force, reduced)
        of_actuators = self.basis[actuated, :]  # S T, (na, m)
        scale = self.system.column_scale[self.system.actuated]
        if len(actuated) >= self.independent.size:
            factors = Householder(_rows_times(1 / scale, of_actuators))
            tau = _rows_times(1 / scale, factors.transposed(reduced))
            growth = _growth(factors, 1 / self.system.column_scale[self.independent])
            unproduced = missing = none
            share = ca.SX(1, 1)
        else:
            metric = _rows_times(1 / self.system.column_scale, self.basis)
            lower = ca.chol(ca.densify(metric.T @ metric)).T  # (D^-1 T)' (D^-1 T) = L L'
            whitened = ca.solve(lower, ca.densify(reduced))
            factors = Householder(ca.solve(lower, ca.densify(of_actuators.T)))
            tau, growth = factors.solve(whitened), _growth(factors, scale)
            missing = ca.solve(lower, reduced - of_actuators.T @ tau)
            share = ca.sumsqr(missing) / (ca.sumsqr(whitened) + self.nothing)
            unproduced = self.least_force(reduced - of_actuators.T @ tau)
        rest = force - unproduced
        rest[actuated, 0] -= tau
        return self._forces(force, tau, self.reduced(rest)[1], unproduced, share, growth)

    def _carried_by_dependent(self, force: Expression, reduced: Expression) -> Forces:
        """Return the forces of actuators that drive fewer motions than they and the motions are.

        Some of them (a) are independent velocities, and all that drive; the others (b) move as
        those do, B T_a = C. What they lack is f along the other independent velocities (p), which
        they stand still in: with G = T' D^-2 T and its part G_p,

            r = D^-2 T_p z,   G_p z = T_p' f,   tau_a + C' tau_b = T_a' (f - r),   |D tau| least.
        """
        actuated, scale = self.system.actuated.tolist(), self.system.column_scale
        independent = self.independent.tolist()
        at = [k for k, index in enumerate(independent) if index in actuated]
        rest = [k for k in range(len(independent)) if k not in at]
        if len(at) < self.partition.actuated_rank:
            raise MechanismError(
                f"the actuators drive {self.partition.actuated_rank} motions, of which only "
                f"{len(at)} well enough for generated code"
            )
        metric = _rows_times(1 / scale, self.basis)
        along = LDL(ca.sparsify((metric.T @ metric)[rest, rest])).solve(ca.sparsify(reduced[rest]))
        unproduced = _rows_times(1 / scale, metric[:, rest] @ along)
        size = reduced.T @ LDL(ca.sparsify(metric.T @ metric)).solve(ca.sparsify(reduced))
        share = (reduced[rest].T @ along) / (size + self.nothing)
        driven = self.reduced(force - unproduced)[0][at]
        weights = 1 / scale[self.system.actuated]
        factors = Householder(_rows_times(weights, self.basis[actuated, at]))
        tau = _rows_times(weights, factors.transposed(ca.sparsify(driven)))
        left = force - unproduced
        left[actuated, 0] -= tau
        return self._forces(force, tau, self.reduced(left)[1], unproduced, share, ca.SX(0))

    def least_force(self, reduced: Expression) -> Expression:
        """Return the least force f (nv,) with a given T' f, D^-2 T (T' D^-2 T)^-1 T' f.

        Least in one unit. Closures carry nothing of it, and all of what is left.
        """
        if not self.independent.size:
            return ca.SX(self.tree.model.nv, 1)
        metric = _rows_times(1 / self.system.column_scale, self.basis)  # D^-1 T
        along = LDL(ca.sparsify(metric.T @ metric)).solve(ca.sparsify(reduced))
        return _rows_times(1 / self.system.column_scale, metric @ along)

    def _forces(
        self,
        force: Expression,
        tau: Expression,
        y: Expression,
        unproduced: Expression,
        missing: Expression,
        growth: Expression,
    ) -> Forces:
        error = (force - unproduced - self.jacobian.T @ y)[self.system.passive.tolist()]
        return Forces(tau, y, ca.sqrt(ca.sumsqr(error)), unproduced, missing, growth)

    # Motion under forces --------------------------------------------------------------------------

    @cached_property
    def mass_matrix(self) -> Expression:
        """T' M T, shape (m, m)."""
        return ca.sparsify(self.basis.T @ self.mass_times_basis)

    @cached_property
    def inertia(self) -> LDL:
        """Factors of T' M T.

        Raises
        ------
        MechanismError
            If a motion moves no mass, whatever the configuration.
        """
        moved = self.mass_matrix.sparsity()
        names = column_names(self.system.model)[1]
        still = [names[i] for k, i in enumerate(self.independent) if not moved.has_nz(k, k)]
        if still:
            raise MechanismError(
                f"no mass moves with {few(still)}: forward dynamics needs the masses of the links "
                "(<inertial> elements, or those parameters of a 3-RPS); gaps, jacobian, closed, "
                "motion_basis, velocity and acceleration need none"
            )
        return LDL(self.mass_matrix)

    @cached_property
    def mass_times_basis(self) -> Expression:
        """M T, shape (nv, m)."""
        return ca.sparsify(self.tree.mass_matrix() @ self.basis)

    def response(self, reduced: Expression, opening: Expression) -> Expression:
        """Return the accelerations a (nv, k) with given T' f and J a = -c.

        That is w of the independent velocities and what follows of the others:

            (T' M T) w = -T' f,    J_d a_d = -(c + J_u w).

        Parameters
        ----------
        reduced, opening
            T' f and c, shapes (m, k) and (nc, k).
        """
        independent = self.independent.tolist()
        w = -self.inertia.solve(ca.sparsify(reduced))
        a = -self.dependent(opening + self.jacobian[:, independent] @ w)
        a[independent, :] = w
        return ca.sparsify(a)

    @cached_property
    def acceleration(self) -> Expression:
        """The acceleration under the forces tau, shape (nv,)."""
        force = -self.required(self.drift)
        force[self.system.actuated.tolist(), 0] += self.tau
        return ca.densify(self.basis @ self.inertia.solve(self.basis.T @ force) + self.drift)

    @cached_property
    def inertia_check(self) -> Expression:
        """Spread of the pivots of T' M T over `SPREAD`: at most 1 where every motion moves mass."""
        scale = self.system.column_scale[self.independent]
        units = (scale / scale.max(initial=0.0)) ** 2  # of the pivots
        inverse = [
            d / float(unit)
            for d, unit in zip(self.inertia.inverse_diagonal.elements(), units, strict=True)
        ]
        largest = sum((ca.fabs(1 / d) for d in inverse), ca.SX(0))
        return largest * sum((ca.fabs(d) for d in inverse), ca.SX(0)) / SPREAD


def _operations(*results: Expression) -> int:
    """Return how many instructions a function with these results has."""
    whole = ca.cse([ca.densify(result) for result in results])
    symbols = ca.symvar(ca.veccat(*whole))
    return int(ca.Function("f", symbols, whole).n_instructions())


def _rows_times(factors: Array, rows: Expression) -> Expression:
    """Return diag(factors) times a matrix, without what is multiplied by one."""
    if np.array_equal(factors, np.ones_like(factors)):
        return rows
    return ca.sparsify(ca.diag(ca.DM(factors)) @ rows)


def _growth(factors: Householder, units: Array) -> Expression:
    """Return the sum of the squared inverse pivots, times the columns' units, over `GROWTH`'s."""
    inverse = (pivot.value * units[pivot.column] for pivot in factors.inverse_pivots)
    return sum((x * x for x in inverse), ca.SX(0)) / GROWTH**2
