"""Derivatives of the dynamics of a mechanism, as CasADi expressions.

The equations are those of `rps_pin.closed_loop.dynamics.derivatives`: with F = rnea + passive -
external forces - J' lambda (lambda held) and c = J a + J' v,

    inverse dynamics     dtau = T' dF;
    forward dynamics     (T' M T) da_i = S' dtau - T' (dF + M x),  J x = -dc,  x_i = 0,
                         J_d da_d = -(dc + J_i da_i),

and in independent coordinates y, which the rest follows,

    dq = T dy,    dv = T dy' + V_y dy,    J V_y = -(J v)_q T,

    dtau = T' (F_q + M X_q) T dy + T' (F_v + M X_v) (T dy' + V_y dy) + T' M T dy'',
    da_i = a_iq T dy + a_iv (T dy' + V_y dy) + a_itau dtau,

X_q and X_v being the x of c_q and c_v. T' M x needs no x: it is -Y' dc with J_d' Y = (M T)_d.
The derivatives of rnea are in closed form (see `rnea_derivatives`); of the rest of F, of J v and of
c, CasADi's: the factors of J_d are used again, not
differentiated. Derivatives by q are along the tangent of the configuration.

Derivatives by q alone, or v alone, lead off the closed motions, where the rows of spherical and
rigid closures in a moving body's axes and in the package's are not turned alike. With w and w' that
body's angular velocity and acceleration, e the gap, e' = J v and mu the multipliers, all zero but
w, w' and mu, the package's c, in the body's axes, has in addition

    spherical   2 w x de' + w' x de + w x (w x de),    and F has  -W' (de x mu),  w = W v;
    rigid       w x de'.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import casadi as ca

from rps_pin.codegen.expressions.closures import Carrier
from rps_pin.codegen.expressions.mechanism import Expression, MechanismExpressions
from rps_pin.codegen.expressions.rnea_derivatives import rnea_derivatives
from rps_pin.codegen.linear_maps import LinearMap


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
        self._carriers = x.rows.carriers()

    def _by_q(self, expression: Expression) -> Expression:
        return ca.sparsify(ca.jacobian(expression, self.x.q) @ self._tangent)

    @cached_property
    def force_q(self) -> Expression:
        """F_q, shape (nv, nv)."""
        slope = self._rnea_slopes[0] + self._by_q(self._rest)
        for carrier in self._carriers:
            if carrier.is_point:
                along = (
                    ca.skew(self.multipliers[carrier.rows]) @ self.x.rows.jacobian[carrier.rows, :]
                )
                slope += carrier.spin_jacobian.T @ along
        return ca.sparsify(slope)

    @cached_property
    def force_v(self) -> Expression:
        """F_v, shape (nv, nv)."""
        return ca.sparsify(self._rnea_slopes[1] + ca.jacobian(self._rest, self.x.v))

    @cached_property
    def rate_q(self) -> Expression:
        """(J v)_q, shape (nc, nv)."""
        return self._by_q(self.x.rows.jacobian @ self.x.v)

    @cached_property
    def opening_q(self) -> Expression:
        """c_q, shape (nc, nv)."""
        slope = self._by_q(self._opening)
        for carrier in self._carriers:
            slope[carrier.rows, :] += self._turned(
                carrier, self.rate_q[carrier.rows, :], self.x.rows.jacobian[carrier.rows, :]
            )
        return ca.sparsify(slope)

    @cached_property
    def opening_v(self) -> Expression:
        """c_v, shape (nc, nv)."""
        slope = ca.jacobian(self._opening, self.x.v)
        for carrier in self._carriers:
            slope[carrier.rows, :] += self._turned(carrier, self.x.rows.jacobian[carrier.rows, :])
        return ca.sparsify(slope)

    def _turned(
        self, carrier: Carrier, rates: Expression, gaps: Expression | None = None
    ) -> Expression:
        """Return the additional terms of dc, of changes of e' and e, shape (rows, nv) each."""
        spin = ca.skew(carrier.spin)
        if not carrier.is_point:
            return ca.vertcat(*(spin @ part for part in ca.vertsplit(rates, 3)))
        turned = 2 * spin @ rates
        if gaps is not None:
            spin_rate = carrier.spin_rate + carrier.spin_jacobian @ self.x.a
            turned += (ca.skew(spin_rate) + spin @ spin) @ gaps
        return turned

    def _reduced(self, of_force: Expression, opening: Expression) -> Expression:
        """Return T' (dF + M x), (m, k), for the x with J x = -opening and no independent entries.

        T' M x = -Y' opening, J_d' Y = (M T)_d.
        """
        x, reduced = self.x, self.x.basis.T @ of_force
        dependent = x.partition.dependent.tolist()
        if dependent:
            reduced -= self._adjoint.T @ opening
        return ca.sparsify(reduced)

    @cached_property
    def _adjoint(self) -> Expression:
        """Y, shape (nc, m)."""
        return self.x.factors.transposed(
            self.x.mass_times_basis[self.x.partition.dependent.tolist(), :]
        )

    @cached_property
    def _reduced_q(self) -> Expression:
        return self._reduced(self.force_q, self.opening_q)

    @cached_property
    def _reduced_v(self) -> Expression:
        return self._reduced(self.force_v, self.opening_v)

    def by_parameters(self) -> tuple[Expression, Expression]:
        """Return the gaps' derivatives by the parameters, (nc, np), and those of T' F, (m, np).

        The second with independent positions, velocities and accelerations held, which the rest of
        the mechanism follows with its loops closed:

            dq = X dp,  dv = V dp,  J X = -e_p,  J V = -((J v)_p + (J v)_q X),
            d(T' F) = T' F_p + T' (F_q X + F_v V) + T' M A,  J A = -(c_p + c_q X + c_v V).
        """
        x, p = self.x, self.x.parameters.symbols
        gaps = ca.jacobian(x.rows.gap, p)
        rate = x.rows.jacobian @ x.v
        followed = -x.dependent(ca.sparsify(gaps))
        opening = ca.jacobian(rate, p) + self._by_q(rate) @ followed
        speeds = -x.dependent(ca.sparsify(opening))
        whole = x.tree.rnea(x.v, x.a) + self._rest
        force = ca.jacobian(whole, p) + self.force_q @ followed + self.force_v @ speeds
        bias = ca.jacobian(self._opening, p) + self.opening_q @ followed + self.opening_v @ speeds
        return gaps, self._reduced(ca.sparsify(force), ca.sparsify(bias))

    def at(self, multipliers: Expression, slopes: dict[str, Expression]) -> dict[str, Expression]:
        """Return derivatives with an expression in place of the multipliers."""
        values = ca.substitute(list(slopes.values()), [self.multipliers], [ca.densify(multipliers)])
        return dict(zip(slopes, values, strict=True))

    @cached_property
    def followed(self) -> Expression:
        """V_y, shape (nv, m)."""
        return ca.sparsify(-self.x.dependent(self.rate_q @ self.x.basis))

    def inverse(self) -> InverseSlopes:
        """Return the derivatives of the actuator forces, the independent joints being actuated."""
        x, T = self.x, self.x.basis
        return InverseSlopes(
            T.T @ self.force_q,
            T.T @ self.force_v,
            x.mass_times_basis.T,
            self._reduced_q @ T + self._reduced_v @ self.followed,
            self._reduced_v @ T,
            x.mass_matrix,
        )

    def changes(self) -> tuple[Expression, Expression]:
        """Return T' (dF + M x - S' dtau) and dc by q, v and tau side by side.

        Shapes (m, 2 nv + na) and (nc, 2 nv + na).
        """
        x = self.x
        of_actuators = x.basis[x.system.actuated.tolist(), :].T
        still = ca.SX(x.rows.gap.numel(), x.tau.numel())
        reduced = ca.horzcat(self._reduced_q, self._reduced_v, -of_actuators)
        return ca.sparsify(reduced), ca.horzcat(self.opening_q, self.opening_v, still)

    def forward(self) -> ForwardSlopes:
        """Return the derivatives of the acceleration."""
        x, nv = self.x, self.x.tree.model.nv
        independent = x.independent.tolist()
        by_q, by_v, by_tau = ca.horzsplit(
            x.response(*self.changes()), [0, nv, 2 * nv, 2 * nv + x.tau.numel()]
        )
        of_q, of_v = by_q[independent, :], by_v[independent, :]
        return ForwardSlopes(
            by_q,
            by_v,
            by_tau,
            of_q @ x.basis + of_v @ self.followed,
            of_v @ x.basis,
            by_tau[independent, :],
        )


class ForwardColumns:
    """What the derivatives of the acceleration are computed from, column by column.

    Attributes
    ----------
    right
        T' (dF + M x - S' dtau) above dc, by q, v and tau side by side, sparse, shape
        (m + nc, 2 nv + na).
    response : LinearMap
        From a column of these to one of da.
    basis, followed
        Rows of T and V_y of the dependent velocities, sparse, shape (nd, m).
    """

    def __init__(self, x: MechanismExpressions, multipliers: Expression) -> None:
        slopes = Slopes(x)
        dependent = x.partition.dependent.tolist()
        reduced = ca.SX.sym("reduced", x.independent.size)
        opening = ca.SX.sym("opening", x.rows.gap.numel())
        self.response = LinearMap(ca.vertcat(reduced, opening), x.response(reduced, opening))
        right = ca.sparsify(ca.vertcat(*slopes.changes()))
        self.right = slopes.at(multipliers, {"right": right})["right"]
        self.basis = ca.sparsify(x.basis[dependent, :])
        self.followed = ca.sparsify(slopes.followed[dependent, :])
