"""A mechanism's quantities as CasADi functions, for optimisation and optimal control."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.equations import refuse_twice
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.expressions.functions import UNDER_WRENCHES, MechanismFunctions
from rps_pin.codegen.expressions.independent import choose, regular_samples
from rps_pin.codegen.expressions.mechanism import MechanismExpressions
from rps_pin.errors import did_you_mean

#: Each function: its arguments, its results with their shapes, and what they are.
_TABLE: Mapping[str, tuple[str, str, str]] = {
    "gaps": ("q", "gaps (nc)", "e of the closures, m or rad"),
    "jacobian": ("q", "jacobian (nc nv)", "J: e' = J v"),
    "gap_accelerations": ("q, v, a", "gap_accelerations (nc)", "e'' = J a + J' v"),
    "unit_lengths": (
        "q",
        "lengths (nq - nv)",
        "|x|^2 - 1 of quaternions and (cos, sin) in q",
    ),
    "tangent": ("q", "tangent (nq nv)", "G: dq/dt = G v"),
    "integrate": ("q, move", "moved (nq)", "q moved by a tangent vector, as pinocchio.integrate"),
    "closing_step": (
        "q",
        "step (nv), squared_gap",
        "Newton's step of the dependent velocities that closes the loops, zero where they are "
        "closed, and the squared gap in characteristic lengths",
    ),
    "projection": (
        "q, v",
        "step (nv), projected (nv), squared_gap",
        "step of least norm, and v less its opening part of least norm",
    ),
    "motion_basis": ("q", "basis (nv m)", "T: v = T u"),
    "velocity": ("q, u", "v (nv)", "the velocity of independent velocities u"),
    "acceleration": ("q, v, w", "a (nv)", "the acceleration of independent accelerations w"),
    "projected_velocity": ("q, v", "projected (nv)", "T u with u of v"),
    "inverse_dynamics": (
        "q, v, a",
        "tau (na), multipliers (nc); unproduced (nv) of an underactuated mechanism",
        "forces of actuators and closures that make a motion, and what they cannot make",
    ),
    "forward_dynamics": ("q, v, tau", "a (nv)", "the acceleration under actuator forces"),
    "constraint_forces": ("q, v, a, tau", "multipliers (nc)", "lambda of a motion under tau"),
    "generalised_force": ("q, v, a", "force (nv)", "f = rnea + passive - external forces"),
    "equations_of_motion": (
        "q, v, a, tau, multipliers",
        "error (nv)",
        "f - S' tau - J' lambda, zero for a motion: all coordinates, nothing eliminated",
    ),
    "tree_mass_matrix": ("q", "mass (nv nv)", "M of the open tree"),
    "mass_matrix": ("q", "mass (m m)", "T' M T"),
    "bias": ("q, v", "bias (m)", "T' f at the acceleration with w = 0, without wrenches"),
    "gravity_forces": ("q", "force (m)", "T' g"),
    "energy": ("q, v", "energy (2)", "kinetic and potential, J"),
    "inverse_dynamics_derivatives": (
        "q, v, a",
        "by_q, by_v, by_a, by_position, by_velocity, by_acceleration",
        "derivatives of tau by tangent vectors, and by independent motions (m m)",
    ),
    "forward_dynamics_derivatives": (
        "q, v, tau",
        "by_q, by_v, by_tau, by_position, by_velocity, by_actuation",
        "derivatives of a, and of its independent entries",
    ),
}
#: Results that are left out: guards of numerical calls, not smooth where they are zero.
_GUARDS = ("check", "growth", "residual", "missing")


class CasadiFunctions:
    """Named `casadi.Function` objects of a mechanism: ``functions.inverse_dynamics(q, v, a)``.

    ``print(functions)`` lists all with arguments, results and shapes; ``print(functions.velocity)``
    shows the numbers of one. Arguments are also taken by name, and then results come by name:
    ``functions.velocity(q=q, u=u)["v"]``. Vectors are columns, matrices are sparse. Each takes
    numbers, SX and MX, is smooth at all regular closed configurations, and has exact derivatives
    of any order, parameters included. Nothing is checked: what eliminates the closures (results
    with u, w, tau, m) holds where the loops are closed and the dependent velocities are determined.

    External wrenches, shape (6 k,) in the order of `wrench_frames`, and parameters, shape (np,),
    are further arguments, in this order, of functions that depend on forces, and of all.

    Derivatives by a configuration are those by tangent vectors, ``jacobian(f, q) @ tangent(q)``;
    along motions that keep the loops closed, ``jacobian(f, q) @ tangent(q) @ motion_basis(q)``.

    Attributes
    ----------
    names : tuple of str
    independent, dependent : (m,) and (nv - m,) arrays
        Indices of the independent velocities u, in the order of u, and of the others.
    wrench_frames : tuple of str
    parameters : tuple of str
        What each parameter is.
    nominal_parameters : (np,) array
    """

    def __init__(self, expressions: MechanismExpressions, name: str = "") -> None:
        self._functions = MechanismFunctions(expressions)
        self._made: dict[str, Any] = {}
        self._name = name
        self.names = tuple(_TABLE)
        self.independent = expressions.independent.copy()
        self.dependent = expressions.partition.dependent.copy()
        self.wrench_frames = expressions.wrench_frames
        self.parameters = expressions.parameters.labels
        self.nominal_parameters: Array = expressions.parameters.nominal.copy()

    def __getattr__(self, name: str) -> Any:
        if name not in _TABLE:
            near = did_you_mean(name, _TABLE)
            raise AttributeError(f"no function {name!r}{near}; there are: {', '.join(_TABLE)}")
        return self._function(name)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.names]

    def __repr__(self) -> str:
        return f"<CasADi functions of {self._name or 'a mechanism'}; print them for a list>"

    def __str__(self) -> str:
        """Return a table of the functions, and the sizes of their arguments."""
        x = self._functions.expressions
        sizes = {
            "nq": x.q.numel(),
            "nv": x.v.numel(),
            "m": self.independent.size,
            "na": x.tau.numel(),
            "nc": x.rows.gap.numel(),
        }
        listed = ", ".join(f"{size} = {count}" for size, count in sizes.items())
        lines = [f"{self._name or 'mechanism'}: {listed}"]
        for name, (arguments, results, meaning) in _TABLE.items():
            lines += [f"{name}({arguments}{self._further(name)}) -> {results}", f"    {meaning}"]
        return "\n".join([*lines, "frame(NAME)(q) -> placement (4 4), jacobian (6 m)"])

    def _further(self, name: str) -> str:
        wrenches = ", wrenches" if self.wrench_frames and name in UNDER_WRENCHES else ""
        return wrenches + (", parameters" if self.parameters else "")

    def frame(self, name: str) -> Any:
        """Return the function of q that gives a frame's placement, (4, 4), and its Jacobian (6, m).

        The Jacobian takes the independent velocities to the twist (linear, angular) in world axes
        at the frame's origin.

        Raises
        ------
        MechanismError
            If there is no such frame; lists those there are.
        """
        system = self._functions.expressions.system
        return self._function(f"frame_jacobian_{system.frame(name)}")

    def parameter_vector(self, changes: Mapping[str, ArrayLike]) -> Array:
        """Return the nominal parameters with some changed, shape (np,).

        Parameters
        ----------
        changes
            New numbers, by label (see `parameters`), or all of a group by its name.

        Raises
        ------
        InputError
            If a name is none of these, or its numbers do not fit.
        """
        return self._functions.expressions.parameters.vector(changes)

    def _function(self, name: str) -> Any:
        if name not in self._made:
            whole = self._functions[name]
            given = whole.sx_in()
            results = dict(zip(whole.name_out(), whole.call(given), strict=True))
            kept = {
                key: value if value.is_column() else ca.sparsify(value)
                for key, value in results.items()
                if key not in _GUARDS
            }
            self._made[name] = ca.Function(
                name, given, list(kept.values()), whole.name_in(), list(kept)
            )
        return self._made[name]


def to_casadi(
    mechanism: ClosedLoopModel,
    *,
    parameters: Sequence[str] = (),
    wrench_frames: Sequence[str] = (),
) -> CasadiFunctions:
    """Return a mechanism's quantities as CasADi functions.

    Parameters
    ----------
    mechanism
        The mechanism. Later changes of it do not change the functions.
    parameters
        Groups of numbers that are an argument of each function: ``"gravity"``, ``"inertia:JOINT"``,
        ``"mass:JOINT"``, ``"placement:JOINT"``, ``"closure:NAME"``, ``"distance:NAME"``,
        ``"payload:FRAME"`` (see `rps_pin.codegen.expressions.parameters`).
    wrench_frames
        Frames at which external wrenches act.

    Raises
    ------
    InputError
        If a parameter is unknown, named twice, or in conflict with another.
    MechanismError
        If there is no such frame, one is named twice, or a joint has no expressions.
    """
    system = mechanism.system
    frames = (wrench_frames,) if isinstance(wrench_frames, str) else tuple(wrench_frames)
    refuse_twice("wrench frame", frames)
    for frame in frames:
        system.frame(frame)
    partition = choose(system, regular_samples(system, mechanism.home).jacobians)
    expressions = MechanismExpressions(system, partition, parameters, frames)
    return CasadiFunctions(expressions, mechanism.name)
