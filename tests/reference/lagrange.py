"""Lagrange's equations with multipliers, by SymPy: the textbook way to a closed loop.

The coordinates q are those of the opened loops, and phi(q) = 0 closes them. SymPy differentiates

    d/dt dT/dv - dT/dq + dV/dq = S' tau + (dphi/dq)' lambda,

and the numbers are put in last. Nothing here knows a closed form of the loop, or of its rates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from tests.closed_loop.mechanisms import GRAVITY, Bar

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moving:
    """A body: mass, moment of inertia, centre of mass (any dimension, height last), angle."""

    mass: float
    inertia: float
    com: sp.Matrix
    angle: sp.Expr


def bar_body(bar: Bar, place: sp.Matrix, angle: sp.Expr) -> Moving:
    """A bar in the x-z plane."""
    along = sp.Matrix([sp.cos(angle), sp.sin(angle)])
    across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])
    return Moving(bar.mass, bar.inertia, place + bar.along * along + bar.across * across, angle)


class Lagrange:
    """The equations of motion of some bodies in coordinates q, loops closed by phi(q) = 0."""

    def __init__(
        self, q: Sequence[sp.Symbol], bodies: Sequence[Moving], loops: Sequence[sp.Expr]
    ) -> None:
        place = sp.Matrix(q)
        speed = sp.Matrix(sp.symbols(f"rate:{len(q)}"))
        kinetic, potential = sp.Integer(0), sp.Integer(0)
        for one in bodies:
            velocity = one.com.jacobian(place) * speed
            turning = (sp.Matrix([one.angle]).jacobian(place) * speed)[0]
            kinetic += one.mass * velocity.dot(velocity) / 2 + one.inertia * turning**2 / 2
            potential += one.mass * GRAVITY * one.com[-1]
        momentum = sp.Matrix([kinetic]).jacobian(speed).T
        mass = momentum.jacobian(speed)
        slope = sp.Matrix([kinetic - potential]).jacobian(place).T
        bias = momentum.jacobian(place) * speed - slope
        phi = sp.Matrix(loops)
        rows = phi.jacobian(place)
        drift = (rows * speed).jacobian(place) * speed
        arguments = (*place, *speed)
        self._terms = sp.lambdify(arguments, [mass, bias, rows, drift, phi], cse=True)

    def terms(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array, Array]:
        """M (n, n), bias (n,), dphi/dq (k, n), its change times v (k,), phi (k,)."""
        mass, bias, rows, drift, phi = (np.array(x, dtype=float) for x in self._terms(*q, *v))
        return mass, bias.ravel(), rows, drift.ravel(), phi.ravel()

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, driven: Sequence[int]
    ) -> tuple[Array, Array]:
        """Solve S' tau + (dphi/dq)' lambda = M a + bias for tau and lambda."""
        mass, bias, rows, _, _ = self.terms(q, v)
        columns = np.hstack([np.eye(len(q))[:, list(driven)], rows.T])
        solution = np.linalg.solve(columns, mass @ a + bias)
        return solution[: len(driven)], solution[len(driven) :]

    def completed(
        self, q: Array, v_driven: Array, a_driven: Array, driven: Sequence[int]
    ) -> tuple[Array, Array]:
        """The velocity and acceleration (n,) that keep the loops closed."""
        n, k = len(q), list(driven)
        selected = np.eye(n)[k]
        rows = self.terms(q, np.zeros(n))[2]
        matrix = np.vstack([selected, rows])
        v = np.linalg.solve(matrix, np.concatenate([v_driven, np.zeros(len(rows))]))
        drift = self.terms(q, v)[3]
        return v, np.linalg.solve(matrix, np.concatenate([a_driven, -drift]))
