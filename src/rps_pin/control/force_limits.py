"""Forces within the actuators' limits whose effect is nearest to that of forces that are not.

With f* the forces wanted and B = M_x^-1 K' the platform's acceleration by the actuators' forces,
forces f miss the acceleration wanted by B (f - f*). They are those of the quadratic program

    min |W B (f - f*)|^2,    |f_i| <= limit_i,

solved by ProxQP. W makes accelerations of the pose ones of the platform's balls: with the Cholesky
factor L of `LegGains`, |L' x''|^2 / 3 is their mean square, in m^2/s^4, however z and tilts are
mixed. Across the path an error counts more than along it: with t the direction of the target's
rate,

    W' W = L (1 - (1 - along) n n') L',    n = L' t / |L' t|:

a robot that is too weak for its target then falls behind on its path, rather than leave it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import proxsuite
from numpy.typing import NDArray

from rps_pin.control.scalar_rates import LegGains
from rps_pin.rps.scalar_tracking import Triple

Array = NDArray[np.float64]

#: Of ProxQP, on a problem whose variables are shares of the limits.
_TOLERANCE = 1e-9
_MOST_ITERATIONS = 100
#: Slower than this, m/s of the balls, a target has no direction.
_STANDING = 1e-9


class Allowed(NamedTuple):
    """Forces within the limits, and what became of the wanted ones."""

    force: Triple
    """N; within the limits, exactly."""
    missing: Triple
    """B (f - f*): what the pose's acceleration will differ by, m/s^2, rad/s^2."""
    solved: bool
    """Whether the program was solved; else the wanted forces are cut off one by one."""


class ForceLimits:
    """The program of one robot, its memory allocated once; for use in one thread.

    Parameters
    ----------
    limit
        Of each actuator, N; positive, infinite for none.
    along
        How much the square of an error along the path counts, 0 to 1, beside one across it.
    """

    def __init__(self, limit: Triple, along: float) -> None:
        self.limit = limit
        self._along = along
        self._size = np.minimum(limit, 1e12)  # shares of no limit are none
        proxqp = proxsuite.proxqp
        self._solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        self._problem = problem = proxqp.dense.QP(3, 0, 0, True)  # True: bounds on variables
        settings = problem.settings
        settings.eps_abs, settings.eps_rel = _TOLERANCE, 0.0
        settings.max_iter = settings.max_iter_in = _MOST_ITERATIONS
        settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        # Without it a warm start that is feasible, but not optimal, is taken for the solution.
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = _TOLERANCE, 0.0
        ones = np.ones(3)
        problem.init(np.eye(3), np.zeros(3), None, None, None, None, None, -ones, ones)
        problem.solve()

    def within(self, force: Triple) -> bool:
        """Return whether forces keep the limits."""
        (f1, f2, f3), (l1, l2, l3) = force, self.limit
        return -l1 <= f1 <= l1 and -l2 <= f2 <= l2 and -l3 <= f3 <= l3

    def cut(self, force: Triple) -> Triple:
        """Return forces cut off one by one."""
        one, two, three = (
            max(-most, min(most, f)) for f, most in zip(force, self.limit, strict=True)
        )
        return one, two, three

    def nearest(self, wanted: Triple, mass: Array, gains: LegGains, path: Triple) -> Allowed:
        """Return the forces nearest in effect to finite ones that break the limits.

        Parameters
        ----------
        wanted
            f*, N.
        mass
            M_x, shape (3, 3).
        gains
            K and L at the pose.
        path
            The target's rate: m/s, rad/s, rad/s.
        """
        effect = np.linalg.solve(mass, np.array(gains.K).T)  # B
        goal = np.array(wanted)
        weighted = self._weighted(np.array(gains.L), effect, path) * self._size
        hessian = weighted.T @ weighted
        share = goal / self._size
        scale = float(hessian.trace()) * max(1.0, float(np.abs(share).max()))
        hessian /= scale
        self._problem.update(H=hessian, g=-(hessian @ share))
        self._problem.solve()
        results = self._problem.results
        found = results.x
        solved = results.info.status == self._solved and math.isfinite(float(found.sum()))
        force = self.cut(tuple((found * self._size).tolist()) if solved else wanted)
        one, two, three = (effect @ (np.array(force) - goal)).tolist()
        return Allowed(force, (one, two, three), solved)

    def _weighted(self, factor: Array, effect: Array, path: Triple) -> Array:
        """Return W B, for one of the W that there are."""
        balls = factor.T @ effect
        along = factor.T @ np.array(path)
        speed = math.sqrt(float(along @ along))
        if not speed > _STANDING:
            return balls
        n = along / speed
        return balls - (1.0 - math.sqrt(self._along)) * np.outer(n, n @ balls)
