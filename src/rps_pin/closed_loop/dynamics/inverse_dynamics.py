"""Inverse dynamics of a closed-loop mechanism: constrained RNEA, a KKT problem.

With S picking the actuated rows and J the loop closures' Jacobian,

    S' tau + J' lambda = rnea(q, v, a).

The passive rows hold no actuator: J_p' lambda = rnea_p. With as many actuators as mobility, lambda
follows from one factorisation of J_p (LU where it is square, QR where rows are redundant: then of
least norm), and the actuated rows give tau. In every other case, see `by_motions`. Damping,
friction and springs add to rnea, external forces take from it.
"""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import condition_number


class InverseDynamics:
    """Actuator and constraint forces that make a mechanism move as asked.

    Attributes
    ----------
    tau : (na,) array
        Generalised forces of the actuated joints, in the order of `ClosedLoopModel.actuated`; N for
        prismatic joints, N m for revolute ones. Positive does work when the coordinate grows.
    constraint_forces : (nc,) array
        The multipliers lambda: what each closure's frame b side exerts on its frame a side, in
        world axes at frame a's origin; N, and N m for the angular rows. ``mechanism.rows(name)``
        tells which are a closure's.
    residual : float
        Norm of the KKT equations' error on the passive rows, in the units of generalised forces.
    unproduced : (nv,) array or None
        Where actuators are lacking, the generalised force that the motion takes and nothing in the
        mechanism produces, S' tau + J' lambda + unproduced = rnea + ...: the smallest that would
        have to be added. None if the actuators can do it.
    """

    __slots__ = ("_scaled_jacobian", "constraint_forces", "residual", "tau", "unproduced")

    def __init__(
        self,
        tau: Array,
        constraint_forces: Array,
        residual: float,
        scaled_jacobian: tuple[tuple[Array, Array], Array],
        unproduced: Array | None = None,
    ) -> None:
        self.tau = tau
        self.constraint_forces = constraint_forces
        self.residual = residual
        self._scaled_jacobian = scaled_jacobian
        self.unproduced = unproduced

    @property
    def condition(self) -> float:
        """Condition number of the passive joints' Jacobian (see `ClosedLoopModel.condition`).

        Computed when asked for.
        """
        return condition_number(self._passive_jacobian())

    @property
    def orientation(self) -> int:
        """Sign of det J_p: it changes where a motion crosses a singularity.

        0 where J_p is not square, or its determinant vanishes. Computed when asked for.
        """
        jacobian = self._passive_jacobian()
        if jacobian.shape[0] != jacobian.shape[1]:
            return 0
        return int(np.linalg.slogdet(jacobian)[0])

    def _passive_jacobian(self) -> Array:
        """Return J_p with all entries in one unit, shape (nc, np)."""
        (rows, columns), jacobian = self._scaled_jacobian
        return rows * jacobian * columns

    def __repr__(self) -> str:
        return (
            f"InverseDynamics(tau={self.tau}, constraint_forces={self.constraint_forces}, "
            f"residual={self.residual:.3g}"
            + (")" if self.unproduced is None else f", unproduced={self.unproduced})")
        )
