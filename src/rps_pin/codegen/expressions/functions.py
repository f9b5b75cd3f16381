"""Quantities of a mechanism as named CasADi functions, from which C and CUDA are generated.

Where it says (check), the last result of the function is ``check``: the opening of the loops and
the growth of rounding errors, at most 1 each where the other results hold (see `mechanism`).
External wrenches (6 for each frame, force and moment in world axes at the frame's origin) and
parameters follow the arguments listed, if the mechanism was given any.

============================  ==============  ======================================================
name                          arguments       results
============================  ==============  ======================================================
gaps                          q               e (nc)
jacobian                      q               J (nc nv)
gap_accelerations             q, v, a         J a + J' v (nc)
motion_basis                  q               T (nv m) (check)
velocity                      q, u            v (nv) (check)
acceleration                  q, v, w         a (nv) (check)
inverse_dynamics              q, v, a         tau (na), lambda (nc), residual (1); if there are
                                              fewer actuators than motions: residual force (nv), its
                                              squared share (1) (check)
forward_dynamics              q, v, tau       a (nv) (check)
constraint_forces             q, v, a, tau    lambda (nc) (check)
generalised_force             q, v, a         rnea + passive - external forces (nv)
equations_of_motion           q, v, a, tau,   rnea + passive - external forces - S' tau
                              lambda          - J' lambda (nv)
tree_mass_matrix              q               M (nv nv)
mass_matrix                   q               T' M T (m m) (check)
bias                          q, v            T' (required force of a_0) (m) (check)
gravity_forces                q               T' g (m) (check)
energy                        q, v            kinetic, potential (2)
inverse_dynamics_derivatives  q, v, a         derivatives of tau by q, v, a (m nv each), by
                                              position, velocity, acceleration (m m each) (check)
forward_dynamics_derivatives  q, v, tau       derivatives of a by q, v (nv nv), tau (nv na), and of
                                              its independent entries: position, velocity (m m),
                                              actuation (m na) (check)
integrate                     q, dv           q (nq)
tangent                       q               dq/dt of each velocity (nq nv)
unit_lengths                  q               squared lengths, less 1, of quaternions and
                                              (cos, sin) (nq - nv)
closing_step                  q               dv of the dependent velocities (nv), squared gap (1),
                                              growth (1)
continuing_step               q               the same, and the sign of det J_d but for a constant
                                              (1); 1 where J_d is not square
stage                         q, v, tau       a (nv), power of actuators, wrenches, damping and
                                              friction (1), growth (1)
least_norm_step               q               dv of least norm (nv), squared gap (1), growth (1)
nearest_step                  q, q'           dv towards q' in the allowed motions (nv), squared
                                              distance and squared dv in one unit (1), growth (1)
projection                    q, v            dv of least norm (nv), v less its opening part of
                                              least norm (nv), squared gap (1), growth (1)
projected_velocity            q, v            v (nv), its dependent entries changed
============================  ==============  ======================================================

With parameters there are also their derivatives: ``gaps_by_parameters`` (q), (nc np);
``inverse_dynamics_by_parameters`` (q, v, a), those of T' f (m np), f the required force, which is
tau where the actuated joints are the independent ones; ``forward_dynamics_by_parameters`` (q, v,
tau), those of the independent accelerations (m np); both (check). Independent positions,
velocities and accelerations are held; the rest of the mechanism follows, its loops closed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import casadi as ca

from rps_pin.codegen.expressions.derivatives import (
    ForwardColumns,
    ForwardSlopes,
    InverseSlopes,
    Slopes,
)
from rps_pin.codegen.expressions.elimination import LDL
from rps_pin.codegen.expressions.mechanism import Expression, MechanismExpressions


class MechanismFunctions:
    """The functions of one mechanism, each made when it is asked for.

    Parameters
    ----------
    expressions
        The mechanism.
    """

    def __init__(self, expressions: MechanismExpressions) -> None:
        self.expressions = expressions
        self._made: dict[str, Any] = {}

    def names(self) -> list[str]:
        """Return the names of all functions."""
        with_parameters = bool(self.expressions.parameters.labels)
        return [name for name in _MAKERS if with_parameters or not name.endswith("_by_parameters")]

    def __getitem__(self, name: str) -> Any:
        """Return the `casadi.Function` of a name."""
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    @cached_property
    def forward_columns(self) -> ForwardColumns:
        """What ``forward_columns`` gives the nonzero numbers of."""
        x = self.expressions
        columns = ForwardColumns(x, _multipliers(x))
        columns.right = ca.substitute(columns.right, x.a, x.acceleration)
        return columns

    def _make(self, name: str) -> Any:
        x = self.expressions
        kind, _, index = name.rpartition("_")
        if kind in ("frame", "frame_jacobian"):
            given, results = _of_frame(x, int(index), kind)
        elif name == "forward_columns":
            given, results = _of_columns(x, self.forward_columns)
        else:
            given, results = _MAKERS[name](x)
        if x.wrench_frames and name in UNDER_WRENCHES:
            given["wrenches"] = x.wrenches
        if x.parameters.labels:
            given["parameters"] = x.parameters.symbols
        outputs = ca.cse([ca.SX(result) for result in results.values()])
        return ca.Function(name, list(given.values()), outputs, list(given), list(results))


def is_matrix(result: str) -> bool:
    """Return whether a result of this name is a matrix, even if it has a single column."""
    return result in ("jacobian", "basis", "placement", "mass") or result.startswith("by_")


Made = tuple[dict[str, Expression], dict[str, Expression]]
_MAKERS: dict[str, Callable[[MechanismExpressions], Made]] = {}
#: Functions that take wrenches.
UNDER_WRENCHES: set[str] = {"step", "steps", "forward_columns"}


def _function(
    wrenches: bool = False,
) -> Callable[[Callable[[MechanismExpressions], Made]], Callable[[MechanismExpressions], Made]]:
    """Register the maker of a function of its own name."""

    def register(
        maker: Callable[[MechanismExpressions], Made],
    ) -> Callable[[MechanismExpressions], Made]:
        name = maker.__name__.removeprefix("_")
        _MAKERS[name] = maker
        if wrenches:
            UNDER_WRENCHES.add(name)
        return maker

    return register


# Closures and motions that keep them -------------------------------------------------------------


@_function()
def _gaps(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"gaps": x.rows.in_package(x.rows.gap)}


@_function()
def _jacobian(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"jacobian": x.rows.package_jacobian()}


@_function()
def _gap_accelerations(x: MechanismExpressions) -> Made:
    accelerations = x.rows.package_jacobian() @ x.a + x.rows.package_bias()
    return {"q": x.q, "v": x.v, "a": x.a}, {"gap_accelerations": accelerations}


@_function()
def _motion_basis(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"basis": x.basis, "check": x.check}


@_function()
def _velocity(x: MechanismExpressions) -> Made:
    u = ca.SX.sym("u", x.independent.size)
    return {"q": x.q, "u": u}, {"v": _moved(x, u), "check": x.check}


@_function()
def _acceleration(x: MechanismExpressions) -> Made:
    w = ca.SX.sym("w", x.independent.size)
    opening = ca.DM(x.system.row_scale) * (x.jacobian @ x.v)
    least = x.system.equations.speed**2 + x.nothing
    speed = least + ca.sumsqr(x.v / x.system.column_scale)
    consistent = ca.sumsqr(opening) / speed / x.consistent**2
    check = ca.vertcat(x.opening + consistent, x.growth)
    given = {"q": x.q, "v": x.v, "w": w}
    # One solution for both: J_d a_d = -(J_u w + J' v).
    return given, {"a": _moved(x, w, x.rows.bias), "check": check}


def _moved(x: MechanismExpressions, u: Expression, bias: Expression | None = None) -> Expression:
    """Return y with given independent entries and J y + bias = 0, shape (nv,)."""
    independent = x.independent.tolist()
    right = x.jacobian[:, independent] @ u
    y = -x.dependent(right if bias is None else right + bias)
    y[independent, 0] = u
    return y


def _of_frame(x: MechanismExpressions, frame: int, kind: str) -> Made:
    """Return the placement of a frame, and its closed-loop Jacobian in world axes."""
    turn, place = x.tree.frame_placement(frame)
    last = ca.DM([[0.0, 0.0, 0.0, 1.0]])
    placement = {"placement": ca.vertcat(ca.horzcat(turn, place), last)}
    if kind == "frame":
        return {"q": x.q}, placement
    jacobian = ca.sparsify(x.tree.frame_jacobian(frame)) @ x.basis
    return {"q": x.q}, placement | {"jacobian": jacobian, "check": x.check}


# Dynamics -----------------------------------------------------------------------------------------


@_function(wrenches=True)
def _inverse_dynamics(x: MechanismExpressions) -> Made:
    found = x.forces
    results = {
        "tau": found.tau,
        "multipliers": x.rows.in_package(found.multipliers),
        "residual": found.residual,
    }
    if x.partition.actuated_rank < x.independent.size:
        results |= {"unproduced": found.unproduced, "missing": found.missing}
    check = ca.vertcat(x.opening, x.growth + found.growth)
    return {"q": x.q, "v": x.v, "a": x.a}, results | {"check": check}


@_function(wrenches=True)
def _forward_dynamics(x: MechanismExpressions) -> Made:
    return _accelerated(x.cheapest)


def _accelerated(x: MechanismExpressions) -> Made:
    check = ca.vertcat(x.opening, x.growth + x.inertia_check)
    return {"q": x.q, "v": x.v, "tau": x.tau}, {"a": x.acceleration, "check": check}


@_function(wrenches=True)
def _constraint_forces(x: MechanismExpressions) -> Made:
    x = x.cheapest
    rest = x.required(x.a)
    rest[x.system.actuated.tolist(), 0] -= x.tau
    rest -= x.least_force(x.reduced(rest)[0])  # what closures cannot carry
    multipliers = x.reduced(rest)[1]
    given = {"q": x.q, "v": x.v, "a": x.a, "tau": x.tau}
    return given, {"multipliers": x.rows.in_package(multipliers), "check": x.check}


@_function(wrenches=True)
def _generalised_force(x: MechanismExpressions) -> Made:
    return {"q": x.q, "v": x.v, "a": x.a}, {"force": x.required(x.a)}


@_function(wrenches=True)
def _equations_of_motion(x: MechanismExpressions) -> Made:
    multipliers = ca.SX.sym("multipliers", x.jacobian.shape[0])
    error = x.required(x.a) - x.rows.package_jacobian().T @ multipliers
    error[x.system.actuated.tolist(), 0] -= x.tau
    given = {"q": x.q, "v": x.v, "a": x.a, "tau": x.tau, "multipliers": multipliers}
    return given, {"error": error}


@_function()
def _tree_mass_matrix(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"mass": x.tree.mass_matrix()}


@_function()
def _mass_matrix(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"mass": x.mass_matrix, "check": x.check}


@_function()
def _bias(x: MechanismExpressions) -> Made:
    force = x.tree.rnea(x.v, x.drift) + x.passive_forces
    return {"q": x.q, "v": x.v}, {"bias": x.reduced(force)[0], "check": x.check}


@_function()
def _gravity_forces(x: MechanismExpressions) -> Made:
    still = ca.SX(x.tree.model.nv, 1)
    return {"q": x.q}, {"force": x.reduced(x.tree.rnea(still, still))[0], "check": x.check}


@_function()
def _energy(x: MechanismExpressions) -> Made:
    both = ca.vertcat(x.tree.kinetic_energy(), x.tree.potential_energy() + x.spring_energy)
    return {"q": x.q, "v": x.v}, {"energy": both}


# Derivatives --------------------------------------------------------------------------------------


@_function(wrenches=True)
def _inverse_dynamics_derivatives(x: MechanismExpressions) -> Made:
    slopes, motion = Slopes(x), {"q": x.q, "v": x.v, "a": x.a}
    found = slopes.at(x.forces.multipliers, _by(slopes.inverse()))
    return motion, found | {"check": x.check}


def _by(slopes: InverseSlopes | ForwardSlopes) -> dict[str, Expression]:
    """Return derivatives by names that are not those of arguments."""
    return {f"by_{name}": slope for name, slope in slopes._asdict().items()}


@_function(wrenches=True)
def _forward_dynamics_derivatives(x: MechanismExpressions) -> Made:
    given, results = _accelerated(x)
    slopes = Slopes(x)
    found = slopes.at(_multipliers(x), _by(slopes.forward()))
    names, values = list(found), list(found.values())
    values = ca.substitute(values, [x.a], [results["a"]])
    return given, dict(zip(names, values, strict=True)) | {"check": results["check"]}


def _multipliers(x: MechanismExpressions) -> Expression:
    """Return lambda of the motion q, v, a under the forces tau, shape (nc,)."""
    rest = x.required(x.a)
    rest[x.system.actuated.tolist(), 0] -= x.tau
    return x.reduced(rest)[1]


def _of_columns(x: MechanismExpressions, columns: ForwardColumns) -> Made:
    """Return the numbers from which `routines` computes the derivatives of forward dynamics."""
    given, results = _accelerated(x)
    numbers = {
        "right": ca.vertcat(ca.SX(0, 1), *columns.right.nonzeros()),
        "coefficients": columns.response.coefficients,
        "basis_numbers": ca.vertcat(ca.SX(0, 1), *columns.basis.nonzeros()),
        "followed_numbers": ca.vertcat(ca.SX(0, 1), *columns.followed.nonzeros()),
    }
    return given, numbers | {"check": results["check"]}


@_function()
def _gaps_by_parameters(x: MechanismExpressions) -> Made:
    gaps = ca.jacobian(x.rows.in_package(x.rows.gap), x.parameters.symbols)
    return {"q": x.q}, {"by_parameters": gaps}


@_function(wrenches=True)
def _inverse_dynamics_by_parameters(x: MechanismExpressions) -> Made:
    slopes = Slopes(x)
    found = slopes.at(x.forces.multipliers, {"by_parameters": slopes.by_parameters()[1]})
    return {"q": x.q, "v": x.v, "a": x.a}, found | {"check": x.check}


@_function(wrenches=True)
def _forward_dynamics_by_parameters(x: MechanismExpressions) -> Made:
    slopes = Slopes(x)
    given, results = _accelerated(x)
    change = -x.inertia.solve(slopes.by_parameters()[1])
    found = slopes.at(_multipliers(x), {"by_parameters": change})
    found = {k: ca.substitute(f, x.a, results["a"]) for k, f in found.items()}
    return given, found | {"check": results["check"]}


# Moves on the manifold ----------------------------------------------------------------------------


@_function()
def _integrate(x: MechanismExpressions) -> Made:
    move = ca.SX.sym("move", x.tree.model.nv)
    return {"q": x.q, "move": move}, {"moved": x.tree.integrate(x.q, move)}


@_function()
def _tangent(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"tangent": x.tree.tangent(x.q)}


@_function()
def _unit_lengths(x: MechanismExpressions) -> Made:
    return {"q": x.q}, {"lengths": x.tree.unit_lengths(x.q)}


@_function()
def _closing_step(x: MechanismExpressions) -> Made:
    step = -x.dependent(x.rows.gap)
    return {"q": x.q}, {"step": step, "squared_gap": x.squared_gap, "growth": x.growth}


@_function()
def _continuing_step(x: MechanismExpressions) -> Made:
    given, results = _closing_step(x)
    return given, results | {"orientation": ca.SX(1) if x.orientation is None else x.orientation}


@_function()
def _least_norm_step(x: MechanismExpressions) -> Made:
    x = x.cheapest
    step = _of_least_norm(x, -x.rows.gap)
    return {"q": x.q}, {"step": step, "squared_gap": x.squared_gap, "growth": x.growth}


@_function()
def _nearest_step(x: MechanismExpressions) -> Made:
    """Towards a configuration: D^2 T (T' T)^-1 T' g in one unit, g the slope of the distance."""
    x = x.cheapest
    given = ca.SX.sym("given", x.tree.model.nq)
    per_unit = ca.DM(1 / x.system.column_scale)
    away = per_unit * x.tree.difference(x.q, given)
    squared = ca.sumsqr(away)
    slope = -(ca.jacobian(squared / 2, x.q) @ x.tree.tangent(x.q)).T
    scaled = ca.sparsify(ca.diag(per_unit) @ x.basis)  # D^-1 T
    step = ca.SX(x.tree.model.nv, 1)
    if x.independent.size:
        along = LDL(ca.sparsify(scaled.T @ scaled)).solve(ca.sparsify(x.basis.T @ slope))
        step = x.basis @ along
    results = {
        "step": step,
        "squared_distance": squared,
        "squared_step": ca.sumsqr(per_unit * step),
    }
    return {"q": x.q, "given": given}, results | {"growth": x.growth}


@_function()
def _projection(x: MechanismExpressions) -> Made:
    x = x.cheapest
    both = _of_least_norm(x, -ca.horzcat(x.rows.gap, x.rows.jacobian @ x.v))
    results = {"step": both[:, 0], "projected": x.v + both[:, 1]}
    return {"q": x.q, "v": x.v}, results | {"squared_gap": x.squared_gap, "growth": x.growth}


def _of_least_norm(x: MechanismExpressions, right: Expression) -> Expression:
    """Return y of least norm in one unit, (nv, k), with J y = right.

    That is some solution less its part in the allowed motions, y - T (T' D^-2 T)^-1 T' D^-2 y.
    """
    some = x.dependent(right)
    if not x.independent.size:
        return some
    per_unit = ca.diag(ca.DM(1 / x.system.column_scale))
    scaled = ca.sparsify(per_unit @ x.basis)  # D^-1 T
    along = LDL(ca.sparsify(scaled.T @ scaled)).solve(ca.sparsify(scaled.T @ (per_unit @ some)))
    return some - x.basis @ along


@_function(wrenches=True)
def _stage(x: MechanismExpressions) -> Made:
    x = x.cheapest
    acting = x.external_forces - x.passive_forces + x.springs
    acting[x.system.actuated.tolist(), 0] += x.tau
    growth = x.growth + x.inertia_check
    given = {"q": x.q, "v": x.v, "tau": x.tau}
    return given, {"a": x.acceleration, "power": acting.T @ x.v, "growth": growth}


@_function()
def _projected_velocity(x: MechanismExpressions) -> Made:
    x = x.cheapest
    return {"q": x.q, "v": x.v}, {"projected": _moved(x, x.v[x.independent.tolist(), 0])}
