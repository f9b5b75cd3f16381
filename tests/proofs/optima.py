"""Least |W tau| with S' tau + J' lambda = f and G (tau, lambda) >= h: what the best answer is.

The rows J and f are put together from Pinocchio's frame Jacobians and its rnea; optimality is
certified by the conditions of Karush, Kuhn and Tucker (sufficient, the problem being convex), and
what is possible at all comes from linear programming.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import linprog, nnls

from rps_pin import ClosedLoopModel
from tests.closed_loop import mechanisms
from tests.worst import worst

Array = NDArray[np.float64]


class Quality(NamedTuple):
    """Of an answer; all relative, and zero for a perfect one."""

    equations: float
    limits: float
    stationarity: float


class Distribution:
    """The forces of one state of a mechanism, x = (tau, lambda)."""

    def __init__(self, mechanism: ClosedLoopModel, q: Array, v: Array, a: Array) -> None:
        model = mechanism.model
        self.actuators = len(mechanism.actuated)
        selected = np.eye(model.nv)[:, mechanism.actuated_indices]
        rows = mechanisms.loop_jacobian(mechanism, q)
        self.equations = np.hstack([selected, rows.T])
        self.force = pin.rnea(model, model.createData(), q, v, a)
        self.size = self.equations.shape[1]
        self.limits: list[tuple[Array, float]] = []

    def limit_torques(self, limit: float) -> None:
        """-limit <= tau <= limit."""
        for sign in (1.0, -1.0):
            self.limits += [(sign * row, -limit) for row in np.eye(self.size)[: self.actuators]]

    def limit_forces(self, direction: Array, least: float) -> None:
        """direction . lambda is at least so much."""
        self.limits.append((np.concatenate([np.zeros(self.actuators), direction]), least))

    def least_peak(self) -> float:
        """The smallest limit t on every |tau| that leaves a solution, `limit_torques` apart."""
        n = self.actuators
        peak = np.zeros((2 * n, self.size + 1))  # +-tau - t <= 0
        peak[:n, :n], peak[n:, :n], peak[:, -1] = np.eye(n), -np.eye(n), -1.0
        rows = [peak, *(np.append(-row, 0.0)[None] for row, _ in self.limits)]
        right = np.concatenate([np.zeros(2 * n), [-least for _, least in self.limits]])
        answer = linprog(
            np.eye(self.size + 1)[-1],
            A_ub=np.vstack(rows),
            b_ub=right,
            A_eq=np.hstack([self.equations, np.zeros((len(self.force), 1))]),
            b_eq=self.force,
            bounds=(None, None),
        )
        assert answer.success, answer.message
        return float(answer.fun)

    def is_feasible(self) -> bool:
        """Whether any forces are within the limits."""
        answer = linprog(
            np.zeros(self.size),
            A_ub=np.vstack([-row for row, _ in self.limits]),
            b_ub=[-least for _, least in self.limits],
            A_eq=self.equations,
            b_eq=self.force,
            bounds=(None, None),
        )
        assert answer.status in (0, 2), answer.message
        return bool(answer.status == 0)

    def quality(
        self,
        tau: Array,
        forces: Array,
        weights: Array | float = 1.0,
        preferred: Array | float = 0.0,
    ) -> Quality:
        """How far an answer is from the best.

        Along the solutions of the equations, x + Z y, the slope of |W (tau - tau_0)|^2 / 2 must be
        a sum, with no negative shares, of the slopes of the limits that hold.
        """
        x = np.concatenate([tau, forces])
        scale = float(np.abs(x).max())
        missing = np.abs(self.equations @ x - self.force).max() / scale
        beyond = [least - row @ x for row, least in self.limits]
        ways = null_space(self.equations, rcond=1e-10)
        slope = ways[: self.actuators].T @ (np.square(weights) * (tau - preferred))
        size = np.linalg.norm(np.square(weights) * (tau - preferred))
        pairs = zip(self.limits, beyond, strict=True)
        held = [row @ ways for (row, _), by in pairs if by > -1e-7 * scale]
        left = np.linalg.norm(slope) if not held else nnls(np.array(held).T, slope)[1]
        return Quality(
            float(missing), worst(np.maximum(beyond, 0.0), 0.0) / scale, float(left / size)
        )
