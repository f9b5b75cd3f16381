"""Result of inverse dynamics in generated code, of one sample or a batch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.dynamics.inverse_dynamics import orientation
from rps_pin.errors import InputError


class HasPassiveJacobian(Protocol):
    """A `CompiledMechanism`."""

    def condition(self, q: ArrayLike, **options: Any) -> Any:
        """Return the condition number of J_p."""

    def passive_jacobian(self, q: ArrayLike, **options: Any) -> Array:
        """Return J_p."""


#: A copy of one sample's q; or a batch's own array, and a sum of some of its numbers.
Kept = tuple[Array, Any]
#: So many samples of a batch.
_SOME = 1000


def kept(q: Array) -> Kept:
    """Return q as it is kept for what is computed later: a copy of a batch costs too much."""
    return (q.copy(), None) if q.ndim == 1 else (q, _sum(q))


def _sum(q: Array) -> Any:
    rows = q.reshape(-1, q.shape[-1]) if q.size else q
    return rows[:: 1 + len(rows) // _SOME].sum()


class GeneratedForces:
    """Actuator and constraint forces; as `InverseDynamics`, with leading batch dimensions.

    Attributes
    ----------
    tau : (..., na) array
    constraint_forces : (..., nc) array
    residual : float, or (...) array
    unproduced : (..., nv) array or None
        None if the actuators produce the motion of every sample.
    """

    __slots__ = ("_at", "_residual", "constraint_forces", "tau", "unproduced")

    def __init__(
        self,
        tau: Array,
        constraint_forces: Array,
        residual: Array,
        unproduced: Array | None,
        at: tuple[HasPassiveJacobian, Kept, Any],
    ) -> None:
        self.tau, self.constraint_forces, self._residual = tau, constraint_forces, residual
        self.unproduced, self._at = unproduced, at

    @property
    def residual(self) -> Any:
        """Norm of the equations' error on the passive rows, float or (...)."""
        return self._residual[..., 0] if self._residual.ndim > 1 else float(self._residual[0])

    def _of_passive_jacobian(self, call: Callable[..., Any]) -> Any:
        mechanism, (q, total), parameters = self._at
        if total is not None and not np.array_equal(_sum(q), total, equal_nan=True):
            raise InputError(
                "q was changed since inverse_dynamics was called: the condition of a batch is "
                "computed from it when it is asked for"
            )
        return call(mechanism, q, parameters=parameters, errors="mask")

    @property
    def condition(self) -> Any:
        """Condition number of the passive joints' Jacobian, float or (...); see `InverseDynamics`.

        Computed when asked for, for a batch from the array q that was given: `InputError` if that
        was changed since. NaN where q is.
        """
        return self._of_passive_jacobian(lambda mechanism, q, **o: mechanism.condition(q, **o))

    @property
    def orientation(self) -> Any:
        """Sign of det J_p, or 0, int or (...); see `InverseDynamics`. Computed when asked for."""
        jacobian = self._of_passive_jacobian(lambda m, q, **o: m.passive_jacobian(q, **o))
        return each(orientation, jacobian, int)

    def __repr__(self) -> str:
        return (
            f"GeneratedForces(tau={self.tau}, constraint_forces={self.constraint_forces}, "
            f"residual={self.residual}"
            + (")" if self.unproduced is None else f", unproduced={self.unproduced})")
        )


def each(of: Callable[[Array], Any], matrices: Array, kind: type) -> Any:
    """Return a number of each matrix, (..., rows, columns); NaN, or 0, if it is not finite."""

    def number(matrix: Array) -> Any:
        if np.isfinite(matrix).all():
            return of(matrix)
        return 0 if kind is int else np.nan

    if matrices.ndim == 2:
        return number(matrices)
    batch = matrices.shape[:-2]
    return np.array([number(matrices[index]) for index in np.ndindex(batch)], kind).reshape(batch)
