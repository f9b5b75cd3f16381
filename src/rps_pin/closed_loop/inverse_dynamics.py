"""Inverse dynamics of a closed-loop mechanism: constrained RNEA, a KKT problem.

With S picking the actuated rows and J the loop closures' Jacobian,

    S' tau + J' lambda = rnea(q, v, a).

The passive rows hold no actuator: J_p' lambda = rnea_p. Where J_p is square, which is the case of a
mechanism with as many actuators as mobility and no redundant rows, lambda follows from one LU
factorisation, and the actuated rows give tau. In every other case tau comes from the motions N that
the closures allow (J N = 0), which do not feel lambda: (S N)' tau = N' rnea; then lambda, of least
norm since redundant rows leave it undetermined.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rps_pin.errors import SingularityError

Array = NDArray[np.float64]

#: Relative size below which a singular value counts as zero.
RANK_TOLERANCE = 1e-10


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
    """

    __slots__ = ("_scaled_jacobian", "constraint_forces", "residual", "tau")

    def __init__(
        self,
        tau: Array,
        constraint_forces: Array,
        residual: float,
        scaled_jacobian: tuple[tuple[Array, Array], Array],
    ) -> None:
        self.tau = tau
        self.constraint_forces = constraint_forces
        self.residual = residual
        self._scaled_jacobian = scaled_jacobian

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
            f"residual={self.residual:.3g})"
        )


def condition_number(passive_jacobian: Array) -> float:
    """Return largest over smallest singular value of J_p, ``inf`` if passive joints stay free.

    Parameters
    ----------
    passive_jacobian
        J_p, shape (nc, np), scaled so that all its entries have one unit.
    """
    rows, columns = passive_jacobian.shape
    if columns == 0:
        return 1.0
    if rows < columns:
        return np.inf
    values = np.linalg.svd(passive_jacobian, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else np.inf


def allowed_motions(jacobian: Array) -> Array:
    """Return an orthonormal basis N of the motions N that the closures allow, shape (nv, m)."""
    _, values, vectors = np.linalg.svd(jacobian)
    rank = int(np.count_nonzero(values > RANK_TOLERANCE * values[0])) if values.size else 0
    return vectors[rank:].T


def solve_by_allowed_motions(
    jacobian: Array, actuated: NDArray[np.intp], generalised_force: Array, scale: Array
) -> tuple[Array, Array]:
    """Return tau and lambda for any number of closure rows, redundant ones included.

    Parameters
    ----------
    jacobian
        J, shape (nc, nv).
    actuated
        Indices of the actuated velocities.
    generalised_force
        rnea(q, v, a), shape (nv,).
    scale
        Positive scaling of the velocities, shape (nv,): coordinates v / scale share one unit.

    Raises
    ------
    SingularityError
        If the actuators cannot produce the forces asked for, or if there are more of them than the
        mobility, so that tau is not unique.
    """
    motions = scale[:, None] * allowed_motions(jacobian * scale)  # J N = 0, column scaling undone
    mobility = motions.shape[1]
    actuator_motions = motions[actuated]
    if len(actuated) != mobility:
        kind = "more" if len(actuated) > mobility else "fewer"
        raise SingularityError(
            f"{len(actuated)} actuated joints for a mobility of {mobility} at this configuration: "
            f"with {kind} actuators than mobility their forces are not determined",
            np.inf,
            1 / RANK_TOLERANCE,
        )
    condition = condition_number(actuator_motions)
    if not condition * RANK_TOLERANCE < 1:
        raise SingularityError(
            f"the actuated joints do not move all of the mechanism here: condition {condition:.3g}",
            condition,
            1 / RANK_TOLERANCE,
        )
    tau = np.asarray(np.linalg.solve(actuator_motions.T, motions.T @ generalised_force), np.float64)
    rest = generalised_force.copy()
    rest[actuated] -= tau
    multipliers, *_ = np.linalg.lstsq(jacobian.T, rest, rcond=RANK_TOLERANCE)
    return tau, np.asarray(multipliers, np.float64)
