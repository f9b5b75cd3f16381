"""Forward dynamics of a closed-loop mechanism in reduced coordinates.

With v = T u for any basis T of the motions that the closures allow (J T = 0) and a_0 any solution
of J a + J' v = 0, all accelerations are a = T w + a_0, and multiplying

    rnea(q, v, a) + e(q, v) = S' tau + J' lambda + external forces

by T' leaves a small system without lambda, regular also where links are massless:

    (T' M T) w = T' (S' tau + external forces - rnea(q, v, a_0) - e(q, v)).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array
from rps_pin.errors import MechanismError, SingularityError
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, rank

#: Relative to the largest: what counts as no inertia at all.
_NO_INERTIA = 1e-14


def basis_and_drift(jacobian: Array, drift: Array, scale: Array) -> tuple[Array, Array]:
    """Return T, shape (nv, m), and a_0, shape (nv,), of a Jacobian of any rank.

    Parameters
    ----------
    jacobian
        J, shape (nc, nv), its rows in one unit.
    drift
        J' v, shape (nc,), in the same units.
    scale
        Scaling of the velocities to one unit, shape (nv,).
    """
    left, values, right = np.linalg.svd(jacobian * scale)
    count = rank(values)
    along = (left[:, :count].T @ drift) / values[:count]
    return scale[:, None] * right[count:].T, -scale * (right[:count].T @ along)


def solve_reduced(mass: Array, force: Array) -> Array:
    """Return w of (T' M T) w = force, or say that a motion has no inertia.

    Raises
    ------
    SingularityError
        If the reduced mass matrix is not positive definite.
    """
    if mass.size == 0:
        return np.zeros(0)
    factor, solution, failed = dposv(mass, force)  # Cholesky
    diagonal = factor.diagonal()
    if not failed and diagonal.min() ** 2 > _NO_INERTIA * diagonal.max() ** 2:
        return np.asarray(solution, dtype=np.float64)
    raise SingularityError(
        "a motion that the closures allow moves no mass: its acceleration is not determined "
        "(give the links on its way a mass, or its joints an armature)",
        np.inf,
        1 / RANK_TOLERANCE,
    )


class ProximalDynamics:
    """Pinocchio's own constrained forward dynamics, by proximal iterations.

    It takes redundant rows as they are, and needs a regular mass matrix of the open tree: every
    joint must move some mass of its own.

    Parameters
    ----------
    model
        The open tree.
    constraints
        A vector of spherical and rigid constraint models.
    """

    def __init__(self, model: pin.Model, constraints: pin.StdVec_RigidConstraintModel) -> None:
        self._model, self._constraints = model, constraints
        self._data = model.createData()
        self._scratch = pin.StdVec_RigidConstraintData()
        for constraint in constraints:
            self._scratch.append(constraint.createData())
        pin.initConstraintDynamics(model, self._data, constraints, self._scratch)
        self._settings = pin.ProximalSettings(1e-14, 1e-10, 200)

    def __call__(self, q: Array, v: Array, force: Array) -> Array:
        """Return the acceleration (nv,) under generalised forces (nv,).

        Raises
        ------
        MechanismError
            If the open tree's mass matrix is singular.
        """
        a: Array = pin.constraintDynamics(
            self._model, self._data, q, v, force, self._constraints, self._scratch, self._settings
        ).copy()
        if not np.isfinite(a).all():
            raise MechanismError(
                "Pinocchio's constraintDynamics returned no finite acceleration: the mass matrix "
                "of the open tree is singular (massless links); use method='reduced'"
            )
        return a
