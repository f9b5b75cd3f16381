"""Bodies that become longer with a dimension, with their density.

A body is stretched by the factor k along directions that span a subspace with the projector P: its
points r move to A r, A = 1 + (k - 1) P. With d the number of directions, its mass becomes k^d m,
its first moment k^d A h, and its second moments S = integral of r r' dm become k^d A S A'; the
inertia about the origin is tr(S) 1 - S.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.validation import numbers


def projector(directions: ArrayLike) -> tuple[Array, int]:
    """Return the projector on the span of directions (3,) or (k, 3), and its rank."""
    given = np.atleast_2d(numbers(directions, "stretch", "one direction (3,) or several (k, 3)"))
    if given.ndim != 2 or given.shape[1] != 3 or not np.isfinite(given).all():
        raise InputError(f"stretch = {shown(directions)}: it must be directions of three numbers")
    _, values, right = np.linalg.svd(given)
    rank = int((values > 1e-9 * max(values[0], 1e-300)).sum()) if values[0] > 0 else 0
    if rank == 0:
        raise InputError("stretch: a direction is zero")
    return right[:rank].T @ right[:rank], rank


def stretched(body: Array, projection: Array, rank: int, ratio: Array) -> Array:
    """Return bodies (n, 10) of `pinocchio.Inertia.toDynamicParameters`, stretched by (n,)."""
    mass, first = body[:, 0], body[:, 1:4]
    xx, xy, yy, xz, yz, zz = body[:, 4:].T
    inertia = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)
    trace = np.trace(inertia, axis1=1, axis2=2)
    second = trace[:, None, None] / 2 * np.eye(3) - inertia
    A = np.eye(3) + (ratio - 1.0)[:, None, None] * projection
    more = ratio**rank
    second = more[:, None, None] * A @ second @ A
    inertia = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    found = np.empty_like(body)
    found[:, 0] = more * mass
    found[:, 1:4] = more[:, None] * np.einsum("nij,nj->ni", A, first)
    found[:, 4:] = np.stack(
        [inertia[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))], axis=-1
    )
    return found
