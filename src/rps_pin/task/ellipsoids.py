"""Ellipsoids of the forces and speeds that a task has from actuators' forces and speeds.

With K = d(actuators)/d(task) in one unit and its singular values, K = U S V': actuators' forces of
norm 1 make the forces K' tau, an ellipsoid with the semi-axes s_i v_i; and actuators' speeds of
norm 1 the speeds with |K x'| = 1, one with v_i / s_i. What is strong one way is slow that way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError


class Ellipsoids(NamedTuple):
    """Ellipsoids of forces and speeds about zero."""

    forces: Array
    """Semi-axes, shape (..., m, m): row i is a force of the task, N and N m, at forces of the
    actuators of norm 1 N (torques over the characteristic length). The longest is first."""
    speeds: Array
    """Semi-axes, shape (..., m, m): row i is a rate of the task, m/s and rad/s, at speeds of the
    actuators of norm 1 m/s (angular ones times the length). The shortest is first: row i of both
    is one direction."""


def ellipsoids(K: Array, units: Array, limit: float) -> Ellipsoids:
    """Return the ellipsoids of K in one unit, shape (..., na, m), na at least m.

    Parameters
    ----------
    K
        See `Task.in_one_unit`.
    units
        Factors that take speeds in one unit to those of the coordinates, shape (m,).
    limit
        Largest condition number.

    Raises
    ------
    SingularityError
        If it is larger: some speed has no limit.
    """
    _, values, right = np.linalg.svd(K, full_matrices=False)
    least, largest = values[..., -1], values[..., 0]
    if (K.shape[-2] < K.shape[-1]) or not (least * limit >= largest).all():
        condition = float((largest / np.maximum(least, 1e-300)).max())
        raise SingularityError(
            "the actuators do not determine the task here: its ellipsoid of speeds has no end in "
            "some direction",
            np.inf if K.shape[-2] < K.shape[-1] else condition,
            limit,
        )
    gains = values[..., None]
    return Ellipsoids(np.asarray(gains * right / units), np.asarray(right / gains * units))
