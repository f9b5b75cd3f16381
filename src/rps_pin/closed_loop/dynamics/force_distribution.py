"""Inverse dynamics with more actuators than mobility, and with limits on the forces.

Of all tau and lambda with

    S' tau + J' lambda = f(q, v, a)

(f: `ClosedLoopModel.generalised_force`) within their limits, that of least |W (tau - tau_0)| is
meant. The equations are solved first: every solution is

    tau = tau_l + F y,    lambda = lambda_l + L y + K z,

tau_l the unlimited solution, F the tau without work in any allowed motion (W F orthonormal), K the
null space of J' (J' K = 0). So |W (tau - tau_0)|^2 is that of tau_l plus |y|^2, the limits are
linear in y and z, and a least-distance problem is left (see `quadratic_program`). Whatever its
accuracy, the equations of motion hold to rounding.

Units: moments are made forces by the characteristic length as their lever, as in
`ClosedLoopModel`; tolerances are relative to |W tau|.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.column_names import column_names
from rps_pin.closed_loop.dynamics import least_effort
from rps_pin.closed_loop.dynamics.force_bounds import ForceBound
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.errors import InfeasibleError, InputError, LimitExcess, shown
from rps_pin.numerics.linear_algebra import Decomposition
from rps_pin.numerics.quadratic_program import LeastDistance, NearestPoint, least_violation
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import numbers, real_vector

TorqueLimits = Literal["model"] | float | ArrayLike | tuple[ArrayLike, ArrayLike] | None

#: Cost of K z against that of y, before squaring: z is as small as it can be without costing more
#: than about the square of this, relatively, in effort. Matters only where a bound rests on
#: redundant rows.
REDUNDANCY_WEIGHT = 1e-4


class DistributedForces(NamedTuple):
    """Actuator and constraint forces that make a mechanism move as asked, within limits."""

    tau: Array
    """Forces of the actuated joints, shape (na,), N and N m."""
    constraint_forces: Array
    """The multipliers lambda, shape (nc,), as `InverseDynamics` has them."""
    residual: float
    """Norm of f - S' tau - J' lambda, in the units of generalised forces."""
    effort: float
    """|W (tau - tau_0)|."""
    at_limit: tuple[str, ...]
    """Names of the actuators and bounds whose limits are active."""
    iterations: int
    """Of ProxQP; 0 where it was not needed."""


@refuses_other_kinds
@one_thread("mechanism.system.guard")
class ForceDistribution:
    """Finds the forces of least effort within limits, at one state after another.

    Build once, call often: memory and solver are allocated once, and each call starts from the
    limits that were active in the last. For that reason one object serves one thread (as its
    mechanism does).

    Parameters
    ----------
    mechanism
        The mechanism.
    weights
        Diagonal of W, positive, shape (na,) or one for all. Left out, |W tau| is the norm of tau
        in N, torques divided by the characteristic length.
    torque_limits
        Limits of tau, N and N m: one number or shape (na,) for both directions, a pair of (lower,
        upper), each a number or shape (na,), or ``"model"`` for those of the model (of its file).
        An array of shape (2,) is two actuators' limits; a tuple of two is a pair. None: no limits.
    bounds
        Limits on constraint forces; see `ForceBound` and `friction_pyramid`.

    Raises
    ------
    InputError
        If an argument has the wrong shape, or limits leave nothing.
    MechanismError
        If a bound's closure is unknown; lists those there are.
    """

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        *,
        weights: ArrayLike | None = None,
        torque_limits: TorqueLimits = None,
        bounds: Iterable[ForceBound] = (),
    ) -> None:
        self.mechanism = mechanism
        self._actuated = mechanism.actuated_indices
        self._rows, self._columns = mechanism.row_scale, mechanism.velocity_scale
        na = self._actuated.size
        self._angular = mechanism.angular_velocities
        self._actuated_columns = self._columns[self._actuated]
        self.weights = self._actuated_columns.copy()
        if weights is not None:
            self.weights = _spread(weights, na, "weights")
            if not (self.weights > 0).all():
                raise InputError(f"weights = {self.weights}: they must be positive")
        self._levers = self._actuated_columns / self.weights
        self._largest_lever = float(self._levers.max())
        self.lower, self.upper = self._torque_limits(torque_limits)
        self.bounds: Sequence[ForceBound] = tuple(bounds)
        for bound in self.bounds:
            if not isinstance(bound, ForceBound):
                raise InputError(f"bounds: {shown(bound)} is not a ForceBound")
        # Each bound's direction over all rows; and times the scaled multipliers.
        self._directions = np.zeros((len(self.bounds), mechanism.constraint_size))
        for direction, bound in zip(self._directions, self.bounds, strict=True):
            rows = mechanism.rows(bound.closure)
            direction[rows] = bound.combination(rows.stop - rows.start)
        self._bounded = self._directions * self._rows
        limits = np.reshape([(bound.lower, bound.upper) for bound in self.bounds], (-1, 2))
        self._lower = np.concatenate([self.weights * self.lower, limits[:, 0]])
        self._upper = np.concatenate([self.weights * self.upper, limits[:, 1]])
        self._limited = bool(np.isfinite([self._lower, self._upper]).any())
        self._names = [*self._actuator_names(), *(bound.name for bound in self.bounds)]
        self._nearest = LeastDistance(self._lower.size)

    def reset(self) -> None:
        """Forget the last call: the next one starts cold. Results do not depend on it."""
        self._nearest.reset()

    def solve(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        preferred: ArrayLike | None = None,
    ) -> DistributedForces:
        """Return the forces of least effort within the limits.

        Parameters
        ----------
        q, v, a, wrenches
            As for `ClosedLoopModel.inverse_dynamics`.
        preferred
            tau_0, shape (na,), that tau should be near; zero if left out.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        ClosureError
            If q is open by more than 1e-4 characteristic lengths.
        InfeasibleError
            If the limits leave no such forces (says which would have to be wider, and by how
            much), or the actuators cannot produce them at all.
        SingularityError
            If the actuators hardly move one of the motions here.
        """
        force = self.mechanism.generalised_force(q, v, a, wrenches=wrenches)
        jacobian = self.mechanism.jacobian(q)
        self.mechanism.system.refuse_open(real_vector(q, self.mechanism.model.nq, "q"))
        aim = np.zeros(self.weights.size)
        if preferred is not None:
            aim = real_vector(preferred, aim.size, "preferred")
        factors = self.mechanism.system.decomposed(jacobian)
        effort, free = self._unlimited(factors, force, aim)
        names: tuple[str, ...] = ()
        iterations, redundant = 0, None
        if self._limited:
            point = self._point_within_limits(factors, force, aim, effort, free)
            iterations = point.iterations
            if point.limits.size:
                names = tuple(self._names[i] for i in point.limits)
                effort = effort + free @ point.x[: free.shape[1]]
                redundant = point.x[free.shape[1] :]
        tau = aim + effort / self.weights
        multipliers = self._multipliers(factors, force, tau)
        if redundant is not None and redundant.size:
            multipliers += self._rows * (self._redundant(factors) @ redundant)
        rest = force - multipliers @ jacobian
        rest[self._actuated] -= tau
        residual, size = math.sqrt(rest @ rest), math.sqrt(effort @ effort)
        return DistributedForces(tau, multipliers, residual, size, names, iterations)

    def _unlimited(self, factors: Decomposition, force: Array, aim: Array) -> tuple[Array, Array]:
        """Return W (tau_l - tau_0), shape (na,), and W F, shape (na, na - rank).

        Raises
        ------
        InfeasibleError, SingularityError
            As `solve`.
        """
        motions = factors.null_space().T  # N' in scaled units
        rest = self._columns * force
        rest[self._actuated] -= self._actuated_columns * aim
        reduced = motions @ rest
        of_actuators = (motions.take(self._actuated, axis=1) * self._levers).T  # W^-1 S N
        best = least_effort.least_effort(of_actuators, reduced, size=self._largest_lever)
        limit = self.mechanism.max_condition
        least_effort.refuse_nearly_singular(best.values, limit, self._largest_lever)
        if best.missing @ best.missing > least_effort.RESIDUAL**2 * (reduced @ reduced):
            motions = self._columns[:, None] * motions.T
            force = least_effort.residual_force(motions, best.missing, self._columns)
            raise self._infeasible_motion(force)
        return best.tau, best.free

    def _multipliers(self, factors: Decomposition, force: Array, tau: Array) -> Array:
        """Return lambda of least norm, shape (nc,): J' lambda = f - S' tau."""
        rest = self._columns * force
        rest[self._actuated] -= self._actuated_columns * tau
        return self._rows * factors.transposed_least_norm(rest)

    def _redundant(self, factors: Decomposition) -> Array:
        """Return K: scaled lambdas with J' lambda = 0, shape (nc, nc - rank), cheap ones."""
        return factors.left[:, factors.rank :] / REDUNDANCY_WEIGHT

    def _point_within_limits(
        self, factors: Decomposition, force: Array, aim: Array, effort: Array, free: Array
    ) -> NearestPoint:
        """Return (y, z) of the solution, z only where bounds rest on redundant rows."""
        values, rows = effort + self.weights * aim, free
        if self.bounds:
            multipliers = self._multipliers(factors, force, aim + effort / self.weights)
            of_effort = np.zeros((self._columns.size, free.shape[1]))
            of_effort[self._actuated] = -self._levers[:, None] * free
            of_point = self._bounded @ factors.transposed_least_norm(of_effort)
            redundant = self._bounded @ self._redundant(factors)
            values = np.concatenate([values, self._directions @ multipliers])
            rows = np.zeros((values.size, free.shape[1] + redundant.shape[1]))
            rows[: effort.size, : free.shape[1]] = free
            rows[effort.size :, : free.shape[1]] = of_point
            rows[effort.size :, free.shape[1] :] = redundant
        size = math.sqrt(effort @ effort)
        problem = rows, self._lower - values, self._upper - values, size
        point = self._nearest.solve(*problem)
        if point is None:
            raise self._infeasible(problem, values)
        return point

    def _infeasible(
        self, problem: tuple[Array, Array, Array, float], values: Array
    ) -> InfeasibleError:
        """Return the error that names the limits that would have to be wider."""
        rows, _, _, size = problem
        x, beyond = least_violation(*problem)
        units = np.concatenate([self.weights, np.ones(len(self.bounds))])
        needed = values + rows @ x
        violations = [
            LimitExcess(
                self._names[i],
                float(needed[i] / units[i]),
                float((self._upper if beyond[i] > 0 else self._lower)[i] / units[i]),
                self._unit(i),
            )
            for i in np.argsort(-np.abs(beyond))
            if abs(beyond[i]) > 1e-9 * (size + np.abs(beyond).max())
        ]
        if not violations:
            return InfeasibleError(
                "the limits leave so little room that forces within them cannot be told from none"
            )
        return InfeasibleError(
            "no forces within the limits: " + "; ".join(map(str, violations)), violations
        )

    def _infeasible_motion(self, force: Array) -> InfeasibleError:
        """Return the error of a motion that leaves a residual force."""
        scaled = np.abs(self._columns * force)
        names = column_names(self.mechanism.model)[1]
        parts = [
            f"{force[i]:.6g} {'N' if self._columns[i] == 1.0 else 'N m'} at joint {names[i]!r}"
            for i in np.argsort(-scaled)[:3]
            if scaled[i] > 0.01 * scaled.max()
        ]
        return InfeasibleError(
            f"the {self._actuated.size} actuated joints cannot produce this motion, whatever their "
            f"limits: it would take a further {', '.join(parts)}",
            unproduced=force,
        )

    def _unit(self, limit: int) -> str:
        if limit < self._actuated.size:
            return "N m" if self._angular[self._actuated[limit]] else "N"
        direction = self._directions[limit - self._actuated.size]
        angular = self.mechanism.angular_rows[direction != 0]
        return "N m" if angular.all() else "N"

    def _torque_limits(self, given: TorqueLimits) -> tuple[Array, Array]:
        na = self._actuated.size
        if given is None:
            return np.full(na, -np.inf), np.full(na, np.inf)
        if isinstance(given, str):
            if given != "model":
                raise InputError(f"torque_limits = {given!r}: it must be 'model' or numbers")
            model = self.mechanism.model
            lower = model.lowerEffortLimit[self._actuated].copy()
            upper = model.upperEffortLimit[self._actuated].copy()
        elif isinstance(given, tuple) and len(given) == 2:
            lower, upper = (_spread(limit, na, "torque_limits") for limit in given)
        else:
            upper = _spread(given, na, "torque_limits")
            lower = -upper
        wrong = ~((lower <= upper) & (lower < np.inf) & (upper > -np.inf))
        if wrong.any():
            name = self._actuator_names()[int(np.argmax(wrong))]
            raise InputError(f"torque_limits of {name}: {lower[wrong][0]} to {upper[wrong][0]}")
        return lower, upper

    def _actuator_names(self) -> list[str]:
        names = column_names(self.mechanism.model)[1]
        return [f"actuator {names[i]!r}" for i in self._actuated]


def _spread(value: ArrayLike, size: int, name: str) -> Array:
    """Return one number, or as many as needed, as an array (size,) that is not NaN."""
    array = numbers(value, name, f"a number, or {size} numbers")
    if array.ndim and array.shape != (size,):
        raise InputError(f"{name} has shape {array.shape}; it must be a number or ({size},)")
    if np.isnan(array).any():
        raise InputError(f"{name} = {value!r} is not a number everywhere")
    return np.array(np.broadcast_to(array, size))
