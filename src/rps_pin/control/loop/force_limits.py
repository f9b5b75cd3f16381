"""Forces within the actuators' limits, nearest in effect to forces that exceed them.

With f* the forces of the law and B = M_x^-1 K' the pose's acceleration per actuator force, forces f
change the acceleration by B (f - f*). The limited forces solve the quadratic program

    min (f - f*)' B' M_x B (f - f*),    |f_i| <= limit_i,

by ProxQP, which starts each time from the same guess: the answer depends on the arguments alone,
not on calls before. Their motion is the nearest to the wanted one in the sense of Gauss's principle
of least constraint. B' M_x B = K M_x^-1 K' is the inverse of the inertia in actuator space.

**Pace.** A target that moves on with the clock runs away from a robot whose actuators are too weak
for it. The part of the acceleration error along the target's rate t gives the rate of change of the
pace along the trajectory (Dahl and Nielsen 1990),

    t' M_x (acceleration error) / (t' M_x t),

per second and relative to the pace; see `Controller.pace`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import eigenpy
import numpy as np
import proxsuite

from rps_pin.arrays import Array
from rps_pin.control.any_task.motion import TaskJacobian
from rps_pin.control.estimator.leg_jacobian import LegJacobian
from rps_pin.numerics.elementary import Number, less, select

#: Least pace of a target.
LEAST_PACE = 0.05
#: Time constant of its return to 1, s.
_RECOVERY = 0.2
#: Of ProxQP, with variables scaled by the limits.
_TOLERANCE = 1e-11
_MOST_ITERATIONS = 100
#: Weight of forces without effect, where there are more actuators than coordinates.
_NEAREST = 1e-7
#: Kinetic energy of the target's motion, J, below which it has no direction.
_AT_REST = 1e-18


class LimitedForces(NamedTuple):
    """Forces within the limits and the effect of limiting them."""

    force: Any
    """f, N, a tuple; within the limits exactly."""
    acceleration_error: Any
    """B (f - f*): change of the pose's acceleration, m/s^2, rad/s^2."""
    pace_rate: float
    """Relative rate of change of the pace, 1/s; negative: slower."""
    solved: bool
    """Whether the program was solved; otherwise each force was limited by itself."""


def recovered_pace(pace: Number, elapsed: Number) -> Number:
    """Return the pace after a time (s) within the limits: it returns to 1."""
    share = elapsed / _RECOVERY
    return pace + (1.0 - pace) * select(less(share, 1.0), share, 1.0)


def within_limits(force: Any, limit: Any) -> Number:
    """Return whether no force is beyond its limit."""
    found: Number = True
    for f, most in zip(force, limit, strict=True):
        found = found * (abs(f) <= most)
    return found


class ForceLimits:
    """The quadratic program of one robot, with its memory allocated once; for use in one thread.

    Parameters
    ----------
    limit
        Of each actuator, N; positive, infinite for none.
    """

    def __init__(self, limit: tuple[float, ...]) -> None:
        self.limit = limit
        count = len(limit)
        self._size = np.minimum(limit, 1e12)  # finite, for the scaling
        self._factors = eigenpy.LDLT(count)
        proxqp = proxsuite.proxqp
        self._solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        self._problem = problem = proxqp.dense.QP(count, 0, 0, True)  # True: bounds on variables
        settings = problem.settings
        settings.eps_abs, settings.eps_rel = _TOLERANCE, 0.0
        settings.max_iter = settings.max_iter_in = _MOST_ITERATIONS
        settings.initial_guess = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
        # Without it ProxQP accepts a guess that is feasible but not optimal.
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = _TOLERANCE, 0.0
        ones = np.ones(count)
        problem.init(np.eye(count), np.zeros(count), None, None, None, None, None, -ones, ones)
        problem.solve()

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies scratch memory of their own; there is no state."""
        return type(self), (self.limit,)

    def within(self, force: Any) -> bool:
        """Return whether forces keep the limits."""
        return bool(within_limits(force, self.limit))

    def clipped(self, force: Any) -> Any:
        """Return forces limited one by one, a tuple."""
        return tuple([max(-most, min(most, f)) for f, most in zip(force, self.limit, strict=True)])

    @np.errstate(all="ignore")  # the largest floats overflow: they neither raise nor warn
    def nearest(
        self, wanted: Any, mass: Array, jacobian: LegJacobian | TaskJacobian, rate: Any
    ) -> LimitedForces:
        """Return the limited forces nearest in effect to finite forces beyond the limits.

        Parameters
        ----------
        wanted
            f*, N or N m.
        mass
            M_x, shape (m, m).
        jacobian
            K at the pose.
        rate
            The target's: m/s, rad/s, rad/s.
        """
        by_pose, goal = np.array(jacobian.K), np.array(wanted)
        self._factors.compute(mass)
        effect = self._factors.solve(by_pose.T)  # B
        hessian = self._size * (by_pose @ effect) * self._size[:, None]
        share = goal / self._size
        scale = sum(hessian.diagonal().tolist())
        hessian /= scale * max(1.0, *map(abs, share.tolist()))
        if len(mass) < len(goal):  # forces without effect: among equals the nearest
            hessian += _NEAREST * np.eye(len(goal))
        self._problem.update(H=hessian, g=-hessian.dot(share))
        self._problem.solve()
        results = self._problem.results
        found = results.x
        solved = results.info.status == self._solved and math.isfinite(found.sum())
        force = self.clipped((found * self._size).tolist() if solved else goal.tolist())
        error = effect.dot(np.array(force) - goal)
        direction = np.array(rate)
        momentum = mass.dot(direction)
        energy = float(momentum.dot(direction))
        pace_rate = float(momentum.dot(error)) / energy if energy > _AT_REST else 0.0
        return LimitedForces(force, tuple(error.tolist()), pace_rate, solved)
