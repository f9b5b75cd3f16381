"""A mechanism's quantities as CasADi functions, for optimisation and optimal control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from rps_pin.arrays import Array
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.independent import choose, regular_samples
from rps_pin.codegen.expressions.mechanism import MechanismExpressions
from rps_pin.errors import did_you_mean


class CasadiFunctions:
    """Named `casadi.Function` objects of a mechanism: ``functions.inverse_dynamics(q, v, a)``.

    Their names, arguments and results are in the table of `rps_pin.codegen.expressions.functions`,
    without the checks: they are meant for closed configurations. External wrenches and parameters,
    if there are any, are further arguments.

    Attributes
    ----------
    names : tuple of str
    independent : (m,) array
        Indices of the independent velocities u.
    parameters : tuple of str
        What each parameter is.
    nominal_parameters : (np,) array
    """

    def __init__(self, expressions: MechanismExpressions) -> None:
        self._functions = MechanismFunctions(expressions)
        self._made: dict[str, Any] = {}
        self.names = tuple(self._functions.names())
        self.independent = expressions.independent.copy()
        self.parameters = expressions.parameters.labels
        self.nominal_parameters: Array = expressions.parameters.nominal.copy()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self.names:
            near = did_you_mean(name, self.names)
            raise AttributeError(f"no function {name!r}{near}; there are: {', '.join(self.names)}")
        return self._function(name)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.names]

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

    def _function(self, name: str) -> Any:
        if name not in self._made:
            whole = self._functions[name]
            given = whole.sx_in()
            results = dict(zip(whole.name_out(), whole.call(given), strict=True))
            results.pop("check", None)
            self._made[name] = ca.Function(
                name, given, list(results.values()), whole.name_in(), list(results)
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
        The mechanism.
    parameters, wrench_frames
        As for `compile_mechanism`.
    """
    system = mechanism.system
    partition = choose(system, regular_samples(system, mechanism.home).jacobians)
    return CasadiFunctions(MechanismExpressions(system, partition, parameters, wrench_frames))
