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

#: Below this a singular value counts as zero, relative to the largest (or to 1 if that is less).
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


def rank_of(values: Array) -> int:
    """Return how many singular values, largest first, of a matrix in one unit are not rounding.

    In one unit a row that says anything has entries of about 1: if all are far smaller, they are
    rounding themselves (rows that a plane mechanism fulfils anyway).
    """
    if not values.size:
        return 0
    return int(np.count_nonzero(values > RANK_TOLERANCE * max(float(values[0]), 1.0)))


def allowed_motions(jacobian: Array) -> Array:
    """Return an orthonormal basis N of the motions with J N = 0, shape (nv, m); J in one unit."""
    _, values, vectors = np.linalg.svd(jacobian)
    return vectors[rank_of(values) :].T


def pseudo_inverse(jacobian: Array) -> Array:
    """Return the pseudo-inverse of a matrix in one unit, rounding taken as zero."""
    left, values, right = np.linalg.svd(jacobian, full_matrices=False)
    rank = rank_of(values)
    inverse: Array = (right[:rank].T / values[:rank]) @ left[:, :rank].T
    return inverse


def least_norm(matrix: Array, right: Array) -> Array:
    """Return the least-squares solution of least norm, rounding in the matrix taken as zero."""
    solution: Array = pseudo_inverse(matrix) @ right
    return solution
