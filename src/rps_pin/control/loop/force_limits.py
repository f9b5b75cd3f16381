"""Forces within the actuators' limits whose effect is nearest to that of forces that are not.

With f* the forces wanted and B = M_x^-1 K' the platform's acceleration by the actuators' forces,
forces f miss the acceleration wanted by B (f - f*). They are those of the quadratic program

    min (f - f*)' B' M_x B (f - f*),    |f_i| <= limit_i,

solved by ProxQP: the motion nearest to the one wanted in the sense of Gauss's principle of least
constraint, by which constraints of any kind change a motion. B' M_x B = K M_x^-1 K' is the inverse
of the inertia that the actuators see.

**Pace.** A target that goes on by the clock runs away from a robot that is too weak for it, and no
choice of forces mends that. So along the target's rate t, what is missing asks for another time
along the trajectory (Dahl and Nielsen 1990): its rate should change by

    t' M_x (missing) / (t' M_x t),

per second and of itself; see `Controller.pace`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import eigenpy
import numpy as np
import proxsuite

from rps_pin.arrays import Array
from rps_pin.control.estimator.scalar_rates import LegGains
from rps_pin.rps.kinematics.tracking import Triple

#: Of ProxQP, on a problem whose variables are shares of the limits.
_TOLERANCE = 1e-9
_MOST_ITERATIONS = 100
#: With less kinetic energy than this, J, a target has no direction.
_STANDING = 1e-18


class Allowed(NamedTuple):
    """Forces within the limits, and what became of the wanted ones."""

    force: Triple
    """N; within the limits, exactly."""
    missing: Triple
    """B (f - f*): what the pose's acceleration will differ by, m/s^2, rad/s^2."""
    hurry: float
    """By how much the target's rate should change a second, of itself, 1/s; negative: slow down."""
    solved: bool
    """Whether the program was solved; else the wanted forces are cut off one by one."""


class ForceLimits:
    """The program of one robot, its memory allocated once; for use in one thread.

    Parameters
    ----------
    limit
        Of each actuator, N; positive, infinite for none.
    """

    def __init__(self, limit: Triple) -> None:
        self.limit = limit
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

    def nearest(self, wanted: Triple, mass: Array, gains: LegGains, rate: Triple) -> Allowed:
        """Return the forces nearest in effect to finite ones that break the limits.

        Parameters
        ----------
        wanted
            f*, N.
        mass
            M_x, shape (3, 3).
        gains
            K at the pose.
        rate
            The target's: m/s, rad/s, rad/s.
        """
        by_pose, goal = np.array(gains.K), np.array(wanted)
        self._factors.compute(mass)
        effect = self._factors.solve(by_pose.T)  # B
        hessian = self._size * (by_pose @ effect) * self._size[:, None]
        share = goal / self._size
        (d1, d2, d3), (a, b, c) = hessian.diagonal().tolist(), share.tolist()
        hessian /= (d1 + d2 + d3) * max(1.0, abs(a), abs(b), abs(c))
        self._problem.update(H=hessian, g=-hessian.dot(share))
        self._problem.solve()
        results = self._problem.results
        found = results.x
        solved = results.info.status == self._solved and math.isfinite(found.sum())
        f1, f2, f3 = (found * self._size).tolist() if solved else wanted
        force = self.cut((f1, f2, f3))
        missing = effect.dot(np.array(force) - goal)
        along = np.array(rate)
        momentum = mass.dot(along)
        energy = float(momentum.dot(along))
        hurry = float(momentum.dot(missing)) / energy if energy > _STANDING else 0.0
        one, two, three = missing.tolist()
        return Allowed(force, (one, two, three), hurry, solved)
