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

import eigenpy
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
        self._factors = eigenpy.LDLT(3)
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
        self._factors.compute(mass)
        effect = self._factors.solve(np.array(gains.K).T)  # B
        goal = np.array(wanted)
        weighted = (self._weights(gains.L, path) @ effect) * self._size
        hessian = weighted.T @ weighted
        share = goal / self._size
        a, b, c = share.tolist()
        size = float(weighted.ravel().dot(weighted.ravel()))  # the trace
        hessian /= size * max(1.0, abs(a), abs(b), abs(c))
        self._problem.update(H=hessian, g=-hessian.dot(share))
        self._problem.solve()
        results = self._problem.results
        found = results.x
        solved = results.info.status == self._solved and math.isfinite(found.sum())
        f1, f2, f3 = (found * self._size).tolist() if solved else wanted
        force = self.cut((f1, f2, f3))
        one, two, three = effect.dot(np.array(force) - goal).tolist()
        return Allowed(force, (one, two, three), solved)

    def _weights(self, factor: tuple[Triple, Triple, Triple], path: Triple) -> Array:
        """Return W = (1 - (1 - sqrt(along)) n n') L', one of those that there are."""
        (l00, _, _), (l10, l11, _), (l20, l21, l22) = factor
        p1, p2, p3 = path
        t1, t2, t3 = l00 * p1 + l10 * p2 + l20 * p3, l11 * p2 + l21 * p3, l22 * p3
        speed = math.sqrt(t1 * t1 + t2 * t2 + t3 * t3)
        if not speed > _STANDING:
            return np.array(((l00, l10, l20), (0.0, l11, l21), (0.0, 0.0, l22)))
        n1, n2, n3 = t1 / speed, t2 / speed, t3 / speed
        less = 1.0 - math.sqrt(self._along)
        m1, m2, m3 = n1 * l00, n1 * l10 + n2 * l11, n1 * l20 + n2 * l21 + n3 * l22  # n' L'
        k1, k2, k3 = less * n1, less * n2, less * n3
        return np.array(
            (
                (l00 - k1 * m1, l10 - k1 * m2, l20 - k1 * m3),
                (-k2 * m1, l11 - k2 * m2, l21 - k2 * m3),
                (-k3 * m1, -k3 * m2, l22 - k3 * m3),
            )
        )
