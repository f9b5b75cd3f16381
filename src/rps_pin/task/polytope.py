"""Polytopes of the forces and speeds that actuators within limits give a task.

With K = d(actuators)/d(task), forces f = K' tau and speeds a' = K x'. Limits of the actuators,
l <= tau <= u, make the forces a zonotope, the sum of the segments [l_i, u_i] K_i, K_i the rows of
K; and the speeds the intersection of the slabs l_i <= K_i x' <= u_i.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from rps_pin.arrays import Array
from rps_pin.errors import InfeasibleError, SingularityError
from rps_pin.numerics.linear_algebra import singular_values
from rps_pin.validation import real_vector

#: A facet's normal is no normal below this part of the largest.
_NONE = 1e-10


class Ball(NamedTuple):
    """A ball inside a polytope."""

    center: Array
    """Shape (m,), in the units of the polytope."""
    radius: float
    """In one unit: angles count with the characteristic length (moments divided by it, N; angular
    speeds times it, m/s)."""


class Polytope:
    """A bounded convex set of forces or speeds of a task: normals @ x <= offsets.

    Attributes
    ----------
    normals, offsets : (k, m) and (k,) arrays
        Of its facets; a row of normals times the units is of length 1.
    units : (m,) array
        Factors that take numbers in one unit (N, m/s) to those of the coordinates.
    vertices : (n, m) array
        Its corners.
    """

    def __init__(self, normals: Array, offsets: Array, units: Array, vertices: Array) -> None:
        length = np.linalg.norm(normals * units, axis=1)
        self.normals, self.offsets = normals / length[:, None], offsets / length
        self.units, self.vertices = units, vertices

    def contains(self, x: Array) -> bool:
        """Return whether a point (m,) is inside, or on the boundary to rounding error."""
        point = real_vector(x, self.units.size, "x")
        slack = 1e-9 * float(np.abs(self.offsets).max())
        return bool((self.normals @ point <= self.offsets + slack).all())

    def ball(self, center: Array | None = None) -> Ball:
        """Return the largest ball inside about a center (m,); zero if left out.

        The radius is negative if the center is outside.
        """
        at = np.zeros(self.units.size)
        if center is not None:
            at = real_vector(center, self.units.size, "center").copy()
        return Ball(at, float((self.offsets - self.normals @ at).min()))

    def inscribed_ball(self) -> Ball:
        """Return the largest ball inside, wherever its center is."""
        size = self.units.size
        a = np.column_stack([self.normals * self.units, np.ones(len(self.normals))])
        goal = np.append(np.zeros(size), -1.0)
        found = linprog(goal, A_ub=a, b_ub=self.offsets, bounds=(None, None))
        if not found.success:
            raise InfeasibleError(f"no ball was found in the polytope: {found.message}")
        x = np.asarray(found.x, dtype=np.float64)
        return Ball(x[:size] * self.units, float(x[size]))


def of_forces(K: Array, lower: Array, upper: Array, units: Array) -> Polytope:
    """Return the polytope of K' tau, lower <= tau <= upper.

    Parameters
    ----------
    K
        d(actuators)/d(task), shape (na, m), na >= m.
    lower, upper
        Limits of the actuators, shape (na,).
    units
        Factors that take forces in one unit (N) to those of the coordinates, shape (m,).

    Raises
    ------
    SingularityError
        If K has not the rank m, so that some force cannot be made.
    """
    generators = K / units
    count, size = K.shape
    _refuse_flat(generators, "forces")
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    normals = []
    for chosen in combinations(range(count), size - 1):
        _, values, right = np.linalg.svd(generators[list(chosen)])
        if size == 1 or values[-1] > _NONE * np.abs(generators).max():
            normals.append(right[-1])
    both = np.vstack([normals, np.negative(normals)])
    reach = np.abs(both @ generators.T) @ half + both @ generators.T @ middle
    corners = _corners(lower, upper) @ generators
    if count > size:
        corners = _hull(corners)
    return Polytope(both / units, reach, units, corners * units)


def of_speeds(K: Array, lower: Array, upper: Array, units: Array) -> Polytope:
    """Return the polytope of the x' with lower <= K x' <= upper.

    Parameters
    ----------
    K, lower, upper
        As for `of_forces`, the limits those of speeds, lower < 0 < upper.
    units
        Factors that take speeds in one unit (m/s) to those of the coordinates, shape (m,).

    Raises
    ------
    SingularityError
        If K has not the rank m, so that some speed has no limit.
    """
    rows = K * units
    _refuse_flat(rows, "speeds")
    normals, offsets = np.vstack([rows, -rows]), np.concatenate([upper, -lower])
    if K.shape[0] == K.shape[1]:
        corners = np.linalg.solve(rows, _corners(lower, upper).T).T
    elif K.shape[1] == 1:
        ends = offsets / normals[:, 0]
        corners = np.array([[ends[ends < 0].max()], [ends[ends > 0].min()]])
    else:  # zero is inside
        halfspaces = np.column_stack([normals, -offsets])
        corners = _hull(HalfspaceIntersection(halfspaces, np.zeros(K.shape[1])).intersections)
    return Polytope(normals / units, offsets, units, corners * units)


def _corners(lower: Array, upper: Array) -> Array:
    """Return the corners of a box, shape (2^n, n)."""
    return np.array(list(product(*zip(lower, upper, strict=True))))


def _hull(points: Array) -> Array:
    """Return those of points that are corners of their convex hull."""
    if points.shape[1] == 1:
        return np.array([points.min(axis=0), points.max(axis=0)])
    return np.asarray(points[ConvexHull(points).vertices])


def _refuse_flat(rows: Array, what: str) -> None:
    values = singular_values(rows)
    if rows.shape[0] < rows.shape[1] or values[-1] <= _NONE * values[0]:
        raise SingularityError(
            f"the actuators do not determine the task here: its {what} make no polytope with an "
            "inside",
            np.inf,
            1 / _NONE,
        )
