"""Derivatives of the dynamics of a mechanism, as CasADi expressions.

The equations are those of `rps_pin.closed_loop.dynamics.derivatives`: with F = rnea + passive -
external forces - J' lambda (lambda held) and c = J a + J' v,

    inverse dynamics     dtau = T' dF;
    forward dynamics     da = T dw + x,  J x = -dc,  (T' M T) dw = T' (S' dtau - dF - M x),

and in independent coordinates y, which the rest follows,

    dq = T dy,    dv = T dy' + V_y dy,    da = T dy'' + A_y dy + A_y' dy',
    J V_y = -(J v)_q T,    J A_y = -(c_q T + c_v V_y),    J A_y' = -c_v T.

The derivatives of rnea are in closed form (see `rnea_derivatives`); of the rest of F, of J v and of
c, CasADi's: the factors of A_d are used again, not
differentiated. Derivatives by q are along the tangent of the configuration.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import casadi as ca

from rps_pin.codegen.expressions.mechanism import Expression, MechanismExpressions
from rps_pin.codegen.expressions.rnea_derivatives import rnea_derivatives


class InverseSlopes(NamedTuple):
    """Derivatives of tau, (m, nv) and (m, m) each; see `InverseDynamicsDerivatives`."""

    q: Expression
    v: Expression
    a: Expression
    position: Expression
    velocity: Expression
    acceleration: Expression


class ForwardSlopes(NamedTuple):
    """Derivatives of a; see `ForwardDynamicsDerivatives`."""

    q: Expression
    v: Expression
    tau: Expression
    position: Expression
    velocity: Expression
    actuation: Expression


class Slopes:
    """Derivatives at a motion q, v, a with multipliers lambda of the rows; all symbols.

    Parameters
    ----------
    x
        The mechanism.
    """

    def __init__(self, x: MechanismExpressions) -> None:
        self.x = x
        self.multipliers = ca.SX.sym("multipliers", x.rows.gap.shape[0])
        self._tangent = x.tree.tangent(x.q)
        #: F without rnea, whose derivatives are known in closed form.
        self._rest = x.passive_forces - x.external_forces - x.rows.jacobian.T @ self.multipliers
        self._rnea_slopes = rnea_derivatives(x.tree, x.v, x.a)
        self._opening = x.rows.jacobian @ x.a + x.rows.bias

    def _by_q(self, expression: Expression) -> Expression:
        return ca.sparsify(ca.jacobian(expression, self.x.q) @ self._tangent)

    @cached_property
    def force_q(self) -> Expression:
        """F_q, shape (nv, nv)."""
        return ca.sparsify(self._rnea_slopes[0] + self._by_q(self._rest))

    @cached_property
    def force_v(self) -> Expression:
        """F_v, shape (nv, nv)."""
        return ca.sparsify(self._rnea_slopes[1] + ca.jacobian(self._rest, self.x.v))

    @cached_property
    def _follow(self) -> tuple[Expression, Expression, Expression]:
        """Return V_y, A_y and A_y', shape (nv, m)."""
        x = self.x
        rate_q = self._by_q(x.rows.jacobian @ x.v)
        velocity = self._held(rate_q @ x.basis)
        acceleration = self._held(self.opening_q @ x.basis + self.opening_v @ velocity)
        return velocity, acceleration, self._held(self.opening_v @ x.basis)

    @cached_property
    def opening_q(self) -> Expression:
        """c_q, shape (nc, nv)."""
        return self._by_q(self._opening)

    @cached_property
    def opening_v(self) -> Expression:
        """c_v, shape (nc, nv)."""
        return ca.jacobian(self._opening, self.x.v)

    def _held(self, opening: Expression) -> Expression:
        """Return X (nv, k) with J X = -opening, zero for the independent velocities."""
        return ca.sparsify(-self.x.dependent(self.x.in_units(opening)))

    def at(self, multipliers: Expression, slopes: dict[str, Expression]) -> dict[str, Expression]:
        """Return derivatives with an expression in place of the multipliers."""
        values = ca.substitute(list(slopes.values()), [self.multipliers], [ca.densify(multipliers)])
        return dict(zip(slopes, values, strict=True))

    def inverse(self) -> InverseSlopes:
        """Return the derivatives of the actuator forces, the independent joints being actuated."""
        T, M = self.x.basis, self.x.tree.mass_matrix()
        V_y, A_y, A_dy = self._follow
        by_q, by_v, by_a = T.T @ self.force_q, T.T @ self.force_v, T.T @ M
        return InverseSlopes(
            by_q,
            by_v,
            by_a,
            T.T @ (self.force_q @ T + self.force_v @ V_y + M @ A_y),
            T.T @ (self.force_v @ T + M @ A_dy),
            self.x.mass_matrix,
        )

    def forward(self) -> ForwardSlopes:
        """Return the derivatives of the acceleration.

        Those of the independent entries: (T' M T) da_i = S' dtau less what inverse dynamics asks.
        """
        x = self.x
        T, M = x.basis, x.tree.mass_matrix()

        def response(of_force: Expression, opening: Expression) -> Expression:
            """Return da of dF and dc, shapes (nv, k) and (nc, k)."""
            held = self._held(opening)
            along = x.inertia.solve(ca.sparsify(-(T.T @ (of_force + M @ held))))
            return T @ along + held

        by_q, by_v = response(self.force_q, self.opening_q), response(self.force_v, self.opening_v)
        inverse = self.inverse()
        of_actuators = ca.sparsify(T[x.system.actuated.tolist(), :].T)
        along = x.inertia.solve(of_actuators)
        return ForwardSlopes(
            by_q,
            by_v,
            T @ along,
            -x.inertia.solve(ca.sparsify(inverse.position)),
            -x.inertia.solve(ca.sparsify(inverse.velocity)),
            along,
        )
